//! `evaluate` beside the reference program of the protocols (numpy, seed 1).

use std::path::Path;

use tactus_core::explorer::Config;
use tactus_core::features::WHITE_STEPS;
use tactus_core::table::{Action, Contents, Table, retell};
use tactus_lab::data::properties::PropertyTable;
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::data::replay::measure_all;
use tactus_lab::eval::evaluate::{Method, Summary, evaluate, explorer};
use tactus_lab::eval::experiment::{Experiment, Protocol};
use tactus_lab::eval::novelty::leave_one_out;
use tactus_tests::{count, data};

fn summary(experiment: &Experiment, method: Method, runs: u64) -> Summary {
    let config = Config {
        method: method.method(),
        strategy: method.strategy(),
        ..Config::default()
    };
    let outcomes = evaluate(experiment, config, runs, || ()).unwrap();
    Summary::new(&outcomes, &experiment.names, config.max_slides)
}

fn recorded(folder: &Path, protocol: Protocol, train_slides: usize) -> Experiment {
    let set = RecordingSet::open(folder).unwrap();
    let names = set.textures().iter().map(|t| t.name.clone()).collect();
    Experiment::recorded(
        names,
        &measure_all(&set, |_| ()).unwrap(),
        None,
        protocol,
        train_slides,
        1,
    )
    .unwrap()
}

/// SHA-256 of the features.csv of the public slides, which their manifest names.
const PUBLIC_FEATURES: &str = "461bc916e92fa5a26fc1ba98e4064c34f8b75f2c2bb9ab40915ba5794d05e9ed";

#[test]
fn recorded_slides_give_the_reference_figures() {
    let Some(folder) = data("biotac") else { return };
    // the reference program was run on the public slides; others of the same materials are near
    let manifest = std::fs::read_to_string(folder.join("manifest.json")).unwrap();
    let public = manifest.contains(PUBLIC_FEATURES);
    let tolerance = if public { 0.02 } else { 0.15 };
    // accuracy and median of paper, cycle and random
    for (protocol, train_slides, reference) in [
        (
            Protocol::Interleaved,
            5,
            [(0.894, 3.0), (0.886, 3.0), (0.870, 5.0)],
        ),
        (
            Protocol::Blocked,
            5,
            [(0.762, 3.0), (0.756, 3.0), (0.736, 5.0)],
        ),
        (
            Protocol::Blocked,
            15,
            [(0.826, 4.0), (0.815, 4.0), (0.786, 5.0)],
        ),
        (
            Protocol::Drift,
            5,
            [(0.622, 3.0), (0.622, 3.0), (0.604, 4.0)],
        ),
    ] {
        // others may be too few for that
        if !public && train_slides > 5 {
            continue;
        }
        let experiment = recorded(&folder, protocol, train_slides);
        for (method, (accuracy, median)) in [Method::Paper, Method::Cycle, Method::Random]
            .into_iter()
            .zip(reference)
        {
            let s = summary(&experiment, method, 8000);
            let what = format!("{protocol:?}, {train_slides} training slides, {method:?}");
            println!(
                "{what}: {:.3} (reference {accuracy}), median {}",
                s.accuracy, s.median_slides
            );
            assert!(
                (s.accuracy - accuracy).abs() <= tolerance,
                "{what}: accuracy {} for {accuracy}",
                s.accuracy
            );
            assert!(!public || s.median_slides == median, "{what}");
        }
    }
}

#[test]
fn property_worlds_give_the_reference_figures() {
    let Some(folder) = data("worlds") else { return };
    // The reference program with 2000 runs: its `range(25)` made `range(125)`. The 400 that it prints by itself have a
    // standard error of 0.02; its world 1 random, 0.830, is 0.04 below what 2000 give.
    for (world, paper, random) in [
        (1, (0.918, 5.0), (0.870, 7.0)),
        (2, (0.877, 5.0), (0.813, 7.0)),
        (3, (0.966, 5.0), (0.875, 7.0)),
    ] {
        let set = PropertyTable::read(&folder.join(format!("world_{world}.csv"))).unwrap();
        let experiment = Experiment::given(&set, None, 1).unwrap();
        assert_eq!(
            (
                experiment.names.len(),
                experiment.movements.len(),
                experiment.train_slides
            ),
            (117, 3, 5)
        );
        for (method, (accuracy, median)) in [(Method::Paper, paper), (Method::Random, random)] {
            let s = summary(&experiment, method, count(4000, 2000));
            println!(
                "world {world}, {method:?}: {:.3} (reference {accuracy}), median {}",
                s.accuracy, s.median_slides
            );
            assert!(
                (s.accuracy - accuracy).abs() <= 0.03,
                "world {world}, {method:?}: {} for {accuracy}",
                s.accuracy
            );
            assert_eq!(s.median_slides, median, "world {world}, {method:?}");
        }
    }
}

#[test]
fn figures_do_not_depend_on_the_number_of_threads() {
    let Some(folder) = data("biotac") else { return };
    let experiment = recorded(&folder, Protocol::Interleaved, 5);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| evaluate(&experiment, Config::default(), 400, || ()).unwrap())
    };
    let one = on(1);
    assert!(one == on(3) && one.iter().any(|o| o.sure));
}

/// The figures that the fused method is to reach (5 training slides unless said), on any folder of this layout.
#[test]
fn the_fused_method_is_right_when_it_is_sure() {
    let Some(folder) = data("biotac") else { return };
    for (protocol, train_slides, accuracy, wrong) in [
        (Protocol::Interleaved, 5, 0.99, 0.008),
        (Protocol::Blocked, 5, 0.985, 0.01),
        (Protocol::Blocked, 15, 0.995, 0.01),
        (Protocol::Drift, 5, 0.975, 0.01),
    ] {
        let manifest = std::fs::read_to_string(folder.join("manifest.json")).unwrap();
        let public = manifest.contains(PUBLIC_FEATURES);
        // others may be too few for that, and a little harder
        if !public && train_slides > 5 {
            continue;
        }
        let slack = if public { 0.0 } else { 0.03 };
        let s = summary(
            &recorded(&folder, protocol, train_slides),
            Method::Fused,
            // each learns and calibrates a table; all 8000 are the book's, by `tactus evaluate`
            count(2000, 500),
        );
        println!(
            "{protocol:?}, {train_slides} training slides, fused: {:.4}, wrong among the sure {:.4}, median {}",
            s.accuracy, s.wrong_when_sure, s.median_slides
        );
        assert!(
            s.accuracy >= accuracy - slack,
            "{protocol:?}: {}",
            s.accuracy
        );
        assert!(
            s.wrong_when_sure <= wrong + slack,
            "{protocol:?}: {}",
            s.wrong_when_sure
        );
        assert_eq!(s.median_slides, 1.0, "{protocol:?}");
    }
}

#[test]
fn all_properties_of_a_slide_tell_the_worlds_apart() {
    let Some(folder) = data("worlds") else { return };
    let all: Vec<Summary> = (1..=3)
        .map(|world| {
            let set = PropertyTable::read(&folder.join(format!("world_{world}.csv"))).unwrap();
            let experiment = Experiment::given(&set, None, 1).unwrap();
            let s = summary(&experiment, Method::StudentAll, count(4000, 1000));
            println!(
                "world {world}, student-all: {:.3}, wrong among the sure {:.3}, median {}",
                s.accuracy, s.wrong_when_sure, s.median_slides
            );
            s
        })
        .collect();
    let mean = |of: fn(&Summary) -> f64| all.iter().map(of).sum::<f64>() / 3.0;
    assert!(mean(|s| s.accuracy) >= 0.975);
    assert!(mean(|s| s.wrong_when_sure) <= 0.02);
    assert!(all.iter().all(|s| s.median_slides <= 3.0));
}

#[test]
fn new_materials_are_noticed_and_a_session_is_followed() {
    let Some(folder) = data("biotac") else { return };
    let config = Config {
        method: Method::Fused.method(),
        ..Config::default()
    };
    let interleaved = recorded(&folder, Protocol::Interleaved, 5);
    let after = leave_one_out(&interleaved, config, count(2000, 500), || ()).unwrap();
    println!("{after:?}");
    let told = (after.verdicts_new, after.verdicts_known);
    let after = after.novelty;
    assert!(
        told.0.new >= 0.75 && told.0.right == 0.0 && told.1.right >= 0.95,
        "{told:?}"
    );
    assert!(after[1].unknown.new >= 0.6 && after[1].known.new <= 0.03);
    let drift = recorded(&folder, Protocol::Drift, 5);
    let lives = [[false, false], [true, false], [true, true]];
    let [none, alone, asking] = lives.map(|[learns, asks]| session(&drift, learns, asks));
    println!("{none:?} {alone:?} {asking:?}");
    assert!(none.right < alone.right);
    assert!(alone.right >= 0.97 && alone.worst >= 0.80);
    assert!(asking.right >= 0.98 && asking.uncertain <= 0.10);
    // slides move away from what was learned, and whoever learns follows them
    assert!(none.last_third > 1.1 * none.first_third && alone.last_third < 0.8 * none.last_third);
}

/// Shares of the episodes of one slide each, and distances of the slides from the table, standard deviations.
#[derive(Debug)]
struct Session {
    right: f64,
    worst: f64,
    uncertain: f64,
    first_third: f64,
    last_third: f64,
}

/// A session in the order of time: the first slides are learned, and each later one is an episode, from which the probe
/// learns by itself where it is certain, and by asking where it is not.
fn session(experiment: &Experiment, learns: bool, asks: bool) -> Session {
    let config = Config {
        method: Method::Fused.method(),
        open: true,
        ..Config::default()
    };
    let mut bytes = experiment.run(0).learn(config.method).unwrap();
    let textures = experiment.names.len();
    let sessions: Vec<_> = (0..textures).map(|t| experiment.session(t)).collect();
    let times = sessions[0][0].1.len();
    let (mut right, mut uncertain, mut distances) = (vec![0.0; textures], 0.0, Vec::new());
    for time in 0..times {
        for (texture, movements) in sessions.iter().enumerate() {
            let slide = &movements[0].1[time];
            let mut explorer = explorer(&bytes, experiment.measured, config, None).unwrap();
            let action = Action {
                movement: 0,
                property: None,
            };
            explorer.observe(action, slide).unwrap();
            let best = usize::from(explorer.best().texture);
            let is_certain = explorer.is_certain();
            drop(explorer);
            right[texture] += f64::from(best == texture) / times as f64;
            uncertain += f64::from(!is_certain) / (times * textures) as f64;
            let table = Table::read(&bytes).unwrap();
            let Contents::Fused(set, features) = table.contents() else {
                panic!("{:?}", table.contents());
            };
            let white = slide.vector(set, features.into()).unwrap();
            let white = table.whiten(0, &white).unwrap();
            let known = table.whitened(texture as u16, 0).mean;
            let apart = white.iter().zip(known);
            let apart = apart.map(|(z, m)| f64::from(i32::from(*z) - i32::from(m)));
            let squares: f64 = apart.map(|d| (d / f64::from(WHITE_STEPS)).powi(2)).sum();
            distances.push((squares / white.len() as f64).sqrt());
            let label = match is_certain {
                true => best,
                false if asks => texture,
                false => continue,
            };
            if learns {
                let mut known = table.whitened(label as u16, 0);
                known.adapt(&white);
                let tally = table.tally(label as u16);
                retell(&mut bytes, label as u16, 0, &known, tally).unwrap();
            }
        }
    }
    let mean = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
    let third = distances.len() / 3;
    Session {
        worst: right.iter().copied().fold(1.0, f64::min),
        right: mean(&right),
        uncertain,
        first_third: mean(&distances[..third]),
        last_third: mean(&distances[distances.len() - third..]),
    }
}
