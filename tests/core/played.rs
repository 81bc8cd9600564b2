//! Real recordings as what the finger of the simulated rig feels: how faithfully they are played, and how well the paper's
//! method tells real materials by them.

use rayon::prelude::*;
use tactus_core::dsp::Plan;
use tactus_core::explorer::{Config, Explorer, Method};
use tactus_core::features::Movement;
use tactus_core::features::{Property, PropertySet};
use tactus_core::probe::explore::{ExplorationStep, explore};
use tactus_core::table::Table;
use tactus_lab::data::recording::Recording;
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::data::replay::{MeasuredSlide, measure};
use tactus_lab::eval::evaluate::{Summary, evaluate};
use tactus_lab::eval::experiment::{Experiment, Protocol};
use tactus_lab::sim::collection::calibrated;
use tactus_lab::sim::recorded::RecordedTexture;
use tactus_lab::sim::rig::{Performed, SimRig};
use tactus_tests::data;
use tactus_world::played::Played;

/// The movement of data/biotac.
fn movement() -> Movement {
    Movement::new(800, 25_000).unwrap()
}

/// A recording that says where in it one is: P_AC counts up, the force rises.
fn ramp(from: i16) -> Played {
    Played {
        pac: (0..8000).map(|n| from + n % 500).collect(),
        shear_mn: (0..500).map(|n| 300 + n).collect(),
    }
}

#[test]
fn every_sample_of_a_recording_is_played_once() {
    let setup = RecordedTexture::setup(1);
    let mut rig = SimRig::new(setup);
    rig.control().calibrate(calibrated(setup).unwrap()).unwrap();
    rig.home().unwrap();
    rig.world().play(vec![ramp(0), ramp(600)], 1);
    let mut begun = Vec::new();
    for _ in 0..3 {
        let observed = rig.record(movement()).unwrap();
        // the stage gets going within milliseconds; until then the finger is still
        let pac = observed.pac();
        let start = pac.iter().position(|&x| x > 20).unwrap();
        assert!(start < 100, "{start}");
        let steady = observed.steady(2200);
        let steps: Vec<i16> = pac[steady.clone()]
            .windows(2)
            .map(|w| w[1] - w[0])
            .collect();
        assert!(steps.iter().all(|&step| step == 1 || step == -499));
        begun.push(pac[steady.start] > 550);
        // 300 mN and 1 mN for every 10 ms since the movement began
        let shear = observed.shear_mn().unwrap();
        let window = observed.steady(1000);
        let middle = (window.start + window.end) / 2;
        let mean = shear[window].iter().map(|&mn| f64::from(mn)).sum::<f64>()
            / observed.steady(1000).len() as f64;
        let expected = 300.0 + middle as f64 / 10.0;
        assert!((mean - expected).abs() < 20.0, "{mean} mN, {expected}");
    }
    assert_eq!(begun[0], begun[2], "over and over");
    assert_ne!(begun[0], begun[1], "the next slide is the next recording");
    let counts = rig.world().played();
    assert_eq!((counts.slides, counts.clipped, counts.over), (3, 0, 0));
}

#[test]
fn what_is_cut_is_counted() {
    let mut rig = SimRig::new(RecordedTexture::setup(1));
    rig.home().unwrap();
    let loud = Played {
        pac: [0, 3000].repeat(500),
        shear_mn: vec![500],
    };
    rig.world().play(vec![loud], 1);
    rig.record(movement()).unwrap();
    let counts = rig.world().played();
    assert_eq!(counts.clipped, 500);
    assert!(counts.over > 4000, "{counts:?}");
    // without recordings the finger feels the sample again
    rig.world().play(Vec::new(), 1);
    rig.record(movement()).unwrap();
    assert_eq!(rig.world().played().slides, 0);
}

/// The stretch of a whole recording that the rig feels, s: its steady part begins so long after the recording's, and ends
/// after 3 s of constant speed.
const STRETCH_S: (f32, f32) = (0.5 + 0.225, 0.5 + 3.025);

/// The same slide, of which this stretch counts.
fn stretch(slide: &Recording, window: (f32, f32)) -> Recording {
    let (pac, shear) = (slide.pac(), slide.shear_mn());
    let slide = Recording {
        window,
        ..slide.clone()
    };
    slide.cut(&[], &pac, shear.as_deref()).unwrap()
}

/// What came of explorations.
#[derive(Clone, Copy, Default, Debug)]
struct Tally {
    right: u32,
    sure: u32,
    wrong_when_sure: u32,
    slides: u32,
    cut: u32,
}

fn config(method: Method) -> Config {
    Config {
        method,
        ..Config::default()
    }
}

/// An exploration of each of the 20 materials with slides that were not learned.
fn explore_all(set: &RecordingSet, method: Method, train: usize, seed: u64) -> Tally {
    let calibration = calibrated(RecordedTexture::setup(0)).unwrap();
    let plan = Plan::new();
    let recorded_texture = RecordedTexture::interleaved(set, train, seed).unwrap();
    assert_eq!(recorded_texture.movement, movement());
    let bytes = recorded_texture.learn(method, calibration).unwrap();
    let table = Table::read(&bytes).unwrap();
    let explore_one = |texture: usize| {
        let mut rig = recorded_texture.unknown(texture, seed);
        rig.control().calibrate(calibration).unwrap();
        let mut explorer = Explorer::<32>::new(table, PropertySet::ALL, config(method)).unwrap();
        let mut slides = 0;
        let exploration = explore(
            &mut rig,
            &mut explorer,
            &plan,
            || 0,
            |event| match event {
                ExplorationStep::Measured(..) => slides += 1,
                ExplorationStep::Rejected(_, why) => {
                    panic!("{}: {why}", recorded_texture.names[texture])
                }
                ExplorationStep::Chosen(..)
                | ExplorationStep::Early(_)
                | ExplorationStep::Decided { .. }
                | ExplorationStep::Verified(..)
                | ExplorationStep::CutShort(..) => {}
            },
        );
        let verdict = embassy_futures::block_on(exploration).unwrap();
        let counts = rig.world().played();
        assert_eq!(counts.slides, slides, "a recording for each slide");
        assert_eq!(counts.over, 0);
        let right = usize::from(verdict.texture) == texture;
        Tally {
            right: right.into(),
            sure: verdict.sure.into(),
            wrong_when_sure: (verdict.sure && !right).into(),
            slides,
            cut: counts.clipped,
        }
    };
    let tallies: Vec<Tally> = (0..recorded_texture.names.len())
        .into_par_iter()
        .map(explore_one)
        .collect();
    tallies.iter().fold(Tally::default(), Tally::and)
}

impl Tally {
    fn and(self, other: &Self) -> Self {
        Self {
            right: self.right + other.right,
            sure: self.sure + other.sure,
            wrong_when_sure: self.wrong_when_sure + other.wrong_when_sure,
            slides: self.slides + other.slides,
            cut: self.cut + other.cut,
        }
    }
}

/// Accuracy of 8000 virtual explorations with the same stretches of the recordings, no rig in between.
fn without_a_rig(set: &RecordingSet, method: Method, train: usize) -> f64 {
    let plan = Plan::new();
    let observed: Vec<Vec<MeasuredSlide>> = (0..set.textures().len())
        .into_par_iter()
        .map(|texture| {
            let slides = set.load_texture(texture).unwrap();
            let observed = |slide: &Recording| MeasuredSlide {
                number: slide.number,
                movement: slide.movement,
                measurement: measure(&plan, &stretch(slide, STRETCH_S)).unwrap(),
            };
            slides.iter().map(observed).collect()
        })
        .collect();
    let names: Vec<String> = set.textures().iter().map(|t| t.name.clone()).collect();
    let experiment =
        Experiment::recorded(names, &observed, None, Protocol::Interleaved, train, 1).unwrap();
    let config = config(method);
    let outcomes = evaluate(&experiment, config, 8000, || ()).unwrap();
    Summary::new(&outcomes, experiment.names(), config.max_slides).accuracy
}

#[test]
fn twenty_real_materials_are_told_apart_on_the_simulated_rig() {
    let Some(folder) = data("biotac") else { return };
    let set = RecordingSet::open(&folder).unwrap();
    for (method, train, least) in [
        (Method::Paper, 5, 80),
        (Method::Paper, 15, 80),
        (Method::Fused, 5, 95),
    ] {
        let explored = (1..=5).map(|seed| explore_all(&set, method, train, seed));
        let seeds: Vec<Tally> = explored.collect();
        let all = seeds.iter().fold(Tally::default(), Tally::and);
        let rights: Vec<u32> = seeds.iter().map(|t| t.right).collect();
        let expected = without_a_rig(&set, method, train);
        println!(
            "{method:?}, {train} slides learned: {rights:?} of 20 each, {all:?}; without a rig {expected:.3}"
        );
        // 100 runs scatter about what the recordings themselves allow
        let spread = (100.0 * expected * (1.0 - expected)).sqrt();
        let off = f64::from(all.right) - 100.0 * expected;
        assert!(
            off.abs() < 3.0 * spread.max(1.0),
            "{all:?}, and {expected} without a rig"
        );
        assert!(all.right >= least, "{rights:?}");
    }
}

/// Real tangential forces jump: the stage keeps its speed none the less.
#[test]
fn the_stage_keeps_its_speed_under_recorded_forces() {
    let Some(folder) = data("biotac") else { return };
    let set = RecordingSet::open(&folder).unwrap();
    let calibration = calibrated(RecordedTexture::setup(0)).unwrap();
    let recorded_texture = RecordedTexture::interleaved(&set, 5, 1).unwrap();
    let worst: Vec<(f64, f64, &str)> = (0..recorded_texture.names.len())
        .into_par_iter()
        .map(|texture| {
            let mut rig = SimRig::new(RecordedTexture::setup(texture as u64));
            rig.control().calibrate(calibration).unwrap();
            rig.home().unwrap();
            rig.world().play(recorded_texture.test[texture].clone(), 1);
            for _ in 0..recorded_texture.test[texture].len() {
                rig.record(recorded_texture.movement).unwrap();
            }
            let performed = rig.performed();
            let speed = performed.iter().map(|p| p.speed_error).fold(0.0, f64::max);
            let force = |p: &Performed| {
                (p.force_n / f64::from(recorded_texture.movement.force_n()) - 1.0).abs()
            };
            let force = performed.iter().map(force).fold(0.0, f64::max);
            (speed, force, recorded_texture.names[texture].as_str())
        })
        .collect();
    for (speed, force, name) in &worst {
        println!(
            "{name}: speed {:.2} %, force {:.2} % off",
            speed * 100.0,
            force * 100.0
        );
    }
    let (speed, _, name) = worst.iter().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
    assert!(*speed <= 0.01, "{name}: {speed}");
}

/// The rig feels 3 of the 5 s that the golden properties are of, and subtracts its own sensor's noise.
#[test]
fn played_recordings_have_the_properties_of_the_recordings() {
    let Some(folder) = data("biotac") else { return };
    let set = RecordingSet::open(&folder).unwrap();
    let calibration = calibrated(RecordedTexture::setup(0)).unwrap();
    let plan = Plan::new();
    let recorded_texture = RecordedTexture::interleaved(&set, 5, 1).unwrap();
    let off: Vec<[f64; 3]> = (0..recorded_texture.names.len())
        .into_par_iter()
        .map(|texture| {
            let mut rig = SimRig::new(RecordedTexture::setup(texture as u64));
            rig.control().calibrate(calibration).unwrap();
            rig.home().unwrap();
            let recorded = set.load_texture(texture).unwrap();
            // the same stretch of the same slide, straight from the folder
            let whole = &recorded[7];
            rig.world().play(
                vec![Played {
                    pac: whole.pac()[1100..].to_vec(),
                    shear_mn: whole.shear_mn().unwrap()[50..].to_vec(),
                }],
                1,
            );
            let observed = rig.record(movement()).unwrap();
            let (start, end) = observed.window;
            let stretch = stretch(whole, (start + 0.5, end + 0.5));
            let [here, there] =
                [&observed, &stretch].map(|s| measure(&plan, s).unwrap().properties);
            Property::ALL.map(|p| f64::from(here.get(p).unwrap() - there.get(p).unwrap()))
        })
        .collect();
    for (property, n) in Property::ALL.into_iter().zip(0..) {
        let largest = off.iter().map(|o| o[n].abs()).fold(0.0, f64::max);
        println!("{property}: at most {largest:.4} off");
        let allowed = [0.06, 0.05, 0.01][n];
        assert!(largest < allowed, "{property}: {largest}");
    }
}
