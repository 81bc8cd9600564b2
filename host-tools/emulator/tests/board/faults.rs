//! Faults of the rig and of the firmware itself, from seeded instants, on the emulated board: judged by the pins and by
//! the world behind them, not by what the firmware says of itself.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::rig::Fault as Seen;
use tactus_core::wire::{Command, Event, Identify, MAX_FRAME, Phase, Request, Reset, encode};
use tactus_emulator::board::{Emulator, Options, Output};
use tactus_emulator::host::talk::{Talk, TalkError};
use tactus_world::encoder::Cut;
use tactus_world::faults::Fault;
use tactus_world::world::Setup;

use crate::broken_code::{Instead, break_code};
use crate::common::{elf, ready};

/// A cause.
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

use When::{Approaching, Pressing, Sliding};

struct Case {
    name: &'static str,
    cause: Cause,
    when: When,
    /// Reports that are right; none where the firmware itself goes down.
    seen: &'static [Seen],
    /// From the fault to the stage's brake and to the first step up, ms; `None` where the lever itself is at fault, and
    /// steps are no measure.
    deadline_ms: Option<u64>,
}

/// By the fault table: its deadline, and what it takes until the fault shows.
const CASES: [Case; 17] = [
    rig(
        "sensor unplugged before the slide",
        UNPLUGGED,
        Approaching,
        SILENT,
        12,
    ),
    rig(
        "sensor unplugged while sliding",
        UNPLUGGED,
        Sliding,
        SILENT,
        12,
    ),
    // 44 damaged words a second: the 23rd after half a second, give or take the luck
    rig(
        "one word in a hundred with a flipped bit",
        FLIPS,
        Sliding,
        &[Seen::SensorErrors],
        1000,
    ),
    rig(
        "MISO stuck high",
        Fault::MisoStuck { high: true },
        Sliding,
        SILENT,
        12,
    ),
    rig(
        "MISO stuck low",
        Fault::MisoStuck { high: false },
        Pressing,
        SILENT,
        12,
    ),
    // 30 ms of way are compared
    rig("stage stalled", Fault::StageJammed, Sliding, STALLED, 65),
    rig(
        "encoder's wires cut",
        Fault::EncoderCut(Cut::Both),
        Sliding,
        NO_ENCODER,
        65,
    ),
    rig(
        "lever loses steps",
        Fault::LeverLosesSteps { share: 1.0 },
        Pressing,
        SLIPS,
        NONE,
    ),
    // its contact bounces for 4 ms
    rig(
        "emergency stop while pressing",
        Fault::EStop,
        Pressing,
        &[Seen::EStop],
        9,
    ),
    rig(
        "emergency stop while sliding",
        Fault::EStop,
        Sliding,
        &[Seen::EStop],
        9,
    ),
    rig(
        "the lever runs down while pressing",
        Fault::LeverRunaway,
        Pressing,
        RUNS,
        NONE,
    ),
    rig(
        "the lever runs down while sliding",
        Fault::LeverRunaway,
        Sliding,
        RUNS_LATE,
        NONE,
    ),
    // 2 s without a check-in; the task that would report it is the one that hangs
    code(
        "the tasks of thread mode hang",
        CHECK_IN,
        Instead::Hangs,
        Pressing,
        2010,
    ),
    // the watchdog's 100 ms, by an oscillator of 32 kHz, then the firmware's start
    code("the servo hangs", SERVO, Instead::Hangs, Sliding, 500),
    code("the servo crashes", SERVO, Instead::Crashes, Sliding, 3),
    // its task has its turn every 5 ms
    code("a task panics", CHECK_IN, Instead::Panics, Sliding, 8),
    // the slot in which the NMI is raised, and two periods of the lever's timer
    Case {
        cause: Cause::Clock,
        ..code("the clock stops", "", Instead::Nmi, Sliding, 3)
    },
];

const UNPLUGGED: Fault = Fault::SensorUnplugged;
const FLIPS: Fault = Fault::BitFlips { share: 0.01 };
const SILENT: &[Seen] = &[Seen::SensorSilent];
const STALLED: &[Seen] = &[Seen::StageStall, Seen::StageOff];
const NO_ENCODER: &[Seen] = &[Seen::EncoderSilent, Seen::StageOff];
const SLIPS: &[Seen] = &[Seen::LeverSlips, Seen::Unsteady, Seen::LeverNotHome];
const RUNS: &[Seen] = &[Seen::ForceHigh, Seen::Unsteady];
/// The slide may end before the force is too high.
const RUNS_LATE: &[Seen] = &[Seen::ForceHigh, Seen::LeverSlips, Seen::Unsteady];
const CHECK_IN: &str = "tactus_check_in";
const SERVO: &str = "tactus_servo_tick";
/// The lever itself is at fault, and steps are no measure.
const NONE: u64 = 0;

/// A fault of the rig.
const fn rig(
    name: &'static str,
    fault: Fault,
    when: When,
    seen: &'static [Seen],
    deadline_ms: u64,
) -> Case {
    Case {
        name,
        cause: Cause::Rig(fault),
        when,
        seen,
        deadline_ms: if deadline_ms == NONE {
            None
        } else {
            Some(deadline_ms)
        },
    }
}

/// A fault of the firmware, which reports nothing while it is down.
const fn code(
    name: &'static str,
    function: &'static str,
    instead: Instead,
    when: When,
    deadline_ms: u64,
) -> Case {
    Case {
        name,
        cause: Cause::Code(function, instead),
        when,
        seen: &[],
        deadline_ms: Some(deadline_ms),
    }
}

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

/// The outcome of a fault.
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

/// Reads the pins' changes since a fault.
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

/// The objections to the end of a fault; an empty list is good.
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
#[ignore = "long"]
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
#[ignore = "long"]
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

/// A driver that steps down by itself under a finger that waits, while P_DC says nothing of it: the lever waits at its
/// limit switch, which opens.
#[test]
#[ignore = "long"]
fn a_lever_that_comes_down_under_a_waiting_finger_is_seen() {
    let Some(elf) = elf() else { return };
    let mut talk = board(&elf, 79, 5);
    let mut random = ChaCha8Rng::seed_from_u64(79);
    talk.send(identify(1), 80.0, |_, _| ()).unwrap();
    assert!(!talk.board().rig().world().lever_top(), "it hangs");
    assert_eq!(fault_within(&mut talk, 10_000), None);
    assert!(talk.board().rig().world().lever_top());
    for n in 0..5 {
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

/// One of each kind.
#[test]
fn a_fault_of_each_kind_is_answered_in_time() {
    check(&[
        "sensor unplugged while sliding",
        "emergency stop while pressing",
        "the lever runs down while pressing",
        "the servo hangs",
    ]);
}

#[test]
#[ignore = "long"]
fn every_fault_is_answered_in_time() {
    for cases in CASES.chunks(3) {
        let names: Vec<&str> = cases.iter().map(|case| case.name).collect();
        check(&names);
    }
}
