//! The fused way of deciding where the table knows how its means go with the speed: each mean is moved to the speed of the
//! slides, and a slide of unknown speed is one of any.
//!
//! Slides of an episode at a movement have the mean m + B u, with the slope B of the texture and the mean u of their
//! ln(speed). Of u a part may be unknown: with its variance p the covariance V of the mean grows by p B B'. By Sherman and Morrison
//! the squared distance r' V^-1 r then falls by p (r' V^-1 B)^2 / (1 + p B' V^-1 B), and ln |V| grows by ln(1 + p B' V^-1 B).

use super::episode::{Episode, MovementSums};
use super::novelty::{NoveltyModel, Source, student_norm};
use super::spread::{DEGREES_OF_FREEDOM, Spread};
use super::whitened::q16;
use crate::dsp::fixed::ln_q16;
use crate::features::{MAX_FEATURES, Vector};
use crate::table::{Contents, PAIRS, SlopesView, Table, moved};

/// Whitened numbers, as many as the most features.
type White = [i16; MAX_FEATURES];

impl MovementSums {
    /// The mean of ln(speed) of its slides in 1/1024, and the variance of what of it is unknown.
    pub(super) fn pace(&self, slopes: &SlopesView<'_>) -> (i16, f32) {
        let (k, known) = (i32::from(self.slides.max(1)), i32::from(self.paces));
        let unknown = k - known;
        let sum = self.pace + unknown * i32::from(slopes.mean);
        let mean = sum.saturating_mul(2).saturating_add(k).div_euclid(2 * k);
        let variance = if unknown > 0 {
            slopes.variance * unknown as f32 / (k * k) as f32
        } else {
            0.0
        };
        (
            mean.clamp(i16::MIN.into(), i16::MAX.into()) as i16,
            variance,
        )
    }
}

/// As [`super::whitened::add_likelihoods`], with slopes; `odds` has space for as many numbers as `logs`.
#[inline(never)]
pub(super) fn add_likelihoods(
    table: &Table<'_>,
    episode: &Episode,
    novelty_models: &[NoveltyModel],
    drifting: bool,
    logs: &mut [i32],
    odds: &mut [f32],
) -> Option<(f32, bool)> {
    let Contents::Fused(_, features) = table.contents() else {
        return None;
    };
    let features = usize::from(features);
    let odds = odds.get_mut(..logs.len())?;
    odds.fill(0.0);
    let calibrated = novelty_models
        .first()
        .is_some_and(NoveltyModel::is_calibrated);
    let of_all = if calibrated {
        student_norm(features * episode.len())
    } else {
        0.0
    };
    let (mut elsewhere, mut can_tell) = (-of_all, true);
    for sums in episode {
        let mean = sums.mean(features);
        let slopes = table.slopes_at(sums.movement)?;
        let (pace, variance) = sums.pace(&slopes);
        let background = novelty_models
            .iter()
            .find(|b| b.movement == sums.movement)?;
        // what is not in the table goes with the speed as all textures do
        let slowed = table.at_movement_speed(None, sums.movement, &mean, pace);
        let unknown = if calibrated {
            background.population_likelihood(table, &slowed, sums.slides)
        } else {
            background.likelihood(table, &slowed, sums.slides)
        };
        elsewhere += unknown;
        can_tell &= background.source != Source::Nowhere;
        let column = table.column(sums.movement);
        let drifts = table.drifts(sums.movement).filter(|_| drifting);
        let mut spread: Option<Spread> = None;
        for ((log, odds), texture) in logs.iter_mut().zip(&mut *odds).zip(0..) {
            let slides = column.slides(texture);
            if slides == 0 {
                *log += q16(unknown);
                continue;
            }
            // mostly that of the texture before, which has as many slides
            let spread = match spread {
                Some(ref last) if last.slides == slides => last,
                _ => spread.insert(Spread::new(sums.slides, slides, features, drifts)),
            };
            let slope = numbers(slopes.column.mean(texture), features);
            let apart = apart(
                &mean,
                &numbers(column.mean(texture), features),
                &slope,
                pace,
            );
            let (off, growth) = distance(&apart, &slope, variance, &spread.narrowness);
            *odds += off;
            *log += spread.norm - (ln_q16((growth * 65536.0) as u64) >> 1);
        }
    }
    for ((log, odds), texture) in logs.iter_mut().zip(odds).zip(0..) {
        let taught = episode.iter();
        let taught = taught.filter(|sums| table.trials(texture, sums.movement) > 0);
        let taught = taught.count() * features;
        let weight = i64::from(DEGREES_OF_FREEDOM) + taught as i64;
        let tail = weight * i64::from(ln_q16((1 << 16) + (*odds * 65536.0) as u64));
        // 512/2 times 31 in Q16: 29 bits
        *log -= (tail >> 1) as i32;
        if calibrated && taught < features * episode.len() {
            *log += q16(student_norm(taught) - of_all);
        }
    }
    Some((elsewhere, can_tell))
}

fn numbers(bytes: &[u8], features: usize) -> White {
    let mut numbers = White::default();
    for (to, from) in numbers.iter_mut().zip(bytes.as_chunks().0).take(features) {
        *to = i16::from_le_bytes(*from);
    }
    numbers
}

/// How far a mean of slides at this pace is from that of a texture of this slope; 0 beyond the features.
fn apart(mean: &Vector, known: &White, slope: &White, pace: i16) -> White {
    let mut apart = White::default();
    let known = known.iter().zip(slope);
    for (apart, (z, (m, b))) in apart.iter_mut().zip(mean.iter().zip(known)) {
        *apart = z.saturating_sub(m.saturating_add(moved(*b, pace)));
    }
    apart
}

/// An eighth of the squared distance in spite of this variance of ln(speed), with a weight for each two numbers in Q16, and
/// by what it makes the determinant of the covariance grow.
fn distance(apart: &White, slope: &White, variance: f32, weights: &[u32; PAIRS]) -> (f32, f32) {
    let off = sum(apart, apart, weights);
    if variance <= 0.0 {
        return (off, 1.0);
    }
    // V^-1 is eight times the weights
    let p = 8.0 * variance;
    let (along, steep) = (sum(apart, slope, weights), sum(slope, slope, weights));
    let growth = 1.0 + p * steep;
    ((off - p * along * along / growth).max(0.0), growth)
}

/// Sum of the products of numbers in 1/256, times weights in Q16.
fn sum(a: &White, b: &White, weights: &[u32; PAIRS]) -> f32 {
    let pairs = a.as_chunks::<2>().0.iter().zip(b.as_chunks::<2>().0);
    let products = pairs.zip(weights).map(|(([a, c], [b, d]), weight)| {
        let of_two = i64::from(*a) * i64::from(*b) + i64::from(*c) * i64::from(*d);
        of_two * i64::from(*weight)
    });
    products.sum::<i64>() as f32 * (1.0 / 4_294_967_296.0)
}
