//! The fused recipe in f64, played on recorded slides: the figures that the fixed-point one must come up to, and what
//! novelty and learning on the go do.
//!
//! `--nocapture` prints all figures. Every slide set is drawn with a fixed seed; the number of threads changes nothing.

use std::path::Path;

use rayon::prelude::*;
use tactus_lab::data::recording::Recording;
use tactus_lab::data::recordings::RecordingSet;
use tactus_tests::data;

use crate::oracle;
#[path = "oracle/verdicts.rs"]
mod verdicts;

use oracle::{Episode, LIMIT, Learning, SURE, Trained, features};
use verdicts::{Drift, Judge, Told};

/// Virtual explorations of a protocol, unless a test says otherwise.
const RUNS: u64 = 2000;
/// Of those whose tables are calibrated, which takes longer.
const JUDGED: u64 = 600;
/// SHA-256 of the features.csv of the public slides, which their manifest names: the floors are for these.
const PUBLIC_FEATURES: &str = "461bc916e92fa5a26fc1ba98e4064c34f8b75f2c2bb9ab40915ba5794d05e9ed";

/// Features as `[texture][slide][feature]`, slides in the order of time; one movement.
type Session = Vec<Vec<Vec<f64>>>;

fn public(folder: &Path) -> bool {
    std::fs::read_to_string(folder.join("manifest.json"))
        .is_ok_and(|text| text.contains(PUBLIC_FEATURES))
}

fn session(folder: &Path, features: fn(&Recording) -> Vec<f64>) -> Session {
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

fn with_traction(slide: &Recording) -> Vec<f64> {
    let shear = slide.shear_mn().unwrap();
    features::with_traction(
        &slide.pac()[slide.steady(2200)],
        &shear[slide.steady(slide.shear_rate_hz)],
    )
}

fn with_pressure(slide: &Recording) -> Vec<f64> {
    features::with_pressure(
        &slide.pac()[slide.steady(2200)],
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
    best: usize,
    right: bool,
    sure: bool,
    slides: u32,
}

/// One exploration: slides from `draw` until sure, or the limit.
fn explore(table: &Trained, truth: usize, mut draw: impl FnMut() -> Vec<f64>) -> Outcome {
    let mut episode = Episode::new(1);
    loop {
        episode.slide_z(0, &draw());
        let (best, p) = episode.best(table);
        let sure = p > SURE;
        if sure || episode.slides() == LIMIT {
            return Outcome {
                best,
                right: best == truth,
                sure,
                slides: episode.slides(),
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

/// Shares flagged as unknown after 1, 2 and 3 slides: of the texture that was left out, and of those that were learned.
#[derive(Clone, Copy, Default, Debug)]
struct Flagged {
    unknown: [f64; 3],
    known: [f64; 3],
}

impl std::fmt::Display for Flagged {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for k in 0..3 {
            let (unknown, known) = (self.unknown[k], self.known[k]);
            write!(f, "  {}: {unknown:.3} at {known:.4} false alarms", k + 1)?;
        }
        Ok(())
    }
}

/// Leaves each of `textures` out in turn and learns the others of `textures` from `n` slides: who is flagged?
fn leave_one_out(
    session: &Session,
    textures: &[usize],
    protocol: Protocol,
    n: usize,
    flags: impl Fn(&Trained, &Episode) -> bool + Sync,
) -> (Flagged, Vec<f64>) {
    let draws = RUNS as usize / textures.len();
    let each: Vec<Flagged> = textures
        .par_iter()
        .map(|&left_out| {
            let known: Vec<usize> = textures
                .iter()
                .copied()
                .filter(|&t| t != left_out)
                .collect();
            let mut sum = Flagged::default();
            for draw in 0..draws {
                let mut random = Random::new(2, (left_out * draws + draw) as u64);
                let (picks, test) = split(protocol, n, session[left_out].len(), &mut random);
                let table = train(session, &known, &picks);
                let mut show = |texture: usize, flagged: &mut [f64; 3], weight: f64| {
                    let mut episode = Episode::new(1);
                    for share in flagged {
                        episode.slide(&table, 0, &session[texture][test[random.below(test.len())]]);
                        *share += f64::from(u8::from(flags(&table, &episode))) * weight;
                    }
                };
                show(left_out, &mut sum.unknown, 1.0 / draws as f64);
                for &texture in &known {
                    show(texture, &mut sum.known, 1.0 / (draws * known.len()) as f64);
                }
            }
            sum
        })
        .collect();
    let mut all = Flagged::default();
    for flagged in &each {
        for k in 0..3 {
            all.unknown[k] += flagged.unknown[k] / each.len() as f64;
            all.known[k] += flagged.known[k] / each.len() as f64;
        }
    }
    (all, each.iter().map(|f| f.unknown[1]).collect())
}

#[test]
fn unknown_materials_are_flagged() {
    let Some(folder) = data("biotac") else { return };
    for (what, features) in [
        ("traction", with_traction as fn(&Recording) -> Vec<f64>),
        ("P_DC", with_pressure),
    ] {
        let session = session(&folder, features);
        let all: Vec<usize> = (0..session.len()).collect();
        for (protocol, n) in PROTOCOLS {
            let (flagged, each) = leave_one_out(&session, &all, protocol, n, |table, episode| {
                episode.novel(table)
            });
            println!("unknown, {what} and 12 bands, {protocol:?} {n}:{flagged}");
            let each: Vec<String> = each.iter().map(|e| format!("{e:.2}")).collect();
            println!("    after two slides, by material: {}", each.join(" "));
            if public(&folder) && what == "traction" && matches!(protocol, Protocol::Interleaved) {
                assert!(flagged.unknown[1] >= 0.80 && flagged.known[1] <= 0.03);
            }
        }
    }
}

/// Shares told after one slide, two and three: new, changed, changed with the right name, right, wrong, undecided.
type ToldShares = [[f64; 6]; verdicts::SLIDES];

/// Leaves each texture out in turn, learns the others from `n` slides, and shows slides of the one that was left out and of
/// another, none twice: what is told of the known one, and of the new one.
fn told(
    session: &Session,
    protocol: Protocol,
    n: usize,
    drift: Drift,
    alpha: f64,
) -> [ToldShares; 2] {
    let each: Vec<[ToldShares; 2]> = (0..JUDGED)
        .into_par_iter()
        .map(|run| {
            let mut random = Random::new(4, run);
            let left_out = run as usize % session.len();
            let other = (left_out + 1 + random.below(session.len() - 1)) % session.len();
            let known: Vec<usize> = (0..session.len()).filter(|&t| t != left_out).collect();
            let (picks, test) = split(protocol, n, session[left_out].len(), &mut random);
            let slides = |&t: &usize| picks.iter().map(|&p| session[t][p].clone()).collect();
            let judge = Judge::learn(&known.iter().map(slides).collect::<Vec<_>>(), drift);
            let place = known.iter().position(|&t| t == other);
            [(other, place), (left_out, None)].map(|(texture, place)| {
                let order = random.order(test.len());
                let mut sum = vec![0.0; session[texture][0].len()];
                std::array::from_fn(|more| {
                    let z = judge.z(&session[texture][test[order[more]]]);
                    sum.iter_mut().zip(z).for_each(|(sum, z)| *sum += z);
                    let k = more + 1;
                    let mean: Vec<f64> = sum.iter().map(|s| s / k as f64).collect();
                    let (told, best) = judge.tell(&mean, k, alpha);
                    let right = Some(best) == place;
                    let is = |told_so: bool| f64::from(u8::from(told_so));
                    [
                        is(told == Told::New),
                        is(told == Told::Changed),
                        is(told == Told::Changed && right),
                        is(told == Told::Sure && right),
                        is(told == Told::Sure && !right),
                        is(told == Told::Undecided),
                    ]
                })
            })
        })
        .collect();
    let mean = |which: usize, k: usize, what: usize| {
        each.iter().map(|told| told[which][k][what]).sum::<f64>() / each.len() as f64
    };
    std::array::from_fn(|which| {
        std::array::from_fn(|k| std::array::from_fn(|what| mean(which, k, what)))
    })
}

#[test]
fn known_changed_and_new_are_told_apart() {
    let Some(folder) = data("biotac") else { return };
    let session = session(&folder, with_traction);
    let cases = [
        (Protocol::Interleaved, 5, Drift::USUAL, 0.01),
        (Protocol::Interleaved, 5, Drift::USUAL, 0.02),
        (Protocol::Interleaved, 5, Drift::NONE, 0.01),
        (Protocol::Interleaved, 15, Drift::USUAL, 0.01),
        (Protocol::Blocked, 5, Drift::USUAL, 0.01),
        (Protocol::Drift, 5, Drift::USUAL, 0.01),
    ];
    for (protocol, n, drift, alpha) in cases {
        let [known, new] = told(&session, protocol, n, drift, alpha);
        println!("{protocol:?} {n}, drift {}, alpha {alpha}", drift.bands);
        for (k, (known, new)) in (1..).zip(known.iter().zip(&new)) {
            let percent =
                |shares: &[f64; 6]| shares.map(|s| format!("{:5.1}", 100.0 * s)).join(" ");
            println!("  {k}: known {}   new {}", percent(known), percent(new));
        }
        if !public(&folder) || drift == Drift::NONE || alpha > 0.01 {
            continue;
        }
        for ([called_new, changed, named, right, wrong, _], new) in known.into_iter().zip(new) {
            let drifts = matches!(protocol, Protocol::Drift);
            assert!(called_new <= if drifts { 0.05 } else { 0.03 });
            assert!(wrong <= 0.01 && right >= if drifts { 0.56 } else { 0.75 });
            assert!(changed <= 0.3 && named >= 0.6 * changed);
            assert!(new[4] <= 0.08, "sure of a name that is wrong");
        }
        // after three slides
        assert!(new[2][0] + new[2][1] >= 0.85);
    }
}

/// A table that the product learns has the limits of the recipe, as far as draws go, and tells the same.
#[test]
fn a_learned_table_is_calibrated_as_the_recipe_says() {
    use tactus_core::explorer::{Config, Explorer, Method, Told as Product};
    use tactus_core::features::{Movement, Observation, Properties, PropertySet};
    use tactus_core::table::Table;
    let (textures, d) = (19, 13);
    let mut random = Random::new(11, 0);
    let mut normals =
        |sd: f64| -> Vec<f64> { (0..d).map(|_| sd * verdicts::normal(&mut random)).collect() };
    let means: Vec<Vec<f64>> = (0..textures).map(|_| normals(0.5)).collect();
    // neighbouring bands scatter together
    let mut slide = |texture: usize, off: f64| -> Vec<f64> {
        let (own, away) = (normals(0.12), normals(off));
        let of = |i: usize| own[i] + 0.8 * own[i.saturating_sub(1)] + away[i] + means[texture][i];
        let x: Vec<f64> = (0..d).map(of).collect();
        let traction = 0.7 + 0.2 * x[0];
        let x = std::iter::once(traction).chain(x[1..].iter().copied());
        x.map(|x| (x * 1024.0).round() / 1024.0).collect()
    };
    let observed = |x: &Vec<f64>| Observation {
        properties: Properties::new([Some(x[0] as f32), None, None]),
        bands: x[1..].iter().map(|x| (x * 1024.0) as i16).collect(),
        pressure: None,
        pace: None,
    };
    let training: Session = (0..textures)
        .map(|texture| (0..5).map(|_| slide(texture, 0.0)).collect())
        .collect();
    let judge = Judge::learn(&training, Drift::USUAL);
    let slides: Vec<Vec<Vec<Observation>>> = training
        .iter()
        .map(|slides| vec![slides.iter().map(observed).collect()])
        .collect();
    let names: Vec<String> = (0..textures).map(|t| t.to_string()).collect();
    let movements = [Movement::FOR_TRACTION];
    let bytes = tactus_lab::eval::learn::learn(Method::Fused, None, &names, &movements, &slides);
    let bytes = bytes.unwrap();
    let table = Table::read(&bytes).unwrap();
    let limits = table.limits().unwrap();
    for (which, tails) in [limits.drifted, limits.same].into_iter().enumerate() {
        for (tail, [begin, excess]) in tails.into_iter().zip(judge.limits[which]) {
            let limit = f64::from(tail.begin) + f64::from(tail.excess) * 10f64.ln();
            let expected = begin + excess * 10f64.ln();
            println!("limit {limit:.2}, the recipe's {expected:.2}");
            // both scatter by 0.15 or so
            assert!((limit - expected).abs() < 0.9, "{limit} {expected}");
        }
    }
    let config = Config {
        method: Method::Fused,
        open: true,
        // alpha is half of what comes
        false_alarm: Some(0.02),
        ..Config::default()
    };
    let mut explorer = Explorer::<32>::new(table, PropertySet::ALL, config).unwrap();
    let action = explorer.choose(&explorer.expected_outcomes(), 0);
    let (mut same, mut all, mut kinds) = (0, 0, [0; 4]);
    for run in 0..600 {
        let off = [0.0, 0.1, 0.25, 0.6][run % 4];
        explorer.restart();
        let mut mean = vec![0.0; d];
        for k in 1..=3 {
            let x = slide(run % textures, off);
            explorer.observe(action, &observed(&x)).unwrap();
            for (mean, z) in mean.iter_mut().zip(judge.z(&x)) {
                *mean += (z - *mean) / k as f64;
            }
            let (told, best) = judge.tell(&mean, k, 0.01);
            let here = explorer.best();
            let kind = match here.told() {
                Product::New => Told::New,
                Product::Changed => Told::Changed,
                Product::Sure => Told::Sure,
                Product::Undecided => Told::Undecided,
            };
            kinds[kind as usize] += 1;
            all += 1;
            let named = matches!(told, Told::New) || usize::from(here.texture) == best;
            same += usize::from(kind == told && named);
        }
    }
    println!("{same} of {all} told alike, {kinds:?}");
    assert!(same as f64 >= 0.95 * all as f64, "{same} of {all}");
    assert!(kinds[..3].iter().all(|count| *count > 100), "{kinds:?}");
}

/// The results of a session whose episodes have one slide each.
#[derive(Clone, Debug)]
struct Lived {
    episodes: f64,
    /// The gate was not passed.
    asked: f64,
    /// Right where it did not ask; where it asks, the episode ends with the right name.
    right_or_asked: f64,
    learned_wrong: f64,
    /// Right by material.
    by_texture: Vec<f64>,
}

impl Lived {
    fn new(textures: usize) -> Self {
        Self {
            episodes: 0.0,
            asked: 0.0,
            right_or_asked: 0.0,
            learned_wrong: 0.0,
            by_texture: vec![0.0; textures],
        }
    }

    fn add(&mut self, other: &Self) {
        self.episodes += other.episodes;
        self.asked += other.asked;
        self.right_or_asked += other.right_or_asked;
        self.learned_wrong += other.learned_wrong;
        for (sum, right) in self.by_texture.iter_mut().zip(&other.by_texture) {
            *sum += right;
        }
    }

    fn accuracy(&self) -> f64 {
        self.by_texture.iter().sum::<f64>() / self.episodes
    }

    fn worst(&self) -> f64 {
        let episodes = self.episodes / self.by_texture.len() as f64;
        self.by_texture
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min)
            / episodes
    }
}

impl std::fmt::Display for Lived {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{:.4} right, worst material {:.3}, gate not passed {:.4}, right with the user's answers {:.4}, wrong updates {:.5}",
            self.accuracy(),
            self.worst(),
            self.asked / self.episodes,
            self.right_or_asked / self.episodes,
            self.learned_wrong / self.episodes
        )
    }
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Life {
    /// Nothing is learned.
    Static,
    /// What passes the gate is learned.
    Alone,
    /// And what does not is learned under the name that the user gives.
    WithUser,
}

/// The first `n` slides train; then each later slide of each of `textures` is an episode of its own, in the order of time.
/// The order of the textures at each slide number is drawn anew in each of the `lives`.
fn live(
    session: &Session,
    textures: &[usize],
    n: usize,
    learning: &Learning,
    life: Life,
    lives: u64,
) -> Lived {
    let picks: Vec<usize> = (0..n).collect();
    let trained = train(session, textures, &picks);
    let all: Vec<Lived> = (0..lives)
        .into_par_iter()
        .map(|seed| {
            let mut random = Random::new(3, seed);
            let mut table = trained.clone();
            let mut lived = Lived::new(textures.len());
            let episodes = n..session[textures[0]].len();
            for slide in episodes {
                for texture in random.order(textures.len()) {
                    let mut episode = Episode::new(1);
                    episode.slide(&table, 0, &session[textures[texture]][slide]);
                    let (best, _) = episode.best(&table);
                    let certain = episode.certain(learning, &table);
                    let right = f64::from(u8::from(best == texture));
                    lived.episodes += 1.0;
                    lived.by_texture[texture] += right;
                    lived.right_or_asked += if certain { right } else { 1.0 };
                    lived.asked += f64::from(u8::from(!certain));
                    let name = match life {
                        Life::Static => None,
                        Life::Alone => certain.then_some(best),
                        Life::WithUser => Some(if certain { best } else { texture }),
                    };
                    if let Some(name) = name {
                        lived.learned_wrong += f64::from(u8::from(name != texture));
                        table.learn_episode(learning, name, &episode);
                    }
                }
            }
            lived
        })
        .collect();
    let mut sum = Lived::new(textures.len());
    for lived in &all {
        sum.add(lived);
    }
    sum
}

/// Six sessions out of one: from slide 1, 5 or 9, forwards and backwards in time.
fn cut(session: &Session) -> Vec<Session> {
    let mut backwards = session.clone();
    backwards.iter_mut().for_each(|slides| slides.reverse());
    [session, &backwards]
        .into_iter()
        .flat_map(|s| [0, 4, 8].map(|from| s.iter().map(|t| t[from..].to_vec()).collect()))
        .collect()
}

/// Share of the first slides of a texture that was left out that pass the gate: they would spoil another one's mean.
fn unknown_learned(session: &Session, textures: &[usize], learning: &Learning) -> f64 {
    let passed = |table: &Trained, episode: &Episode| episode.certain(learning, table);
    leave_one_out(session, textures, Protocol::Interleaved, 5, passed)
        .0
        .unknown[0]
}

#[test]
fn a_session_is_learned_on_the_go() {
    let Some(folder) = data("biotac") else { return };
    for (what, features) in [
        ("traction", with_traction as fn(&Recording) -> Vec<f64>),
        ("P_DC", with_pressure),
    ] {
        let session = session(&folder, features);
        let all: Vec<usize> = (0..session.len()).collect();
        // the variants were chosen on the materials of even index: they report on the others
        let others: Vec<usize> = (1..session.len()).step_by(2).collect();
        for (name, learning) in [
            ("recipe", Learning::RECIPE),
            ("nimble", Learning::NIMBLE),
            ("nimble and eager", Learning::NIMBLE_AND_EAGER),
        ] {
            println!(
                "learning, {what}, {name}: unknown passes the gate {:.3}",
                unknown_learned(&session, &others, &learning)
            );
            for life in [Life::Static, Life::Alone, Life::WithUser] {
                let lived = live(&session, &all, 5, &learning, life, 40);
                println!("learning, {what}, {name}, {life:?}, all materials: {lived}");
                if public(&folder) && what == "traction" {
                    match life {
                        // the recipe's own memory of 8 falls short here: 0.969, worst material 0.72
                        Life::Alone if name != "recipe" => {
                            assert!(lived.accuracy() >= 0.97 && lived.worst() >= 0.80);
                        }
                        Life::WithUser => {
                            assert!(lived.accuracy() >= 0.98 && lived.worst() >= 0.80);
                            // with the recipe's own memory: 0.104
                            assert!(name == "recipe" || lived.asked / lived.episodes <= 0.10);
                            assert!(lived.learned_wrong == 0.0);
                        }
                        _ => (),
                    }
                }
                let mut sum = Lived::new(others.len());
                let mut worst = f64::INFINITY;
                for cut in cut(&session) {
                    let lived = live(&cut, &others, 5, &learning, life, 10);
                    worst = worst.min(lived.worst());
                    sum.add(&lived);
                }
                println!(
                    "learning, {what}, {name}, {life:?}, odd materials in six sessions: {sum}, worst in any {worst:.3}"
                );
            }
        }
    }
}

/// Share of right verdicts from one slide of a texture that was learned from `n` slides, the others from five.
fn learned_from(session: &Session, n: usize) -> f64 {
    let right: usize = (0..RUNS)
        .into_par_iter()
        .map(|run| {
            let mut random = Random::new(4, run);
            let new = run as usize % session.len();
            let (picks, test) = split(Protocol::Interleaved, 5, session[new].len(), &mut random);
            let known: Vec<usize> = (0..session.len()).filter(|&t| t != new).collect();
            let mut table = train(session, &known, &picks);
            let slides = picks[..n].iter().map(|&p| session[new][p].clone());
            let index = table.teach(&[slides.collect()]);
            let mut episode = Episode::new(1);
            episode.slide(&table, 0, &session[new][test[random.below(test.len())]]);
            usize::from(episode.best(&table).0 == index)
        })
        .sum();
    right as f64 / RUNS as f64
}

#[test]
fn a_texture_is_learned_from_few_slides() {
    let Some(folder) = data("biotac") else { return };
    let session = session(&folder, with_traction);
    for (n, floor) in [(1, 0.84), (2, 0.90), (3, 0.93), (5, 0.94)] {
        let right = learned_from(&session, n);
        println!("learned from {n}: recognised from one slide {right:.4}");
        assert!(!public(&folder) || right >= floor, "{n}: {right}");
    }
}

/// The nearest multiple of 1 / `steps`, inside +-`limit`.
fn rounded(z: &[f64], steps: f64, limit: f64) -> Vec<f64> {
    let round = |z: &f64| (z * steps).round().clamp(-limit * steps, limit * steps) / steps;
    z.iter().map(round).collect()
}

#[test]
fn coarse_whitened_features_decide_alike() {
    let Some(folder) = data("biotac") else { return };
    let session = session(&folder, with_traction);
    let textures: Vec<usize> = (0..session.len()).collect();
    for (protocol, n) in PROTOCOLS {
        // i16 and i8, means and slides alike
        for (steps, limit) in [(256.0, 128.0 - 1.0 / 256.0), (4.0, 31.75)] {
            let runs: Vec<(bool, bool, f64)> = (0..RUNS)
                .into_par_iter()
                .map(|run| {
                    let mut random = Random::new(5, run);
                    let truth = run as usize % session.len();
                    let (picks, test) = split(protocol, n, session[truth].len(), &mut random);
                    let table = train(&session, &textures, &picks);
                    let mut coarse = table.clone();
                    for mean in coarse.means.iter_mut().flatten() {
                        *mean = rounded(mean, steps, limit);
                    }
                    let slides: Vec<Vec<f64>> = (0..LIMIT)
                        .map(|_| &session[truth][test[random.below(test.len())]])
                        .map(|x| table.movements[0].z(x))
                        .collect();
                    let mut of = slides.iter().cloned();
                    let exact = explore(&table, truth, || of.next().unwrap());
                    let mut of = slides.iter().map(|z| rounded(z, steps, limit));
                    let rough = explore(&coarse, truth, || of.next().unwrap());
                    let furthest = slides
                        .iter()
                        .flatten()
                        .fold(0.0, |f: f64, z| f.max(z.abs()));
                    (exact.best == rough.best, exact == rough, furthest)
                })
                .collect();
            let share = |f: fn(&(bool, bool, f64)) -> bool| {
                runs.iter().filter(|r| f(r)).count() as f64 / RUNS as f64
            };
            let (same, identical) = (share(|r| r.0), share(|r| r.1));
            println!(
                "z in steps of 1/{steps}, {protocol:?} {n}: same texture {same:.4}, and same slides {identical:.4}; \
                 furthest z {:.1}, beyond the limit in {:.4} of the runs",
                runs.iter().fold(0.0, |f: f64, r| f.max(r.2)),
                runs.iter().filter(|r| r.2 > limit).count() as f64 / RUNS as f64
            );
            assert!(!public(&folder) || same >= if steps > 4.0 { 0.999 } else { 0.99 });
        }
    }
}

// By hand, without recordings.

fn near(a: f64, b: f64) {
    assert!((a - b).abs() < 1e-12 * (1.0 + b.abs()), "{a} for {b}");
}

/// One feature, textures about 1 and 11, variance 2.
fn two_textures() -> Trained {
    Trained::train(&vec![
        vec![vec![vec![0.0], vec![2.0]]],
        vec![vec![vec![10.0], vec![12.0]]],
    ])
}

#[test]
fn one_feature_by_hand() {
    let mut table = two_textures();
    let root = 2f64.sqrt();
    near(table.movements[0].w[0][0], 1.0 / root);
    near(table.movements[0].g[0], 6.0);
    near(table.means[0][0][0], -5.0 / root);
    near(table.means[1][0][0], 5.0 / root);
    assert_eq!(table.counts, [[2.0], [2.0]]);

    // one slide right on the first: v = 1 + 1/2, q = 0 and 50
    let mut episode = Episode::new(1);
    let confusion = (-50f64 / 12.0).exp();
    near(episode.benefits(&table)[0], 1.0 / (1.0 + confusion));
    episode.slide(&table, 0, &[1.0]);
    let l = episode.log_likelihoods(&table);
    near(l[0], -0.5 * 1.5f64.ln());
    near(l[1], -0.5 * 1.5f64.ln() - 4.5 * (1.0 + 50.0 / 12.0f64).ln());
    let ratio = (1.0 + 50.0 / 12.0f64).powf(-4.5);
    near(episode.best(&table).1, 1.0 / (1.0 + ratio));
    near(
        episode.posterior_from(&table, &[1.0, 9.0])[0],
        1.0 / (1.0 + 9.0 * ratio),
    );
    // the background: about 0, variance 12.5 + 1
    near(
        episode.novelty(&table),
        -0.5 * 13.5f64.ln() - 4.5 * (1.0 + 12.5 / 13.5 / 8.0f64).ln() + 0.5 * 1.5f64.ln()
            - (0.5 * (1.0 + ratio)).ln(),
    );
    // the benefit of a second slide: the square root of what is left
    let p = episode.posterior(&table);
    let left =
        1.0 - p[0] * p[0] / (p[0] + confusion * p[1]) - p[1] * p[1] / (p[1] + confusion * p[0]);
    near(episode.benefits(&table)[0], 1.0 - left.sqrt());

    // a second slide replaces what the first said: k = 2, mean at 2
    episode.slide(&table, 0, &[3.0]);
    let l = episode.log_likelihoods(&table);
    near(l[0], -4.5 * (1.0 + 0.5 / 8.0f64).ln());

    // learned once for the episode: 1 moves a third of the way to 2
    table.learn_episode(&Learning::RECIPE, 0, &episode);
    near(table.means[0][0][0], (1.0 + 1.0 / 3.0 - 6.0) / root);
    near(table.counts[0][0], 3.0);
    // and a count stops at the memory, or stays where training brought it
    for _ in 0..20 {
        table.learn(&Learning::RECIPE, 0, 0, &[0.0]);
    }
    near(table.counts[0][0], 8.0);
    table.counts[0][0] = 15.0;
    table.means[0][0][0] = 9.0;
    table.learn(&Learning::RECIPE, 0, 0, &[0.0]);
    near(table.counts[0][0], 15.0);
    near(table.means[0][0][0], 8.0);

    let third = table.teach(&[vec![vec![20.0], vec![22.0], vec![24.0]]]);
    assert_eq!(third, 2);
    near(table.means[2][0][0], 16.0 / root);
    near(table.counts[2][0], 3.0);
}

#[test]
fn movements_add_and_lend_each_other_their_covariance() {
    // variances 2 and 8 with two degrees of freedom each: 15 parts in 17 of the average, 5
    let slides = |far: f64| {
        vec![
            vec![vec![far], vec![far + 2.0]],
            vec![vec![far], vec![far + 4.0]],
        ]
    };
    let table = Trained::train(&vec![slides(0.0), slides(10.0)]);
    near(
        table.movements[0].w[0][0],
        (2.0 + 15.0 / 17.0 * 3.0f64).powf(-0.5),
    );
    near(
        table.movements[1].w[0][0],
        (8.0 - 15.0 / 17.0 * 3.0f64).powf(-0.5),
    );
    let mut of = [Episode::new(2), Episode::new(2), Episode::new(2)];
    of[0].slide(&table, 0, &[1.0]);
    of[1].slide(&table, 1, &[4.0]);
    of[2].slide(&table, 0, &[1.0]);
    of[2].slide(&table, 1, &[4.0]);
    let [first, second, both] = of.map(|v| v.log_likelihoods(&table));
    for j in 0..2 {
        near(both[j], first[j] + second[j]);
    }
}

#[test]
fn shrinkage_by_hand() {
    let unit = |d: usize, off: f64| -> oracle::Matrix {
        (0..d)
            .map(|i| (0..d).map(|j| if i == j { 1.0 } else { off }).collect())
            .collect()
    };
    // nothing to estimate: all identity
    for d in 1..5 {
        near(oracle::oas(&unit(d, 0.0), 80.0), 1.0);
    }
    // d = 2, t = 2 + 2 / 4: (0 t + 4) / ((100 + 1 - 1) (1 / 2))
    near(oracle::oas(&unit(2, 0.5), 100.0), 0.08);
    // d = 4, t = 4 + 12 / 4: (7 / 2 + 16) / ((N + 1 / 2) 3)
    near(oracle::oas(&unit(4, 0.5), 9.5), 0.65);
    near(oracle::oas(&unit(4, 0.5), 1.0), 1.0);
    // deviations 1 and 3 keep, the correlation loses 8 %
    let s = oracle::shrunk(&vec![vec![1.0, 1.5], vec![1.5, 9.0]], 100.0);
    for (s, exact) in s.iter().flatten().zip([1.0, 1.38, 1.38, 9.0]) {
        near(*s, exact);
    }
}

#[test]
fn whitening_makes_the_covariance_the_identity() {
    let s = vec![
        vec![4.0, 2.0, -1.0],
        vec![2.0, 10.0, 3.0],
        vec![-1.0, 3.0, 6.0],
    ];
    let w = oracle::inverse_lower(&oracle::cholesky(&s));
    for i in 0..3 {
        assert!(w[i][i + 1..].iter().all(|&w| w == 0.0));
        for j in 0..3 {
            let mut sum = 0.0;
            for (a, row) in s.iter().enumerate() {
                for (b, s) in row.iter().enumerate() {
                    sum += w[i][a] * s * w[j][b];
                }
            }
            near(sum, f64::from(u8::from(i == j)));
        }
    }
}

#[test]
fn a_tone_fills_its_band() {
    // bin 20 of a periodic Hann window has A^2 N / 6, its neighbours a quarter of that, all in the fifth band of 6 bins
    let tone: Vec<i16> = (0..1536)
        .map(|n| {
            let phase = std::f64::consts::TAU * 20.0 * f64::from(n) / 512.0;
            (8000.0 * phase.cos()).round() as i16 + 100
        })
        .collect();
    let bands = features::ln_bands(&tone);
    let exact = (8000f64.powi(2) * 512.0 / 4.0 / 6.0).ln();
    assert!((bands[4] - exact).abs() < 1e-4, "{} {exact}", bands[4]);
    for other in [0, 1, 2, 6, 7, 8, 11] {
        assert!(bands[other] < 1.0, "{bands:?}");
    }
    let x = features::with_pressure(&tone, &[1, 3, 1, 3]);
    near(x[0], 2.0);
    near(x[1], 1.0);
    assert_eq!(x[2..], bands);
    let x = features::with_traction(&tone, &[1000, 2000]);
    near(x[0], 1.5);
    assert_eq!(x.len(), 13);
}
