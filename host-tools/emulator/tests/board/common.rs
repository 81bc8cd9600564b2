//! What the tests of the firmware share: where it is, and boards that run it.

use std::io::Read as _;
use std::path::{Path, PathBuf};

use flate2::read::GzDecoder;
use tactus_core::table::Table;
use tactus_emulator::board::Options;
use tactus_emulator::host::talk::Talk;
use tactus_emulator::host::under_finger::Unknown;

/// The ELF that an environment variable names, as `cargo xtask test` sets them: `TACTUS_ELF` is the rig's. Without it
/// these tests have nothing to run, which `TACTUS_REQUIRE_ELF=1` makes a failure.
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

/// CRC-32 (ISO-HDLC), bit by bit.
pub(crate) fn crc32(bytes: &[u8]) -> [u8; 4] {
    let crc = !bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            (crc >> 1) ^ (0xEDB8_8320 & 0u32.wrapping_sub(crc & 1))
        })
    });
    crc.to_le_bytes()
}

/// The table with the limits of changed textures from here on, whatever they were; its checksum is right.
pub(crate) fn with_limits_of_change(table: &[u8], begin: f32) -> Vec<u8> {
    let limits = Table::read(table).unwrap().limits().unwrap();
    let mut bytes = table.to_vec();
    for tail in limits.same {
        let there = [tail.begin, tail.excess].map(f32::to_le_bytes).concat();
        let at = bytes.windows(8).position(|some| some == there).unwrap();
        bytes[at..at + 4].copy_from_slice(&begin.to_le_bytes());
    }
    let end = bytes.len() - 4;
    let crc = crc32(&bytes[..end]);
    bytes[end..].copy_from_slice(&crc);
    bytes
}

/// The bytes of a file that is packed.
pub(crate) fn unpacked(path: &Path) -> Vec<u8> {
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).unwrap();
    GzDecoder::new(file).read_to_end(&mut bytes).unwrap();
    bytes
}
