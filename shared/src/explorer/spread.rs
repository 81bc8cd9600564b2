//! The likelihood of a whitened mean as Student's t, in fixed point.

use crate::dsp::fixed::ln_q16;
use crate::table::{Numbers, PAIRS};

/// Degrees of freedom of Student's t in the fused way of deciding.
pub(super) const DEGREES_OF_FREEDOM: u8 = 8;

/// Student's t of `k` slides against a mean of `n`, whose difference has the variance v = 1/k + 1/n, and along each
/// axis that of the drift.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spread {
    pub(super) slides: u8,
    /// 1/(8 v) along each two axes in Q16: 20 bits at most.
    pub(super) narrowness: [u32; PAIRS],
    /// -1/2 of the sum of ln v, Q16.
    pub(super) norm: i32,
    pub(super) weight: i32,
}

impl Spread {
    /// Of `k` slides against a mean of `n`, none of them 0, of so many features that drift so much.
    pub(super) fn new(k: u8, n: u8, features: usize, drifts: Option<Numbers<'_>>) -> Self {
        let weight = i32::from(DEGREES_OF_FREEDOM) + features as i32;
        let Some(drifts) = drifts else {
            let (k32, n32) = (u32::from(k), u32::from(n));
            let of_v = u64::from(u32::from(DEGREES_OF_FREEDOM) * (k32 + n32));
            // 20 bits at most, as k and n have 8 each
            let narrowness = ((u64::from(k32 * n32) << 16) / of_v.max(1)) as u32;
            let ln_v = -i64::from(ln_q16(
                u64::from(DEGREES_OF_FREEDOM) * u64::from(narrowness),
            ));
            return Self {
                slides: n,
                narrowness: [narrowness; PAIRS],
                // ln v is 5 at most, times 14/2
                norm: (-(features as i64) * ln_v / 2) as i32,
                weight,
            };
        };
        let v = 1.0 / f32::from(k) + 1.0 / f32::from(n);
        let mut narrowness = [0; PAIRS];
        // two logarithms for all: variances are 2^-7 to 2^18, and products of seven numbers still
        let mut products = [1.0; 2];
        for ((slot, drift), at) in narrowness.iter_mut().zip(drifts).zip(0..) {
            let total = v + drift;
            *slot = (65536.0 / f32::from(DEGREES_OF_FREEDOM) / total) as u32;
            let [first, second] = &mut products;
            *first *= total;
            if 2 * at + 1 < features {
                *second *= total;
            }
        }
        let [first, second] = products.map(libm::logf);
        let ln = first + second;
        Self {
            slides: n,
            narrowness,
            norm: (ln * -32768.0) as i32,
            weight,
        }
    }

    /// ln of the likelihood up to a constant, Q16, at such a [`distance`].
    pub(super) fn likelihood(&self, distance: u64) -> i32 {
        let odds = (1 << 16) + (distance >> 16);
        // the odds are at least 1, their logarithm is 27 at most: neither is negative, nor beyond 21 bits times 22
        let tail = (self.weight * ln_q16(odds)) >> 1;
        // some 100 at most: 2^23 in Q16
        self.norm - tail
    }
}

/// Squared distance of two whitened means with a weight for each two numbers, Q32 where the weights are Q16: 54 bits
/// at most. What is more than 128 standard deviations apart counts as 128.
#[inline]
pub(super) fn distance(from: &[i16], mean: &[u8], weights: &[u32; PAIRS]) -> u64 {
    let (mean, _) = mean.as_chunks();
    let mut squares = from.iter().zip(mean).map(|(a, b)| {
        let apart = i32::from(a.saturating_sub(i16::from_le_bytes(*b)));
        // 2^30 at most
        (apart * apart) as u32
    });
    let mut sum = 0;
    for weight in weights {
        let pair = squares.next().unwrap_or(0) + squares.next().unwrap_or(0);
        sum += u64::from(pair) * u64::from(*weight);
    }
    sum
}
