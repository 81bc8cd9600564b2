//! Slides of the simulated rig that end as soon as the verdict is certain, over 50 worlds.

use std::cell::RefCell;

use embassy_futures::block_on;
use rayon::prelude::*;
use tactus_core::dsp::Plan;
use tactus_core::explorer::{Config, Explorer, Method};
use tactus_core::features::{Movement, PropertySet};
use tactus_core::probe::explore::{ExplorationStep, explore};
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::{Fault, Phase};
use tactus_core::table::{MAX_TEXTURES, Table};
use tactus_core::wire::{Command, Event, Identify};
use tactus_lab::sim::collection::{Collection, calibrated, texture_name};
use tactus_lab::sim::flash::{RamFlash, TABLE};
use tactus_lab::sim::probe::{Host, switch_on};
use tactus_lab::sim::rig::{SimError, SimRig};
use tactus_link::follow::Follower;
use tactus_tests::{count, seeds};
use tactus_world::faults::Fault as Cause;
use tactus_world::world::Setup;

use crate::rigs::{assert_all, homed, setup, start, texture, wait};

/// Sliding and the rig's time, s; right and wrong when sure; slides that ended early; the largest force, N.
#[derive(Clone, Copy, Default, Debug)]
struct Sums {
    sliding_s: f64,
    rig_s: f64,
    right: f64,
    wrong: f64,
    early: usize,
    most_n: f64,
}

impl Sums {
    fn and(self, other: Self) -> Self {
        Self {
            sliding_s: self.sliding_s + other.sliding_s,
            rig_s: self.rig_s + other.rig_s,
            right: self.right + other.right,
            wrong: self.wrong + other.wrong,
            early: self.early + other.early,
            most_n: self.most_n.max(other.most_n),
        }
    }
}

fn explored(
    world: &Collection,
    calibration: RigCalibration,
    table: Table<'_>,
    (texture, trial): (u8, u64),
) -> Sums {
    let config = Config {
        method: Method::Fused,
        open: true,
        ..Config::default()
    };
    let mut rig = SimRig::new(world.setup(texture, trial));
    rig.control().calibrate(calibration).unwrap();
    let mut explorer = Explorer::<MAX_TEXTURES>::new(table, PropertySet::ALL, config).unwrap();
    let (mut early, mut slides) = (Vec::new(), 0);
    let tell = |step: ExplorationStep<'_, SimError>| match step {
        ExplorationStep::Early(ms) => early.push((slides, ms)),
        ExplorationStep::Measured(..) => slides += 1,
        _ => {}
    };
    let verdict = block_on(explore(&mut rig, &mut explorer, &Plan::new(), || 0, tell)).unwrap();
    // the last one is the only one that ends early, and it did end then: block and look take less than 0.1 s
    assert!(early.len() <= 1);
    if let Some(&(slide, ms)) = early.first() {
        assert_eq!(slide + 1, slides);
        assert!(verdict.sure, "what ends a slide is a verdict");
        let made_s = rig.performed().last().unwrap().steady_s;
        let lasted = made_s - f64::from(ms) / 1e3;
        assert!((-0.05..0.15).contains(&lasted), "{made_s} s for {ms} ms");
        // nobody learns from it
        let observed: u8 = explorer.observed().map(|(_, slides, _)| slides).sum();
        assert_eq!(observed + 1, slides);
    }
    let right = table.name(verdict.texture) == Some(texture_name(texture));
    let flag = |is: bool| f64::from(u8::from(is));
    let performed = rig.performed();
    Sums {
        sliding_s: performed.iter().map(|p| p.steady_s).sum(),
        rig_s: rig.now().as_secs_f64(),
        right: flag(verdict.sure && right),
        wrong: flag(verdict.sure && !right),
        early: early.len(),
        most_n: performed.iter().map(|p| p.force_max_n).fold(0.0, f64::max),
    }
}

/// Four explorations in a world, by slides to their end and by slides that may end early.
fn in_a_world(seed: u64) -> [Sums; 2] {
    let world = Collection::new(seed, Collection::spread(texture(seed), 8), 4);
    let calibration = calibrated(world.setup(world.textures[0], 0)).unwrap();
    let early = world.learn_at(
        &Collection::MOVEMENTS,
        (Method::Fused, None),
        &[500, 1000, 2000],
        calibration,
        || (),
    );
    let early = early.unwrap();
    let early = Table::read(&early).unwrap();
    // the same without lengths
    let whole = tactus_lab::eval::learn::know_lengths(early.as_bytes(), &[]).unwrap();
    let whole = Table::read(&whole).unwrap();
    let presented = |n: u64| {
        let at = (seed + n) as usize * 7 % world.textures.len();
        (world.textures[at], 100 + n)
    };
    [whole, early].map(|table| {
        let all = (0..4).map(|n| explored(&world, calibration, table, presented(n)));
        all.fold(Sums::default(), Sums::and)
    })
}

#[test]
fn a_rig_slides_less_and_is_as_right() {
    let worlds: Vec<u64> = (1..=count(50, 3)).collect();
    let sums: Vec<[Sums; 2]> = worlds.into_par_iter().map(in_a_world).collect();
    let sum = |n: usize| sums.iter().map(|of| of[n]).fold(Sums::default(), Sums::and);
    let [before, after] = [sum(0), sum(1)];
    println!(
        "{} explorations: {before:?}, early {after:?}",
        4 * sums.len()
    );
    assert!(before.early == 0 && after.early > 0);
    assert!(after.sliding_s < before.sliding_s);
    assert!(after.rig_s < before.rig_s);
    assert!(after.most_n < 2.2);
    // both ways see the same slides up to the one that ends early: what differs, differs by three standard errors at
    // most
    let worse = |of: fn(&Sums) -> f64| {
        let each: Vec<f64> = sums.iter().map(|[b, a]| of(a) - of(b)).collect();
        let mean = each.iter().sum::<f64>() / each.len() as f64;
        let squares: f64 = each.iter().map(|d| (d - mean).powi(2)).sum();
        let error = (squares / (each.len() as f64 - 1.0) / each.len() as f64).sqrt();
        mean - 3.0 * error
    };
    assert!(worse(|s| -s.right) <= 0.0, "less right");
    assert!(worse(|s| s.wrong) <= 0.0, "more wrong when sure");
}

/// The reports to a host that wants all samples.
#[derive(Default)]
struct Heard(Vec<Event>);

impl Host for Heard {
    fn tell(&mut self, event: Event) {
        self.0.push(event);
    }

    fn streams(&self) -> bool {
        true
    }
}

#[test]
fn a_probe_says_when_a_slide_ended_and_learns_nothing_from_it() {
    let world = Collection::new(5, Collection::spread(47, 8), 5);
    let calibration = calibrated(world.setup(47, 0)).unwrap();
    let bytes = world
        .learn_at(
            &Collection::MOVEMENTS,
            (Method::Fused, None),
            &[500, 1000],
            calibration,
            || (),
        )
        .unwrap();
    let table = Table::read(&bytes).unwrap();
    let lengths: Vec<u16> = table.lengths_ms().collect();
    assert_eq!(lengths, [500, 1000]);
    let plan = Plan::new();
    let mut ended = 0;
    for (&texture, trial) in world.textures.iter().zip(200..) {
        let mut rig = SimRig::new(world.setup(texture, trial));
        rig.control().calibrate(calibration).unwrap();
        rig.home().unwrap();
        let heard = RefCell::new(Heard::default());
        let mut buffer = vec![0; TABLE];
        let flash = RamFlash::blank();
        let mut probe = switch_on(rig, flash, &bytes, &mut buffer, &plan, &heard).unwrap();
        let asked = Identify::default();
        block_on(probe.perform(&Command::Identify(asked.clone()))).unwrap();
        let heard = heard.take().0;
        // the same samples say the same on a PC, the end of the slide included
        let mut follower = Follower::new(table, PropertySet::ALL, &asked, &plan).unwrap();
        for event in &heard {
            follower.hear(event).unwrap();
        }
        assert!(follower.agreement().agrees(), "{:?}", follower.agreement());
        let early = heard.iter().any(|event| matches!(event, Event::Early(_)));
        let slides = heard
            .iter()
            .filter(|event| matches!(event, Event::SlideReport { .. }));
        // a whole slide before it is learned from, by itself, and this one is not
        let learned = heard.iter().find_map(|event| match event {
            Event::TextureLearned(learned) => Some(learned.slides),
            _ => None,
        });
        if early {
            ended += 1;
            let whole = slides.count() - 1;
            assert!(
                usize::from(learned.unwrap_or(0)) <= whole,
                "{learned:?} of {whole}"
            );
        }
        // P_AC at constant speed that the host got: the block that was on its way, and those of the brake, at most
        let begins = |event: &Event| match event {
            Event::Block(block) => block.steady,
            _ => None,
        };
        let last = heard
            .iter()
            .rposition(|event| begins(event).is_some())
            .unwrap();
        let (from, to) = begins(&heard[last]).unwrap();
        let moving = heard[last..].iter().map(|event| match event {
            Event::Block(block) => block.pac.len() as u32,
            _ => 0,
        });
        let came: u32 = moving.sum();
        assert_eq!(came < to, early, "{came} of {from} to {to}");
    }
    println!("{ended} of {} ended early", world.textures.len());
    assert!(ended >= 6, "{ended} of 8 ended early");
}

/// The guard of a slide is that of its brake.
#[test]
fn guards_watch_while_a_slide_is_ended() {
    let causes = [
        (Cause::EStop, Some(Fault::EStop)),
        (Cause::SensorUnplugged, Some(Fault::SensorSilent)),
        // the lift may come before the force is high
        (Cause::LeverRunaway, None),
    ];
    let runs = seeds(50).flat_map(|seed| causes.map(|(cause, fault)| (seed, cause, fault)));
    assert_all(runs.collect(), |&(seed, cause, fault)| {
        let drawn = Setup {
            world_seed: seed,
            ..setup(texture(seed), seed)
        };
        let mut rig = homed(drawn, Unguarded::default());
        // 63 mm/s: the longest brake, 63 ms
        start(&mut rig, Movement::FOR_ROUGHNESS, Phase::Sliding);
        wait(&mut rig, 400 + seed * 3);
        rig.control().end_slide();
        wait(&mut rig, seed % 20);
        assert_eq!(rig.control().phase(), Phase::Sliding);
        rig.world().inject(cause);
        let ended = rig.rest(|_| ());
        let is_named = fault.is_none_or(|fault| ended == Err(SimError::Fault(fault)));
        let truth = rig.world().truth();
        // an emergency stop takes the lever's supply
        let is_lifted = truth.force_n == 0.0 || cause == Cause::EStop;
        let stands = truth.speed_mm_s.abs() < 0.5;
        let is_right = is_named && is_lifted && stands && truth.force_max_n < 2.2;
        let said = format!("{cause:?}, seed {seed}: {ended:?}, {truth:?}");
        if is_right { Ok(()) } else { Err(said) }
    });
}
