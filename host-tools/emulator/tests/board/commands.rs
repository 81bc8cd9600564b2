//! Whatever comes over the link, in whatever order and at whatever moment: the finger is never crushed, the stage never runs
//! into its ends, the board never restarts, and afterwards it does as it is told. Judged by the world behind the pins.

use std::path::Path;

use rand::seq::IndexedRandom as _;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::explorer::{Method, Strategy};
use tactus_core::table::Name;
use tactus_core::wire::{Command, Forget, Identify, MAX_FRAME, Request, Train, encode};
use tactus_emulator::board::{Emulator, Options};
use tactus_emulator::host::talk::{Talk, TalkError};
use tactus_world::stage::TRAVEL_MM;
use tactus_world::world::Setup;

use crate::common::{elf, ready};

/// More force than this is never on the finger, N: see the guard of the core's `rig`.
const MOST_N: f64 = 2.2;
/// Messages to each board.
const SENT: u16 = 24;

/// Two that the factory's table knows, and as many that may come to be.
fn name(random: &mut ChaCha8Rng) -> Name {
    let names = ["Cork", "Burlap", "elm", "oak"];
    Name::try_from(*names.choose(random).unwrap()).unwrap()
}

fn bytes(random: &mut ChaCha8Rng, most: usize) -> Vec<u8> {
    let length = random.random_range(0..=most);
    (0..length).map(|_| random.random()).collect()
}

fn identify(random: &mut ChaCha8Rng) -> Identify {
    // most could be meant, some could not
    let number = |random: &mut ChaCha8Rng| match random.random_range(0..8) {
        0 => random.random(),
        _ => random.random_range(0..116),
    };
    let many = [0, 0, 2, 3].choose(random).copied().unwrap();
    let among: Vec<u16> = (0..many).map(|_| number(random)).collect();
    let odd = f32::from_bits(random.random());
    let threshold = [0.99, 0.999, 0.9, 0.99, 0.99, f32::NAN, -1.0, odd];
    let methods = [
        None,
        Some(Method::Paper),
        Some(Method::Student),
        Some(Method::Fused),
    ];
    let strategies = [Strategy::Bayesian, Strategy::Cycling, Strategy::Random];
    Identify {
        among: among.into_iter().collect(),
        threshold: *threshold.choose(random).unwrap(),
        max_slides: random.random(),
        method: *methods.choose(random).unwrap(),
        strategy: *strategies.choose(random).unwrap(),
        open: random.random(),
        learn: random.random(),
        seed: random.random(),
        false_alarm: random.random::<bool>().then(|| random.random()),
    }
}

/// What moves comes most often.
fn command(random: &mut ChaCha8Rng) -> Command {
    match random.random_range(0..33) {
        0..=6 => Command::Identify(identify(random)),
        7..=10 => Command::Train(Train {
            name: name(random),
            trials: random.random(),
            pilot: random.random(),
            seed: random.random(),
        }),
        11..=14 => Command::Home,
        15 => Command::Stop,
        16 => Command::ReadCalibration,
        17..=18 => Command::Calibrate,
        19 => Command::Status,
        20 => Command::Stream(random.random()),
        21 => Command::Label(name(random)),
        22 => Command::Rename {
            from: name(random),
            to: name(random),
        },
        23 => Command::Forget(Forget::Texture(name(random))),
        24 => Command::ReadTable(random.random()),
        25 => Command::BeginTable(random.random_range(0..20_000)),
        26 => Command::WriteTable {
            offset: random.random_range(0..20_000),
            bytes: bytes(random, 200).into_iter().collect(),
        },
        27 => Command::CommitTable,
        28 => Command::FactoryTable,
        29 => Command::Verify(identify(random)),
        30 => Command::SetFalseAlarm(random.random::<bool>().then(|| random.random())),
        31 => Command::SetHighForce(random.random()),
        _ => Command::WriteCalibration(bytes(random, 64).into_iter().collect()),
    }
}

/// Fails if the world came to harm so far; gives the force.
fn unharmed(board: &Emulator, after: &str) -> f64 {
    let truth = board.rig().world().truth();
    assert!(
        truth.force_max_n <= MOST_N,
        "{:.3} N by {after}",
        truth.force_max_n
    );
    let (low, high) = truth.stage_reach_mm;
    assert!(
        low > 0.0 && high < TRAVEL_MM,
        "the stage was at {low:.2} and {high:.2} mm by {after}"
    );
    assert_eq!(truth.lever_bad_pulses, 0, "{after}");
    truth.force_n
}

/// A board that gets one command after the other, each before the last is done or long after.
fn survives(elf: &Path, seed: u64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let setup = Setup {
        texture: random.random_range(1..=117),
        trial_seed: seed,
        ..Setup::default()
    };
    let mut talk = Talk::new(Emulator::start(elf, setup, Options::default()).unwrap());
    ready(&mut talk);
    let board = talk.board();
    let mut pressed_n = 0.0_f64;
    let mut after = String::new();
    for id in 0..SENT {
        if random.random_range(0..8) == 0 {
            let noise = bytes(&mut random, 400);
            board.send(&noise);
            after += "noise, ";
        } else {
            let command = command(&mut random);
            after.extend(format!("{command:?}").chars().take(60));
            after += ", ";
            let mut buffer = [0; MAX_FRAME + 1];
            board.send(encode(&Request { id, command }, &mut buffer).unwrap());
        }
        // from the next one at once to the middle of a slide
        let longest = [10, 2000, 20_000].choose(&mut random).copied().unwrap();
        let until_ns = board.now_ns() + random.random_range(0..longest) * 1_000_000;
        while board.now_ns() < until_ns {
            board.run_ms(10).unwrap();
            pressed_n = pressed_n.max(unharmed(board, &after));
        }
    }
    // the last ones may be an unfinished frame: a delimiter ends it
    board.send(&[0]);
    // what was said so far, the boot's report first, is nobody's answer
    board.received();
    match talk.send(Command::Stop, 10.0, |_, _| ()) {
        Ok(()) | Err(TalkError::Refused(_)) => {}
        Err(why) => panic!("stop: {why} after {after}"),
    }
    talk.board().run_ms(2000).unwrap();
    let truth = talk.board().rig().world().truth();
    assert!(
        truth.indentation_mm < 0.0 && truth.speed_mm_s.abs() < 0.01,
        "{truth:?} after {after}"
    );
    // what was being stored may take its time
    let home = (0..5).any(|_| match talk.send(Command::Home, 40.0, |_, _| ()) {
        Ok(()) => true,
        Err(TalkError::Refused(why)) => {
            println!("seed {seed}: home: {why}");
            talk.board().run_ms(1000).unwrap();
            false
        }
        Err(why) => panic!("home: {why} after {after}"),
    });
    assert!(home, "still refused to home, after {after}");
    unharmed(talk.board(), &after);
    let resets = talk.board().resets().unwrap();
    assert!(resets.is_empty(), "{resets:?} after {after}");
    println!("seed {seed}: {pressed_n:.2} N at most in {SENT} messages");
    assert!(pressed_n > 0.1, "nothing was pressed: try another seed");
}

#[test]
fn random_commands_do_no_harm() {
    let Some(elf) = elf() else { return };
    std::thread::scope(|scope| {
        for seed in [2, 3] {
            let elf = &elf;
            scope.spawn(move || survives(elf, seed));
        }
    });
}
