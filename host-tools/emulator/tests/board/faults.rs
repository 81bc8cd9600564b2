//! Faults of the rig and of the firmware itself, from seeded instants, on the emulated board: judged by the pins and by the
//! world behind them, not by what the firmware says of itself.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::rig::Fault as Seen;
use tactus_core::wire::{Command, Event, Identify, MAX_FRAME, Phase, Request, Reset, encode};
use tactus_emulator::board::{Emulator, Options, Output};
use tactus_emulator::host::talk::{Talk, TalkError};
use tactus_world::encoder::Cut;
use tactus_world::faults::Fault;
use tactus_world::world::Setup;

use crate::common::{elf, ready};

/// Unused flash.
const NOWHERE: u64 = 0x080F_FF00;

/// What a function does instead of its work, once: its code is whole again 10 ms later, as after a disturbance that left
/// no trace.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Instead {
    /// It never returns.
    Hangs,
    /// It runs into an undefined instruction.
    Crashes,
    /// It panics.
    Panics,
    /// It raises the NMI of the clock security system, and goes no further.
    Nmi,
}

/// Code for [`NOWHERE`] that calls `core::panicking::panic`.
fn panicking(panic: u64) -> Vec<u8> {
    // ldr r3 from the word behind, blx r3
    let code = [0x4B00_u16, 0x4798];
    let mut bytes: Vec<u8> = code.iter().flat_map(|c| c.to_le_bytes()).collect();
    bytes.extend((panic as u32 | 1).to_le_bytes());
    bytes
}

/// Thumb's `b.w` from one address to another (ARMv7-M manual, B, encoding T4).
fn branch(from: u64, to: u64) -> [u8; 4] {
    let offset = (to as i64 - (from as i64 + 4)) as u32;
    let bit = |n: u32| offset >> n & 1;
    let s = bit(24);
    let high = 0xF000 | s << 10 | offset >> 12 & 0x3FF;
    let (j1, j2) = (!(bit(23) ^ s) & 1, !(bit(22) ^ s) & 1);
    let low = 0x9000 | j1 << 13 | j2 << 11 | offset >> 1 & 0x7FF;
    let [a, b] = (high as u16).to_le_bytes();
    let [c, d] = (low as u16).to_le_bytes();
    [a, b, c, d]
}

/// Breaks a function; what to put back, and where.
fn break_code(board: &mut Emulator, name: &str, instead: Instead) -> (u64, Vec<u8>) {
    let (address, _) = board.symbol(name).unwrap();
    let address = address & !1;
    let code = board.read(address, 4).unwrap();
    match instead {
        Instead::Hangs => {
            // a branch to itself
            board.write(NOWHERE, &[0xFE, 0xE7]).unwrap();
            board.write(address, &branch(address, NOWHERE)).unwrap();
        }
        Instead::Panics => {
            let (panic, _) = board.symbol("rust_begin_unwind").unwrap();
            board.write(NOWHERE, &panicking(panic)).unwrap();
            board.write(address, &branch(address, NOWHERE)).unwrap();
        }
        Instead::Nmi => {
            // ldr r0, [pc, #8]; movs r1, #1; lsls r1, #31; str r1, [r0]; a branch to itself; nop; ICSR
            let code = [
                0x4802_u16, 0x2101, 0x07C9, 0x6001, 0xE7FE, 0xBF00, 0xED04, 0xE000,
            ];
            let bytes: Vec<u8> = code.iter().flat_map(|c| c.to_le_bytes()).collect();
            board.write(NOWHERE, &bytes).unwrap();
            board.write(address, &branch(address, NOWHERE)).unwrap();
        }
        // udf
        Instead::Crashes => board.write(address, &[0x00, 0xDE]).unwrap(),
    }
    (address, code)
}

/// What breaks.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Cause {
    Rig(Fault),
    /// A function of the firmware, by the name that it exports.
    Code(&'static str, Instead),
    /// The debug probe's 8 MHz stop.
    Clock,
}

/// When it breaks, by what really happens.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum When {
    /// The finger is in the air, before the first contact.
    Approaching,
    /// The finger presses, the stage stands.
    Pressing,
    Sliding,
}

struct Case {
    name: &'static str,
    cause: Cause,
    when: When,
    /// What may be reported; nothing where the firmware itself goes down.
    seen: &'static [Seen],
    /// From the fault to the stage's brake and to the first step up, ms; `None` where the lever itself is at fault, and
    /// steps are no measure.
    deadline_ms: Option<u64>,
}

/// By the fault table: its deadline, and what it takes until the fault shows.
const CASES: [Case; 17] = [
    Case {
        name: "sensor unplugged before the slide",
        cause: Cause::Rig(Fault::SensorUnplugged),
        when: When::Approaching,
        seen: &[Seen::SensorSilent],
        deadline_ms: Some(12),
    },
    Case {
        name: "sensor unplugged while sliding",
        cause: Cause::Rig(Fault::SensorUnplugged),
        when: When::Sliding,
        seen: &[Seen::SensorSilent],
        deadline_ms: Some(12),
    },
    Case {
        // 44 damaged words a second: the 23rd after half a second, give or take the luck
        name: "one word in a hundred with a flipped bit",
        cause: Cause::Rig(Fault::BitFlips { share: 0.01 }),
        when: When::Sliding,
        seen: &[Seen::SensorErrors],
        deadline_ms: Some(1000),
    },
    Case {
        name: "MISO stuck high",
        cause: Cause::Rig(Fault::MisoStuck { high: true }),
        when: When::Sliding,
        seen: &[Seen::SensorSilent],
        deadline_ms: Some(12),
    },
    Case {
        name: "MISO stuck low",
        cause: Cause::Rig(Fault::MisoStuck { high: false }),
        when: When::Pressing,
        seen: &[Seen::SensorSilent],
        deadline_ms: Some(12),
    },
    Case {
        name: "stage stalled",
        cause: Cause::Rig(Fault::StageJammed),
        when: When::Sliding,
        seen: &[Seen::StageStall, Seen::StageOff],
        // 30 ms of way are compared
        deadline_ms: Some(65),
    },
    Case {
        name: "encoder's wires cut",
        cause: Cause::Rig(Fault::EncoderCut(Cut::Both)),
        when: When::Sliding,
        seen: &[Seen::EncoderSilent, Seen::StageOff],
        deadline_ms: Some(65),
    },
    Case {
        name: "lever loses steps",
        cause: Cause::Rig(Fault::LeverLosesSteps { share: 1.0 }),
        when: When::Pressing,
        seen: &[Seen::LeverSlips, Seen::Unsteady, Seen::LeverNotHome],
        deadline_ms: None,
    },
    Case {
        // its contact bounces for 4 ms
        name: "emergency stop while pressing",
        cause: Cause::Rig(Fault::EStop),
        when: When::Pressing,
        seen: &[Seen::EStop],
        deadline_ms: Some(9),
    },
    Case {
        // its contact bounces for 4 ms
        name: "emergency stop while sliding",
        cause: Cause::Rig(Fault::EStop),
        when: When::Sliding,
        seen: &[Seen::EStop],
        deadline_ms: Some(9),
    },
    Case {
        name: "the lever's driver runs down on its own while pressing",
        cause: Cause::Rig(Fault::LeverRunaway),
        when: When::Pressing,
        seen: &[Seen::ForceHigh, Seen::Unsteady],
        deadline_ms: None,
    },
    Case {
        // the slide may end before the force is too high
        name: "the lever's driver runs down on its own while sliding",
        cause: Cause::Rig(Fault::LeverRunaway),
        when: When::Sliding,
        seen: &[Seen::ForceHigh, Seen::LeverSlips, Seen::Unsteady],
        deadline_ms: None,
    },
    Case {
        // 2 s without a check-in
        name: "the tasks of thread mode hang",
        cause: Cause::Code("tactus_check_in", Instead::Hangs),
        when: When::Pressing,
        // the task that would report it is the one that hangs: the report comes after the restart
        seen: &[],
        deadline_ms: Some(2010),
    },
    Case {
        // the watchdog's 100 ms, by an oscillator of 32 kHz, then the firmware's start
        name: "the servo hangs",
        cause: Cause::Code("tactus_servo_tick", Instead::Hangs),
        when: When::Sliding,
        seen: &[],
        deadline_ms: Some(500),
    },
    Case {
        name: "the servo crashes",
        cause: Cause::Code("tactus_servo_tick", Instead::Crashes),
        when: When::Sliding,
        seen: &[],
        deadline_ms: Some(3),
    },
    Case {
        name: "a task panics",
        cause: Cause::Code("tactus_check_in", Instead::Panics),
        when: When::Sliding,
        seen: &[],
        // its task has its turn every 5 ms
        deadline_ms: Some(8),
    },
    Case {
        name: "the clock stops",
        cause: Cause::Clock,
        when: When::Sliding,
        seen: &[],
        // the slot in which the NMI is raised, and two periods of the lever's timer
        deadline_ms: Some(3),
    },
];

pub(crate) fn board(elf: &std::path::Path, seed: u64, texture: u8) -> Talk {
    board_with(elf, seed, texture, Options::default())
}

/// The same with other options, but for the trace's length.
pub(crate) fn board_with(elf: &std::path::Path, seed: u64, texture: u8, options: Options) -> Talk {
    let setup = Setup {
        texture,
        trial_seed: seed,
        ..Setup::default()
    };
    let options = Options {
        trace_s: 4,
        ..options
    };
    let mut talk = Talk::new(Emulator::start(elf, setup, options).unwrap());
    ready(&mut talk);
    talk
}

/// Never sure: an exploration of so many slides.
pub(crate) fn identify(slides: u8) -> Command {
    Command::Identify(Identify {
        among: Default::default(),
        threshold: 1.0,
        max_slides: slides,
        method: None,
        strategy: Default::default(),
        open: false,
        learn: false,
        seed: 5,
        false_alarm: None,
    })
}

pub(crate) fn is_time(when: When, board: &mut Emulator) -> bool {
    let truth = board.rig().world().truth();
    match when {
        // 0.8 s of the way down are left at least
        When::Approaching => truth.force_n == 0.0 && (-1.8..-0.4).contains(&truth.indentation_mm),
        When::Pressing => truth.force_n > 0.15 && truth.speed_mm_s.abs() < 1.0,
        When::Sliding => truth.force_n > 0.15 && truth.speed_mm_s > 5.0,
    }
}

/// What came of a fault.
#[derive(Debug, Default)]
struct Outcome {
    seen: Option<Seen>,
    rebooted: Option<(Reset, Option<String>)>,
    force_max_n: f64,
    /// From the fault, ms: the stage without duty for good, and the first step up.
    braked_ms: Option<f64>,
    lifting_ms: Option<f64>,
    force_n: f64,
}

fn run(case: &Case, talk: &mut Talk, random: &mut ChaCha8Rng) -> Outcome {
    talk.board().rig().world().reset_extremes();
    let mut outcome = Outcome::default();
    let mut broken_ns = None;
    let delay_ns = random.random_range(0..300_000_000);
    let mut due_ns = None;
    let mut broken = None;
    let mut over_ns = u64::MAX;
    let mut booted = None;
    let mut seen = None;
    let after_ms = case.deadline_ms.unwrap_or(1500) + 400;
    // a fault that the rig gets over by itself ends an exploration after six slides, each with a homing
    let ended = talk.send(identify(10), 200.0, |board, report| {
        if let Some(report) = report {
            match &report.event {
                Event::Fault(fault) => seen = Some(*fault),
                Event::Booted {
                    reset, last_words, ..
                } => booted = Some((*reset, last_words.as_ref().map(|w| w.as_str().to_owned()))),
                _ => {}
            }
            return;
        }
        if due_ns.is_none() && is_time(case.when, board) {
            due_ns = Some(board.now_ns() + delay_ns);
        }
        if broken_ns.is_none() && due_ns.is_some_and(|due| board.now_ns() >= due) {
            // still so: a slide may have ended meanwhile
            if !is_time(case.when, board) {
                due_ns = None;
                return;
            }
            match case.cause {
                Cause::Rig(fault) => board.inject(fault),
                Cause::Code(name, instead) => broken = Some(break_code(board, name, instead)),
                Cause::Clock => {
                    board.stop_clock().unwrap();
                    // by the slow clock the sensor's next slot comes within 2.4 ms
                    broken = Some(break_code(board, "TIM2", Instead::Nmi));
                }
            }
            broken_ns = Some(board.now_ns());
            over_ns = board.now_ns() + after_ms * 1_000_000;
        }
        if let Some(since_ns) = broken_ns
            && board.now_ns() >= since_ns + 10_000_000
            && let Some((address, code)) = broken.take()
        {
            board.write(address, &code).unwrap();
        }
        if board.now_ns() >= over_ns {
            over_ns = u64::MAX;
            look(board, broken_ns.unwrap_or_default(), &mut outcome);
        }
    });
    assert!(
        broken_ns.is_some(),
        "{}: its time never came: {ended:?}",
        case.name
    );
    // a movement that failed is made again, and what passes by itself does not come again
    let over = seen.is_some_and(|fault| fault.is_of_the_movement()) && ended.is_ok();
    assert!(
        over || matches!(ended, Err(TalkError::Refused(_) | TalkError::Rebooted(_))),
        "{}: {ended:?}",
        case.name
    );
    // to the end of lifting or of the restart
    let until_ns = broken_ns.unwrap_or_default() + (after_ms + 8000) * 1_000_000;
    while talk.board().now_ns() < until_ns {
        for report in talk.step().unwrap() {
            match report.event {
                Event::Fault(fault) => seen = seen.or(Some(fault)),
                Event::Booted {
                    reset, last_words, ..
                } => booted = Some((reset, last_words.map(|w| w.as_str().to_owned()))),
                _ => {}
            }
        }
        if talk.board().now_ns() >= over_ns {
            over_ns = u64::MAX;
            look(talk.board(), broken_ns.unwrap_or_default(), &mut outcome);
        }
    }
    outcome.seen = seen;
    outcome.rebooted = booted;
    let truth = talk.board().rig().world().truth();
    outcome.force_max_n = truth.force_max_n;
    outcome.force_n = truth.force_n;
    outcome
}

/// What the pins did since a fault.
fn look(board: &mut Emulator, since_ns: u64, outcome: &mut Outcome) {
    let rig = board.rig();
    let ms = |at_ns: u64| at_ns.saturating_sub(since_ns) as f64 * 1e-6;
    let (mut down, mut duty) = (true, 0.0);
    outcome.braked_ms = Some(0.0);
    for &(at_ns, output) in rig.trace() {
        match output {
            Output::LeverDown(is) => down = is,
            Output::LeverStep(true) if !down && at_ns >= since_ns => {
                outcome.lifting_ms.get_or_insert(ms(at_ns));
            }
            Output::StageDuty(now) => {
                duty = now;
                if now == 0.0 {
                    outcome.braked_ms = Some(ms(at_ns));
                }
            }
            _ => {}
        }
    }
    if duty != 0.0 {
        outcome.braked_ms = None;
    }
}

/// What a fault must not come to; an empty list is good.
fn objections(case: &Case, outcome: &Outcome) -> Vec<String> {
    let mut objections = Vec::new();
    if outcome.force_max_n > 2.2 {
        objections.push(format!("{:.3} N", outcome.force_max_n));
    }
    // without steps, or without the motors' supply, nothing lifts it
    let stays = Cause::Rig(Fault::EStop) == case.cause
        || matches!(case.cause, Cause::Rig(Fault::LeverLosesSteps { .. }));
    let lifted = outcome.force_n < 0.02;
    if !lifted && !stays {
        objections.push(format!(
            "the finger still presses with {:.3} N",
            outcome.force_n
        ));
    }
    if let Some(deadline_ms) = case.deadline_ms {
        for (what, ms) in [
            ("stage not braked", outcome.braked_ms),
            ("no step up", outcome.lifting_ms),
        ] {
            // the tick of 1 ms that was under way, and the period of the lever's timer
            if ms.is_none_or(|ms| ms > deadline_ms as f64 + 1.7) {
                objections.push(format!("{what} within {deadline_ms} ms: {ms:?}"));
            }
        }
    }
    match (case.seen, outcome.seen) {
        ([], None) => {}
        (expected, Some(seen)) if expected.contains(&seen) => {}
        (expected, seen) => objections.push(format!("saw {seen:?}, not {expected:?}")),
    }
    match (&case.cause, &outcome.rebooted) {
        (Cause::Rig(_), None) => {}
        (Cause::Code(name, Instead::Hangs), Some((Reset::Watchdog, words))) => {
            let said = words.as_ref().is_some_and(|w| w.contains("check in"));
            if name.contains("watch") && !said {
                objections.push(format!("last words {words:?}"));
            }
        }
        (Cause::Code(_, Instead::Crashes), Some((Reset::Software, Some(words))))
            if words.contains("hard fault") => {}
        (Cause::Code(_, Instead::Panics), Some((Reset::Software, Some(words))))
            // in flash
            if words.contains("panic, called from 0x80") => {}
        (Cause::Clock, Some((Reset::Software, Some(words)))) if words.contains("8 MHz") => {}
        (cause, rebooted) => objections.push(format!("{cause:?} came to {rebooted:?}")),
    }
    objections
}

/// One fault after the other on one board, and each time it works again once the fault is gone.
fn check(names: &[&str]) {
    let Some(elf) = elf() else { return };
    // of each board another texture, of each case another instant
    let number = |name: &str| CASES.iter().position(|case| case.name == name).unwrap() as u64;
    let seed = 40 + number(names[0]);
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut talk = board(&elf, seed, random.random_range(1..=117));
    for name in names {
        let case = &CASES[number(name) as usize];
        let outcome = run(case, &mut talk, &mut random);
        eprintln!("{name}: {outcome:?}");
        assert_eq!(objections(case, &outcome), [""; 0], "{name}");
        talk.board().rig().world().clear();
        if let Cause::Rig(_) = case.cause {
            // the sensor starts up
            talk.board().run_ms(200).unwrap();
            talk.send(Command::Home, 40.0, |_, _| ()).unwrap();
        }
    }
    talk.send(identify(1), 80.0, |_, _| ()).unwrap();
}

/// A flash that never says that it is done: the session waits for it, and everything else works.
#[test]
fn a_session_that_is_stuck_is_noticed() {
    let Some(elf) = elf() else { return };
    let mut talk = board(&elf, 78, 5);
    // an idle rig waits for its host as long as it likes
    let idle_ns = talk.board().now_ns() + 35_000_000_000;
    while talk.board().now_ns() < idle_ns {
        talk.step().unwrap();
    }
    assert_eq!(talk.board().resets().unwrap(), []);
    let (address, whole) = talk.board().lose_flash_interrupts().unwrap();
    let began_ns = talk.board().now_ns();
    let mut words = None;
    let ended = talk.send(Command::BeginTable(1000), 60.0, |_, report| {
        if let Some(Event::Booted { last_words, .. }) = report.map(|report| &report.event) {
            words = last_words.as_ref().map(|words| words.as_str().to_owned());
        }
    });
    let took_ms = (talk.board().now_ns() - began_ns) / 1_000_000;
    eprintln!("{ended:?} after {took_ms} ms: {words:?}");
    assert!(
        matches!(ended, Err(TalkError::Rebooted(Reset::Watchdog))),
        "{ended:?}"
    );
    assert!((30_000..31_000).contains(&took_ms));
    assert!(words.is_some_and(|words| words.contains("no progress")));
    // and it works again
    talk.board().write(address, &whole).unwrap();
    ready(&mut talk);
    talk.send(Command::BeginTable(1000), 20.0, |_, _| ())
        .unwrap();
}

/// A stop between two movements, where the rig itself has nothing to stop.
#[test]
fn a_stop_holds_whenever_it_comes() {
    let Some(elf) = elf() else { return };
    let mut talk = board(&elf, 77, 5);
    let mut buffer = [0; MAX_FRAME + 1];
    let stop = Request {
        id: 9999,
        command: Command::Stop,
    };
    let frame = encode(&stop, &mut buffer).unwrap().to_vec();
    let mut sent = false;
    let mut chosen_after = 0;
    let ended = talk.send(identify(10), 100.0, |board, report| {
        let Some(report) = report else { return };
        match report.event {
            Event::Phase(Phase::Lifting) if !sent => {
                sent = true;
                board.send(&frame);
            }
            Event::Phase(Phase::Pressing) if sent => chosen_after += 1,
            _ => {}
        }
    });
    assert!(
        matches!(&ended, Err(TalkError::Refused(why)) if why == "stopped"),
        "{ended:?}"
    );
    assert_eq!(chosen_after, 0, "the finger came down again");
    // and what comes after it is not stopped
    talk.send(Command::Home, 40.0, |_, _| ()).unwrap();
    talk.send(identify(1), 80.0, |_, _| ()).unwrap();
    // an emergency stop while nothing is done: homing waits for the finger, which hangs low
    talk.board().inject(Fault::EStop);
    talk.board().run_ms(10).unwrap();
    assert!(!talk.board().rig().world().lever_top());
    talk.board().rig().world().clear();
    talk.send(Command::Home, 40.0, |_, _| ()).unwrap();
}

/// A driver that steps down by itself under a finger that waits, while P_DC says nothing of it: the lever waits at its limit
/// switch, which opens.
#[test]
fn a_lever_that_comes_down_under_a_waiting_finger_is_seen() {
    let Some(elf) = elf() else { return };
    let mut talk = board(&elf, 79, 5);
    let mut random = ChaCha8Rng::seed_from_u64(79);
    talk.send(identify(1), 80.0, |_, _| ()).unwrap();
    assert!(!talk.board().rig().world().lever_top(), "it hangs");
    assert_eq!(fault_within(&mut talk, 10_000), None);
    assert!(talk.board().rig().world().lever_top());
    for n in 0..20 {
        assert_eq!(fault_within(&mut talk, random.random_range(0..500)), None);
        talk.board().rig().world().reset_extremes();
        talk.board().inject(Fault::PdcStuck);
        talk.board().inject(Fault::LeverRunaway);
        let seen = fault_within(&mut talk, 500);
        assert_eq!(seen, Some(Seen::LeverNotHome), "{n}");
        let mut current = true;
        for (_, output) in talk.board().rig().trace() {
            if let Output::LeverEnable(on) = output {
                current = *on;
            }
        }
        assert!(!current, "{n}: its driver still has current");
        let truth = talk.board().rig().world().truth();
        assert_eq!(truth.force_max_n, 0.0, "{n}");
        talk.board().rig().world().clear();
        talk.board().run_ms(200).unwrap();
        talk.send(Command::Home, 40.0, |_, _| ()).unwrap();
    }
    talk.send(identify(1), 80.0, |_, _| ()).unwrap();
}

/// The first fault that is reported in this time.
fn fault_within(talk: &mut Talk, ms: u64) -> Option<Seen> {
    let until_ns = talk.now_ns() + ms * 1_000_000;
    let mut seen = None;
    while talk.now_ns() < until_ns {
        for report in talk.step().unwrap() {
            if let Event::Fault(fault) = report.event {
                seen = seen.or(Some(fault));
            }
        }
    }
    seen
}

macro_rules! faults {
    ($($test:ident: $names:expr,)*) => {$(
        #[test]
        fn $test() {
            check(&$names);
        }
    )*

    #[test]
    fn every_case_is_run_once() {
        let mut run = [$(&$names[..]),*].concat();
        let mut all = CASES.map(|case| case.name);
        run.sort_unstable();
        all.sort_unstable();
        assert_eq!(run, all);
    }
    };
}

faults! {
    the_sensor_falls_silent: [
        "sensor unplugged before the slide",
        "sensor unplugged while sliding",
        "one word in a hundred with a flipped bit",
    ],
    miso_is_stuck: ["MISO stuck high", "MISO stuck low"],
    the_stage_fails: ["stage stalled", "encoder's wires cut"],
    the_emergency_stop_is_pressed: ["emergency stop while pressing", "emergency stop while sliding"],
    the_lever_fails: [
        "lever loses steps",
        "the lever's driver runs down on its own while pressing",
        "the lever's driver runs down on its own while sliding",
    ],
    the_firmware_goes_down: [
        "the tasks of thread mode hang",
        "the servo hangs",
        "the servo crashes",
        "a task panics",
    ],
    the_clock_stops: ["the clock stops"],
}
