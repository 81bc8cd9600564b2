//! The store of the real firmware, over many writes: its pages turn in time, and it loses nothing.

use tactus_core::rig::calibration::RigCalibration;
use tactus_core::wire::{Command, Event};
use tactus_emulator::board::{Emulator, Options};
use tactus_emulator::host::talk::Talk;
use tactus_world::world::Setup;

use crate::common::{elf, ready};

/// The tasks of thread mode are taken for hung after 2 s: half of it is the most that a write may keep them.
const LONGEST_MS: u64 = 1000;

fn boot(elf: &std::path::Path, store: Option<Vec<u8>>) -> Talk {
    let options = Options {
        store,
        ..Options::default()
    };
    let mut talk = Talk::new(Emulator::start(elf, Setup::default(), options).unwrap());
    ready(&mut talk);
    talk
}

/// The calibration that a command is answered with.
fn calibration_after(talk: &mut Talk, command: Command) -> RigCalibration {
    let mut told = None;
    let hear = |_: &mut Emulator, report: Option<&tactus_core::wire::Report>| {
        if let Some(Event::Calibration(bytes)) = report.map(|r| &r.event) {
            told = Some(bytes.clone());
        }
    };
    talk.send(command, 120.0, hear).unwrap();
    RigCalibration::from_bytes(&told.unwrap()).unwrap()
}

#[test]
#[ignore = "long"]
fn pages_turn_in_time_and_nothing_is_lost() {
    let Some(elf) = elf() else { return };
    let mut talk = boot(&elf, None);
    // a calibration takes 84 bytes of a page of 16 KB: two pages and some
    let measured = calibration_after(&mut talk, Command::Calibrate);
    let calibration = |date| RigCalibration { date, ..measured };
    let mut longest_ms = (0, 0);
    for n in 1..=430 {
        let bytes = calibration(20_260_000 + n).to_bytes();
        let began_ns = talk.board().now_ns();
        let command = Command::WriteCalibration(bytes);
        talk.send(command, 20.0, |_, _| ()).unwrap();
        longest_ms = longest_ms.max(((talk.board().now_ns() - began_ns) / 1_000_000, n));
    }
    eprintln!(
        "longest of 430 writes: {} ms, the {}th",
        longest_ms.0, longest_ms.1
    );
    assert!(longest_ms.0 < LONGEST_MS, "{longest_ms:?}");
    assert_eq!(talk.board().resets().unwrap(), []);

    let store = talk.board().store().unwrap();
    let mut talk = boot(&elf, Some(store));
    let kept = calibration_after(&mut talk, Command::ReadCalibration);
    assert_eq!(kept, calibration(20_260_430));
}
