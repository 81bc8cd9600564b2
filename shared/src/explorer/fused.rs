//! The fused way of deciding: how well the whitened slides of a visit fit each texture, in fixed point.
//!
//! At each movement the running mean of the visit's slides is compared with the texture's mean, as Student's t with 8
//! degrees of freedom. A further slide replaces what the movement said before: adding to it would count the error of the
//! texture's own mean again with every slide.

use heapless::{Vec, VecView};

use crate::fixed::{exp_neg_q30, ln_q16};
use crate::fused::{MAX_FEATURES, Vector, oas, white};
use crate::kernels::{Candidate, Kernels, mask};
use crate::table::{Contents, MAX_MOVEMENTS, Table};

/// Degrees of freedom of Student's t.
const FREEDOM: i32 = 8;
/// Fewest textures whose means say what textures are like.
const POPULATION: usize = 3;
/// Variance of textures' means where there are too few to say, standard deviations within a texture squared.
const WIDE: f32 = 400.0;

/// The slides made of one movement in a visit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Visit {
    pub(super) movement: u8,
    pub(super) slides: u8,
    /// Sum of the whitened slides, 1/256.
    pub(super) white: [i32; MAX_FEATURES],
    /// Sum of the properties.
    pub(super) properties: [f32; 3],
}

/// All movements made in a visit.
pub(super) type Visits = Vec<Visit, MAX_MOVEMENTS>;

/// The slides of `movement`, which now has one more.
pub(super) fn visit(visits: &mut Visits, movement: u8) -> Option<&mut Visit> {
    let at = match visits.iter().position(|v| v.movement == movement) {
        Some(at) => at,
        None => {
            let new = Visit {
                movement,
                slides: 0,
                white: [0; MAX_FEATURES],
                properties: [0.0; 3],
            };
            visits.push(new).ok()?;
            visits.len() - 1
        }
    };
    visits.get_mut(at)
}

impl Visit {
    /// Mean of so many whitened features, to the nearest step.
    pub(super) fn mean(&self, features: usize) -> Vector {
        let n = i32::from(self.slides.max(1));
        let rounded = |sum: i32| sum.saturating_mul(2).saturating_add(n).div_euclid(2 * n);
        // a mean of i16
        let means = self.white.iter().take(features);
        means.map(|&sum| rounded(sum) as i16).collect()
    }
}

/// What Student's t makes of `k` slides against a mean of `n`: 1/(8 v) of the variance v = 1/k + 1/n in Q16, and
/// -(d/2) ln v in Q16.
#[derive(Clone, Copy)]
struct Spread {
    slides: u8,
    narrowness: u32,
    norm: i32,
}

impl Spread {
    fn new(k: u8, n: u8, features: usize) -> Self {
        let (k32, n32) = (u32::from(k), u32::from(n));
        // 20 bits at most, as k and n have 8 each
        let narrowness = (u64::from(k32 * n32) << 16) / u64::from(8 * (k32 + n32));
        Self {
            slides: n,
            narrowness: narrowness as u32,
            // -(14/2) ln v, and ln v is 12 at most
            norm: (features as i64 * i64::from(ln_q16(8 * narrowness)) / 2) as i32,
        }
    }

    /// ln of the likelihood up to a constant, Q16. 8 degrees of freedom and `features` make `weight`.
    fn likelihood(&self, distance: u64, weight: i32) -> i32 {
        let narrowness = u64::from(self.narrowness);
        let beyond = match u32::try_from(distance) {
            Ok(distance) => u64::from(distance) * narrowness,
            Err(_) => distance.saturating_mul(narrowness),
        };
        let odds = (1 << 16) + (beyond >> 16);
        // the odds are at least 1, their logarithm is 34 at most: neither is negative, nor beyond 26 bits times 22
        let tail = (weight * ln_q16(odds)) >> 1;
        // some 60 at most: 2^22 in Q16
        self.norm - tail
    }
}

/// The likelihood of a texture that the table does not have: means of textures scatter as those of the table do.
#[derive(Clone, Copy, Debug)]
pub(super) struct Background {
    movement: u8,
    mean: [f32; MAX_FEATURES],
    variance: [f32; MAX_FEATURES],
    /// Whether there are textures enough to tell.
    known: bool,
}

impl Background {
    pub(super) fn new(table: &Table<'_>, movement: u8) -> Self {
        let mut count = 0;
        let mut sum = [0i64; MAX_FEATURES];
        let mut squares = [0i64; MAX_FEATURES];
        for texture in (0..table.textures()).filter(|&t| table.trials(t, movement) > 0) {
            count += 1;
            let mean = table.white_mean(texture, movement);
            for ((sum, square), m) in sum.iter_mut().zip(&mut squares).zip(mean) {
                *sum += i64::from(m);
                *square += i64::from(m) * i64::from(m);
            }
        }
        let n = count.max(1) as f32;
        let known = count >= POPULATION;
        let step = white(1);
        let mut background = Self {
            movement,
            mean: sum.map(|sum| sum as f32 / n * step),
            variance: [WIDE; MAX_FEATURES],
            known,
        };
        if known {
            for ((variance, sum), squares) in background.variance.iter_mut().zip(sum).zip(squares) {
                // exact in i64: 117 means of 16 bits
                let above = squares * count as i64 - sum * sum;
                *variance = above as f32 / (n * n) * step * step;
            }
            let Contents::Fused(_, features) = table.contents() else {
                return background;
            };
            let variances = background.variance.get_mut(..features.into());
            shrink(variances.unwrap_or_default(), n);
        }
        background
    }

    /// As [`Spread::likelihood`], of the mean of `k` slides.
    fn likelihood(&self, mean: &Vector, k: u8) -> f32 {
        let v = 1.0 / f32::from(k);
        let (mut norm, mut distance) = (0.0, 0.0);
        for ((z, m), variance) in mean.iter().zip(&self.mean).zip(&self.variance) {
            let total = variance + v;
            let apart = white(*z) - m;
            norm += libm::logf(total);
            distance += apart * apart / total;
        }
        let tail = (FREEDOM as f32 + mean.len() as f32) / 2.0;
        -0.5 * norm - tail * libm::log1pf(distance / FREEDOM as f32)
    }
}

/// Draws the variances along the axes of a covariance of `n` towards their mean, by as much as so few deserve ([`oas`]):
/// textures differ in more directions than a few of them show.
fn shrink(variances: &mut [f32], n: f32) {
    let d = variances.len() as f32;
    let sum: f32 = variances.iter().sum();
    let squares: f32 = variances.iter().map(|v| v * v).sum();
    let weight = oas(sum.into(), squares.into(), d.into(), n.into()) as f32;
    for variance in variances {
        *variance += weight * (sum / d - *variance);
    }
}

/// [`Kernels::distances`].
type Distances = fn(&[i16], &[u8], usize, &mut [u64]);

/// Sets the posterior of every texture from all slides of a visit; the log-odds that it is none of them, `None` where the
/// table has too few textures to tell. Those whose entry of `candidates` is minus infinity are none.
pub(super) fn decide<K: Kernels, const N: usize>(
    table: &Table<'_>,
    visits: &Visits,
    backgrounds: &[Background],
    candidates: &[f32],
    posterior: &mut [f32],
) -> Option<f32> {
    let mut log = [0; N];
    let mut distances = [0; N];
    let (log, distances) = (
        log.get_mut(..posterior.len())?,
        distances.get_mut(..posterior.len())?,
    );
    let (elsewhere, can_tell) =
        add_likelihoods(table, visits, backgrounds, log, distances, K::distances)?;
    let average = normalise(log, candidates, posterior)?;
    can_tell.then_some(elsewhere - average)
}

/// Logarithms of the likelihoods up to a constant, Q16, of a texture that the table does not have as well, and whether that
/// one is known. `distances` is room for as many.
#[inline(never)]
fn add_likelihoods(
    table: &Table<'_>,
    visits: &Visits,
    backgrounds: &[Background],
    log: &mut [i32],
    distances: &mut [u64],
    measure: Distances,
) -> Option<(f32, bool)> {
    let Contents::Fused(_, features) = table.contents() else {
        return None;
    };
    let features = usize::from(features);
    let (mut elsewhere, mut can_tell) = (0.0, true);
    for visit in visits {
        let mean = visit.mean(features);
        let background = backgrounds.iter().find(|b| b.movement == visit.movement)?;
        let unknown = background.likelihood(&mean, visit.slides);
        elsewhere += unknown;
        can_tell &= background.known;
        let untaught = (unknown * 65536.0) as i32;
        let mut spread = Spread::new(visit.slides, 1, features);
        let (means, stride) = table.white_means(visit.movement);
        measure(&mean, means, stride, distances);
        let (trials, trials_stride) = table.trials_at(visit.movement);
        // a table has movements
        let trials = trials.iter().step_by(trials_stride.max(1)).copied();
        for ((log, distance), trials) in log.iter_mut().zip(&*distances).zip(trials) {
            let likelihood = if trials == 0 {
                // as little is known of it here as of a texture that the table does not have
                untaught
            } else {
                if spread.slides != trials {
                    spread = Spread::new(visit.slides, trials, features);
                }
                spread.likelihood(*distance, FREEDOM + features as i32)
            };
            *log = log.saturating_add(likelihood);
        }
    }
    Some((elsewhere, can_tell))
}

/// The posterior from its logarithms; the logarithm of the candidates' mean likelihood.
#[inline(never)]
fn normalise(log: &[i32], candidates: &[f32], posterior: &mut [f32]) -> Option<f32> {
    let none = f32::NEG_INFINITY.to_bits();
    let is_candidate = |candidate: &f32| candidate.to_bits() != none;
    let of_candidates = log.iter().zip(candidates);
    let of_candidates = of_candidates.filter(|(_, c)| is_candidate(c));
    let top = of_candidates.map(|(&log, _)| log).max()?;
    let (mut sum, mut count) = (0u64, 0u32);
    for ((p, log), candidate) in posterior.iter_mut().zip(log).zip(candidates) {
        *p = 0.0;
        if is_candidate(candidate) {
            let less = top.abs_diff(*log);
            let likely = if less < FAR { exp_neg_q30(less) } else { 0 };
            sum += u64::from(likely);
            count += 1;
            *p = likely as f32;
        }
    }
    let sum = sum as f32;
    for p in posterior {
        *p /= sum;
    }
    Some(top as f32 / 65536.0 + libm::logf(sum / (1 << 30) as f32 / count as f32))
}

/// e^(-x) is 0 from here on, Q16: [`exp_neg_q30`].
const FAR: u32 = 22 << 16;

/// Degree of confusion of two textures (eq. 7, of the means of whitened slides) whose means are so far apart, Q16: 1 where
/// one was never learned. `fewer` is the smaller number of slides of the two.
fn confusion(apart: u32, fewer: u8) -> f32 {
    if fewer == 0 {
        return 1.0;
    }
    // |m_i - m_j|^2 / (8 (1 + 1/n))
    let n = u32::from(fewer);
    let exponent = match apart.checked_mul(n) {
        Some(product) => product / (8 * (n + 1)),
        None => (u64::from(apart) * u64::from(n) / u64::from(8 * (n + 1))) as u32,
    };
    exp_neg_q30(exponent) as f32 * (1.0 / (1u32 << 30) as f32)
}

/// Sum over the textures that are still likely of the numerator of eq. 11, after a movement.
pub(super) fn uncertainty<K: Kernels, const N: usize>(
    table: &Table<'_>,
    movement: u8,
    posterior: &[f32],
) -> f32 {
    let mut live: Vec<Candidate, N> = Vec::new();
    gather(table, movement, posterior, &mut live);
    let mut rest = live.as_mut_slice();
    while let Some((a, others)) = rest.split_first_mut() {
        K::candidate_distances(a, others);
        confuse_with(a, others);
        rest = others;
    }
    let left = |c: &Candidate| c.probability * c.confused / (c.probability + c.confused);
    live.iter().map(left).sum()
}

/// The textures that are still likely.
#[inline(never)]
pub(super) fn gather(
    table: &Table<'_>,
    movement: u8,
    posterior: &[f32],
    live: &mut VecView<Candidate>,
) {
    let (means, stride) = table.white_means(movement);
    let Contents::Fused(_, features) = table.contents() else {
        return;
    };
    let (trials, trials_stride) = table.trials_at(movement);
    let mask = mask(features.into());
    for (&probability, texture) in posterior.iter().zip(0..) {
        if probability >= super::NEGLIGIBLE {
            let mean = means.get(texture * stride..).unwrap_or_default();
            let slides = trials.get(texture * trials_stride).copied().unwrap_or(0);
            // there is room: as much as for the posterior
            let _ = live.push(Candidate::new(mean, &mask, probability, slides));
        }
    }
}

/// Confusion of one texture with all others, whose distances from it are known.
#[inline(never)]
pub(super) fn confuse_with(a: &mut Candidate, others: &mut [Candidate]) {
    let mut confused = a.confused;
    for b in others {
        // the last factor of the exponent is 2 at most
        let far = b.distance >= u64::from(16 * FAR);
        if far && a.slides > 0 && b.slides > 0 {
            continue;
        }
        // no distance counts where one was never learned
        let apart = if far { 0 } else { b.distance as u32 };
        let confusion = confusion(apart, a.slides.min(b.slides));
        confused += confusion * b.probability;
        b.confused += confusion * a.probability;
    }
    a.confused = confused;
}
