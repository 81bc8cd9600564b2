//! Expected outcomes computed from stored degrees of confusion are those computed without them, to the bit: on the
//! worlds and on recordings.

use tactus_core::explorer::{Config, ExpectedOutcome};
use tactus_lab::data::properties::PropertyTable;
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::data::replay::measure_all;
use tactus_lab::eval::evaluate::{Method, Shared, explorer};
use tactus_lab::eval::experiment::{Experiment, Protocol};
use tactus_tests::{count, data};

/// Explores, and compares the expected outcome of every action at every step; the number of outcomes compared.
fn compared(experiment: &Experiment, method: Method, candidates: Option<&[u16]>) -> usize {
    let config = Config {
        method: method.method(),
        strategy: method.strategy(),
        // beyond what a run takes: late steps have few textures that are likely
        threshold: 1.0,
        ..Config::default()
    };
    let bytes = experiment.run(0).learn(config.method).unwrap();
    let explorer = explorer(&bytes, experiment.measured(), config, candidates).unwrap();
    let shared = Shared::new(explorer, config.strategy);
    let confusions = shared.confusions.expect("there is memory for so few");
    let mut explorer = shared.explorer;
    let bits = |o: &ExpectedOutcome| (o.action, o.uncertainty.to_bits(), o.benefit.to_bits());
    let mut outcomes = 0;
    for number in 0..runs() {
        let mut run = experiment.run(number);
        explorer.restart();
        while explorer.verdict().is_none() {
            let computed = explorer.expected_outcomes();
            let kept = explorer.expected_outcomes_by(&confusions);
            assert!(
                kept.iter().map(bits).eq(computed.iter().map(bits)),
                "{method:?}, run {number}: {kept:?} for {computed:?}"
            );
            outcomes += kept.len();
            let action = explorer.choose(&kept, 0);
            let slide = run.slide(action.movement.into()).unwrap();
            explorer.observe(action, slide).unwrap();
        }
    }
    outcomes
}

fn runs() -> u64 {
    count(150, 50)
}

const METHODS: [(Method, usize); 4] = [
    (Method::Paper, 9),
    (Method::Student, 9),
    (Method::StudentAll, 3),
    (Method::Fused, 3),
];

#[test]
fn stored_degrees_give_the_same_outcomes_in_the_worlds() {
    let Some(folder) = data("worlds") else { return };
    for world in 1..=count(3, 1) {
        let set = PropertyTable::read(&folder.join(format!("world_{world}.csv"))).unwrap();
        let experiment = Experiment::given(&set, None, 1).unwrap();
        let few: Vec<u16> = (0..117).step_by(3).collect();
        for (method, actions) in METHODS {
            for candidates in [None, Some(few.as_slice())] {
                let outcomes = compared(&experiment, method, candidates);
                assert_eq!(
                    outcomes,
                    runs() as usize * 10 * actions,
                    "world {world}, {method:?}"
                );
            }
        }
    }
}

#[test]
fn stored_degrees_give_the_same_outcomes_on_recordings() {
    let Some(folder) = data("biotac") else { return };
    let set = RecordingSet::open(&folder).unwrap();
    let names = set.textures().iter().map(|t| t.name.clone()).collect();
    let observed = measure_all(&set, |_| ()).unwrap();
    let experiment = Experiment::recorded(names, &observed, None, Protocol::Drift, 5, 1).unwrap();
    for (method, actions) in METHODS {
        let outcomes = compared(&experiment, method, None);
        assert_eq!(outcomes, runs() as usize * 10 * actions / 3, "{method:?}");
    }
}
