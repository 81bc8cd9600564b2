//! What the tests of the firmware share: where it is, and boards that run it.

use std::path::{Path, PathBuf};

use tactus_emulator::board::Options;
use tactus_emulator::host::talk::Talk;
use tactus_emulator::host::under_finger::Unknown;

/// The ELF that an environment variable names, as `cargo xtask test` sets them: `TACTUS_ELF` is the rig's. Without it these
/// tests have nothing to run, which `TACTUS_REQUIRE_ELF=1` makes a failure.
pub(crate) fn elf_of(variable: &str) -> Option<PathBuf> {
    let elf = std::env::var_os(variable).map(PathBuf::from);
    if elf.is_none() {
        assert!(
            std::env::var("TACTUS_REQUIRE_ELF").as_deref() != Ok("1"),
            "TACTUS_REQUIRE_ELF=1, but {variable} is not set"
        );
        eprintln!("skipped: {variable} is not set (run `cargo xtask test`)");
    }
    elf
}

/// The rig's firmware.
pub(crate) fn elf() -> Option<PathBuf> {
    elf_of("TACTUS_ELF")
}

/// A board that has homed.
pub(crate) fn boot(elf: &Path, unknown: &Unknown, store: Option<Vec<u8>>) -> Talk {
    let options = Options {
        store,
        ..Options::default()
    };
    let mut talk = Talk::new(unknown.start(elf, options).unwrap());
    ready(&mut talk);
    talk
}

/// Waits until a board has homed, without a fault.
pub(crate) fn ready(talk: &mut Talk) {
    assert_eq!(talk.ready(|_, _| ()).unwrap(), None);
}
