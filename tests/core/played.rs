//! Real recordings as what the finger of the simulated rig feels: how faithfully they are played, and how well the
//! paper's method tells real materials by them.

use rayon::prelude::*;
use tactus_core::dsp::Plan;
use tactus_core::explorer::{Config, Explorer, Method};
use tactus_core::features::Movement;
use tactus_core::features::{Property, PropertySet};
use tactus_core::probe::explore::{ExplorationStep, explore};
use tactus_core::table::Table;
use tactus_lab::data::quality::SlideMarks;
use tactus_lab::data::recording::Recording;
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::data::replay::{MeasuredSlide, measure};
use tactus_lab::eval::evaluate::{Summary, evaluate};
use tactus_lab::eval::experiment::{Experiment, Protocol};
use tactus_lab::sim::collection::calibrated;
use tactus_lab::sim::recorded::RecordedTexture;
use tactus_lab::sim::rig::SimRig;
use tactus_tests::{count, data};
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

/// The stretch of a whole recording that the rig feels, s: its steady part begins so long after the recording's, and
/// ends after 3 s of constant speed.
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

fn config(method: Method) -> Config {
    Config {
        method,
        ..Config::default()
    }
}

/// Right answers to an exploration of each of the 20 materials with slides that were not learned.
fn explore_all(set: &RecordingSet, method: Method, train: usize, seed: u64) -> usize {
    let calibration = calibrated(RecordedTexture::setup(0)).unwrap();
    let plan = Plan::new();
    let recorded_texture = RecordedTexture::interleaved(set, train, seed).unwrap();
    assert_eq!(recorded_texture.movement, movement());
    let bytes = recorded_texture.learn(method, calibration).unwrap();
    let table = Table::read(&bytes).unwrap();
    let is_right = |&texture: &usize| {
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
                ExplorationStep::Rejected(_, why) => panic!("{texture}: {why}"),
                _ => {}
            },
        );
        let verdict = embassy_futures::block_on(exploration).unwrap();
        let counts = rig.world().played();
        assert_eq!(counts.slides, slides, "a recording for each slide");
        assert_eq!(counts.over, 0);
        usize::from(verdict.texture) == texture
    };
    let textures = 0..recorded_texture.names.len();
    textures.into_par_iter().filter(is_right).count()
}

/// Accuracy of virtual explorations with the same stretches of the recordings, no rig in between.
fn without_a_rig(set: &RecordingSet, method: Method, train: usize) -> f64 {
    let plan = Plan::new();
    let of_texture = |texture| {
        let slides = set.load_texture(texture).unwrap();
        let observed = |slide: &Recording| MeasuredSlide {
            number: slide.number,
            movement: slide.movement,
            measurement: measure(&plan, &stretch(slide, STRETCH_S)).unwrap(),
            marks: SlideMarks::of(slide),
            session: Default::default(),
            given: None,
        };
        slides.iter().map(observed).collect()
    };
    let textures = (0..set.textures().len()).into_par_iter();
    let observed: Vec<Vec<MeasuredSlide>> = textures.map(of_texture).collect();
    let experiment = Experiment::recorded(
        set.names(),
        &observed,
        None,
        Protocol::Interleaved,
        train,
        1,
    );
    let (experiment, config) = (experiment.unwrap(), config(method));
    let outcomes = evaluate(&experiment, config, count(8000, 1000), || ()).unwrap();
    Summary::new(&outcomes, &experiment.names, config.max_slides).accuracy
}

#[test]
fn twenty_real_materials_are_told_apart_on_the_simulated_rig() {
    let Some(folder) = data("biotac") else { return };
    let set = RecordingSet::open(&folder).unwrap();
    // at least so many of 100
    let learned = [
        (Method::Fused, 5, 0.95),
        (Method::Paper, 5, 0.80),
        (Method::Paper, 15, 0.80),
    ];
    for (method, train, least) in learned.into_iter().take(count(3, 2) as usize) {
        let seeds = 1..=count(5, 1);
        let runs = 20.0 * seeds.clone().count() as f64;
        let right = seeds.map(|seed| explore_all(&set, method, train, seed));
        let right = right.sum::<usize>() as f64 / runs;
        let expected = without_a_rig(&set, method, train);
        println!("{method:?}, {train} slides learned: {right}, without a rig {expected:.3}");
        // they scatter about what the recordings themselves allow
        let spread = (expected * (1.0 - expected) / runs).sqrt().max(1.0 / runs);
        assert!(
            (right - expected).abs() < 3.0 * spread,
            "{right} {expected}"
        );
        assert!(right >= least || runs < 100.0, "{right}");
    }
}

/// A rig over each material, homed.
fn over_each<T: Send>(of: impl Fn(usize, SimRig) -> T + Sync) -> Vec<T> {
    let calibration = calibrated(RecordedTexture::setup(0)).unwrap();
    let all = (0..20).into_par_iter().map(|texture| {
        let mut rig = SimRig::new(RecordedTexture::setup(texture as u64));
        rig.control().calibrate(calibration).unwrap();
        rig.home().unwrap();
        of(texture, rig)
    });
    all.collect()
}

/// Real tangential forces jump: the stage keeps its speed none the less.
#[test]
fn the_stage_keeps_its_speed_under_recorded_forces() {
    let Some(folder) = data("biotac") else { return };
    let set = RecordingSet::open(&folder).unwrap();
    let recorded_texture = RecordedTexture::interleaved(&set, 5, 1).unwrap();
    let worst = over_each(|texture, mut rig| {
        let slides = &recorded_texture.test[texture];
        rig.world().play(slides.clone(), 1);
        for _ in slides.iter().take(count(99, 5) as usize) {
            rig.record(recorded_texture.movement).unwrap();
        }
        let errors = rig.performed().iter().map(|p| p.speed_error);
        errors.fold(0.0, f64::max)
    });
    println!("speeds off by {worst:.4?}");
    assert!(worst.iter().all(|off| *off <= 0.01), "{worst:?}");
}

/// The rig feels 3 of the 5 s that the golden properties are of, and subtracts its own sensor's noise.
#[test]
fn played_recordings_have_the_properties_of_the_recordings() {
    let Some(folder) = data("biotac") else { return };
    let set = RecordingSet::open(&folder).unwrap();
    let plan = Plan::new();
    let off = over_each(|texture, mut rig| {
        // the same stretch of the same slide, straight from the folder
        let whole = &set.load_texture(texture).unwrap()[7];
        let played = Played {
            pac: whole.pac()[1100..].to_vec(),
            shear_mn: whole.shear_mn().unwrap()[50..].to_vec(),
        };
        rig.world().play(vec![played], 1);
        let observed = rig.record(movement()).unwrap();
        let (start, end) = observed.window;
        let stretch = stretch(whole, (start + 0.5, end + 0.5));
        let [here, there] = [&observed, &stretch].map(|s| measure(&plan, s).unwrap().properties);
        Property::ALL.map(|p| f64::from(here.get(p).unwrap() - there.get(p).unwrap()))
    });
    for (n, allowed) in [0.06, 0.05, 0.01].into_iter().enumerate() {
        let largest = off.iter().map(|o| o[n].abs()).fold(0.0, f64::max);
        assert!(largest < allowed, "{}: {largest}", Property::ALL[n]);
    }
}
