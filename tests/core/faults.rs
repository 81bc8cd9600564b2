//! Every fault of the table on the simulated rig, judged by what really happens there: the force, the lever, the stage.
//!
//! Each fault is injected at seeded instants of several phases. With its guard switched off the same judge must object.

mod pressed;
mod waiting;

use std::time::Duration;

use rayon::prelude::*;
use tactus_core::features::Movement;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::control::Control;
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::pins::Inputs;
use tactus_core::rig::stage::StageConstants;
use tactus_core::rig::{Ended, FAULTS, Fault, Phase, Refused};
use tactus_core::sensor::biotac;
use tactus_core::sensor::pressure::{Calibration, Channel, Counts, Pressure};
use tactus_lab::sim::rig::{SimError, SimRig};
use tactus_tests::{count, seeds};
use tactus_world::encoder::Cut;
use tactus_world::faults::{BOUNCES_NS, Fault as Cause};
use tactus_world::world::Setup;

use crate::rigs::{MOVEMENTS, assert_all, draw, homed, setup, start, until, wait};

/// When the cause comes.
#[derive(Clone, Copy, PartialEq, Debug)]
enum When {
    /// While the limit switches are looked for.
    Homing,
    /// While the stage goes back, the finger lifted.
    Returning,
    /// While the lever comes down, not yet in contact.
    Approaching,
    /// While the lever comes down, in contact.
    Touching,
    /// While the force is being trimmed.
    Settling,
    /// In the background or the slide.
    Background,
    /// At constant speed.
    Sliding,
    /// In the last 29 ms of a slide.
    Arriving,
}

/// From which moment the fault can be detected.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Since {
    /// The cause itself.
    Cause,
    /// Its contact no longer bounces.
    Settled,
    /// The stage is to move.
    Motion,
    /// The real force is over 2.1 N.
    Force,
    /// The lever is well below its limit switch.
    LeverDown,
    /// It takes the machine's own time: no deadline, but an end within a minute.
    Own,
}

/// A cause in some phases of a movement, and the fault that is to be named.
#[derive(Clone, Copy)]
struct Case {
    fault: Fault,
    cause: Cause,
    when: &'static [When],
    since: Since,
}

/// The cases of a table: fault, cause, phases, and from when on the fault can be detected.
macro_rules! cases {
    ($($fault:ident, $cause:expr, $when:expr, $since:ident;)*) => {
        &[$(Case { fault: Fault::$fault, cause: $cause, when: $when, since: Since::$since }),*]
    };
}

const PRESSED: &[When] = &[
    When::Approaching,
    When::Settling,
    When::Background,
    When::Sliding,
];
const ALL: &[When] = &[
    When::Returning,
    When::Approaching,
    When::Settling,
    When::Background,
    When::Sliding,
];
const MOVING: &[When] = &[When::Returning, When::Sliding];

const CASES: &[Case] = cases! {
    ForceHigh, Cause::LeverRunaway, PRESSED, Force;
    EStop, Cause::EStop, ALL, Settled;
    LeverLimit, Cause::LeverTopStuck { closed: true }, ALL, LeverDown;
    StageLimit, Cause::StageLimitStuck { upper: true, closed: true }, PRESSED, Motion;
    StageLimit, Cause::StageLimitStuck { upper: false, closed: true }, &[When::Returning], Motion;
    StageStall, Cause::StageJammed, ALL, Motion;
    EncoderSilent, Cause::EncoderCut(Cut::A), ALL, Motion;
    EncoderSilent, Cause::EncoderCut(Cut::B), MOVING, Motion;
    EncoderSilent, Cause::EncoderCut(Cut::Both), MOVING, Motion;
    SensorSilent, Cause::SensorUnplugged, ALL, Cause;
    SensorSilent, Cause::MisoStuck { high: true }, ALL, Cause;
    SensorSilent, Cause::MisoStuck { high: false }, ALL, Cause;
    SensorErrors, Cause::BitFlips { share: 0.05 }, PRESSED, Own;
    SensorFrozen, Cause::SensorFrozen, ALL, Cause;
    SlideGap, Cause::BitFlips { share: 0.002 }, &[When::Background, When::Sliding], Own;
    NoContact, Cause::LeverLosesSteps { share: 1.0 }, &[When::Approaching], Own;
    LeverSlips, Cause::LeverLosesSteps { share: 0.9 }, &[When::Touching], Own;
    PressureDead, Cause::PdcStuck, &[When::Approaching, When::Touching], Own;
    PressureDead, Cause::PdcFades { seconds: 0.0 }, &[When::Touching], Own;
    StageNotHome, Cause::EncoderCut(Cut::Both), &[When::Homing], Own;
    StageOff, Cause::StageJammed, &[When::Arriving], Own;
    Unsteady, Cause::PdcDrift { counts_per_s: -20.0 }, &[When::Settling], Own;
    LeverNotHome, Cause::LeverTopStuck { closed: false }, &[When::Homing], Own;
    StageNotHome, Cause::StageLimitStuck { upper: false, closed: false }, &[When::Homing], Own;
};

fn touching(rig: &mut SimRig, force_n: f64) {
    let reached = |rig: &mut SimRig| rig.world().truth().force_n > force_n;
    until(rig, "touching", reached).unwrap();
}

/// A rig in which the cause has just come, and the movement that it was in. Up to here nothing can be wrong.
fn injected(case: &Case, when: When, seed: u64, unguarded: Unguarded) -> (SimRig, Movement) {
    let drawn = Setup {
        finger_seed: 1,
        ..setup(1 + draw(seed, 117) as u8, seed)
    };
    let mut rig = SimRig::unguarded(drawn, unguarded);
    // a lever that runs away needs the time of a long slide to get to 2.1 N
    let choice = match when {
        _ if case.fault == Fault::ForceHigh => 0,
        When::Touching => 0,
        // its end is an order of motion
        When::Arriving => 2,
        _ => draw(seed + 1, 3),
    };
    let movement = MOVEMENTS[choice as usize];
    if when == When::Homing {
        wait(&mut rig, 100);
        rig.world().inject(case.cause);
        rig.control().home().unwrap();
        return (rig, movement);
    }
    rig.home().unwrap();
    if when == When::Returning {
        // from the end of a slide to the beginning of the next, the finger clear of the sample
        rig.slide(movement, 1.0, |_, _| ()).unwrap();
    }
    let (phase, wait_ms) = match when {
        When::Returning => (Phase::Positioning, 40 + draw(seed + 2, 400)),
        When::Approaching => (Phase::Pressing, 400 + draw(seed + 2, 1000)),
        When::Touching => (Phase::Pressing, 0),
        When::Settling => (Phase::Pressing, draw(seed + 2, 300)),
        When::Background => (Phase::Background, draw(seed + 2, 900)),
        When::Homing | When::Sliding | When::Arriving => {
            (Phase::Sliding, 120 + draw(seed + 2, 600))
        }
    };
    start(&mut rig, movement, phase);
    // a P_DC that sinks before the force is reached is dead, and no unsteady force
    let wanted_n = f64::from(movement.force_n());
    match when {
        When::Settling if case.fault == Fault::Unsteady => touching(&mut rig, 0.97 * wanted_n),
        When::Settling => touching(&mut rig, 0.9 * wanted_n),
        When::Touching => touching(&mut rig, 0.3),
        _ => {}
    }
    wait(&mut rig, wait_ms);
    if when == When::Arriving {
        let slows = |rig: &mut SimRig| rig.world().truth().speed_mm_s < 29.0;
        until(&mut rig, "arriving", slows).unwrap();
    }
    rig.world().inject(case.cause);
    (rig, movement)
}

/// Goes on until the rig is at rest or names a fault; ms from the moment it could be seen.
fn noticed(rig: &mut SimRig, since: Since) -> Result<u32, String> {
    let settled = rig.now() + Duration::from_nanos(BOUNCES_NS);
    let mut detectable_ms = 0;
    until(rig, "noticed", |rig| {
        if matches!(rig.control().phase(), Phase::Faulted(_) | Phase::Ready) {
            return true;
        }
        detectable_ms += u32::from(match since {
            Since::Cause => true,
            Since::Settled => rig.now() > settled,
            Since::Own => false,
            Since::Force => rig.world().truth().force_n > 2.1,
            Since::LeverDown => rig.world().truth().tip_mm < 14.4,
            Since::Motion => {
                matches!(rig.control().phase(), Phase::Positioning | Phase::Sliding)
            }
        });
        false
    })?;
    Ok(detectable_ms)
}

/// Injects the cause and judges what becomes of it.
fn judge(case: &Case, when: When, seed: u64, unguarded: Unguarded) -> Result<(), String> {
    let (mut rig, movement) = injected(case, when, seed, unguarded);
    rig.world().reset_extremes();
    let pressed_n = rig.world().truth().force_n;
    let detectable_ms = noticed(&mut rig, case.since)?;
    let check = |is: bool, why: String| if is { Ok(()) } else { Err(why) };
    let row = case.fault.row().ok_or("not in the table")?;
    if case.fault == Fault::SlideGap {
        let ended = rig.control().take_ended();
        let is_gap = matches!(ended, Some(Ended::Gap(_)));
        return check(
            is_gap,
            format!("a slide with damaged words ended as {ended:?}"),
        );
    }
    let phase = rig.control().phase();
    let is_named = phase == Phase::Faulted(case.fault);
    check(is_named, format!("{phase:?} in place of {}", row.name))?;
    let in_time = detectable_ms <= row.deadline_ms;
    check(
        in_time,
        format!("noticed after {detectable_ms} ms of {}", row.deadline_ms),
    )?;
    let outputs = rig.outputs();
    let stands = outputs.stage_duty == 0.0 && outputs.lever_steps_s <= 0;
    check(stands, format!("the motors run on: {outputs:?}"))?;
    let refused = rig.control().start(movement, 0.0);
    let is_refused = refused == Err(Refused::Fault(case.fault));
    check(
        is_refused,
        format!("a movement was not refused: {refused:?}"),
    )?;
    // a lever that makes no steps cannot lift either, and that is then the fault
    let ended = rig.rest(|_| ());
    let stuck = matches!(case.cause, Cause::LeverLosesSteps { .. });
    let is_right = ended == Err(SimError::Fault(case.fault))
        || stuck && ended == Err(SimError::Fault(Fault::LeverNotHome));
    check(is_right, format!("ended as {ended:?}"))?;
    // the stage stops
    wait(&mut rig, 200);
    let truth = rig.world().truth();
    let without_power = case.cause == Cause::EStop;
    check(
        truth.force_max_n <= 2.2,
        format!("pressed with {:.3} N", truth.force_max_n),
    )?;
    let goes_on = without_power && truth.force_max_n > pressed_n + 0.01;
    check(!goes_on, format!("pressed on without power: {truth:?}"))?;
    let must_be_lifted = case.fault != Fault::LeverNotHome && !without_power;
    let is_lifted = truth.force_n == 0.0 && truth.indentation_mm <= -0.5;
    check(
        is_lifted || !must_be_lifted,
        format!("the finger is not lifted: {truth:?}"),
    )?;
    let is_slow = truth.speed_mm_s.abs() <= 0.1;
    check(
        is_slow,
        format!("the stage moves with {} mm/s", truth.speed_mm_s),
    )?;
    // and works again
    rig.world().clear();
    let reset = rig.control().reset();
    reset.map_err(|e| format!("does not reset: {e}"))?;
    let home = rig.home();
    home.map_err(|e| format!("does not find home again: {e}"))?;
    let slid = rig.slide(movement, 0.5, |_, _| ());
    check(
        slid == Ok(Ended::Whole),
        format!("does not slide again: {slid:?}"),
    )
}

fn phases() -> impl Iterator<Item = (&'static Case, When)> {
    let all = CASES.iter();
    all.flat_map(|case| case.when.iter().map(move |&when| (case, when)))
}

#[test]
fn every_fault_is_noticed_in_time_and_does_no_harm() {
    // three rejected slides: with the exploration, in the core; tasks that hang: on the emulated board; an arm's:
    // arm.rs
    let elsewhere = [
        Fault::Rejected,
        Fault::TasksHung,
        Fault::ArmSilent,
        Fault::ArmRuns,
        Fault::ArmOff,
    ];
    for row in FAULTS {
        let mut tested = CASES.iter().map(|case| case.fault).chain(elsewhere);
        assert!(tested.any(|fault| fault == row.fault), "{}", row.name);
    }
    let seeds = seeds(20).step_by(3);
    let runs = phases().flat_map(|(case, when)| seeds.clone().map(move |seed| (case, when, seed)));
    assert_all(runs.collect(), |&(case, when, seed)| {
        let done = judge(case, when, 1000 + seed, Unguarded::default());
        let (fault, cause) = (case.fault, case.cause);
        done.map_err(|why| format!("{fault:?} by {cause:?} while {when:?}, seed {seed}: {why}"))
    });
}

#[test]
fn every_guard_is_missed_when_it_is_switched_off() {
    assert_all(phases().collect(), |&(case, when)| {
        match judge(case, when, 1003, Unguarded::against(case.fault)) {
            Ok(()) => Err(format!(
                "{:?} by {:?} while {when:?}",
                case.fault, case.cause
            )),
            Err(_) => Ok(()),
        }
    });
}

/// A rig that presses, its finger on the sample.
fn pressed(unguarded: Unguarded) -> SimRig {
    let mut rig = homed(sample(), unguarded);
    start(&mut rig, Movement::FOR_TRACTION, Phase::Sliding);
    rig
}

fn sample() -> Setup {
    Setup {
        texture: 45,
        ..Setup::default()
    }
}

fn slide(rig: &mut SimRig) -> Result<Ended, SimError> {
    rig.slide(Movement::FOR_TRACTION, 0.5, |_, _| ())
}

#[test]
fn a_finger_that_was_not_lifted_is_not_dragged_along() {
    let first_fault = |unguarded| {
        let mut rig = pressed(unguarded);
        rig.world().inject(Cause::LeverLosesSteps { share: 1.0 });
        let noticed = until(&mut rig, "noticed", |rig| {
            !matches!(rig.control().phase(), Phase::Sliding | Phase::Lifting)
        });
        let phase = noticed.map(|_| rig.control().phase());
        (phase, rig)
    };
    let (phase, mut rig) = first_fault(Unguarded::default());
    assert_eq!(phase, Ok(Phase::Faulted(Fault::LeverSlips)));
    assert_eq!(
        rig.rest(|_| ()),
        Err(SimError::Fault(Fault::LeverNotHome)),
        "worse than the first"
    );
    assert!(rig.world().truth().force_n > 1.0 && rig.world().truth().speed_mm_s == 0.0);
    let (phase, _) = first_fault(Unguarded::against(Fault::LeverSlips));
    assert!(
        phase.is_err(),
        "without the guard it waits in Lifting: {phase:?}"
    );
}

#[test]
fn a_runaway_after_a_fault_finds_the_driver_off() {
    let mut rig = pressed(Unguarded::default());
    rig.world().inject(Cause::StageJammed);
    assert!(rig.rest(|_| ()).is_err());
    rig.world().inject(Cause::LeverRunaway);
    rig.world().reset_extremes();
    wait(&mut rig, 60_000);
    assert_eq!(rig.world().truth().force_max_n, 0.0);
    // and while parked, after the reset
    rig.control().reset().unwrap();
    rig.world().inject(Cause::LeverRunaway);
    wait(&mut rig, 60_000);
    assert_eq!(rig.world().truth().force_max_n, 0.0);
}

#[test]
fn a_reset_or_a_stop_does_not_leave_the_finger_down() {
    let mut rig = pressed(Unguarded::default());
    rig.world().inject(Cause::StageJammed);
    wait(&mut rig, 100);
    assert_eq!(rig.control().reset(), Err(Refused::Busy), "still lifting");
    assert!(rig.rest(|_| ()).is_err());
    assert!(rig.world().truth().indentation_mm < -0.5);

    // powered up with the finger on the sample: stopped while it looks for the limit switch
    let mut rig = SimRig::new(sample());
    wait(&mut rig, 200);
    rig.control().home().unwrap();
    wait(&mut rig, 50);
    rig.control().stop();
    rig.rest(|_| ()).unwrap();
    assert_eq!(rig.control().phase(), Phase::Parked);
    assert!(
        rig.world().lever_top(),
        "the lever has gone on to its switch"
    );
}

/// A switch that says "at the top" everywhere, and somebody who homes again and again: the lever must not take each
/// place for a lower top, until its zero is taken under load.
#[test]
fn a_stuck_switch_and_a_stubborn_operator_do_not_let_the_lever_creep_down() {
    let mut rig = pressed(Unguarded::default());
    rig.world().inject(Cause::LeverTopStuck { closed: true });
    for _ in 0..20 {
        let _ = rig.rest(|_| ());
        rig.control().reset().unwrap();
        let _ = rig.control().home();
        let _ = rig.rest(|_| ());
        let _ = slide(&mut rig);
    }
    let truth = rig.world().truth();
    assert!(truth.force_max_n <= 2.2, "{} N", truth.force_max_n);
    assert!(truth.indentation_mm < 0.0, "{} mm", truth.indentation_mm);
}

/// What makes the count of steps wrong, either way, and many times over: once it is repaired and homed, the rig presses
/// as before.
#[test]
fn steps_that_were_lost_do_not_add_up() {
    let causes = [
        // up into the hard stop, by 10 s of steps
        Cause::LeverTopStuck { closed: false },
        // down, and nobody counts
        Cause::LeverRunaway,
        // fewer than were counted, most of them down
        Cause::LeverLosesSteps { share: 0.9 },
        // none at all: it never left the switch
        Cause::LeverLosesSteps { share: 1.0 },
    ];
    causes.par_iter().for_each(|cause| {
        let mut rig = pressed(Unguarded::default());
        let _ = rig.rest(|_| ());
        for round in seeds(8) {
            rig.home().unwrap();
            rig.world().inject(*cause);
            let _ = slide(&mut rig);
            let _ = rig.rest(|_| ());
            // somebody tries before it is repaired
            let _ = rig.control().reset();
            let _ = rig.home();
            rig.world().clear();
            let _ = rig.control().reset();
            let sound = rig.home().and_then(|()| slide(&mut rig));
            assert!(sound.is_ok(), "{cause:?}, round {round}: {sound:?}");
        }
    });
}

/// A force over the limit that lasts while the lever goes up, because somebody leans on it: it must go on, and it did
/// not even begin where another fault had come first. One that rises while it goes up is the lever's own: it must stop.
#[test]
fn a_force_that_lasts_does_not_end_the_lifting() {
    // counts of P_DC per ms of lifting
    for (e_stop_first, rising, lifts) in [(false, 0, true), (true, 0, true), (false, 1, false)] {
        let mut control = SimRig::new(Setup::default()).control().clone();
        control.home().unwrap();
        let mut steps = 0;
        let mut lifted = 0;
        for ms in 0..600_u16 {
            let high = ms > 100;
            let pdc = 2593 + if high { 190 + rising * (ms - 100) } else { 0 };
            let word = |channel, counts| {
                let counts = Counts::new(counts).unwrap();
                Some(Pressure { channel, counts })
            };
            let mut inputs = Inputs {
                steps,
                e_stop: e_stop_first && ms > 20,
                ..Inputs::default()
            };
            for n in 0..2 {
                let words = [
                    word(Channel::Pac, 2040 + (ms * 7 + n * 5) % 9),
                    word(Channel::Pdc, pdc),
                ];
                inputs.words.extend(words);
            }
            let outputs = control.tick(&inputs);
            if outputs.lever_enabled {
                steps += outputs.lever_steps_s / 1000;
                lifted += i32::from(ms > 200 && outputs.lever_steps_s < 0);
            }
        }
        assert_eq!(control.phase(), Phase::Faulted(Fault::ForceHigh));
        assert_eq!(lifted > 390, lifts, "{lifted} ms, rising {rising}");
        assert_eq!(lifted == 0, !lifts, "{lifted} ms, rising {rising}");
    }
}
