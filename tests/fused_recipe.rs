//! The fused recipe in f64, played on recorded slides: the figures that the fixed-point one must come up to, and what
//! novelty and learning on the go do.
//!
//! `--nocapture` prints all figures. Every slide set is drawn with a fixed seed; the number of threads changes nothing.

use std::path::Path;

use rayon::prelude::*;
use tactus::recordings::{RecordingSet, Slide};
use tactus_tests::data;

#[path = "oracle/mod.rs"]
mod oracle;

use oracle::{LIMIT, SURE, Trained, Visit, features};

/// Virtual explorations of a protocol, unless a test says otherwise.
const RUNS: u64 = 2000;
/// SHA-256 of the features.csv of the public slides, which their manifest names: the floors are for these.
const PUBLIC_FEATURES: &str = "461bc916e92fa5a26fc1ba98e4064c34f8b75f2c2bb9ab40915ba5794d05e9ed";

/// Features as `[texture][slide][feature]`, slides in the order of time; one movement.
type Session = Vec<Vec<Vec<f64>>>;

fn public(folder: &Path) -> bool {
    std::fs::read_to_string(folder.join("manifest.json"))
        .is_ok_and(|text| text.contains(PUBLIC_FEATURES))
}

fn session(folder: &Path, features: fn(&Slide) -> Vec<f64>) -> Session {
    let set = RecordingSet::open(folder).unwrap();
    (0..set.textures().len())
        .into_par_iter()
        .map(|texture| {
            let slides = set.load_texture(texture).unwrap();
            assert!(slides.is_sorted_by_key(|s| s.number));
            slides.iter().map(features).collect()
        })
        .collect()
}

fn with_traction(slide: &Slide) -> Vec<f64> {
    let shear = slide.shear_mn.as_ref().unwrap();
    features::with_traction(
        &slide.pac[slide.steady(2200)],
        &shear[slide.steady(slide.shear_rate_hz)],
    )
}

fn with_pressure(slide: &Slide) -> Vec<f64> {
    features::with_pressure(
        &slide.pac[slide.steady(2200)],
        &slide.pdc[slide.steady(slide.pdc_rate_hz)],
    )
}

/// SplitMix64.
struct Random(u64);

impl Random {
    fn new(seed: u64, run: u64) -> Self {
        let mut random = Self(seed ^ run.wrapping_mul(0xd134_2543_de82_ef95));
        random.next();
        random
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    /// 0 to `n` in random order.
    fn order(&mut self, n: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..n).collect();
        for i in (1..n).rev() {
            order.swap(i, self.below(i + 1));
        }
        order
    }
}

#[derive(Clone, Copy, Debug)]
enum Protocol {
    Interleaved,
    Blocked,
    Drift,
}

/// Slides to train from and to test on, out of `slides` in the order of time.
fn split(
    protocol: Protocol,
    n: usize,
    slides: usize,
    random: &mut Random,
) -> (Vec<usize>, Vec<usize>) {
    match protocol {
        Protocol::Interleaved => {
            let order = random.order(slides);
            (order[..n].to_vec(), order[n..].to_vec())
        }
        Protocol::Blocked => {
            // 19 of 34
            let first = slides * 19 / 34;
            (random.order(first)[..n].to_vec(), (first..slides).collect())
        }
        Protocol::Drift => ((0..n).collect(), (n..slides).collect()),
    }
}

fn train(session: &Session, textures: &[usize], picks: &[usize]) -> Trained {
    let slides = |&t: &usize| vec![picks.iter().map(|&p| session[t][p].clone()).collect()];
    Trained::train(&textures.iter().map(slides).collect())
}

#[derive(Clone, Copy, PartialEq, Debug)]
struct Outcome {
    right: bool,
    sure: bool,
    slides: u32,
}

/// One exploration: slides from `draw` until sure, or the limit.
fn explore(table: &Trained, truth: usize, mut draw: impl FnMut() -> Vec<f64>) -> Outcome {
    let mut visit = Visit::new(1);
    loop {
        visit.slide_z(0, &draw());
        let (best, p) = visit.best(table);
        let sure = p > SURE;
        if sure || visit.slides() == LIMIT {
            return Outcome {
                right: best == truth,
                sure,
                slides: visit.slides(),
            };
        }
    }
}

struct Figures {
    accuracy: f64,
    converged: f64,
    wrong_when_sure: f64,
    median: u32,
    mean: f64,
}

impl Figures {
    fn new(outcomes: &[Outcome]) -> Self {
        let share = |n: usize, of: usize| n as f64 / of.max(1) as f64;
        let count = |f: fn(&Outcome) -> bool| outcomes.iter().filter(|o| f(o)).count();
        let sure = count(|o| o.sure);
        let counted = |o: &Outcome| if o.sure { o.slides } else { LIMIT + 1 };
        let mut slides: Vec<u32> = outcomes.iter().map(counted).collect();
        slides.sort_unstable();
        Self {
            accuracy: share(count(|o| o.right), outcomes.len()),
            converged: share(sure, outcomes.len()),
            wrong_when_sure: share(count(|o| o.sure && !o.right), sure),
            median: slides[slides.len() / 2],
            mean: outcomes.iter().map(|o| f64::from(o.slides)).sum::<f64>() / outcomes.len() as f64,
        }
    }
}

impl std::fmt::Display for Figures {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{:.4}  converged {:.4}  wrong_when_sure {:.4}  median {}  mean {:.2}",
            self.accuracy, self.converged, self.wrong_when_sure, self.median, self.mean
        )
    }
}

const PROTOCOLS: [(Protocol, usize); 4] = [
    (Protocol::Interleaved, 5),
    (Protocol::Blocked, 5),
    (Protocol::Blocked, 15),
    (Protocol::Drift, 5),
];

fn play(session: &Session, protocol: Protocol, n: usize) -> Vec<Outcome> {
    let textures: Vec<usize> = (0..session.len()).collect();
    (0..RUNS)
        .into_par_iter()
        .map(|run| {
            let mut random = Random::new(1, run);
            let truth = run as usize % session.len();
            let (picks, test) = split(protocol, n, session[truth].len(), &mut random);
            let table = train(session, &textures, &picks);
            explore(&table, truth, || {
                table.movements[0].z(&session[truth][test[random.below(test.len())]])
            })
        })
        .collect()
}

#[test]
fn recorded_slides_reach_the_floors() {
    let Some(folder) = data("biotac") else { return };
    let session = session(&folder, with_traction);
    for ((protocol, n), (floor, wrong)) in
        PROTOCOLS
            .into_iter()
            .zip([(0.99, 0.008), (0.985, 0.01), (0.995, 0.01), (0.975, 0.01)])
    {
        let figures = Figures::new(&play(&session, protocol, n));
        println!("traction and 12 bands, {protocol:?} {n}: {figures}");
        if public(&folder) {
            assert!(figures.accuracy >= floor, "{protocol:?} {n}");
            assert!(figures.wrong_when_sure <= wrong, "{protocol:?} {n}");
            if matches!(protocol, Protocol::Interleaved) {
                assert_eq!(figures.median, 1);
            }
        }
    }
}

#[test]
fn pressure_does_as_well_as_traction() {
    let Some(folder) = data("biotac") else { return };
    let session = session(&folder, with_pressure);
    for (protocol, n) in PROTOCOLS {
        let figures = Figures::new(&play(&session, protocol, n));
        println!("P_DC and 12 bands, {protocol:?} {n}: {figures}");
    }
}
