//! How long the core's main steps take on this machine: `cargo bench`. Gates are on instructions; the one gate here is how many
//! times numpy's speed explorations have, both measured in turns.

use std::process::ExitCode;
use std::time::Instant;

use divan::Bencher;
use tactus_core::dsp::Plan;
use tactus_core::explorer::{Config, Explorer};
use tactus_core::features::Movement;
use tactus_core::features::{Block, Observation, Properties, Property, PropertySet, Slide};
use tactus_core::table::{Action, Experience, Table};
use tactus_lab::data::properties::PropertyTable;
use tactus_lab::eval::evaluate::evaluate;
use tactus_lab::eval::experiment::Experiment;
use tactus_lab::eval::learn::encode;
use tactus_lab::sim::rig::SimRig;
use tactus_tests::{data, numpy, skipped};
use tactus_world::world::Setup;

fn main() -> ExitCode {
    divan::main();
    // only where all was asked for, and neither a list nor a check that the benches run
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if arguments.iter().any(|argument| argument != "--bench") {
        return ExitCode::SUCCESS;
    }
    beside_numpy()
}

/// Explorations of each turn ...
const RUNS: u64 = 8000;
/// ... and turns. The fastest of each counts: other work on the cores only makes them slower.
const TURNS: usize = 5;
/// At least so many times as fast as numpy.
const AT_LEAST: f64 = 5.0;

/// The paper's exploration in world 1 beside the same in numpy, each on all cores.
fn beside_numpy() -> ExitCode {
    let Some(folder) = data("worlds") else {
        return ExitCode::SUCCESS;
    };
    let file = folder.join("world_1.csv");
    let experiment = Experiment::given(&PropertyTable::read(&file).unwrap(), None, 1).unwrap();
    let (mut ours, mut numpys) = (0.0f64, 0.0f64);
    for _ in 0..TURNS {
        match numpy::evaluate(&file, RUNS) {
            Ok(found) => numpys = numpys.max(found.runs_per_second),
            Err(why) => {
                skipped(&format!("beside numpy: {why}"));
                return ExitCode::SUCCESS;
            }
        }
        let began = Instant::now();
        let played = evaluate(&experiment, Config::default(), RUNS, || ()).unwrap();
        ours = ours.max(played.len() as f64 / began.elapsed().as_secs_f64());
    }
    let ratio = ours / numpys;
    println!(
        "{RUNS} explorations among 117 textures: {ours:.0} a second, numpy {numpys:.0}: {ratio:.1} times, at least {AT_LEAST} wanted"
    );
    ExitCode::from(u8::from(ratio < AT_LEAST))
}

/// Noise between -1 and 1, always the same.
fn noise(seed: u32) -> impl FnMut() -> f32 {
    let mut x = seed;
    move || {
        x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        x as f32 / u32::MAX as f32 * 2.0 - 1.0
    }
}

fn samples(count: usize) -> Vec<i16> {
    let mut noise = noise(1);
    (0..count)
        .map(|n| (300.0 * (n as f32 * 0.3).sin() + 40.0 * noise()) as i16)
        .collect()
}

/// A 5 s slide, all features, in blocks.
#[divan::bench]
fn features_of_a_slide(bencher: Bencher<'_, '_>) {
    let (plan, samples) = (Plan::new(), samples(11_000));
    bencher.bench(|| {
        let mut slide = Slide::new(&plan, Movement::FOR_TRACTION);
        slide.set_background(2.0);
        for block in Block::cut(&[], 0..11_000, &samples, &[]) {
            slide.take(&block);
        }
        slide.finish()
    });
}

/// 117 textures, three movements, three properties, neighbours hard to tell apart.
fn table() -> Vec<u8> {
    let mut noise = noise(2);
    let names: Vec<String> = (0..117).map(|t| format!("texture {t}")).collect();
    let movements = [
        Movement::FOR_TRACTION,
        Movement::FOR_FINENESS,
        Movement::FOR_ROUGHNESS,
    ];
    let experience: Vec<Vec<Experience>> = names
        .iter()
        .map(|_| {
            movements
                .map(|_| {
                    let centre = [1.0 + 0.8 * noise(), 8.0 + 3.0 * noise(), 4.0 + noise()];
                    let mut experience = Experience::default();
                    for _ in 0..5 {
                        let trial = Properties::new(centre.map(|c| Some(c + 0.1 * noise())));
                        experience.learn(PropertySet::ALL, &trial).unwrap();
                    }
                    experience
                })
                .to_vec()
        })
        .collect();
    encode(PropertySet::ALL, &movements, &names, &experience).unwrap()
}

fn slide() -> Observation {
    Properties::new([Some(1.0), Some(8.0), Some(4.0)]).into()
}

const ACTION: Action = Action {
    movement: 2,
    property: Some(Property::Roughness),
};

fn explorer(table: &[u8]) -> Explorer<'_, 128> {
    let table = Table::read(table).unwrap();
    Explorer::new(table, PropertySet::ALL, Config::default()).unwrap()
}

/// One posterior update, 117 textures.
#[divan::bench]
fn posterior_update(bencher: Bencher<'_, '_>) {
    let bytes = table();
    let (mut explorer, slide) = (explorer(&bytes), slide());
    bencher.bench_local(|| {
        explorer.restart();
        explorer.observe(ACTION, &slide)
    });
}

/// One choice among 9 actions after the first slide, as many textures live as it has left.
#[divan::bench]
fn choice_of_the_next_movement(bencher: Bencher<'_, '_>) {
    let bytes = table();
    let mut explorer = explorer(&bytes);
    explorer.observe(ACTION, &slide()).unwrap();
    bencher.bench_local(|| {
        let expected = explorer.expected_outcomes();
        explorer.choose(&expected, 0)
    });
}

/// Building an explorer, which computes the first choice among 9 actions and 117 equally probable textures.
#[divan::bench]
fn first_choice(bencher: Bencher<'_, '_>) {
    let bytes = table();
    let table = Table::read(&bytes).unwrap();
    bencher.bench(|| {
        Explorer::<128>::new(table, PropertySet::ALL, Config::default()).map(|e| e.slides())
    });
}

/// A second of the simulated rig at rest: world, sensor words and control.
#[divan::bench]
fn second_of_the_simulated_rig(bencher: Bencher<'_, '_>) {
    let mut rig = SimRig::new(Setup::default());
    rig.home().unwrap();
    bencher.bench_local(|| {
        for _ in 0..1000 {
            rig.tick();
        }
    });
}
