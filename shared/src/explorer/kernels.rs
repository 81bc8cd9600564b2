//! The inner loops of a decision, behind one type parameter: a chip may bring faster ones without touching the core.
//!
//! [`Plain`] is the reference. Another implementation must give the same integers, and the same floats to the bit.

use super::overlap::OVERLAP;
use crate::dsp::Plain;
use crate::dsp::fixed::{LN_2, LOG2_E, exp_neg_q30, exp2_neg_q30, ln_q16};
use crate::features::{MAX_FEATURES, Property};
use crate::table::{Gaussian, Gaussians, Numbers, PAIRS, Row, Words, dot, fill, products, words};

/// A texture that is still likely, while a movement is weighed. The order of the fields is fixed, for kernels that are not
/// written in Rust.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Candidate {
    /// Its whitened mean, filled up with zeros.
    pub mean: [i16; MAX_FEATURES],
    /// Sum of squares of the mean; `u32::MAX` where 32 bits do not hold it.
    pub square: u32,
    /// Its probability.
    pub probability: f32,
    /// Sum over all others of confusion times probability: the numerator of eq. 8.
    pub confused: f32,
    /// Slides that it was learned from.
    pub slides: u8,
}

impl Candidate {
    /// One that is not compared yet. Its mean begins where `known` does, `mask` is of its features, and what lies behind them
    /// does not count; each number is [`shrunk`] by one of `by`, if there are any.
    // words, not bytes: copying these would take longer than all else
    #[inline(always)]
    pub(crate) fn new(
        known: &[u8],
        mask: &Mask,
        by: Option<&Mask>,
        probability: f32,
        slides: u8,
    ) -> Self {
        let filled;
        let known = match known.first_chunk() {
            Some(known) => known,
            // the last of a table
            None => {
                filled = fill(known);
                &filled
            }
        };
        let ([a, b, c, d, e, f, g], [p, q, r, s, t, u, v]) = (words(known), *mask);
        // no loops: see `words`
        let mut words = [a & p, b & q, c & r, d & s, e & t, f & u, g & v];
        if let Some(&[i, j, k, l, m, n, o]) = by {
            let [a, b, c, d, e, f, g] = words;
            words = [
                shrunk(a, i),
                shrunk(b, j),
                shrunk(c, k),
                shrunk(d, l),
                shrunk(e, m),
                shrunk(f, n),
                shrunk(g, o),
            ];
        }
        let [a, b, c, d, e, f, g] = words;
        let square = dot(dot(dot(dot(0, a, a), b, b), c, c), d, d);
        let square = dot(dot(dot(square, e, e), f, f), g, g);
        let (low, high) = (|word: u32| word as i16, |word: u32| (word >> 16) as i16);
        #[rustfmt::skip]
        let mean = [
            low(a), high(a), low(b), high(b), low(c), high(c), low(d), high(d),
            low(e), high(e), low(f), high(f), low(g), high(g),
        ];
        Self {
            mean,
            square: u32::try_from(square).unwrap_or(u32::MAX),
            probability,
            confused: 0.0,
            slides,
        }
    }
}

/// Which features of whitened means count, two to a word.
pub(crate) type Mask = [u32; MAX_FEATURES / 2];

/// The first `features` of them.
pub(crate) fn mask(features: usize) -> Mask {
    let mut mask = [0; MAX_FEATURES / 2];
    for (word, at) in mask.iter_mut().zip((0..features).step_by(2)) {
        *word = if at + 1 < features {
            u32::MAX
        } else {
            u32::from(u16::MAX)
        };
    }
    mask
}

/// A texture that is still likely, while an expected uncertainty is computed from the Gaussians of one property. The order of
/// the fields is fixed, as that of [`Candidate`].
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct LiveGaussian {
    /// Its probability times `root`.
    pub weight: f32,
    /// Sum over all others of confusion times probability, the numerator of eq. 8, by `root`.
    pub confused: f32,
    /// What is expected.
    pub mean: f32,
    /// Its variance, in such a unit that distances are in steps of [`OVERLAP`].
    pub variance: f32,
    /// What it contributes to a degree of confusion by its standard deviation alone.
    pub root: f32,
}

impl LiveGaussian {
    /// One that is not compared yet.
    #[inline(always)]
    pub(crate) fn new(probability: f32, of: Gaussian, sqrt: fn(f32) -> f32) -> Self {
        /// 100 ln 2 / 31^2: (m_i - m_j)^2 / 4 octaves are 5^2 parts of 31^2 steps.
        const UNIT: f32 = 0.072_127_7;
        /// The square root of twice that.
        const ROOT: f32 = 0.379_809_68;
        let root = sqrt(ROOT * of.sd);
        Self {
            weight: probability * root,
            confused: 0.0,
            mean: of.mean,
            variance: UNIT * of.sd * of.sd,
            root,
        }
    }
}

/// Numerator of eq. 11 for a texture of such a weight, root and sum ([`LiveGaussian`]).
#[inline]
pub(crate) fn left(weight: f32, root: f32, confused: f32) -> f32 {
    let (probability, confused) = (weight / root, confused * root);
    probability * confused / (probability + confused)
}

/// A texture that is still likely, while an expected uncertainty is computed from Gaussians of several properties.
#[derive(Clone, Copy, Debug)]
pub struct LiveTexture {
    /// Its probability.
    pub probability: f32,
    /// Sum over all others of confusion times probability: the numerator of eq. 8.
    pub confused: f32,
    /// What is expected of the properties looked at, those first.
    pub expected: [Gaussian; Property::ALL.len()],
}

impl LiveTexture {
    /// One that is not compared yet, of which nothing is expected.
    pub const fn new(probability: f32) -> Self {
        Self {
            probability,
            confused: 0.0,
            expected: [Gaussian { mean: 0.0, sd: 1.0 }; Property::ALL.len()],
        }
    }
}

/// Textures that far apart are not confused: 25 ln 2, where the exponential is half of the last place of a number near 1.
pub(crate) const FAR: f32 = 17.33;

/// What squared distances of whitened means, Q16, are worth (eq. 7).
#[derive(Clone, Copy, Debug)]
pub struct Likeness {
    /// The degree of confusion is 2 to the power of less the distance times this, of which the upper half is in Q18.
    pub octaves: u32,
    /// Means that far apart, an even number, are not confused: 25 octaves, as with Gaussians.
    pub far: u32,
}

impl Likeness {
    /// Of two textures, of which the one with fewer slides was learned from so many, 1 at least.
    #[inline(always)]
    pub fn new(fewer: u8) -> Self {
        // the exponent is the squared distance times n / (8 (n + 1))
        let n = u32::from(fewer.max(1));
        let far = ((25 * 8 * LN_2 as u64) >> 16) as u32;
        Self {
            octaves: 2 * LOG2_E / (n + 1) * n,
            far: (far * (n + 1) / n) & !1,
        }
    }
}

/// Kernels for whitened means may count on sums of squares below this, 90 standard deviations: distances have 31 bits then.
pub const MOST_SQUARE: u32 = 1 << 29;

/// Degree of confusion of two textures by one property (eq. 7), with this square root.
#[inline]
pub(crate) fn confused(a: Gaussian, b: Gaussian, sqrt: fn(f32) -> f32) -> f32 {
    // a division takes 14 cycles
    let narrowness = 1.0 / (a.sd * a.sd + b.sd * b.sd);
    let apart = a.mean - b.mean;
    let exponent = apart * apart * (0.25 * narrowness);
    if exponent > FAR {
        return 0.0;
    }
    sqrt(2.0 * a.sd * b.sd * narrowness) * exp_neg(exponent)
}

/// Degrees of freedom of Student's t in the fused way of deciding.
pub(crate) const DEGREES_OF_FREEDOM: u8 = 8;

/// Shrinks two numbers in a word by two others, in 1/2^15.
#[inline(always)]
pub(crate) fn shrunk(word: u32, by: u32) -> u32 {
    let low = (i32::from(word as i16) * i32::from(by as i16)) >> 15;
    let high = ((word as i32 >> 16) * (by as i32 >> 16)) >> 15;
    (high as u32) << 16 | (low as u32 & 0xffff)
}

/// By what the axes of a movement are shrunk, to compare textures learned from `n` slides in spite of this drift: there the
/// mean of a slide has the variance 1 + 1/n + delta instead of 1 + 1/n.
pub(crate) fn scales(drifts: Numbers<'_>, n: u8, sqrt: fn(f32) -> f32) -> Mask {
    let v = 1.0 + 1.0 / f32::from(n.max(1));
    let mut scales = [0; PAIRS];
    for (pair, drift) in scales.iter_mut().zip(drifts) {
        let scale = (sqrt(v / (v + drift)) * 32767.0) as u32;
        *pair = scale << 16 | scale;
    }
    scales
}

/// What Student's t makes of `k` slides against a mean of `n`, whose difference has the variance v = 1/k + 1/n, and along
/// each axis that of the drift.
#[derive(Clone, Copy, Debug)]
pub struct Spread {
    /// n.
    pub slides: u8,
    /// 1/(8 v) along each two axes in Q16: 20 bits at most.
    pub narrowness: [u32; PAIRS],
    /// -1/2 of the sum of ln v, Q16.
    pub norm: i32,
    /// 8 + d.
    pub weight: i32,
}

impl Spread {
    /// Of `k` slides against a mean of `n`, none of them 0, of so many features that drift so much.
    pub(crate) fn new(k: u8, n: u8, features: usize, drifts: Option<Numbers<'_>>) -> Self {
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
    pub(crate) fn likelihood(&self, distance: u64) -> i32 {
        let odds = (1 << 16) + (distance >> 16);
        // the odds are at least 1, their logarithm is 27 at most: neither is negative, nor beyond 21 bits times 22
        let tail = (self.weight * ln_q16(odds)) >> 1;
        // some 100 at most: 2^23 in Q16
        self.norm - tail
    }
}

/// Squared distance of two whitened means with a weight for each two numbers, Q32 where the weights are Q16: 54 bits at most.
/// What is more than 128 standard deviations apart counts as 128.
#[inline]
pub(crate) fn distance(from: &[i16], mean: &[u8], weights: &[u32; PAIRS]) -> u64 {
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

/// A property this many standard deviations off, squared and halved, counts as no farther: 1024 in Q16.
const MOST_OFF: i32 = (1 << 26) - 1;

/// What costs the time of a decision.
pub trait Kernels: crate::dsp::Kernels {
    /// Sets logarithms to 0, the prior.
    fn reset_to_prior(logs: &mut [i32]);

    /// Adds the likelihood (ln, Q16, up to a constant) of textures when the mean of some slides is `from`, to `logs`, one
    /// texture after another. `means` has their whitened means, one at the beginning of every `stride` bytes, learned from
    /// as many slides as `spread` is of. Returns for how many: it may stop at one that is too far away for a short way.
    fn add_likelihoods(
        from: &[i16],
        means: &[u8],
        stride: usize,
        spread: &Spread,
        logs: &mut [i32],
    ) -> usize;

    /// Adds the likelihood (eq. 4; ln, Q16, up to a constant) of every texture when a property is `x`, in steps of the
    /// means. Where nothing was learned, the standard deviation is 0, it adds nothing.
    fn add_gaussians(x: f32, known: &Gaussians<'_>, logs: &mut [i32]);

    /// The posterior (eq. 3) from its logarithms, Q16, of which there are as many, at least one. Returns the greatest of
    /// them, and the sum of the probabilities in parts of that one's, Q30. No two logarithms are 2^31 apart.
    fn posterior(logs: &[i32], posterior: &mut [f32]) -> (i32, f32);

    /// The sum of the products of the numbers of a row, which need not be aligned, with others.
    fn products(row: &Row, others: &Words) -> i64 {
        products(row, others)
    }

    /// Adds the confusion of `a` with each of `others` (eq. 7), by their whitened means, to what they are confused with. All
    /// sums of squares are below [`MOST_SQUARE`]; that of `a` counts as the next even number. Of `a` and each of them, the one
    /// with fewer slides was learned from `fewer`, 1 at least.
    fn confuse_whitened(a: &mut Candidate, others: &mut [Candidate], fewer: u8);

    /// Adds the confusion of `a` with each of `others` (eq. 7) to what they are confused with. Means and standard deviations
    /// are a table's: finite, and these above 0.
    fn confuse(a: &mut LiveGaussian, others: &mut [LiveGaussian]);

    /// Square root of a number that is not negative, correctly rounded (IEEE 754).
    fn sqrt(x: f32) -> f32;
}

impl Kernels for Plain {
    fn reset_to_prior(logs: &mut [i32]) {
        logs.fill(0);
    }

    fn add_likelihoods(
        from: &[i16],
        means: &[u8],
        stride: usize,
        spread: &Spread,
        logs: &mut [i32],
    ) -> usize {
        let known = logs.iter_mut().zip(means.chunks(stride.max(1)));
        known
            .map(|(log, mean)| *log += spread.likelihood(distance(from, mean, &spread.narrowness)))
            .count()
    }

    fn add_gaussians(x: f32, known: &Gaussians<'_>, logs: &mut [i32]) {
        let scale = known.scale();
        for (log, [mean, sd]) in logs.iter_mut().zip(known.cells()) {
            let (mean, sd) = (mean as i16, sd);
            if sd > 0 {
                let z = (x - f32::from(mean)) / f32::from(sd) * scale;
                // to the nearest number that 32 bits hold
                let off = (z * z) as i32;
                *log -= off.min(MOST_OFF) + ln_q16(u64::from(sd) << 16);
            }
        }
    }

    fn posterior(logs: &[i32], posterior: &mut [f32]) -> (i32, f32) {
        let top = logs.iter().copied().max().unwrap_or(0);
        let mut sum = 0u64;
        for (p, log) in posterior.iter_mut().zip(logs) {
            let likely = exp_neg_q30(top.abs_diff(*log));
            sum += u64::from(likely);
            *p = likely as f32;
        }
        let total = sum as f32;
        for p in posterior {
            *p /= total;
        }
        (top, total)
    }

    #[inline(never)]
    fn confuse_whitened(a: &mut Candidate, others: &mut [Candidate], fewer: u8) {
        let Likeness { octaves, far } = Likeness::new(fewer);
        let mut sum = a.confused;
        for b in others {
            let squares = a.mean.iter().zip(&b.mean).map(|(a, b)| {
                let apart = i64::from(*a) - i64::from(*b);
                (apart * apart) as u64
            });
            let distance = squares.sum::<u64>() + u64::from(a.square & 1);
            if distance < u64::from(far) {
                let octaves = (distance * u64::from(octaves)) >> 32;
                let confusion = exp2_neg_q30(octaves as u32) as f32 * (1.0 / (1u32 << 30) as f32);
                sum += confusion * b.probability;
                b.confused += confusion * a.probability;
            }
        }
        a.confused = sum;
    }

    fn confuse(a: &mut LiveGaussian, others: &mut [LiveGaussian]) {
        let mut sum = a.confused;
        for b in others {
            let narrowness = 1.0 / Self::sqrt(a.variance + b.variance);
            let apart = (a.mean - b.mean) * narrowness;
            let step = (apart as i32).clamp(-32, 31) + 32;
            let [constant, linear, square, _] =
                OVERLAP.get(step as usize).copied().unwrap_or_default();
            let confusion = (constant + (linear + square * apart) * apart) * narrowness;
            sum += confusion * b.weight;
            b.confused += confusion * a.weight;
        }
        a.confused = sum;
    }

    fn sqrt(x: f32) -> f32 {
        libm::sqrtf(x)
    }
}

/// 1.5 * 2^23: adding it leaves a number's whole part in the lowest bits.
const ROUND: f32 = 12_582_912.0;
/// 2^x for -0.5..=0.5, from the sixth power on; after them comes 1 (Cephes, exp2f).
const EXP2: [f32; 6] = [
    1.535_336_2e-4,
    1.339_887_4e-3,
    9.618_437e-3,
    5.550_332_5e-2,
    2.402_264_8e-1,
    6.931_472e-1,
];

/// e^(-x) of an `x` from 0 to 86, relative error at most 4e-7 and 8e-8 x; 0 beyond. The same operations on chip and PC.
pub fn exp_neg(x: f32) -> f32 {
    if x > 86.0 {
        return 0.0;
    }
    let octaves = x * -core::f32::consts::LOG2_E;
    let shifted = octaves + ROUND;
    let part = octaves - (shifted - ROUND);
    let [first, rest @ ..] = EXP2;
    let p = rest.iter().fold(first, |p, next| p * part + next);
    let p = p * part + 1.0;
    // times 2^whole: into the exponent
    f32::from_bits(p.to_bits().wrapping_add(shifted.to_bits() << 23))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_neg_is_the_exponential() {
        assert_eq!(exp_neg(0.0), 1.0);
        assert_eq!(exp_neg(86.1), 0.0);
        assert_eq!(exp_neg(f32::INFINITY), 0.0);
        for n in 0..860_000 {
            let x = n as f32 * 1e-4;
            // polynomial and its roundings; the argument in octaves is rounded twice, by half of 2^-23 and log2 e's 2^-26
            let bound = 4e-7 + 8e-8 * f64::from(x);
            let exact = (-f64::from(x)).exp();
            assert!((f64::from(exp_neg(x)) / exact - 1.0).abs() < bound, "{x}");
        }
    }
}
