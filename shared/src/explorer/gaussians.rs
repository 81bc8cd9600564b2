//! The confusion of textures (eq. 7) by Gaussians of their properties.

use heapless::VecView;

use super::config::NEGLIGIBLE;
use super::overlap::OVERLAP;
use crate::features::Property;
use crate::table::{Action, Gaussian, Table};

/// A texture that is still likely, while an expected uncertainty is computed from the Gaussians of one property.
#[derive(Clone, Copy, Debug)]
pub(super) struct LiveGaussian {
    pub(super) weight: f32,
    /// Sum over all others of confusion times probability, the numerator of eq. 8, by `root`.
    pub(super) confused: f32,
    /// A 32nd of what is expected.
    pub(super) mean: f32,
    /// Its variance, in such a unit that distances are in steps of [`OVERLAP`].
    pub(super) variance: f32,
    /// Its contribution to a degree of confusion by its standard deviation alone.
    pub(super) root: f32,
}

impl LiveGaussian {
    fn new(probability: f32, of: Gaussian) -> Self {
        /// 100 ln 2 / 31^2: (m_i - m_j)^2 / 4 octaves are 5^2 parts of 31^2 steps.
        const UNIT: f32 = 0.072_127_7;
        /// The square root of twice that.
        const ROOT: f32 = 0.379_809_68;
        let root = libm::sqrtf(ROOT * of.sd);
        Self {
            weight: probability * root,
            confused: 0.0,
            mean: of.mean / 32.0,
            variance: UNIT * of.sd * of.sd,
            root,
        }
    }
}

/// Numerator of eq. 11 for a texture of such a weight, root and sum ([`LiveGaussian`]).
#[inline]
pub(super) fn left(weight: f32, root: f32, confused: f32) -> f32 {
    let (probability, confused) = (weight / root, confused * root);
    probability * confused / (probability + confused)
}

/// A texture that is still likely, while an expected uncertainty is computed from Gaussians of several properties.
#[derive(Clone, Copy, Debug)]
pub(super) struct LiveTexture {
    pub(super) probability: f32,
    /// Sum over all others of confusion times probability: the numerator of eq. 8.
    pub(super) confused: f32,
    /// The expectations of the properties looked at, those first.
    pub(super) expected: [Gaussian; Property::ALL.len()],
}

impl LiveTexture {
    pub(super) const fn new(probability: f32) -> Self {
        Self {
            probability,
            confused: 0.0,
            expected: [Gaussian { mean: 0.0, sd: 1.0 }; Property::ALL.len()],
        }
    }
}

/// Textures that far apart are not confused: 25 ln 2, where the exponential is half of the last place of a number near
/// 1.
pub(super) const FAR: f32 = 17.33;

/// Degree of confusion of two textures by one property (eq. 7).
#[inline]
pub(super) fn confused(a: Gaussian, b: Gaussian) -> f32 {
    // a division takes 14 cycles
    let narrowness = 1.0 / (a.sd * a.sd + b.sd * b.sd);
    let apart = a.mean - b.mean;
    let exponent = apart * apart * (0.25 * narrowness);
    if exponent > FAR {
        return 0.0;
    }
    libm::sqrtf(2.0 * a.sd * b.sd * narrowness) * exp_neg(exponent)
}

const UNKNOWN: Gaussian = Gaussian { mean: 0.0, sd: 1.0 };

#[inline(never)]
pub(super) fn gather_one(
    table: &Table<'_>,
    action: Action,
    posterior: &[f32],
    live: &mut VecView<LiveGaussian>,
) {
    let known = table.gaussians(action);
    for (&probability, texture) in posterior.iter().zip(0..) {
        if probability >= NEGLIGIBLE {
            let known = known.get(texture);
            let candidate = LiveGaussian::new(probability, known.unwrap_or(UNKNOWN));
            // `live` has space: it is as long as the posterior
            let _ = live.push(candidate);
        }
    }
}

#[inline(never)]
pub(super) fn push(live: &mut VecView<LiveGaussian>, probability: f32, expected: Option<Gaussian>) {
    // `live` has space: it is as long as the posterior
    let _ = live.push(LiveGaussian::new(probability, expected.unwrap_or(UNKNOWN)));
}

#[inline(never)]
pub(super) fn uncertainty_of_one(live: &mut [LiveGaussian]) -> f32 {
    let mut rest = &mut *live;
    while let Some((a, others)) = rest.split_first_mut() {
        confuse(a, others);
        rest = others;
    }
    live.iter()
        .map(|c| left(c.weight, c.root, c.confused))
        .sum()
}

/// Expected uncertainty (eq. 11) of these textures, of which so many properties are looked at.
#[inline(never)]
pub(super) fn uncertainty_of(live: &mut [LiveTexture], properties: usize) -> f32 {
    let mut rest = &mut *live;
    while let Some((a, others)) = rest.split_first_mut() {
        confuse_with(a, others, properties);
        rest = others;
    }
    live.iter()
        .map(|c| left(c.probability, 1.0, c.confused))
        .sum()
}

/// Adds the confusion of `a` with each of `others` (eq. 7) to what they are confused with. Means and standard
/// deviations are a table's: finite, and these above 0.
pub(super) fn confuse(a: &mut LiveGaussian, others: &mut [LiveGaussian]) {
    let LiveGaussian {
        weight,
        mean,
        variance,
        ..
    } = *a;
    let mut sum = a.confused;
    for b in others {
        let (apart, variance) = (mean - b.mean, variance + b.variance);
        // beyond 32 steps nothing is added, and the root takes most of the time
        if apart * apart <= variance {
            let narrowness = 32.0 / root(variance);
            let apart = apart * narrowness;
            let step = (apart as i32).clamp(-32, 31);
            // it is always there
            let coefficients = OVERLAP.get(step as usize & 63);
            let [constant, linear, square, _] = coefficients.copied().unwrap_or_default();
            let confusion = (constant + (linear + square * apart) * apart) * narrowness;
            sum += confusion * b.weight;
            b.confused += confusion * weight;
        }
    }
    a.confused = sum;
}

/// Confusion of one texture with all others (eq. 7), by so many properties.
#[inline(always)]
pub(super) fn confuse_with(a: &mut LiveTexture, others: &mut [LiveTexture], properties: usize) {
    for b in others {
        let pairs = a.expected.iter().zip(&b.expected).take(properties);
        let confusion: f32 = pairs.map(|(a, b)| confused(*a, *b)).product();
        a.confused += confusion * b.probability;
        b.confused += confusion * a.probability;
    }
}

/// 1/sqrt in Q32 of the numbers from 2 to 4, then of those from 1 to 2, in 64 steps each; 16 bits count.
const RECIPROCAL_ROOTS: [u32; 128] = reciprocal_roots();

#[expect(
    clippy::indexing_slicing,
    reason = "the compiler runs it, and has no iterators"
)]
const fn reciprocal_roots() -> [u32; 128] {
    let mut table = [0; 128];
    let mut n = 0;
    while n < table.len() {
        // in the middle of the step
        let of = match n {
            0..64 => 2.0 + (n as f64 + 0.5) / 32.0,
            _ => 1.0 + (n as f64 - 63.5) / 64.0,
        };
        let (mut root, mut turns) = (0.7, 0);
        while turns < 10 {
            root *= 1.5 - 0.5 * of * root * root;
            turns += 1;
        }
        table[n] = ((root * 65536.0) as u32) << 16;
        n += 1;
    }
    table
}

/// The square root of a normal number above 0, correctly rounded, in a third of the time that `libm` takes for it on
/// the chip: Goldschmidt's iterations in whole numbers.
#[inline(always)]
fn root(x: f32) -> f32 {
    const THREE: u32 = 3 << 30;
    let high = |a: u32, b: u32| ((u64::from(a) * u64::from(b)) >> 32) as u32;
    let bits = x.to_bits();
    // from 1 to 4, in Q30
    let mantissa = (bits << 8 | 1 << 31) >> (bits >> 23 & 1);
    // it is always there
    let reciprocal = RECIPROCAL_ROOTS.get((bits >> 17) as usize & 127);
    let reciprocal = reciprocal.copied().unwrap_or_default();
    let root = high(mantissa, reciprocal);
    let by = THREE.wrapping_sub(high(root, reciprocal));
    let (reciprocal, root) = (high(reciprocal, by), high(root, by));
    let by = THREE.wrapping_sub(high(root, reciprocal) << 2);
    let root = high(root, by) >> 5;
    // it is at most one step of the last place too small
    let rest = (mantissa << 16).wrapping_sub(root.wrapping_mul(root));
    let root = root + (root.wrapping_sub(rest) >> 31);
    let exponent = (bits >> 1).wrapping_add(0x1fc0_0000) & 0xff80_0000;
    f32::from_bits(exponent | root & 0x7f_ffff)
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
pub(super) fn exp_neg(x: f32) -> f32 {
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
    fn the_root_is_that_of_the_fpu() {
        // all mantissas with an odd exponent and with an even one
        for bits in 0x3f00_0000..0x4000_0000 {
            let x = f32::from_bits(bits);
            assert_eq!(root(x), x.sqrt(), "{x}");
        }
        for x in [f32::MIN_POSITIVE, 1e-20, 2.5e-8, 3e7, f32::MAX] {
            assert_eq!(root(x), x.sqrt(), "{x}");
        }
    }

    #[test]
    fn exp_neg_is_the_exponential() {
        assert_eq!(exp_neg(0.0), 1.0);
        assert_eq!(exp_neg(86.1), 0.0);
        assert_eq!(exp_neg(f32::INFINITY), 0.0);
        for n in 0..860_000 {
            let x = n as f32 * 1e-4;
            // polynomial and its roundings; the argument in octaves is rounded twice, by half of 2^-23 and log2 e's
            // 2^-26
            let bound = 4e-7 + 8e-8 * f64::from(x);
            let exact = (-f64::from(x)).exp();
            assert!((f64::from(exp_neg(x)) / exact - 1.0).abs() < bound, "{x}");
        }
    }
}
