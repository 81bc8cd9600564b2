//! The real ELF on the board.

use std::path::PathBuf;

use tactus_emulator::{Emulator, Options, Setup};

/// The firmware's ELF, which `cargo xtask emulate` names; without it these tests have nothing to run.
fn elf() -> Option<PathBuf> {
    std::env::var_os("TACTUS_ELF").map(PathBuf::from)
}

#[test]
fn the_firmware_boots_and_uses_only_what_is_modelled() {
    let Some(elf) = elf() else {
        eprintln!("skipped: TACTUS_ELF is not set");
        return;
    };
    let mut emulator = Emulator::start(&elf, Setup::default(), Options::default()).unwrap();
    let began = std::time::Instant::now();
    emulator.run_ms(1000).unwrap();
    eprintln!("1 virtual second took {:?}", began.elapsed());
    let log = emulator.log().unwrap();
    for (at_ns, line) in &log {
        eprintln!("{:9.3} ms {line}", *at_ns as f64 * 1e-6);
    }
    assert!(!log.is_empty(), "it says nothing");
    assert_eq!(emulator.resets().unwrap(), []);
    assert_eq!(emulator.unmapped().unwrap(), [0u64; 0]);
    for register in emulator.unimplemented().unwrap() {
        assert!(register.starts_with("SYSCFG."), "{register}");
    }
}

#[test]
fn code_that_is_broken_on_purpose_hangs_until_the_watchdog_resets_the_chip() {
    let Some(elf) = elf() else {
        eprintln!("skipped: TACTUS_ELF is not set");
        return;
    };
    let mut emulator = Emulator::start(&elf, Setup::default(), Options::default()).unwrap();
    emulator.run_ms(150).unwrap();
    assert_eq!(emulator.resets().unwrap(), []);
    // the interrupt that the servo runs in: a branch to itself
    let (address, _) = emulator.symbol("UART5").unwrap();
    emulator.write(address, &[0xFE, 0xE7]).unwrap();
    assert_eq!(emulator.read(address, 2).unwrap(), [0xFE, 0xE7]);
    emulator.run_ms(300).unwrap();
    let resets = emulator.resets().unwrap();
    eprintln!("{resets:?}");
    assert!(!resets.is_empty(), "the patched code was not run");
}
