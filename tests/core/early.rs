//! Slides of the simulated rig that end as soon as the verdict is certain, over 50 worlds.

use std::cell::RefCell;

use embassy_futures::block_on;
use rayon::prelude::*;
use tactus_core::dsp::Plan;
use tactus_core::explorer::{Config, Explorer, Method};
use tactus_core::features::{Movement, PropertySet};
use tactus_core::probe::explore::{ExplorationStep, explore};
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::{Fault, Phase};
use tactus_core::table::{MAX_TEXTURES, Table};
use tactus_core::wire::{Command, Event, Identify};
use tactus_lab::sim::collection::{Collection, calibrated, texture_name};
use tactus_lab::sim::flash::{RamFlash, TABLE};
use tactus_lab::sim::probe::{Host, switch_on};
use tactus_lab::sim::rig::{SimError, SimRig};
use tactus_link::follow::Follower;
use tactus_world::faults::Fault as Cause;
use tactus_world::world::Setup;

/// What explorations came to, in sum.
#[derive(Clone, Copy, Default, Debug)]
struct Sums {
    explorations: f64,
    sliding_s: f64,
    rig_s: f64,
    right: f64,
    sure: f64,
    wrong_when_sure: f64,
    early: f64,
    most_n: f64,
}

impl Sums {
    fn and(self, other: Self) -> Self {
        Self {
            explorations: self.explorations + other.explorations,
            sliding_s: self.sliding_s + other.sliding_s,
            rig_s: self.rig_s + other.rig_s,
            right: self.right + other.right,
            sure: self.sure + other.sure,
            wrong_when_sure: self.wrong_when_sure + other.wrong_when_sure,
            early: self.early + other.early,
            most_n: self.most_n.max(other.most_n),
        }
    }

    fn show(&self, name: &str) {
        let n = self.explorations;
        println!(
            "{name}: {n} explorations, {:.2} s of sliding and {:.1} s of the rig's time a verdict, right {:.2} %, {} of {} sure are wrong; {} ended early; at most {:.2} N",
            self.sliding_s / n,
            self.rig_s / n,
            100.0 * self.right / n,
            self.wrong_when_sure,
            self.sure,
            self.early,
            self.most_n
        );
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
    let mut early = Vec::new();
    let mut slides = 0;
    let verdict = block_on(explore(
        &mut rig,
        &mut explorer,
        &Plan::new(),
        || 0,
        |step| match step {
            ExplorationStep::Early(ms) => early.push((slides, ms)),
            ExplorationStep::Measured(..) => slides += 1,
            _ => {}
        },
    ));
    let verdict = verdict.unwrap();
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
        explorations: 1.0,
        sliding_s: performed.iter().map(|p| p.steady_s).sum(),
        rig_s: rig.now().as_secs_f64(),
        right: flag(verdict.sure && right),
        sure: flag(verdict.sure),
        wrong_when_sure: flag(verdict.sure && !right),
        early: early.len() as f64,
        most_n: performed.iter().map(|p| p.force_max_n).fold(0.0, f64::max),
    }
}

/// `EARLY_TEXTURES=20 EARLY_TRIALS=5 EARLY_EACH=20 cargo test --release -p tactus-tests --test early -- --nocapture` is the long one.
#[test]
fn a_rig_slides_less_and_is_as_right() {
    let of = |name, usual| std::env::var(name).map_or(usual, |n| n.parse::<u32>().unwrap());
    let textures = of("EARLY_TEXTURES", 8);
    let (trials, each) = (of("EARLY_TRIALS", 4), of("EARLY_EACH", 4));
    let sums: Vec<[Sums; 2]> = (1..=u64::from(of("EARLY_SEEDS", 50)))
        .into_par_iter()
        .map(|seed| {
            let world = Collection {
                seed,
                textures: Collection::spread(1 + (seed * 37 % 117) as u8, textures as u8),
                trials,
            };
            let calibration = calibrated(world.setup(world.textures[0], 0)).unwrap();
            let learn = |lengths_ms: &[u16]| {
                world
                    .learn_lengths(Method::Fused, calibration, lengths_ms, || ())
                    .unwrap()
            };
            let early = learn(&[500, 1000, 2000]);
            let early = Table::read(&early).unwrap();
            // the same without lengths
            let whole = tactus_lab::eval::learn::know_lengths(early.as_bytes(), &[]).unwrap();
            let whole = Table::read(&whole).unwrap();
            let mut sums = [Sums::default(); 2];
            for n in 0..u64::from(each) {
                let at = (seed + n) as usize * 7 % world.textures.len();
                let presented = (world.textures[at], 100 + n);
                for (sums, table) in sums.iter_mut().zip([whole, early]) {
                    *sums = sums.and(explored(&world, calibration, table, presented));
                }
            }
            sums
        })
        .collect();
    let [before, after] =
        [0, 1].map(|n| sums.iter().map(|of| of[n]).fold(Sums::default(), Sums::and));
    before.show("slides to their end");
    after.show("slides that may end early");
    assert_eq!(before.early, 0.0);
    assert!(after.sliding_s < before.sliding_s);
    assert!(after.rig_s < before.rig_s);
    assert!(after.most_n < 2.2);
    // both ways see the same slides up to the one that ends early: what differs, differs by three standard errors at most
    let differs = |of: fn(&Sums) -> f64| {
        let each: Vec<f64> = sums.iter().map(|[b, a]| of(a) - of(b)).collect();
        let mean = each.iter().sum::<f64>() / each.len() as f64;
        let squares: f64 = each.iter().map(|d| (d - mean).powi(2)).sum();
        let error = (squares / (each.len() as f64 - 1.0) / each.len() as f64).sqrt();
        println!("by world {mean:+.3} +- {error:.3}");
        (mean, error)
    };
    let (right, error) = differs(|s| s.right);
    assert!(right >= -3.0 * error, "less right");
    let (wrong, error) = differs(|s| s.wrong_when_sure);
    assert!(wrong <= 3.0 * error, "more wrong when sure");
}

/// What a host hears that wants all samples.
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
    let world = Collection {
        seed: 5,
        textures: Collection::spread(47, 8),
        trials: 5,
    };
    let calibration = calibrated(world.setup(47, 0)).unwrap();
    let bytes = world
        .learn_lengths(Method::Fused, calibration, &[500, 1000], || ())
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
    for seed in 1..=50u64 {
        for (cause, fault) in causes {
            let setup = Setup {
                texture: (seed * 37 % 117) as u8 + 1,
                world_seed: seed,
                trial_seed: seed,
                finger_seed: seed,
                ..Setup::default()
            };
            let mut rig = SimRig::new(setup);
            rig.home().unwrap();
            // 63 mm/s: the longest brake, 63 ms
            rig.control().start(Movement::FOR_ROUGHNESS, 0.3).unwrap();
            while rig.control().phase() != Phase::Sliding {
                rig.tick();
            }
            for _ in 0..400 + seed * 3 {
                rig.tick();
            }
            rig.control().end_slide();
            for _ in 0..seed % 20 {
                rig.tick();
            }
            assert_eq!(rig.control().phase(), Phase::Sliding);
            rig.world().inject(cause);
            let ended = rig.rest(|_| ());
            if let Some(fault) = fault {
                assert_eq!(ended, Err(SimError::Fault(fault)), "seed {seed}");
            }
            let truth = rig.world().truth();
            assert!(truth.force_max_n < 2.2, "{cause:?}, seed {seed}: {truth:?}");
            assert!(
                truth.speed_mm_s.abs() < 0.5,
                "{cause:?}, seed {seed}: {truth:?}"
            );
            // an emergency stop takes the lever's supply
            let lifted = truth.force_n == 0.0 || cause == Cause::EStop;
            assert!(lifted, "{cause:?}, seed {seed}: {truth:?}");
        }
    }
}
