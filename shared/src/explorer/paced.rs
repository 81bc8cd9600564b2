//! The fused way of deciding where the table knows how its means go with the speed: each mean is moved to the speed of
//! the slides, and a slide of unknown speed is one of any.
//!
//! Slides of an episode at a movement have the mean m + B u, with the slope B of the texture and the mean u of their
//! ln(speed). Of u a part may be unknown: with its variance p the covariance V of the mean grows by p B B'. By Sherman
//! and Morrison the squared distance r' V^-1 r then falls by p (r' V^-1 B)^2 / (1 + p B' V^-1 B), and ln |V| grows by
//! ln(1 + p B' V^-1 B).

use super::episode::MovementSums;
use crate::dsp::fixed::ln_q16;
use crate::features::{MAX_FEATURES, Vector};
use crate::table::{PAIRS, SlopesView, moved};

/// Whitened numbers, as many as the most features.
type White = [i16; MAX_FEATURES];

pub(super) struct Pace<'a> {
    /// Its mean, in 1/1024.
    pub(super) mean: i16,
    /// Variance of what of the mean is unknown.
    variance: f32,
    slopes: SlopesView<'a>,
}

impl MovementSums {
    pub(super) fn pace<'a>(&self, slopes: SlopesView<'a>) -> Pace<'a> {
        let (k, known) = (i32::from(self.slides.max(1)), i32::from(self.paces));
        let unknown = k - known;
        let sum = self.pace + unknown * i32::from(slopes.mean);
        let mean = sum.saturating_mul(2).saturating_add(k).div_euclid(2 * k);
        let variance = if unknown > 0 {
            slopes.variance * unknown as f32 / (k * k) as f32
        } else {
            0.0
        };
        Pace {
            mean: mean.clamp(i16::MIN.into(), i16::MAX.into()) as i16,
            variance,
            slopes,
        }
    }
}

impl Pace<'_> {
    /// An eighth of the squared distance of a mean of slides from that of a texture, with a weight for each two
    /// numbers, and by what half the logarithm of the determinant of the covariance grows: both in Q16.
    pub(super) fn distance(
        &self,
        texture: usize,
        mean: &Vector,
        known: &[u8],
        weights: &[u32; PAIRS],
    ) -> (f32, i32) {
        let slope = numbers(self.slopes.column.mean(texture), mean.len());
        let apart = apart(mean, &numbers(known, mean.len()), &slope, self.mean);
        let off = sum(&apart, &apart, weights);
        if self.variance <= 0.0 {
            return (off * 65536.0, 0);
        }
        // V^-1 is eight times the weights
        let p = 8.0 * self.variance;
        let along = sum(&apart, &slope, weights);
        let growth = 1.0 + p * sum(&slope, &slope, weights);
        let off = (off - p * along * along / growth).max(0.0);
        (off * 65536.0, ln_q16((growth * 65536.0) as u64) >> 1)
    }
}

fn numbers(bytes: &[u8], features: usize) -> White {
    let mut numbers = White::default();
    for (to, from) in numbers.iter_mut().zip(bytes.as_chunks().0).take(features) {
        *to = i16::from_le_bytes(*from);
    }
    numbers
}

/// Distance of a mean of slides at this pace from that of a texture of this slope; 0 beyond the features.
fn apart(mean: &Vector, known: &White, slope: &White, pace: i16) -> White {
    let mut apart = White::default();
    let known = known.iter().zip(slope);
    for (apart, (z, (m, b))) in apart.iter_mut().zip(mean.iter().zip(known)) {
        *apart = z.saturating_sub(m.saturating_add(moved(*b, pace)));
    }
    apart
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
