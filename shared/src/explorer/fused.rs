//! The fused way of deciding: how well the whitened slides of a visit fit each texture, in fixed point.
//!
//! At each movement the running mean of the visit's slides is compared with the texture's mean, as Student's t with 8
//! degrees of freedom. A further slide replaces what the movement said before: adding to it would count the error of the
//! texture's own mean again with every slide.

use heapless::{Vec, VecView};

use super::kernels::{Candidate, FREEDOM, Kernels, Spread, distance, mask};
use crate::features::{MAX_FEATURES, Vector};
use crate::fixed::exp_neg_q30;
use crate::table::{Contents, MAX_MOVEMENTS, Table};
use crate::table::{oas, white};
use crate::up_to;

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
        if self.slides == 1 {
            // without divisions
            let slide = self.white.iter().take(features);
            return up_to(slide.map(|&z| z as i16));
        }
        let n = i32::from(self.slides.max(1));
        let rounded = |sum: i32| sum.saturating_mul(2).saturating_add(n).div_euclid(2 * n);
        // a mean of i16
        let means = self.white.iter().take(features);
        up_to(means.map(|&sum| rounded(sum) as i16))
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
    /// From how many slides all textures were learned, if it was as many.
    slides: Option<u8>,
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
        let slides = table.trials(0, movement);
        let same = (0..table.textures()).all(|texture| table.trials(texture, movement) == slides);
        let step = white(1);
        let mut background = Self {
            movement,
            mean: sum.map(|sum| sum as f32 / n * step),
            variance: [WIDE; MAX_FEATURES],
            known,
            slides: same.then_some(slides),
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
        // two logarithms for all: variances are 2^-8 to 2^14, and products of seven numbers still
        const HALF: usize = MAX_FEATURES / 2;
        let known = self.mean.chunks(HALF).zip(self.variance.chunks(HALF));
        for (means, (known, variances)) in mean.chunks(HALF).zip(known) {
            let mut product = 1.0;
            for ((z, m), variance) in means.iter().zip(known).zip(variances) {
                let total = variance + v;
                let apart = white(*z) - m;
                product *= total;
                distance += apart * apart / total;
            }
            norm += libm::logf(product);
        }
        let freedom = f32::from(FREEDOM);
        let tail = (freedom + mean.len() as f32) / 2.0;
        -0.5 * norm - tail * libm::log1pf(distance / freedom)
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

/// [`Kernels::add_likelihoods`].
type AddLikelihoods = fn(&[i16], &[u8], usize, &Spread, &mut [i32]) -> usize;

/// Adds the logarithms of the likelihoods (Q16, up to a constant) of all textures after the slides of a visit to `logs`; that of
/// a texture that the table does not have, and whether the table has textures enough to tell it.
// not generic: so it is compiled with this crate, for speed
#[inline(never)]
pub(super) fn add_likelihoods(
    table: &Table<'_>,
    visits: &Visits,
    backgrounds: &[Background],
    logs: &mut [i32],
    add: AddLikelihoods,
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
        // as little is known of a texture that was never felt here as of one that the table does not have
        let untaught = (unknown * 65536.0) as i32;
        let column = table.column(visit.movement);
        let mut rest = &mut *logs;
        let mut texture = 0;
        while !rest.is_empty() {
            let slides = column.slides(texture);
            let same = if background.slides.is_some() {
                rest.len()
            } else {
                let others = (texture..).zip(&*rest);
                others
                    .take_while(|(other, _)| column.slides(*other) == slides)
                    .count()
            };
            let Some((these, others)) = rest.split_at_mut_checked(same) else {
                break;
            };
            if slides == 0 {
                these.iter_mut().for_each(|log| *log += untaught);
            } else {
                let spread = Spread::new(visit.slides, slides, features);
                let mut done = 0;
                loop {
                    let to_do = these.get_mut(done..).unwrap_or_default();
                    let means = column.mean(texture + done);
                    done += add(&mean, means, column.stride, &spread, to_do);
                    // one that is too far away
                    let Some(log) = these.get_mut(done) else {
                        break;
                    };
                    *log += spread.likelihood(distance(&mean, column.mean(texture + done)));
                    done += 1;
                }
            }
            rest = others;
            texture += same;
        }
    }
    Some((elsewhere, can_tell))
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
    let Contents::Fused(_, features) = table.contents() else {
        return;
    };
    let column = table.column(movement);
    let mask = mask(features.into());
    for (&probability, texture) in posterior.iter().zip(0..) {
        if probability >= super::NEGLIGIBLE {
            let (mean, slides) = (column.mean(texture), column.slides(texture));
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
