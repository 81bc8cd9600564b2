//! The sensor's slots as its end of the wire sees them: bytes, selects and times, and what it complains of.

use std::path::Path;

use tactus::sim::world::Setup;
use tactus_core::rig::Fault as Seen;
use tactus_core::wire::Event;
use tactus_emulator::board::{Emulator, Options};
use tactus_emulator::host::talk::Talk;

use crate::common::{elf, elf_of, ready};
use crate::faults::identify;

const FLASH: u64 = 0x0800_0000;
/// Where images end at the latest: flash bank 1.
const FLASH_BYTES: u64 = 1 << 20;
/// A transaction in the order of the compiler: where the bytes are, how many there are, the gap, select and answer.
const GAP_AT: u64 = 8;
const SELECT_AT: u64 = 12;
const TRANSACTION_BYTES: u64 = 16;
/// The gap behind a command, us.
const GAP_US: u32 = 50;

/// Complaints: an answer that was read too early, a read without a command.
const TOO_EARLY: u8 = 0x2D;
const NOT_ASKED: u8 = 0x5F;

/// What the sensor complained of, and the commands that it got.
fn heard(board: &mut Emulator) -> (Vec<(u8, u64)>, u64) {
    let mut rig = board.rig();
    let complaints = rig.world().sensor().complaints().clone();
    (complaints.into_iter().collect(), rig.sensor_commands())
}

#[test]
fn the_sensor_has_nothing_to_complain_of() {
    let Some(elf) = elf() else { return };
    let board = Emulator::start(&elf, Setup::default(), Options::default()).unwrap();
    let mut talk = Talk::new(board);
    ready(&mut talk);
    talk.send(identify(2), 120.0, |_, _| ()).unwrap();
    let (complaints, commands) = heard(talk.board());
    assert_eq!(complaints, []);
    let seconds = talk.board().now_ns() as f64 * 1e-9 - 0.1;
    let due = 4400.0 * seconds;
    assert!((commands as f64 - due).abs() < 30.0, "{commands} of {due}");
    let rig = talk.board().rig();
    let slides = rig.slides();
    assert_eq!(slides.len(), 2);
    for slide in slides {
        eprintln!("{slide:?}");
        assert_eq!(slide.missed_slots, 0);
        assert!(slide.slot_jitter_us < 7.0, "{} us", slide.slot_jitter_us);
    }
}

/// The places in flash of the transactions that send these bytes.
fn transactions(board: &mut Emulator, sends: [u8; 2]) -> Vec<u64> {
    let flash = board.read(FLASH, FLASH_BYTES).unwrap();
    let word = |at: usize| -> Option<u32> {
        let bytes = flash.get(at..at + 4)?.try_into().ok()?;
        Some(u32::from_le_bytes(bytes))
    };
    let sends_at = |at: usize| {
        let from = word(at)?.checked_sub(FLASH as u32)? as usize;
        (flash.get(from..from + 2)? == sends && word(at + 4)? == 2).then_some(())
    };
    (0..flash.len())
        .step_by(4)
        .filter(|at| sends_at(*at).is_some())
        .map(|at| FLASH + at as u64)
        .collect()
}

/// Runs an image whose slots are not what they should be, and says what the sensor heard and the rig saw.
fn planted(elf: &Path, plant: impl FnOnce(&mut Emulator)) -> (Vec<(u8, u64)>, u64, Option<Seen>) {
    let mut board = Emulator::start(elf, Setup::default(), Options::default()).unwrap();
    plant(&mut board);
    let mut talk = Talk::new(board);
    let mut seen = None;
    while talk.now_ns() < 1_500_000_000 {
        for report in talk.step().unwrap() {
            if let Event::Fault(fault) = report.event {
                seen = seen.or(Some(fault));
            }
        }
    }
    let (complaints, commands) = heard(talk.board());
    eprintln!("{complaints:?} of {commands} commands: {seen:?}");
    (complaints, commands, seen)
}

/// Writes over what is in a transaction, which has to be as it is thought to be.
fn write(board: &mut Emulator, place: u64, is: &[u8], new: &[u8]) {
    assert_eq!(board.read(place, is.len() as u64).unwrap(), is);
    board.write(place, new).unwrap();
}

#[test]
fn the_sensor_complains_of_a_slot_with_a_short_gap() {
    for variable in ["TACTUS_ELF", "TACTUS_HANDHELD_ELF"] {
        let Some(elf) = elf_of(variable) else { return };
        let (complaints, commands, seen) = planted(&elf, |board| {
            for sends in [[0x80, 0x00], [0x83, 0x00]] {
                let places = transactions(board, sends);
                let [place] = places[..] else {
                    panic!("{places:x?} for {sends:x?}")
                };
                let [gap, short] = [GAP_US, 30].map(u32::to_le_bytes);
                write(board, place + GAP_AT, &gap, &short);
            }
        });
        assert!(commands > 4000, "{commands}");
        let [(TOO_EARLY, times)] = complaints[..] else {
            panic!("{complaints:?}")
        };
        assert!(times.abs_diff(commands) <= 1, "{times} of {commands}");
        // the handheld has no phase in which it could say so
        assert!(
            variable != "TACTUS_ELF" || seen == Some(Seen::SensorSilent),
            "{seen:?}"
        );
    }
}

#[test]
fn a_slot_that_reads_before_it_asks_has_no_sample() {
    let Some(elf) = elf() else { return };
    let (complaints, _, seen) = planted(&elf, |board| {
        for command in [[0x80, 0x00], [0x83, 0x00]] {
            let [place] = transactions(board, command)[..] else {
                panic!("{command:x?}")
            };
            // that of the read is the other half of the slot
            let reads = transactions(board, [0x00, 0x01]);
            let near = reads
                .into_iter()
                .find(|read| read.abs_diff(place) == TRANSACTION_BYTES);
            let near = near.expect("no read beside the command");
            let [asks, read] = [place, near].map(|at| board.read(at, 4).unwrap());
            board.write(place, &read).unwrap();
            board.write(near, &asks).unwrap();
        }
    });
    // each later read comes 160 us after the command of the slot before
    assert_eq!(complaints, [(NOT_ASKED, 1)]);
    assert_eq!(seen, Some(Seen::SensorSilent));
}

#[test]
fn a_slot_without_its_select_is_heard_by_nobody() {
    let Some(elf) = elf() else { return };
    let (complaints, commands, seen) = planted(&elf, |board| {
        for command in [[0x80, 0x00], [0x83, 0x00]] {
            let [place] = transactions(board, command)[..] else {
                panic!("{command:x?}")
            };
            // the second select, which the board has not; no answer
            write(board, place + SELECT_AT, &[0, 0], &[1, 0]);
        }
    });
    assert_eq!(commands, 0);
    let [(NOT_ASKED, times)] = complaints[..] else {
        panic!("{complaints:?}")
    };
    assert!(times > 4000, "{times}");
    assert_eq!(seen, Some(Seen::SensorSilent));
}
