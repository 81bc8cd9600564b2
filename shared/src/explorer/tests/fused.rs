//! The fused way of deciding against its recipe, written out in f64.

mod edges;
mod unknown;

use super::*;
use crate::explorer::VerdictKind;
use crate::table::tests::whitening::{Noise, World, learned};
use crate::table::tests::{fused_of, known, naming_new, straight};
use crate::table::{Whitened, Whitening};
use std::string::ToString;

/// Steps 4, 6 and 7 of the recipe on the means that the table holds.
struct Recipe {
    d: f64,
    /// Slides and mean of every texture at every movement.
    known: Vec<Vec<(f64, Vec<f64>)>>,
    candidates: Vec<usize>,
    /// Of every movement: slides, and their whitened sum.
    episodes: BTreeMap<usize, (f64, Vec<f64>)>,
    made: BTreeMap<usize, f64>,
}

impl Recipe {
    fn new(table: Table<'_>, candidates: &[u16]) -> Self {
        let row = |texture| {
            let cell = |movement| {
                let mean = table.white_mean(texture, movement);
                let mean: Vec<f64> = mean.map(|m| f64::from(m) / 256.0).collect();
                (f64::from(table.trials(texture, movement)), mean)
            };
            (0..table.movements().len() as u8).map(cell).collect()
        };
        let known: Vec<Vec<_>> = (0..table.textures()).map(row).collect();
        Self {
            d: known[0][0].1.len() as f64,
            known,
            candidates: candidates.iter().map(|&c| c.into()).collect(),
            episodes: BTreeMap::new(),
            made: BTreeMap::new(),
        }
    }

    fn observe(&mut self, movement: u8, z: &[i16]) {
        let movement = usize::from(movement);
        let (k, sum) = self
            .episodes
            .entry(movement)
            .or_insert((0.0, vec![0.0; z.len()]));
        *k += 1.0;
        sum.iter_mut()
            .zip(z)
            .for_each(|(s, z)| *s += f64::from(*z) / 256.0);
        *self.made.entry(movement).or_default() += 1.0;
    }

    /// l_b of a movement, and whether there are textures enough to have one.
    fn background(&self, movement: usize, k: f64, mean: &[f64]) -> (f64, bool) {
        let all = self.known.iter().map(|row| &row[movement]);
        let all: Vec<&Vec<f64>> = all.filter(|(n, _)| *n > 0.0).map(|(_, m)| m).collect();
        let count = all.len() as f64;
        let centre = |i: usize| all.iter().map(|m| m[i]).sum::<f64>() / count.max(1.0);
        let variance = |i: usize| {
            let squares: f64 = all.iter().map(|m| (m[i] - centre(i)).powi(2)).sum();
            squares / count
        };
        // OAS (Chen et al. 2010, eq. 23) of a covariance that is diagonal
        let eigenvalues: Vec<f64> = (0..mean.len()).map(variance).collect();
        let trace: f64 = eigenvalues.iter().sum();
        let trace_of_square: f64 = eigenvalues.iter().map(|v| v * v).sum();
        let rho = ((1.0 - 2.0 / self.d) * trace_of_square + trace * trace)
            / ((count + 1.0 - 2.0 / self.d) * (trace_of_square - trace * trace / self.d));
        let rho = if (0.0..1.0).contains(&rho) { rho } else { 1.0 };
        let (mut norm, mut distance) = (0.0, 0.0);
        for (i, z) in mean.iter().enumerate() {
            let centre = centre(i);
            let variance = if all.len() < 3 {
                400.0
            } else {
                (1.0 - rho) * eigenvalues[i] + rho * trace / self.d
            };
            norm += (variance + 1.0 / k).ln();
            distance += (z - centre).powi(2) / (variance + 1.0 / k);
        }
        let tail = (8.0 + self.d) / 2.0 * (1.0 + distance / 8.0).ln();
        (-0.5 * norm - tail, all.len() >= 3)
    }

    /// Posterior of the candidates, and log-odds that it is none of them; from the means of the slides, or from these
    /// in whole steps.
    fn decide(&self, whole_steps: bool) -> (Vec<f64>, Option<f64>) {
        let mut l = vec![0.0; self.known.len()];
        let (mut elsewhere, mut can_tell) = (0.0, true);
        for (&movement, (k, sum)) in &self.episodes {
            let mean = sum.iter().map(|s| s / k);
            let mean: Vec<f64> = if whole_steps {
                mean.map(|m| (m * 256.0 + 0.5).floor() / 256.0).collect()
            } else {
                mean.collect()
            };
            let (background, enough) = self.background(movement, *k, &mean);
            elsewhere += background;
            can_tell &= enough;
            for (l, row) in l.iter_mut().zip(&self.known) {
                let (n, m) = &row[movement];
                let v = 1.0 / k + 1.0 / n;
                let q: f64 = mean.iter().zip(m).map(|(z, m)| (z - m).powi(2)).sum();
                *l += if *n == 0.0 {
                    background
                } else {
                    -self.d / 2.0 * v.ln() - (8.0 + self.d) / 2.0 * (1.0 + q / (8.0 * v)).ln()
                };
            }
        }
        let l: Vec<f64> = self.candidates.iter().map(|&c| l[c]).collect();
        let top = l.iter().copied().fold(f64::MIN, f64::max);
        let sum: f64 = l.iter().map(|l| (l - top).exp()).sum();
        let average = top + (sum / l.len() as f64).ln();
        let p = l.iter().map(|l| (l - top).exp() / sum).collect();
        (p, can_tell.then_some(elsewhere - average))
    }

    /// Eq. 11 with the confusion of step 6, for the probabilities `p` of the candidates.
    fn uncertainty(&self, movement: usize, p: &[f64]) -> f64 {
        let confusion = |i: usize, j: usize| {
            let (a, b) = (&self.known[i][movement], &self.known[j][movement]);
            let n = a.0.min(b.0);
            if i == j || n == 0.0 {
                return 1.0;
            }
            let apart: f64 = a.1.iter().zip(&b.1).map(|(a, b)| (a - b).powi(2)).sum();
            (-apart / (8.0 * (1.0 + 1.0 / n))).exp()
        };
        let term = |(&i, pi): (&usize, &f64)| {
            let others = self.candidates.iter().zip(p);
            let sum: f64 = others.map(|(&j, pj)| confusion(i, j) * pj).sum();
            if sum > 0.0 { pi * pi / sum } else { 0.0 }
        };
        1.0 - self.candidates.iter().zip(p).map(term).sum::<f64>()
    }

    fn benefit(&self, movement: usize, p: &[f64]) -> f64 {
        let made = self.made.get(&movement).copied().unwrap_or(0.0);
        1.0 - self
            .uncertainty(movement, p)
            .max(0.0)
            .powf(1.0 / (made + 1.0))
    }
}

const OPEN: Config = Config {
    false_alarm: None,
    verify: false,
    learn: false,
    method: Method::Fused,
    strategy: Strategy::Bayesian,
    threshold: 0.99,
    max_slides: 10,
    open: true,
};
const CLOSED: Config = Config {
    open: false,
    ..OPEN
};

type Twenty<'t> = Explorer<'t, 20>;

/// An explorer of all textures on a rig that measures everything.
fn fused(bytes: &[u8], config: Config) -> Twenty<'_> {
    Explorer::new(Table::read(bytes).unwrap(), PropertySet::ALL, config).unwrap()
}

fn look(movement: u8) -> Action {
    Action {
        movement,
        property: None,
    }
}

/// A slide with these features of a table of traction and bands, or of bands only.
fn with_features(set: FeatureSet, x: &[i16]) -> Observation {
    let mut slide = Observation::default();
    let bands = match set {
        FeatureSet::Force => {
            let traction = Some(f32::from(x[0]) / 1024.0);
            slide.properties = Properties::new([traction, None, None]);
            &x[1..]
        }
        _ => x,
    };
    slide.bands = bands.iter().copied().collect();
    slide
}

/// A slide of bands that are whitened to this, in standard deviations: with a straight whitening.
fn at(z: &[f64]) -> Observation {
    let x: Vec<i16> = z.iter().map(|z| (z * 1024.0).round() as i16).collect();
    with_features(FeatureSet::Bands, &x)
}

/// A table of bands with a straight whitening.
fn straight_table(features: usize, known: &[Vec<Whitened>]) -> Vec<u8> {
    let whitenings = vec![straight(features); known[0].len()];
    fused_of(FeatureSet::Bands, &whitenings, known)
}

/// Verdicts that agree with the recipe's, and all.
#[derive(Default)]
struct Agreement {
    same: u32,
    all: u32,
    unknown: u32,
    sure: u32,
    untaught: u32,
}

impl Agreement {
    /// In 99.5 % of more than `least` verdicts, with all kinds of verdicts among them.
    fn holds(&self, least: u32) {
        let Self {
            same,
            all,
            unknown,
            sure,
            untaught,
        } = *self;
        std::println!("{same} of {all}, {unknown} unknown, {sure} sure, {untaught} untaught");
        assert!(f64::from(same) >= 0.995 * f64::from(all), "{same} of {all}");
        assert!(all > least && unknown > 100 && sure > 500);
    }
}

impl Recipe {
    fn expects(&self, explorer: &Twenty<'_>, candidates: &[u16], outcomes: &[ExpectedOutcome]) {
        let table = explorer.table();
        let p: Vec<f64> = candidates
            .iter()
            .map(|&c| explorer.posterior()[usize::from(c)].into())
            .collect();
        let movements: Vec<u8> = (0..table.movements().len() as u8)
            .filter(|&m| candidates.iter().any(|&c| table.trials(c, m) > 0))
            .collect();
        assert!(
            outcomes
                .iter()
                .map(|o| o.action)
                .eq(movements.iter().map(|&m| look(m)))
        );
        for o in outcomes {
            let movement = o.action.movement.into();
            let difference = f64::from(o.uncertainty) - self.uncertainty(movement, &p);
            assert!(difference.abs() < 3e-4, "{o:?}: {difference}");
            let made = self.made.get(&movement).copied().unwrap_or(0.0);
            let benefit = 1.0
                - f64::from(o.uncertainty)
                    .clamp(0.0, 1.0)
                    .powf(1.0 / (made + 1.0));
            assert!((f64::from(o.benefit) - benefit).abs() < 1e-5, "{o:?}");
            if o.uncertainty > 0.01 {
                let difference = f64::from(o.benefit) - self.benefit(movement, &p);
                assert!(difference.abs() < 1e-3, "{o:?}: {difference}");
            }
        }
    }

    fn tells(&self, explorer: &Twenty<'_>, candidates: &[u16], agreement: &mut Agreement) {
        let (config, slides) = (explorer.config, explorer.slides());
        let (p, log_odds) = self.decide(true);
        // of every movement: what the line between two entries of a logarithm's table is off
        let slides_made = self.episodes.len() as f64;
        let mut total = 0.0;
        for (&c, p) in candidates.iter().zip(&p) {
            let posterior = f64::from(explorer.posterior()[usize::from(c)]);
            assert!(
                (posterior - p).abs() < 5e-4 + 5e-4 * slides_made,
                "{posterior} {p}"
            );
            total += posterior;
        }
        assert!((total - 1.0).abs() < 1e-5, "{total}");
        let others = explorer.posterior().iter().zip(0..);
        let mut others = others.filter(|(_, texture)| !candidates.contains(texture));
        assert!(
            others.all(|(&p, _)| p == 0.0),
            "no candidate, no probability"
        );
        assert_eq!(explorer.log_odds().is_some(), log_odds.is_some());
        if let (Some(found), Some(expected)) = (explorer.log_odds(), log_odds) {
            let error = (f64::from(found) - expected).abs();
            assert!(error < 1e-3 + 3e-3 * slides_made, "{found} {expected}");
        }
        // the verdict, and what the mean's rounding may change: little
        let (rounded, (p, log_odds)) = (p, self.decide(false));
        for (p, rounded) in p.iter().zip(&rounded) {
            assert!((p - rounded).abs() < 0.01, "{p} {rounded}");
        }
        let best = (0..p.len())
            .rev()
            .max_by(|&i, &j| p[i].total_cmp(&p[j]))
            .unwrap();
        let limit = if slides < 2 { 2.0 } else { 1.5 };
        let unknown = config.open && log_odds.is_some_and(|l| l > limit);
        let rather_new = config.open && log_odds.is_some_and(|l| l > 0.0);
        let sure = p[best] > f64::from(config.threshold) && !rather_new;
        let over = sure || unknown && slides >= 2 || slides >= config.max_slides;
        let certain = p[best] > f64::from(config.threshold) && log_odds.is_some_and(|l| l <= -2.0);
        let expected = (over, candidates[best], sure, unknown, certain);
        let verdict = explorer.best();
        let found = (
            explorer.verdict().is_some(),
            verdict.texture,
            verdict.sure,
            verdict.unknown,
            explorer.is_certain(),
        );
        assert_eq!(verdict.log_odds, explorer.log_odds());
        agreement.all += 1;
        agreement.same += u32::from(found == expected);
        agreement.sure += u32::from(sure);
        agreement.unknown += u32::from(unknown);
        if let Some(verdict) = explorer.verdict() {
            assert_eq!(verdict, explorer.best());
        }
    }
}

/// Explores to the last slide, and compares every step with the recipe.
fn explored(
    table: Table<'_>,
    set: FeatureSet,
    candidates: &[u16],
    config: Config,
    mut slide: impl FnMut(u8) -> Vec<i16>,
    agreement: &mut Agreement,
) {
    let among = candidates.to_vec();
    let Ok(mut explorer) = Twenty::among(table, PropertySet::ALL, config, among) else {
        return;
    };
    let mut recipe = Recipe::new(table, candidates);
    for _ in 1..=config.max_slides {
        let outcomes = explorer.expected_outcomes();
        recipe.expects(&explorer, candidates, &outcomes);
        let action = explorer.choose(&outcomes, 0);
        let most = outcomes.iter().map(|o| o.benefit).fold(0.0, f32::max);
        let first = outcomes.iter().find(|o| o.benefit == most);
        assert_eq!(first.unwrap().action, action);
        let x = slide(action.movement);
        explorer.observe(action, &with_features(set, &x)).unwrap();
        recipe.observe(action.movement, &table.whiten(action.movement, &x).unwrap());
        let untaught = candidates
            .iter()
            .any(|&c| table.trials(c, action.movement) == 0);
        agreement.untaught += u32::from(untaught);
        recipe.tells(&explorer, candidates, agreement);
    }
    // what can be learned of it
    let observed: Vec<_> = explorer.observed().collect();
    assert_eq!(observed.len(), recipe.episodes.len());
    for (movement, slides, mean) in observed {
        let (k, sum) = &recipe.episodes[&movement.into()];
        assert_eq!((f64::from(slides), mean.len()), (*k, sum.len()));
        for (mean, sum) in mean.iter().zip(sum) {
            assert!((f64::from(*mean) - sum / k * 256.0).abs() <= 0.5);
        }
    }
}

fn some_config(noise: &mut Noise) -> Config {
    Config {
        threshold: if noise.below(2) == 0 { 0.99 } else { 0.9 },
        max_slides: 1 + noise.below(10) as u8,
        open: noise.below(3) > 0,
        ..OPEN
    }
}

fn some_candidates(noise: &mut Noise, textures: usize) -> Vec<u16> {
    let mut candidates: Vec<u16> = (0..textures as u16).collect();
    if noise.below(3) == 0 {
        candidates.retain(|_| noise.below(2) == 0);
    }
    candidates
}

/// Any means, and any numbers of slides, none as well.
#[test]
fn explores_by_the_recipe() {
    let mut agreement = Agreement::default();
    for seed in 0..600 {
        let noise = &mut Noise(seed);
        let (textures, movements) = (1 + noise.below(20), 1 + noise.below(4));
        let features = 1 + noise.below(12);
        let spread = 0.5 + 4.0 * noise.uniform();
        let mut mean = || -> Vec<f64> { (0..features).map(|_| spread * noise.normal()).collect() };
        let means: Vec<Vec<Vec<f64>>> = (0..=textures)
            .map(|_| (0..movements).map(|_| mean()).collect())
            .collect();
        let table: Vec<Vec<Whitened>> = means[..textures]
            .iter()
            .map(|row| {
                let counts = [0, 1, 2, 5, 5, 5, 8, 40, 255];
                row.iter()
                    .map(|mean| known(counts[noise.below(9)], mean))
                    .collect()
            })
            .collect();
        let bytes = straight_table(features, &table);
        let config = some_config(noise);
        let candidates = some_candidates(noise, textures);
        // now and then one that the table does not have
        let truth = noise.below(textures + 1);
        let slide = |movement: u8| -> Vec<i16> {
            let mean = means[truth][usize::from(movement)].iter();
            mean.map(|m| {
                ((m + noise.normal()) * 1024.0)
                    .round()
                    .clamp(-32768.0, 32767.0) as i16
            })
            .collect()
        };
        let table = Table::read(&bytes).unwrap();
        explored(
            table,
            FeatureSet::Bands,
            &candidates,
            config,
            slide,
            &mut agreement,
        );
    }
    agreement.holds(2000);
    assert!(agreement.untaught > 500);
}

/// From slides to verdicts: whitening and means are learned from five slides of each texture.
#[test]
fn explores_what_was_learned_by_the_recipe() {
    let mut agreement = Agreement::default();
    for seed in 0..60 {
        let noise = &mut Noise(seed);
        let world = World::new(noise, 18, 3, 13);
        let mut slides = world.slides(noise, 5);
        slides.iter_mut().for_each(|textures| textures.truncate(15));
        let whitenings: Vec<Whitening> = learned(&slides);
        let row = |texture: usize| -> Vec<Whitened> {
            let cell = |(whitening, textures): (&Whitening, &Vec<Vec<Vector>>)| {
                let mut known = Whitened::default();
                for slide in &textures[texture] {
                    known.teach(&whitening.apply(slide));
                }
                known
            };
            whitenings.iter().zip(&slides).map(cell).collect()
        };
        let known: Vec<Vec<Whitened>> = (0..15).map(row).collect();
        let bytes = fused_of(FeatureSet::Force, &whitenings, &known);
        let table = Table::read(&bytes).unwrap();
        for _ in 0..6 {
            let config = some_config(noise);
            let candidates = some_candidates(noise, 15);
            let truth = noise.below(18);
            let slide = |movement: u8| world.slide(noise, truth, movement.into()).to_vec();
            explored(
                table,
                FeatureSet::Force,
                &candidates,
                config,
                slide,
                &mut agreement,
            );
        }
    }
    agreement.holds(1000);
}

/// Means 0 and 4 of one slide each, d = 1; slides at 1. By hand: l = -(9/2) ln(1 + q/(8 v)).
#[test]
fn another_slide_of_a_movement_replaces_and_does_not_add() {
    let bytes = straight_table(1, &[vec![known(1, &[0.0])], vec![known(1, &[4.0])]]);
    let mut explorer = fused(&bytes, OPEN);
    // v = 2: 1 + 1/16 and 1 + 9/16; v = 3/2: 1 + 1/12 and 1 + 9/12; v = 1 + 1/255: nearly 1 + 1/8 and 1 + 9/8
    let once = 1.0 / (1.0 + (17.0f32 / 25.0).powf(4.5));
    let twice = 1.0 / (1.0 + (13.0f32 / 21.0).powf(4.5));
    let often = 1.0 / (1.0 + (9.0f32 / 17.0).powf(4.5));
    explorer.observe(look(0), &at(&[1.0])).unwrap();
    assert!(
        (explorer.posterior()[0] - once).abs() < 5e-4,
        "{}",
        explorer.posterior()[0]
    );
    explorer.observe(look(0), &at(&[1.0])).unwrap();
    assert!(
        (explorer.posterior()[0] - twice).abs() < 5e-4,
        "{}",
        explorer.posterior()[0]
    );
    for _ in 0..400 {
        explorer.observe(look(0), &at(&[1.0])).unwrap();
    }
    assert!(
        (explorer.posterior()[0] - often).abs() < 1e-3,
        "{}",
        explorer.posterior()[0]
    );
    // 1 = the mean of 3 and -1
    let mut other = fused(&bytes, OPEN);
    other.observe(look(0), &at(&[3.0])).unwrap();
    assert!(other.posterior()[1] > 0.8);
    other.observe(look(0), &at(&[-1.0])).unwrap();
    assert!((other.posterior()[0] - twice).abs() < 5e-4);
    assert_eq!(other.log_odds(), None, "two textures say nothing of others");
    assert!(!other.is_certain());
    assert!(
        other
            .observed()
            .eq([(0, 2, heapless::Vec::from_slice(&[256]).unwrap())])
    );
}

/// The most that is counted is 255 slides; whatever comes after is not taken in.
#[test]
fn beyond_255_slides_nothing_changes() {
    let bytes = straight_table(1, &[vec![known(9, &[0.0])], vec![known(9, &[1.0])]]);
    let mut explorer = fused(&bytes, OPEN);
    for _ in 0..255 {
        explorer.observe(look(0), &at(&[0.25])).unwrap();
    }
    let posterior = explorer.posterior().to_vec();
    for _ in 0..100 {
        explorer.observe(look(0), &at(&[30.0])).unwrap();
        assert_eq!(
            (explorer.posterior(), explorer.slides()),
            (&posterior[..], 255)
        );
    }
}

/// Where a texture was never learned it is as likely as one that the table does not have.
#[test]
fn a_texture_never_learned_at_a_movement_is_like_any_other() {
    let cell = |x: f64, y: f64| vec![known(10, &[x, y])];
    let table = [
        cell(5.0, 0.0),
        cell(-5.0, 0.0),
        cell(0.0, 5.0),
        vec![known(0, &[3.0, 3.0])],
    ];
    let bytes = straight_table(2, &table);
    let table = Table::read(&bytes).unwrap();
    let mut pair = Twenty::among(table, PropertySet::ALL, OPEN, [0, 3]).unwrap();
    // far from the other candidate: all is on the side of the one never learned
    pair.observe(look(0), &at(&[-30.0, -30.0])).unwrap();
    assert!(pair.posterior()[3] > 0.999, "{:?}", pair.posterior());
    assert_eq!(pair.posterior()[1..3], [0.0, 0.0]);
    // l_b - ln((e^l_b + 0)/2) = ln 2
    let log_odds = pair.log_odds().unwrap();
    assert!((log_odds - 2f32.ln()).abs() < 2e-3, "{log_odds}");
    pair.restart();
    pair.observe(look(0), &at(&[5.0, 0.0])).unwrap();
    assert!(pair.posterior()[0] > 0.9);
    // and confused with all: eq. 11 of two equal ones that nothing tells apart is 1/2
    pair.restart();
    assert!((pair.expected_outcomes()[0].uncertainty - 0.5).abs() < 1e-6);
    // alone it has nothing to be looked at
    let alone = Twenty::among(table, PropertySet::ALL, OPEN, [3]).map(|_| ());
    assert_eq!(alone, Err(ExplorerError::NothingToMeasure));
}

fn axes() -> Vec<u8> {
    let ends = [
        [6.0, 0.0, 0.0],
        [-6.0, 0.0, 0.0],
        [0.0, 6.0, 0.0],
        [0.0, -6.0, 0.0],
        [0.0, 0.0, 6.0],
    ];
    let known: Vec<Vec<Whitened>> = ends.iter().map(|end| vec![known(10, end); 2]).collect();
    straight_table(3, &known)
}
