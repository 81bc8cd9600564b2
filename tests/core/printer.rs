//! A 3D printer as the rig: the host's end that speaks G-code, and a printer in the world that knows nothing of it.
//! Explorations are right, forces are by the world, and whatever breaks, the finger never feels more than 2.2 N.

use std::cell::RefCell;

use embassy_futures::block_on;
use rayon::prelude::*;
use tactus_core::dsp::Plan;
use tactus_core::explorer::Strategy;
use tactus_core::rig::Fault;
use tactus_core::rig::arm::{ArmOrder, ArmReport, ArmState, ArmTask};
use tactus_core::rig::guard::Unguarded;
use tactus_core::sensor::FingerName;
use tactus_core::wire::{Command, Failure, Identify};
use tactus_lab::sim::collection::{Collection, texture_name};
use tactus_lab::sim::flash::{RamFlash, TABLE};
use tactus_lab::sim::over_link::{ArmRig, Mover};
use tactus_lab::sim::printer::{PrinterEnd, learn_on, measured, rig};
use tactus_lab::sim::probe::{SimProbe, switch_on};
use tactus_lab::sim::rig::FORCE_LIMIT_N;
use tactus_link::printer::PrinterError;
use tactus_tests::count;
use tactus_world::noise::Noise;
use tactus_world::printer::{Kind, PrinterFault};
use tactus_world::world::{Setup, World};

use crate::rigs::{Heard, assert_all, texture};

const OLD: Kind = Kind::Marlin {
    emergency_parser: false,
};
const MARLIN: Kind = Kind::Marlin {
    emergency_parser: true,
};

/// Something that breaks in the world, at the printer, or at the PC.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Breaks {
    Printer(PrinterFault),
    /// The program does not run for so many ms.
    Host(u64),
    /// The finger's cable is pulled.
    Finger,
}

/// The moment at which it breaks.
#[derive(Clone, Copy, PartialEq, Debug)]
enum When {
    AtOnce,
    Pressing,
    Pressed,
    Sliding,
    /// At 63 mm/s.
    SlidingFast,
    Lifting,
}

/// The host's end with what breaks, and the world's forces.
struct Breaking {
    end: PrinterEnd,
    breaks: Option<(When, Breaks)>,
    task: Option<ArmTask>,
    state: Option<ArmState>,
    since_ms: u64,
    force_n: f64,
    wanted_n: f64,
    /// Forces of the world at constant speed, N, by the force that was wanted.
    slides: Vec<(f64, Vec<f64>)>,
    failure: Option<PrinterError>,
}

impl Breaking {
    fn new(seed: u64, kind: Kind, breaks: Option<(When, Breaks)>) -> Self {
        Self {
            end: PrinterEnd::new(seed, measured(kind)),
            breaks,
            task: None,
            state: None,
            since_ms: 0,
            force_n: 0.0,
            wanted_n: 0.0,
            slides: Vec::new(),
            failure: None,
        }
    }

    fn is_it(&self, when: When) -> bool {
        let after = self.end.now_ms > self.since_ms + 150;
        let presses = self.force_n > 0.05;
        match (when, self.task, self.state) {
            (When::AtOnce, ..) => true,
            (When::Pressing, Some(ArmTask::Press(_)), Some(ArmState::Busy)) => presses,
            (When::Pressed, Some(ArmTask::Press(_)), Some(ArmState::Pressed)) => after,
            (When::Sliding, Some(ArmTask::Slide), Some(ArmState::Steady)) => after,
            (When::SlidingFast, Some(ArmTask::Slide), Some(ArmState::Steady)) => {
                after && self.wanted_n < 0.3
            }
            (When::Lifting, Some(ArmTask::Lift), _) => presses,
            _ => false,
        }
    }
}

impl Mover for Breaking {
    fn order(&mut self, order: ArmOrder) {
        if let ArmTask::Press(movement) = order.task {
            self.wanted_n = f64::from(movement.force_mn) * 1e-3;
        }
        if self.task != Some(order.task) {
            self.task = Some(order.task);
            (self.state, self.since_ms) = (None, self.end.now_ms);
        }
        self.end.order(order);
    }

    fn force(&mut self, newton: f64) {
        self.force_n = newton;
        self.end.force(newton);
    }

    fn tick(&mut self, world: &mut World) -> Vec<ArmReport> {
        if let Some((when, what)) = self.breaks
            && self.is_it(when)
        {
            self.breaks = None;
            match what {
                Breaks::Printer(fault) => world.printer().unwrap().break_now(fault),
                Breaks::Host(ms) => self.end.sleeps_until = self.end.now_ms + ms,
                Breaks::Finger => world.inject(tactus_world::faults::Fault::SensorUnplugged),
            }
        }
        let reports = self.end.tick(world);
        for report in &reports {
            if self.state != Some(report.state) {
                (self.state, self.since_ms) = (Some(report.state), self.end.now_ms);
                if report.state == ArmState::Steady {
                    self.slides.push((self.wanted_n, Vec::new()));
                }
            }
        }
        if self.state == Some(ArmState::Steady)
            && let Some((_, forces)) = self.slides.last_mut()
        {
            forces.push(world.truth().force_n);
        }
        if let Some(why) = self.end.printer.take_failure() {
            self.failure.get_or_insert(why);
        }
        reports
    }

    fn permit(&mut self, world: &mut World, permitted: bool) {
        self.end.permit(world, permitted);
    }
}

#[derive(Debug)]
struct Ended {
    done: Result<(), Failure>,
    heard: Heard,
    force_max_n: f64,
    left_n: f64,
    misused: u32,
    slides: Vec<(f64, Vec<f64>)>,
    failure: Option<PrinterError>,
}

/// Has a probe explore whose finger hangs on a printer.
fn explore(
    table: &[u8],
    setup: Setup,
    kind: Kind,
    identify: Identify,
    breaks: Option<(When, Breaks)>,
) -> Ended {
    let guarded = (false, Unguarded::default());
    explore_on(table, setup, kind, identify, breaks, guarded)
}

/// The same with or without a mount that yields, and without these guards.
fn explore_on(
    table: &[u8],
    setup: Setup,
    kind: Kind,
    identify: Identify,
    breaks: Option<(When, Breaks)>,
    (stiff, unguarded): (bool, Unguarded),
) -> Ended {
    let (plan, host) = (Plan::new(), RefCell::new(Heard::default()));
    let mut buffer = vec![0; TABLE];
    let breaking = Breaking::new(setup.trial_seed, kind, breaks);
    let mut rig = rig(setup, kind, unguarded, breaking);
    if stiff {
        rig.world().printer().unwrap().hold_stiffly();
    }
    let flash = RamFlash::blank();
    let probe = switch_on(rig, flash, table, &mut buffer, &plan, &host);
    let mut probe: SimProbe<'_, Heard, ArmRig<Breaking>> = probe.unwrap();
    let done = block_on(probe.perform(&Command::Identify(identify))).map(drop);
    for _ in 0..8000 {
        probe.rig.servo.tick();
    }
    let rig = probe.rig.servo.rig();
    let truth = rig.world().truth();
    let misused = rig.world().printer().unwrap().misused();
    let (slides, failure) = {
        let end = rig.program();
        (std::mem::take(&mut end.slides), end.failure.take())
    };
    drop(probe);
    Ended {
        done,
        heard: host.into_inner(),
        force_max_n: truth.force_max_n,
        left_n: truth.force_n,
        misused,
        slides,
        failure,
    }
}

fn collection(seed: u64, unknown: u8, among: u8, finger: FingerName) -> Collection {
    Collection::new(seed, Collection::spread(unknown, among), count(5, 3) as u32).touched_by(finger)
}

/// Explorations of as many seeds in worlds of 6 textures, 3 in the test command, by a finger on a printer that learned
/// them; all or all but one are right, and nothing is lost.
fn explorations_are_right(finger: FingerName, kind: Kind) {
    let all = count(20, 2);
    let ended: Vec<(u64, Ended)> = (1..=all)
        .into_par_iter()
        .map(|seed| {
            let unknown = texture(seed);
            let among = count(6, 3) as u8;
            let world = collection(seed, unknown, among, finger);
            let identify = Identify {
                seed: seed as u32,
                ..Identify::default()
            };
            let setup = world.setup(unknown, 7 + seed);
            let table = learn_on(&world, kind).unwrap();
            (seed, explore(&table, setup, kind, identify, None))
        })
        .collect();
    let (mut right, mut seconds) = (0, 0.0);
    for (seed, ended) in &ended {
        let said = format!("{finger:?} {kind:?} {seed}: {ended:?}");
        assert_eq!(ended.done, Ok(()), "{said}");
        assert!(
            ended.heard.faults.is_empty() && ended.heard.rejected.is_empty(),
            "{said}"
        );
        assert!(
            ended.force_max_n < FORCE_LIMIT_N && ended.misused == 0,
            "{said}"
        );
        let told = ended.heard.verdict.as_ref().unwrap();
        let is_right = told.sure && !told.unknown && told.name == texture_name(texture(*seed));
        if !is_right {
            println!("{finger:?} {kind:?} {seed}: not right: {told:?}");
        }
        right += u64::from(is_right);
        seconds += ended.heard.seconds;
    }
    println!(
        "{finger:?} {kind:?}: {right} of {all} right, {:.0} s each",
        seconds / all as f64
    );
    assert!(right + u64::from(all > 2) >= all, "{right} of {all}");
}

#[test]
fn textures_are_right_by_a_printer_with_marlin() {
    explorations_are_right(FingerName::Mems, MARLIN);
    explorations_are_right(FingerName::Analog, OLD);
}

#[test]
fn textures_are_right_by_a_printer_with_klipper() {
    explorations_are_right(FingerName::Mems, Kind::Klipper);
}

/// Two textures, and the table learned from them by a printer once.
fn known() -> (Collection, &'static [u8]) {
    static TABLE: std::sync::OnceLock<Vec<u8>> = std::sync::OnceLock::new();
    let world = Collection {
        trials: 2,
        ..collection(1, 60, 2, FingerName::Mems)
    };
    let known = TABLE.get_or_init(|| learn_on(&world, MARLIN).unwrap());
    (world, known)
}

/// An exploration of three slides at most in which something breaks, by a machine of seed 1.
fn broken(kind: Kind, when: When, what: Breaks, seed: u64) -> Ended {
    let (world, _) = known();
    let setup = world.setup(world.textures[seed as usize % 2], seed);
    broken_on(setup, kind, when, what)
}

fn broken_on(setup: Setup, kind: Kind, when: When, what: Breaks) -> Ended {
    let identify = Identify {
        seed: setup.trial_seed as u32,
        max_slides: 3,
        threshold: 1.0,
        // each movement once
        open: false,
        strategy: Strategy::Cycling,
        ..Identify::default()
    };
    explore(known().1, setup, kind, identify, Some((when, what)))
}

#[test]
fn whatever_breaks_the_finger_never_feels_more_than_it_bears() {
    use PrinterFault::*;
    use When::*;
    let z = 2;
    let cases: &[(When, PrinterFault)] = &[
        (Pressing, LineLost),
        (Sliding, LineLost),
        (Lifting, LineLost),
        (Pressing, Resets),
        (Sliding, Resets),
        (Lifting, Resets),
        (AtOnce, Resends(6)),
        (Pressing, Resends(60)),
        (Sliding, Resends(60)),
        (AtOnce, OkLost(0.1)),
        (Sliding, OkLost(1.0)),
        (AtOnce, OkTwice(0.3)),
        (AtOnce, Damages(0.002)),
        (Sliding, Damages(0.05)),
        (Sliding, IgnoresStop),
        (AtOnce, Slower(1.5)),
        (Sliding, Slower(3.0)),
        (Pressing, Pauses(60.0)),
        (Sliding, Pauses(60.0)),
        (Lifting, Pauses(60.0)),
        (Pressing, Halts),
        (Sliding, Halts),
        (Lifting, Halts),
        (AtOnce, Reversed(0)),
        (AtOnce, Reversed(z)),
        (Pressed, Reversed(z)),
        (AtOnce, Scale(z, 10.0)),
        (AtOnce, Scale(z, 0.5)),
        (Pressed, Scale(z, 10.0)),
        (AtOnce, Scale(0, 2.0)),
        (Pressing, Misses(z, 0.3)),
        (Pressing, Misses(z, -0.3)),
        (Sliding, Misses(0, 3.0)),
        (Sliding, Rises(2.0)),
        (SlidingFast, Slower(3.0)),
        (Pressing, Scale(0, 1.5)),
        (Sliding, Scale(0, 8.0)),
        (Lifting, Scale(0, 5.0)),
        (SlidingFast, Misses(z, -1.0)),
        (AtOnce, Late(60.0)),
        (Sliding, Late(300.0)),
    ];
    let mut all: Vec<(Kind, When, Breaks, u64)> = Vec::new();
    let kinds = [MARLIN, OLD, Kind::Klipper];
    for (n, &(when, fault)) in cases.iter().enumerate() {
        for seed in 1..=count(3, 1) {
            let seed = seed + n as u64;
            all.push((kinds[seed as usize % 3], when, Breaks::Printer(fault), seed));
        }
    }
    for when in [Pressing, Pressed, Sliding, Lifting] {
        // killed, asleep for ten minutes, busy for half a second
        for ms in [u64::MAX / 2, 600_000, 500] {
            all.push((MARLIN, when, Breaks::Host(ms), 3));
        }
        all.push((OLD, when, Breaks::Finger, 4));
    }
    known();
    assert_all(all, |&(kind, when, what, seed)| {
        let ended = broken(kind, when, what, seed);
        let said = format!(
            "{kind:?} {when:?} {what:?} {seed}: {:?} slides {} faults {:?} {:?} max {:.2} N \
             left {:.2} N misused {} in {:.0} s",
            ended.done,
            ended.heard.slides,
            ended.heard.faults,
            ended.failure.as_ref().map(ToString::to_string),
            ended.force_max_n,
            ended.left_n,
            ended.misused,
            ended.heard.seconds
        );
        println!("{said}");
        match ended.force_max_n < FORCE_LIMIT_N && ended.misused == 0 {
            true => Ok(()),
            false => Err(said),
        }
    });
}

/// Random faults of any size at any moment.
#[test]
fn two_thousand_random_faults_do_not_hurt_the_finger() {
    use PrinterFault::*;
    known();
    assert_all((1..=count(2000, 40)).collect(), |&seed: &u64| {
        let mut draw = Noise::new(seed, 0xfa);
        let mut one_of = |n: usize| (draw.uniform() * n as f64) as usize % n;
        let when = [
            When::AtOnce,
            When::Pressing,
            When::Pressed,
            When::Sliding,
            When::Lifting,
        ][one_of(5)];
        let kind = [MARLIN, OLD, Kind::Klipper][one_of(3)];
        let (which, axis) = (one_of(19), one_of(3));
        let size = draw.uniform();
        let what = match which {
            0 => Breaks::Printer(LineLost),
            1 => Breaks::Printer(Resets),
            2 => Breaks::Printer(Resends((size * 60.0) as u32)),
            3 => Breaks::Printer(OkLost(size * size)),
            4 => Breaks::Printer(OkTwice(size)),
            5 => Breaks::Printer(Damages(0.1 * size * size)),
            6 => Breaks::Printer(IgnoresStop),
            7 => Breaks::Printer(Slower(1.0 + 4.0 * size)),
            8 => Breaks::Printer(Pauses(60.0 * size)),
            9 => Breaks::Printer(Halts),
            10 => Breaks::Printer(Reversed(axis)),
            11 => Breaks::Printer(Scale(axis, 10.0 * size)),
            12 => Breaks::Printer(Misses(axis, 4.0 * size - 2.0)),
            13 => Breaks::Printer(Rises(2.0 * size)),
            14 => Breaks::Printer(Late(400.0 * size)),
            15 => Breaks::Finger,
            16 => Breaks::Host((3000.0 * size) as u64),
            17 => Breaks::Host(600_000),
            _ => Breaks::Host(u64::MAX / 2),
        };
        let ended = broken(kind, when, what, seed);
        // a sum of 8 bits passes one damaged line in 256
        let misused = ended.misused > 0 && which != 5;
        match ended.force_max_n < FORCE_LIMIT_N && !misused {
            true => Ok(()),
            false => Err(format!("{kind:?} {when:?} {what:?} {seed}: {ended:?}")),
        }
    });
}

/// What holds the force is the mount and the guard: without both a sample that rises in mid-slide hurts the finger.
#[test]
fn without_mount_and_guard_the_finger_is_hurt() {
    let (world, table) = known();
    let hurt = |stiff: bool, unguarded: Unguarded| {
        let setup = world.setup(world.textures[0], 34);
        let breaks = Some((When::Sliding, Breaks::Printer(PrinterFault::Rises(2.0))));
        let identify = Identify {
            max_slides: 1,
            threshold: 1.0,
            ..Identify::default()
        };
        explore_on(table, setup, OLD, identify, breaks, (stiff, unguarded)).force_max_n
    };
    let unguarded = Unguarded::against(Fault::ForceHigh).and(Fault::Unsteady);
    assert!(hurt(false, Unguarded::default()) < FORCE_LIMIT_N);
    assert!(hurt(true, unguarded) > FORCE_LIMIT_N);
}

/// Slides at all three movements over textures smooth and coarse, on samples that are tilted.
#[test]
fn a_slide_presses_with_the_force_that_was_asked_for() {
    let (_, table) = known();
    let slides: Vec<(u64, f64, f64)> = (1..=count(60, 12))
        .into_par_iter()
        .flat_map_iter(|seed| {
            let kind = [MARLIN, OLD, Kind::Klipper][seed as usize % 3];
            let identify = Identify {
                seed: seed as u32,
                max_slides: 6,
                threshold: 1.0,
                open: false,
                strategy: Strategy::Cycling,
                ..Identify::default()
            };
            let world = collection(seed, texture(seed), 1, FingerName::Mems);
            let setup = world.setup(texture(seed), 7 + seed);
            let ended = explore(table, setup, kind, identify, None);
            let lost = (&ended.heard.faults, &ended.heard.rejected);
            assert!(lost.0.is_empty() && lost.1.is_empty(), "{seed}: {lost:?}");
            ended.slides.into_iter().map(move |(wanted, forces)| {
                let mean = forces.iter().sum::<f64>() / forces.len() as f64;
                (seed, wanted, (mean / wanted - 1.0).abs())
            })
        })
        .collect();
    for wanted in [0.2, 0.5, 1.26] {
        let mut off: Vec<(f64, u64)> = slides
            .iter()
            .filter(|slide| (slide.1 - wanted).abs() < 0.01)
            .map(|&(seed, _, off)| (off, seed))
            .collect();
        off.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (median, (worst, seed)) = (off[off.len() / 2].0, off[off.len() - 1]);
        println!(
            "{wanted} N: off by {:.1} % (median), {:.1} % (worst of {} slides, seed {seed})",
            100.0 * median,
            100.0 * worst,
            off.len()
        );
        assert!(off.len() >= slides.len() / 4 && median < 0.05 && worst < 0.10);
    }
}

/// A round tip that rolls over a step throws its holder up: at 63 mm/s that is the hardest blow of all. Each texture is
/// another machine, whose holder rubs otherwise.
#[test]
fn a_step_at_63_mm_s_throws_the_weight_up_and_the_finger_bears_it() {
    let (world, _) = known();
    let most = (1..=117).into_par_iter().map(|texture| {
        let setup = Setup {
            world_seed: texture,
            ..world.setup(texture as u8, texture)
        };
        let rises = Breaks::Printer(PrinterFault::Rises(2.0));
        broken_on(setup, MARLIN, When::SlidingFast, rises).force_max_n
    });
    let most = most.reduce(|| 0.0, f64::max);
    println!("a step at 63 mm/s: {most:.2} N at most");
    assert!((1.8..FORCE_LIMIT_N).contains(&most), "{most} N");
}
