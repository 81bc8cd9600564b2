//! The store of the real firmware, over many writes: its pages turn in time, and it loses nothing.

use tactus_core::features::{Movement, Properties, Property, PropertySet};
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::table::{Experience, encode};
use tactus_core::wire::{Command, Event, Identify, Train};
use tactus_emulator::board::{Emulator, Options};
use tactus_emulator::host::talk::{TIMEOUT_S, Talk, TalkError};
use tactus_link::{PushTable, Request};
use tactus_world::mount::Mount;
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
    // and a training that cannot be is refused before anything moves
    let nameless = Command::Train(Train {
        name: Default::default(),
        trials: 5,
        pilot: false,
        seed: 1,
    });
    let refused = talk.send(nameless, 5.0, |_, _| ());
    assert!(matches!(refused, Err(TalkError::Refused(_))), "{refused:?}");
}

/// A table of two textures at 2 N.
fn hard_table() -> Vec<u8> {
    let traction: PropertySet = [Property::Traction].into_iter().collect();
    let learned = [0.5, 1.5].map(|newton| {
        let mut experience = Experience::default();
        for more in [0.0, 0.1, 0.2] {
            let slide = Properties::new([Some(newton + more), None, None]);
            experience.learn(traction, &slide).unwrap();
        }
        [experience]
    });
    let textures = ["smooth", "rough"].into_iter().zip(&learned);
    let textures = textures.map(|(name, known)| (name, &known[..]));
    let movement = Movement::new(1995, 15_849).unwrap();
    let mut buffer = [0; 256];
    let table = encode(&mut buffer, traction, &[movement], textures);
    table.unwrap().as_bytes().to_vec()
}

/// The largest force since this was asked for last, N.
fn pressed_n(talk: &mut Talk) -> f64 {
    let mut rig = talk.board().rig();
    let pressed_n = rig.world().truth().force_max_n;
    rig.world().reset_extremes();
    pressed_n
}

#[test]
fn two_newtons_are_pressed_only_where_they_were_set() {
    let Some(elf) = elf() else { return };
    let mut talk = boot(&elf, None);
    talk.board().rig().world().mount(Mount::FOR_2_N);
    let push = PushTable::new(&hard_table()).unwrap();
    talk.run(push, TIMEOUT_S, |_, _| ()).unwrap();
    let train = || {
        Command::Train(Train {
            name: "felt".try_into().unwrap(),
            trials: 2,
            pilot: false,
            seed: 1,
        })
    };
    pressed_n(&mut talk);
    match talk.send(train(), TIMEOUT_S, |_, _| ()) {
        Err(TalkError::Refused(why)) => assert!(why.contains("--high-force on"), "{why}"),
        other => panic!("{other:?}"),
    }
    assert_eq!(pressed_n(&mut talk), 0.0);
    talk.send(Command::SetHighForce(true), TIMEOUT_S, |_, _| ())
        .unwrap();
    talk.send(train(), 2.0 * TIMEOUT_S, |_, _| ()).unwrap();
    let trained_n = pressed_n(&mut talk);
    assert!((1.9..=2.2).contains(&trained_n), "{trained_n} N");
    // without power in between
    let store = talk.board().store().unwrap();
    let mut talk = boot(&elf, Some(store));
    talk.board().rig().world().mount(Mount::FOR_2_N);
    let status = talk.run(Request::status(), TIMEOUT_S, |_, _| ()).unwrap();
    assert!(status.high_force && status.textures == 3, "{status:?}");
    pressed_n(&mut talk);
    let identify = Identify {
        max_slides: 1,
        ..Identify::default()
    };
    talk.send(Command::Identify(identify), TIMEOUT_S, |_, _| ())
        .unwrap();
    let identified_n = pressed_n(&mut talk);
    println!("{trained_n:.3} N, then {identified_n:.3} N");
    assert!((1.9..=2.2).contains(&identified_n), "{identified_n} N");
    assert_eq!(talk.board().resets().unwrap(), []);
}
