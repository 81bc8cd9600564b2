//! Tables with drift, limits and speeds against the recipe in f64, whose matrices are inverted as they are: posterior,
//! choice, new and changed.

use super::*;
use crate::explorer::Answer;
use crate::table::tests::whitening::Noise;
use crate::table::tests::{fused_of, known, straight};
use crate::table::{
    Against, Drift, Drifts, Limits, Pace, Population, Sections, Slope, Tail, Whitened,
    with_sections,
};

/// Slides of an episode at a movement: their whitened mean, and ln(speed) of each.
type Slides = (Vec<f64>, Vec<Option<f64>>);

/// The recipe on what a table was made from: whitening is straight.
pub(super) struct Recipe {
    pub(super) d: usize,
    /// Slides and mean of every texture at every movement.
    pub(super) known: Vec<Vec<(f64, Vec<f64>)>>,
    /// Variances of the drift at every movement.
    drifts: Vec<Vec<f64>>,
    limits: Limits,
    /// Speeds of every movement, and slopes of every texture at every movement; none where the table knows no speeds.
    pub(super) paces: Vec<Pace>,
    pub(super) slopes: Vec<Slope>,
}

/// Agreement of the recipe and the explorer, kind by kind.
#[derive(Default, Debug)]
pub(super) struct Agreement {
    pub(super) all: i32,
    pub(super) same: i32,
    news: i32,
    changes: i32,
    /// Slides at a movement of which some speeds are known.
    pub(super) partly: i32,
    /// First slides that are recognised, with a sensor of speed and without.
    pub(super) right: [i32; 2],
}

const NU: f64 = 8.0;

/// ln of the gamma function for 1, 1.5, 2...
fn ln_gamma(x: f64) -> f64 {
    match x {
        0.5 => std::f64::consts::PI.sqrt().ln(),
        1.0 => 0.0,
        _ => (x - 1.0).ln() + ln_gamma(x - 1.0),
    }
}

/// Inverse and ln |V| of a positive matrix, by Gauss and Jordan.
fn inverse(matrix: &[Vec<f64>]) -> (Vec<Vec<f64>>, f64) {
    let d = matrix.len();
    let unit = |i: usize| (0..d).map(move |j| f64::from(u8::from(i == j)));
    let mut rows: Vec<Vec<f64>> = (0..d)
        .map(|i| matrix[i].iter().copied().chain(unit(i)).collect())
        .collect();
    let mut ln = 0.0;
    for i in 0..d {
        let pivot = rows[i][i];
        ln += pivot.ln();
        rows[i].iter_mut().for_each(|x| *x /= pivot);
        let row = rows[i].clone();
        for (_, other) in rows.iter_mut().enumerate().filter(|(j, _)| *j != i) {
            let by = other[i];
            other.iter_mut().zip(&row).for_each(|(x, r)| *x -= by * r);
        }
    }
    (rows.iter().map(|row| row[d..].to_vec()).collect(), ln)
}

impl Recipe {
    /// ln of the likelihood of a texture that nobody knows: the covariance of the means, shrunk (OAS), less what their
    /// own slides scatter.
    fn background(&self, movement: usize, k: f64, z: &[f64]) -> f64 {
        let cells = self.known.iter().map(|row| &row[movement]);
        let means: Vec<&(f64, Vec<f64>)> = cells.filter(|(n, _)| *n > 0.0).collect();
        let (count, d) = (means.len() as f64, self.d as f64);
        let centre = |i: usize| means.iter().map(|(_, m)| m[i]).sum::<f64>() / count;
        let of_slides = means.iter().map(|(n, _)| 1.0 / n).sum::<f64>() / count;
        let c = |i: usize, j: usize| {
            let each = means
                .iter()
                .map(|(_, m)| (m[i] - centre(i)) * (m[j] - centre(j)));
            each.sum::<f64>() / (count - 1.0)
        };
        let all = || (0..self.d).flat_map(|i| (0..self.d).map(move |j| (i, j)));
        let trace: f64 = (0..self.d).map(|i| c(i, i)).sum();
        let squares: f64 = all().map(|(i, j)| c(i, j).powi(2)).sum();
        let above = (1.0 - 2.0 / d) * squares + trace * trace;
        let below = (count - 2.0 / d) * (squares - trace * trace / d);
        let rho = if above < below { above / below } else { 1.0 };
        // no variance of these worlds is below the least: the matrix itself will do
        let v = |i: usize, j: usize| {
            let sphere = if i == j {
                rho * trace / d - of_slides + 1.0 / k
            } else {
                0.0
            };
            (1.0 - rho) * c(i, j) + sphere
        };
        let matrix: Vec<Vec<f64>> = (0..self.d)
            .map(|i| (0..self.d).map(|j| v(i, j)).collect())
            .collect();
        let (inverse, ln) = inverse(&matrix);
        let apart: Vec<f64> = (0..self.d).map(|i| z[i] - centre(i)).collect();
        let distance: f64 = all()
            .map(|(i, j)| apart[i] * inverse[i][j] * apart[j])
            .sum();
        let farthest = d + 2.0 * (2.0 * d).sqrt();
        -0.5 * (ln + distance.min(farthest))
    }

    /// This slope, or none.
    fn slope(&self, slope: Option<&Slope>) -> Vec<f64> {
        let number = |i| slope.map_or(0.0, |slope| f64::from(slope[i]) / 256.0);
        (0..self.d).map(number).collect()
    }

    /// Mean of ln(speed) and the variance of what of it is unknown.
    fn pace(&self, movement: usize, paces: &[Option<f64>]) -> (f64, f64) {
        let Some(usual) = self.paces.get(movement) else {
            return (0.0, 0.0);
        };
        let k = paces.len() as f64;
        let each = paces
            .iter()
            .map(|u| u.unwrap_or(f64::from(usual.mean) / 1024.0));
        let unknown = paces.iter().filter(|u| u.is_none()).count() as f64;
        (
            each.sum::<f64>() / k,
            f64::from(usual.variance) * unknown / (k * k),
        )
    }

    /// -A_j of every texture after so many slides of these means, and the background.
    fn decide(&self, episode: &BTreeMap<usize, Slides>, drifting: bool) -> (Vec<f64>, f64) {
        let Self {
            d, known, drifts, ..
        } = self;
        let background: BTreeMap<usize, f64> = episode
            .iter()
            .map(|(&movement, (z, paces))| {
                let (u, _) = self.pace(movement, paces);
                let pooled = self.slope(self.paces.get(movement).map(|pace| &pace.pooled));
                let slowed: Vec<f64> = z.iter().zip(&pooled).map(|(z, b)| z - b * u).collect();
                let k = paces.len() as f64;
                (movement, self.background(movement, k, &slowed))
            })
            .collect();
        let of = |(texture, row): (usize, &Vec<(f64, Vec<f64>)>)| {
            let (mut t, mut ln, mut p, mut elsewhere) = (0.0, 0.0, 0.0, 0.0);
            for (&movement, (z, paces)) in episode {
                let (n, mean) = &row[movement];
                if *n == 0.0 {
                    elsewhere += background[&movement];
                    continue;
                }
                p += *d as f64;
                let (u, variance) = self.pace(movement, paces);
                let slope = self.slope(self.slopes.get(texture * row.len() + movement));
                let v = |i: usize, j: usize| {
                    let own = 1.0 / paces.len() as f64 + 1.0 / n;
                    let drift = if drifting { drifts[movement][i] } else { 0.0 };
                    let own = if i == j { own + drift } else { 0.0 };
                    own + variance * slope[i] * slope[j]
                };
                let matrix: Vec<Vec<f64>> = (0..*d)
                    .map(|i| (0..*d).map(|j| v(i, j)).collect())
                    .collect();
                let (inverse, ln_v) = inverse(&matrix);
                let r: Vec<f64> = (0..*d).map(|i| z[i] - mean[i] - slope[i] * u).collect();
                ln += ln_v;
                for i in 0..*d {
                    t += (0..*d).map(|j| r[i] * inverse[i][j] * r[j]).sum::<f64>();
                }
            }
            let half = (NU + p) / 2.0;
            ln_gamma(half)
                - ln_gamma(NU / 2.0)
                - p / 2.0 * (NU / 2.0).ln()
                - 0.5 * ln
                - half * (1.0 + t / NU).ln()
                + elsewhere
        };
        let likelihoods = known.iter().enumerate().map(of).collect();
        (likelihoods, background.values().sum())
    }

    /// Eq. 11, where all textures were learned from as many slides.
    fn uncertainty(&self, movement: usize, p: &[f64]) -> f64 {
        let confusion = |i: usize, j: usize| {
            let ((n, a), (_, b)) = (&self.known[i][movement], &self.known[j][movement]);
            let each = a.iter().zip(b).zip(&self.drifts[movement]);
            let t = each.map(|((a, b), delta)| (a - b).powi(2) / (1.0 + 1.0 / n + delta));
            (-t.sum::<f64>() / 8.0).exp()
        };
        let term = |i: usize| {
            let sum: f64 = p.iter().enumerate().map(|(j, p)| confusion(i, j) * p).sum();
            p[i] * p[i] / sum
        };
        1.0 - (0..p.len()).map(term).sum::<f64>()
    }
}

/// A world with its table: whitened means of textures, movements by movements.
pub(super) fn world(noise: &mut Noise, drift: Drift, evenly: bool) -> (Recipe, Vec<u8>) {
    let mut whole = |least: usize, below: usize| least + noise.below(below - least);
    let (d, textures, movements) = (whole(2, 13), whole(8, 20), whole(1, 4));
    let slides = whole(2, 9) as u8;
    let mut known_means = vec![vec![Whitened::default(); movements]; textures];
    for (texture, row) in known_means.iter_mut().enumerate() {
        for (movement, cell) in row.iter_mut().enumerate() {
            let mean: Vec<f64> = (0..d).map(|_| 3.0 * noise.normal()).collect();
            let n = match (texture * 7 + movement * 3) % 10 {
                _ if evenly => slides,
                0 => 0,
                other => other as u8,
            };
            *cell = known(n, &mean);
        }
    }
    let drifts: Vec<Drifts> = (0..movements)
        .map(|_| {
            let mut drifts = Drifts::default();
            if !drift.is_none() {
                drifts[..d.div_ceil(2)].fill_with(|| (1.5 * noise.normal()).exp() as f32);
            }
            drifts
        })
        .collect();
    let of = |movement: usize| {
        let means = known_means.iter().map(|row| &row[movement]);
        Population::new(d, means.map(|cell| (cell.slides, &cell.mean[..]))).unwrap()
    };
    let populations: Vec<Population> = (0..movements).map(of).collect();
    let tail = |begin| Tail { begin, excess: 2.0 };
    let limits = Limits {
        false_alarm: 0.02,
        drifted: [tail(-3.0), tail(-4.0), tail(-3.5)],
        same: [tail(-4.5), tail(-4.0), tail(-6.0)],
    };
    let whitenings = vec![straight(d); movements];
    let plain = fused_of(FeatureSet::Bands, &whitenings, &known_means);
    let mut out = vec![0; 100_000];
    let sections = Sections {
        drift: (drift, &drifts),
        novelty: Some((limits, &populations)),
        slopes: None,
    };
    let table = with_sections(&mut out, &Table::read(&plain).unwrap(), &sections).unwrap();
    let row = |row: &Vec<Whitened>| {
        let cell = |cell: &Whitened| {
            let mean = cell.mean[..d].iter().map(|m| f64::from(*m) / 256.0);
            (f64::from(cell.slides), mean.collect())
        };
        row.iter().map(cell).collect()
    };
    let recipe = Recipe {
        d,
        known: known_means.iter().map(row).collect(),
        drifts: drifts
            .iter()
            .map(|pairs| (0..d).map(|axis| pairs[axis / 2].into()).collect())
            .collect(),
        limits,
        paces: Vec::new(),
        slopes: Vec::new(),
    };
    (recipe, table.as_bytes().to_vec())
}

/// Drift of every world but each fourth.
pub(super) fn drift_of(number: usize) -> Drift {
    if number.is_multiple_of(4) {
        Drift::NONE
    } else {
        Drift::default()
    }
}

impl Recipe {
    /// Presents every texture to an explorer of this table, and compares what it finds: probabilities, log-odds and
    /// their share are off by so much at most.
    pub(super) fn compare(
        &self,
        bytes: &[u8],
        noise: &mut Noise,
        near: (f64, f64, f64),
        agreement: &mut Agreement,
    ) {
        let config = Config {
            method: Method::Fused,
            max_slides: 254,
            open: true,
            ..Config::default()
        };
        let table = Table::read(bytes).unwrap();
        let mut explorer = Explorer::<20>::new(table, PropertySet::ALL, config).unwrap();
        for texture in 0..self.known.len() {
            self.present(texture, &mut explorer, noise, near, agreement);
        }
    }

    /// Four slides. Some textures are as they were learned, some drift, some are new; where the table knows speeds,
    /// some are felt with a sensor of speed, some without, and some with one that loses track now and then.
    fn present(
        &self,
        texture: usize,
        explorer: &mut Explorer<'_, 20>,
        noise: &mut Noise,
        near: (f64, f64, f64),
        agreement: &mut Agreement,
    ) {
        explorer.restart();
        let (table, movements) = (explorer.table(), self.known[0].len());
        let (kind, paced) = (texture % 3, !self.paces.is_empty());
        let mut off = || -> Vec<f64> {
            let off = [0.0, 1.0, 2.5][kind];
            (0..self.d).map(|_| off * noise.normal()).collect()
        };
        let offs: Vec<Vec<f64>> = if paced {
            vec![vec![0.0; self.d]; movements]
        } else {
            (0..movements).map(|_| off()).collect()
        };
        let mut episode: BTreeMap<usize, Slides> = BTreeMap::new();
        for slides in 1..=4u8 {
            let movement = (usize::from(slides) * 5 + texture) % movements;
            let u = if paced { 0.25 * noise.normal() } else { 0.0 };
            let slope = self.slope(self.slopes.get(texture * movements + movement));
            let mean = self.known[texture][movement].1.iter().zip(&slope);
            let x: Vec<i16> = mean
                .zip(&offs[movement])
                .map(|((m, b), off)| ((m + b * u + off + noise.normal()) * 1024.0).round() as i16)
                .collect();
            let is_known = paced && (kind == 0 || kind == 2 && slides % 2 == 0);
            let pace = is_known.then_some((u * 1024.0).round() as i16);
            let slide = Observation {
                bands: x.iter().copied().collect(),
                pace,
                ..Observation::default()
            };
            let action = Action {
                movement: movement as u8,
                property: None,
            };
            if explorer.observe(action, &slide).is_err() {
                break;
            }
            let white = table.whiten(movement as u8, &x).unwrap();
            let zero = || (vec![0.0; self.d], Vec::new());
            let (mean, paces) = episode.entry(movement).or_insert_with(zero);
            paces.push(pace.map(|u| f64::from(u) / 1024.0));
            for (mean, z) in mean.iter_mut().zip(&white) {
                *mean += (f64::from(*z) / 256.0 - *mean) / paces.len() as f64;
            }
            agreement.partly +=
                i32::from(paces.iter().any(Option::is_some) && paces.contains(&None));
            let best = explorer.best();
            if slides == 1 && kind < 2 {
                agreement.right[kind] += i32::from(usize::from(best.texture) == texture);
            }
            self.agrees(explorer, &episode, slides, near, agreement);
        }
    }

    /// Compares the explorer with the recipe after these slides. Limits are exceeded by less than the fixed point's
    /// error now and then.
    fn agrees(
        &self,
        explorer: &mut Explorer<'_, 20>,
        episode: &BTreeMap<usize, Slides>,
        slides: u8,
        (p_off, off, share): (f64, f64, f64),
        agreement: &mut Agreement,
    ) {
        let (likelihoods, background) = self.decide(episode, true);
        let most = likelihoods.iter().copied().fold(f64::MIN, f64::max);
        let sum: f64 = likelihoods.iter().map(|l| (l - most).exp()).sum();
        for (found, l) in explorer.posterior().iter().zip(&likelihoods) {
            let p = (l - most).exp() / sum;
            assert!((f64::from(*found) - p).abs() < p_off, "{found} {p}");
        }
        let limit = |against, share| f64::from(self.limits.limit(against, slides, share));
        let by = |share| background - most - limit(Against::Drifted, share);
        let over = by(None);
        let (far, fits) = (by(Some(0.0005)) > 0.0, by(Some(0.3)) <= 0.0);
        let new = if slides == 1 { far } else { over > 0.0 };
        let fits = if slides <= 4 { fits } else { over <= 0.0 };
        let sure = 1.0 / sum > 0.99 && fits;
        let found = f64::from(explorer.log_odds().unwrap());
        assert!(
            (found - over).abs() < off + share * over.abs(),
            "{found} {over}"
        );
        let (likelihoods, background) = self.decide(episode, false);
        let most = likelihoods.iter().copied().fold(f64::MIN, f64::max);
        let drifts = self.drifts.iter().flatten().any(|variance| *variance > 0.0);
        let changed = background - most > limit(Against::Same, None) && drifts;
        let told = (new, fits, changed, sure, sure && changed);
        let best = explorer.best();
        let is_changed = explorer.changed_by().is_some_and(|by| by > 0.0);
        let fit = explorer.fits();
        let here = (best.unknown, fit, is_changed, best.sure, best.changed);
        agreement.all += 1;
        agreement.same += i32::from(told == here);
        agreement.news += i32::from(best.unknown);
        agreement.changes += i32::from(is_changed);
        let (slides, _) = self.known[0][0];
        if self.paces.is_empty() && self.known.iter().flatten().all(|(n, _)| *n == slides) {
            let p: Vec<f64> = explorer.posterior().iter().map(|p| (*p).into()).collect();
            for outcome in explorer.expected_outcomes() {
                let found = f64::from(outcome.uncertainty);
                let expected = self.uncertainty(outcome.action.movement.into(), &p);
                assert!((found - expected).abs() < 2e-3, "{found} {expected}");
            }
        }
    }
}

#[test]
fn known_changed_and_new_are_the_recipes() {
    let (mut noise, mut agreement) = (Noise(7), Agreement::default());
    for number in 0..120 {
        let (recipe, bytes) = world(&mut noise, drift_of(number), number % 3 > 0);
        recipe.compare(&bytes, &mut noise, (3e-3, 0.03, 2e-3), &mut agreement);
    }
    std::println!("{agreement:?}");
    let Agreement {
        all,
        same,
        news,
        changes,
        ..
    } = agreement;
    assert!(f64::from(same) > 0.999 * f64::from(all));
    assert!(all > 4000 && news > 200 && changes > 200);
}

/// "The same as this one?" after each of three slides, of a texture's own and of another's: score, limit and answer.
#[test]
fn one_texture_is_verified_as_by_the_recipe() {
    let mut noise = Noise(11);
    let config = Config {
        method: Method::Fused,
        max_slides: 254,
        ..Config::default()
    };
    // score below which it is the same
    let sure = -(f64::from(config.threshold) / (1.0 - f64::from(config.threshold))).ln();
    let (mut same, mut different, mut unsure) = ([0; 2], [0; 2], 0);
    for _ in 0..60 {
        let (recipe, bytes) = world(&mut noise, Drift::default(), true);
        let table = Table::read(&bytes).unwrap();
        let textures = recipe.known.len();
        for reference in 0..textures {
            let presented = if reference % 2 == 0 {
                reference
            } else {
                (reference + 1) % textures
            };
            let one = [reference as u16];
            let mut explorer = Explorer::<20>::among(table, PropertySet::ALL, config, one).unwrap();
            assert_eq!(explorer.verification(), None, "nothing was felt");
            let mut mean = vec![0.0; recipe.d];
            for slides in 1..=3u8 {
                let x: Vec<i16> = recipe.known[presented][0]
                    .1
                    .iter()
                    .map(|m| ((m + noise.normal()) * 1024.0).round() as i16)
                    .collect();
                let slide = Observation {
                    bands: x.iter().copied().collect(),
                    ..Observation::default()
                };
                let action = Action {
                    movement: 0,
                    property: None,
                };
                explorer.observe(action, &slide).unwrap();
                for (mean, z) in mean.iter_mut().zip(table.whiten(0, &x).unwrap()) {
                    *mean += (f64::from(z) / 256.0 - *mean) / f64::from(slides);
                }
                let episode = BTreeMap::from([(0, (mean.clone(), vec![None; slides.into()]))]);
                let (likelihoods, background) = recipe.decide(&episode, true);
                let score = background - likelihoods[reference];
                let limit = recipe.limits.limit(Against::Drifted, slides, None);
                let found = explorer.verification().unwrap();
                assert!((f64::from(found.score) - score).abs() < 0.03 + 2e-3 * score.abs());
                assert_eq!(found.limit, limit);
                let limit = f64::from(limit);
                let is_own = usize::from(presented == reference);
                match found.answer {
                    Answer::Different => {
                        assert!(score > limit - 0.1, "{score} {limit}");
                        different[is_own] += 1;
                    }
                    Answer::Same => {
                        assert!(score < sure.min(limit) + 0.1, "{score} {sure}");
                        same[is_own] += 1;
                    }
                    Answer::Unsure => {
                        assert!(score > sure - 0.1 && score < limit + 0.1, "{score}");
                        unsure += 1;
                    }
                }
            }
        }
        let two = Explorer::<20>::among(table, PropertySet::ALL, config, [0, 1]).unwrap();
        let white = table.whiten(0, &[0; 12][..recipe.d]).unwrap();
        assert_eq!(two.verify(&[(0, 1, white)]), None, "of which of the two?");
    }
    std::println!("same {same:?}, different {different:?}, not sure {unsure}");
    assert!(
        same[1] > 500 && different[0] > 500,
        "{same:?} {different:?}"
    );
}
