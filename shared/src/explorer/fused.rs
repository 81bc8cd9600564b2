//! The fused way of deciding: how well the whitened slides of a visit fit each texture, in fixed point.
//!
//! At each movement the running mean of the visit's slides is compared with the texture's mean, as Student's t with 8
//! degrees of freedom. A further slide replaces what the movement said before: adding to it would count the error of the
//! texture's own mean again with every slide.

use heapless::Vec;

use crate::fixed::{exp_neg_q30, ln_q16};
use crate::fused::{MAX_FEATURES, Vector, white};
use crate::table::{MAX_MOVEMENTS, Table};

/// Degrees of freedom of Student's t.
const FREEDOM: i64 = 8;
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

/// |a - b|^2 of two whitened vectors, Q16.
pub(super) fn distance(a: impl Iterator<Item = i16>, b: impl Iterator<Item = i16>) -> u64 {
    a.zip(b)
        .map(|(a, b)| {
            let apart = i64::from(a) - i64::from(b);
            (apart * apart) as u64
        })
        .sum()
}

/// What Student's t makes of `k` slides against a mean of `n`: 1/(8 v) of the variance v = 1/k + 1/n in Q16, and
/// -(d/2) ln v in Q16.
#[derive(Clone, Copy)]
struct Spread {
    slides: u8,
    narrowness: u64,
    norm: i64,
}

impl Spread {
    fn new(k: u8, n: u8, features: usize) -> Self {
        let (k64, n64) = (u64::from(k), u64::from(n));
        let narrowness = ((k64 * n64) << 16) / (8 * (k64 + n64));
        Self {
            slides: n,
            narrowness,
            norm: features as i64 * i64::from(ln_q16(8 * narrowness)) / 2,
        }
    }

    /// ln of the likelihood up to a constant, Q16.
    fn likelihood(&self, distance: u64, features: usize) -> i32 {
        let odds = (1 << 16) + (distance.saturating_mul(self.narrowness) >> 16);
        let tail = (FREEDOM + features as i64) * i64::from(ln_q16(odds)) / 2;
        // some 60 at most: 2^22 in Q16
        (self.norm - tail) as i32
    }
}

/// The likelihood of a texture that the table does not have: means of textures scatter as those of the table do.
#[derive(Clone, Copy, Debug)]
struct Background {
    mean: [f32; MAX_FEATURES],
    variance: [f32; MAX_FEATURES],
    /// Whether there are textures enough to tell.
    known: bool,
}

impl Background {
    fn new(table: &Table<'_>, movement: u8) -> Self {
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

/// Sets the posterior of every texture from all slides of a visit; the log-odds that it
/// is none of them, `None` where the table has too few textures to tell.
pub(super) fn decide<const N: usize>(
    table: &Table<'_>,
    features: usize,
    visits: &Visits,
    is_candidate: impl Fn(u16) -> bool,
    posterior: &mut Vec<f32, N>,
) -> Option<f32> {
    let mut log: Vec<i32, N> = posterior.iter().map(|_| 0).collect();
    let (mut elsewhere, mut can_tell) = (0.0, true);
    for visit in visits {
        let mean = visit.mean(features);
        let background = Background::new(table, visit.movement);
        let unknown = background.likelihood(&mean, visit.slides);
        elsewhere += unknown;
        can_tell &= background.known;
        let untaught = (unknown * 65536.0) as i32;
        let mut spread = Spread::new(visit.slides, 1, features);
        for (log, texture) in log.iter_mut().zip(0..) {
            let trials = table.trials(texture, visit.movement);
            let likelihood = if trials == 0 {
                // as little is known of it here as of a texture that the table does not have
                untaught
            } else {
                if spread.slides != trials {
                    spread = Spread::new(visit.slides, trials, features);
                }
                let known = table.white_mean(texture, visit.movement);
                spread.likelihood(distance(mean.iter().copied(), known), features)
            };
            *log = log.saturating_add(likelihood);
        }
    }
    let candidates = || {
        log.iter()
            .zip(0..)
            .filter(|&(_, texture)| is_candidate(texture))
    };
    let top = candidates().map(|(&log, _)| log).max()?;
    let (mut sum, mut count) = (0u64, 0u32);
    for (&log, texture) in candidates() {
        let likely = exp_neg_q30(top.abs_diff(log));
        sum += u64::from(likely);
        count += 1;
        if let Some(p) = posterior.get_mut(usize::from(texture)) {
            *p = likely as f32;
        }
    }
    let sum = sum as f32;
    for (p, texture) in posterior.iter_mut().zip(0..) {
        *p = if is_candidate(texture) { *p / sum } else { 0.0 };
    }
    let average = top as f32 / 65536.0 + libm::logf(sum / (1 << 30) as f32 / count as f32);
    can_tell.then_some(elsewhere - average)
}

/// Degree of confusion of two textures at a movement (eq. 7, of the means of whitened slides): 1 where one was never
/// learned.
pub(super) fn confusion(table: &Table<'_>, movement: u8, a: u16, b: u16) -> f32 {
    let fewer = table.trials(a, movement).min(table.trials(b, movement));
    if fewer == 0 {
        return 1.0;
    }
    let apart = distance(table.white_mean(a, movement), table.white_mean(b, movement));
    // |m_i - m_j|^2 / (8 (1 + 1/n))
    let n = u64::from(fewer);
    let exponent = apart.saturating_mul(n) / (8 * (n + 1));
    let exponent = u32::try_from(exponent).unwrap_or(u32::MAX);
    exp_neg_q30(exponent) as f32 / (1u32 << 30) as f32
}
