//! The sensor's slots as its end of the wire sees them: bytes, selects and times, and what it complains of.

use std::path::Path;

use tactus_core::rig::Fault as Seen;
use tactus_core::wire::{Command, Event};
use tactus_emulator::board::{Emulator, Options};
use tactus_emulator::host::talk::Talk;
use tactus_world::world::Setup;

use crate::common::{elf, elf_of, ready};
use crate::faults::identify;

/// A transaction as the firmware keeps it in RAM: its time, the gap behind it, three frames, the select, how many
/// bytes.
const GAP_AT: u64 = 4;
const FRAME_AT: u64 = 8;
const SELECT_AT: u64 = 14;
const BYTES_AT: u64 = 15;
const TRANSACTION_BYTES: u64 = 20;
/// Ticks of the slots' timer in a us, and the gap behind a command, us.
const TICKS: u32 = 84;
const GAP_US: u32 = 50;
/// By now RAM has its initial values, and no slot has begun: the sensor starts for 100 ms.
const BEFORE_SLOTS_MS: u64 = 50;

/// Commands that it gets before the slots, while the firmware finds out that it is a BioTac.
const LOOKED: u64 = 5;

/// Complaints: an answer that was read too early, a read without a command.
const TOO_EARLY: u8 = 0x2D;
const NOT_ASKED: u8 = 0x5F;

/// The sensor's complaints, and the commands that it got.
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
    talk.send(identify(1), 120.0, |_, _| ()).unwrap();
    let (complaints, commands) = heard(talk.board());
    assert_eq!(complaints, []);
    let seconds = talk.board().now_ns() as f64 * 1e-9 - 0.1;
    let due = 4400.0 * seconds;
    assert!((commands as f64 - due).abs() < 30.0, "{commands} of {due}");
    let rig = talk.board().rig();
    let slides = rig.slides();
    assert_eq!(slides.len(), 1);
    for slide in slides {
        eprintln!("{slide:?}");
        assert_eq!(slide.missed_slots, 0);
        assert!(slide.slot_jitter_us < 7.0, "{} us", slide.slot_jitter_us);
    }
}

/// The places in RAM of the transactions that send this frame of two bytes.
fn transactions(board: &mut Emulator, frame: u16) -> Vec<u64> {
    let (begin, bytes) = board.symbol("SLOT_PLAN").unwrap();
    let places = (begin..=begin + bytes - TRANSACTION_BYTES).step_by(4);
    places
        .filter(|place| {
            board.read(place + FRAME_AT, 2).unwrap() == frame.to_le_bytes()
                && board.read(place + BYTES_AT, 1).unwrap() == [2]
        })
        .collect()
}

/// Runs an image whose slots are not what they should be, and says what the sensor heard and the rig saw.
fn planted(elf: &Path, plant: impl FnOnce(&mut Emulator)) -> (Vec<(u8, u64)>, u64, Option<Seen>) {
    let mut board = Emulator::start(elf, Setup::default(), Options::default()).unwrap();
    board.run_ms(BEFORE_SLOTS_MS).unwrap();
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
            for sends in [0x8000, 0x8300] {
                let places = transactions(board, sends);
                let [place] = places[..] else {
                    panic!("{places:x?} for {sends:x?}")
                };
                let [gap, short] = [GAP_US, 30].map(|us| (us * TICKS).to_le_bytes());
                write(board, place + GAP_AT, &gap, &short);
            }
        });
        assert!(commands > 4000, "{commands}");
        let [(TOO_EARLY, times)] = complaints[..] else {
            panic!("{complaints:?}")
        };
        assert!(
            times.abs_diff(commands) <= 1 + LOOKED,
            "{times} of {commands}"
        );
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
        for command in [0x8000, 0x8300] {
            let [place] = transactions(board, command)[..] else {
                panic!("{command:x?}")
            };
            // that of the read is the other half of the slot
            let reads = transactions(board, 0x0001);
            let near = reads
                .into_iter()
                .find(|read| read.abs_diff(place) == TRANSACTION_BYTES);
            let near = near.expect("no read beside the command");
            let frames = [place, near].map(|at| at + FRAME_AT);
            let [asks, read] = frames.map(|at| board.read(at, 2).unwrap());
            board.write(frames[0], &read).unwrap();
            board.write(frames[1], &asks).unwrap();
        }
    });
    // each later read comes 160 us after the command of the slot before
    assert_eq!(complaints, [(NOT_ASKED, 1)]);
    assert_eq!(seen, Some(Seen::SensorSilent));
}

/// One command of thousands is A1, as noise on a select that floats may make it: the sensor streams, until it hears no
/// clock for 5 s.
#[test]
#[ignore = "long"]
fn a_sensor_that_streams_is_left_alone_until_it_answers() {
    /// The frame that asks for P_AC, and the one that starts the streaming mode.
    const ASKS: u16 = 0x8000;
    const STREAM: u16 = 0xA100;
    for variable in ["TACTUS_ELF", "TACTUS_HANDHELD_ELF"] {
        let Some(elf) = elf_of(variable) else { return };
        let mut board = Emulator::start(&elf, Setup::default(), Options::default()).unwrap();
        board.run_ms(BEFORE_SLOTS_MS).unwrap();
        let [place] = transactions(&mut board, ASKS)[..] else {
            panic!("one transaction asks for P_AC")
        };
        let frames = [ASKS, STREAM].map(u16::to_le_bytes);
        write(&mut board, place + FRAME_AT, &frames[0], &frames[1]);
        while !board.rig().world().sensor().is_streaming() {
            board.run_ms(1).unwrap();
            assert!(
                board.now_ns() < 1_000_000_000,
                "{variable}: no command came"
            );
        }
        write(&mut board, place + FRAME_AT, &frames[1], &frames[0]);
        let deaf_ns = board.now_ns();
        while board.rig().world().sensor().is_streaming() {
            board.run_ms(100).unwrap();
            let deaf_s = (board.now_ns() - deaf_ns) as f64 * 1e-9;
            assert!(deaf_s < 37.0, "{variable}: deaf for {deaf_s} s");
        }
        // it is asked as before, and whoever uses it need not know
        let commands = board.rig().sensor_commands();
        board.run_ms(1000).unwrap();
        let asked = board.rig().sensor_commands() - commands;
        assert!(asked.abs_diff(4400) < 30, "{variable}: {asked} commands");
        if variable == "TACTUS_ELF" {
            let mut talk = Talk::new(board);
            // that the board has booted is still on the line
            let _ = talk.send(Command::Status, 1.0, |_, _| ());
            talk.send(Command::Home, 40.0, |_, _| ()).unwrap();
        }
    }
}

#[test]
fn a_slot_without_its_select_is_heard_by_nobody() {
    let Some(elf) = elf() else { return };
    let (complaints, commands, seen) = planted(&elf, |board| {
        for command in [0x8000, 0x8300] {
            let [place] = transactions(board, command)[..] else {
                panic!("{command:x?}")
            };
            // the second select, which the board has not
            write(board, place + SELECT_AT, &[0], &[1]);
        }
    });
    assert!(commands <= LOOKED, "{commands}");
    let [(NOT_ASKED, times)] = complaints[..] else {
        panic!("{complaints:?}")
    };
    assert!(times > 4000, "{times}");
    assert_eq!(seen, Some(Seen::SensorSilent));
}
