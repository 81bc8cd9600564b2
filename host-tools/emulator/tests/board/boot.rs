//! The real ELF on the board.

use tactus_core::wire::{Command, Event, Phase};
use tactus_emulator::board::{Emulator, Options, Output};
use tactus_emulator::host::talk::Talk;
use tactus_world::faults::Fault;
use tactus_world::world::Setup;

use crate::common::elf;

#[test]
fn the_firmware_boots_and_uses_only_what_is_modelled() {
    let Some(elf) = elf() else { return };
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
    assert_eq!(emulator.violations().unwrap(), []);
}

#[test]
fn code_that_is_broken_on_purpose_hangs_until_the_watchdog_resets_the_chip() {
    let Some(elf) = elf() else { return };
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

/// The words that a board without the debug probe's 8 MHz says, and whether it works all the same.
#[test]
#[ignore = "long"]
fn a_board_without_the_probes_clock_runs_by_its_own() {
    let Some(elf) = elf() else { return };
    for clock in [true, false] {
        let options = Options {
            clock,
            ..Options::default()
        };
        let mut talk = Talk::new(Emulator::start(&elf, Setup::default(), options).unwrap());
        let mut words = None;
        let ready = |event: &Event| match event {
            Event::Booted { last_words, .. } => {
                words = Some(last_words.clone());
                None
            }
            Event::Phase(Phase::Ready) => Some(Ok(())),
            _ => None,
        };
        talk.wait(30.0, |_, _| (), ready).unwrap();
        let words = words.unwrap().map(|words| words.as_str().to_owned());
        eprintln!("clock {clock}: {words:?}");
        let said = words.is_some_and(|words| words.contains("8 MHz"));
        assert_eq!(said, !clock);
        if !clock {
            // the line, the stage, the sensor's slots and the motor's current, at their rates
            talk.send(Command::Calibrate, 80.0, |_, _| ()).unwrap();
        }
        assert_eq!(talk.board().resets().unwrap(), []);
    }
}

/// Whatever becomes of the start-up, the watchdog is there.
#[test]
fn a_start_up_that_hangs_is_ended_by_the_watchdog() {
    let Some(elf) = elf() else { return };
    let mut emulator = Emulator::start(&elf, Setup::default(), Options::default()).unwrap();
    // before the clocks are set up
    let (address, _) = emulator.symbol("tactus_board_start").unwrap();
    emulator.write(address, &[0xFE, 0xE7]).unwrap();
    emulator.run_ms(3000).unwrap();
    let resets = emulator.resets().unwrap();
    eprintln!("{resets:?}");
    assert!(!resets.is_empty(), "it hangs for ever");
}

/// The first evening: nobody has calibrated anything, and up is down. The first act is to lift the finger; what presses
/// it must not become the measure of no contact, neither by itself nor by a user who homes again.
#[test]
#[ignore = "long"]
fn a_first_boot_that_goes_down_instead_of_up_presses_once_and_no_more() {
    let Some(elf) = elf() else { return };
    let setup = Setup {
        texture: 30,
        ..Setup::default()
    };
    let mut board = Emulator::start(&elf, setup, Options::default()).unwrap();
    board.inject(Fault::LeverDirInverted);
    let mut talk = Talk::new(board);
    let mut forces = Vec::new();
    for _ in 0..3 {
        let limit_ns = talk.board().now_ns() + 12_000_000_000;
        while talk.board().now_ns() < limit_ns {
            talk.step().unwrap();
        }
        forces.push(talk.board().rig().world().truth().force_max_n);
        let _ = talk.send(Command::Home, 40.0, |_, _| ());
    }
    let after_n = talk.board().rig().world().truth().force_max_n;
    eprintln!("{forces:.2?} N, then {after_n:.2} N");
    assert!(after_n < 2.2, "{after_n:.2} N on the finger");
}

/// A flash that never says that it is ready keeps neither the finger down nor the rest of the rig from working.
#[test]
#[ignore = "long"]
fn a_store_that_does_not_open_does_not_keep_the_finger_down() {
    let Some(elf) = elf() else { return };
    // a power cut while a page was erased: the store goes on with it when it is opened
    let mut store = vec![0xFF; 64 << 10];
    store[0xBFF0..0xBFF4].copy_from_slice(b"eras");
    let options = Options {
        store: Some(store),
        trace_s: 30,
        ..Options::default()
    };
    let mut board = Emulator::start(&elf, Setup::default(), options).unwrap();
    board.lose_flash_interrupts().unwrap();
    let mut talk = Talk::new(board);
    talk.wait(
        20.0,
        |_, _| (),
        |event| matches!(event, Event::Phase(Phase::Ready)).then_some(Ok(())),
    )
    .unwrap();
    let now_ms = talk.board().now_ns() / 1_000_000;
    // the pin is low at first, and is not reported then
    let mut down = false;
    let mut up_ms = |&(at_ns, output): &(u64, Output)| match output {
        Output::LeverDown(is) => {
            down = is;
            None
        }
        Output::LeverStep(true) if !down => Some(at_ns / 1_000_000),
        _ => None,
    };
    let first_ms = talk.board().rig().trace().find_map(&mut up_ms);
    eprintln!("lifts from {first_ms:?} ms on, ready after {now_ms} ms");
    assert!(first_ms.is_some_and(|ms| ms < 500), "{first_ms:?}");
    assert_eq!(talk.board().resets().unwrap(), []);
    talk.send(Command::Home, 40.0, |_, _| ()).unwrap();
}
