//! The inner loops, behind one type parameter: a chip may bring faster ones without touching the core.
//!
//! [`Plain`] is the reference. Another implementation must give the same integers, and the same floats to the bit.

use crate::fir::{TAPS, Taps};
use crate::fused::MAX_FEATURES;
use crate::spectrum::{FRAME, FrameSum};

/// A texture that is still likely, while a movement is weighed. The order of the fields is fixed, for kernels that are not
/// written in Rust.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Candidate {
    /// Its whitened mean, filled up with zeros: [`crate::fused`].
    pub mean: [i16; MAX_FEATURES],
    /// Its probability.
    pub probability: f32,
    /// Sum of squares of the mean, which [`Candidate::new`] computes.
    pub square: u64,
    /// Squared distance from the texture that it is compared with.
    pub distance: u64,
    /// Sum over all others of confusion times probability: the numerator of eq. 8.
    pub confused: f32,
    /// Slides that it was learned from.
    pub slides: u8,
}

impl Candidate {
    /// One that is not compared yet, from the bytes of its mean.
    pub fn new(known: &[u8], probability: f32, slides: u8) -> Self {
        let mut mean = [0; MAX_FEATURES];
        let mut square = 0;
        for (to, from) in mean.iter_mut().zip(known.as_chunks().0) {
            *to = i16::from_le_bytes(*from);
            square += i64::from(*to) * i64::from(*to);
        }
        Self {
            mean,
            probability,
            square: square as u64,
            distance: 0,
            confused: 0.0,
            slides,
        }
    }
}

/// What costs the time of a slide and of a decision.
pub trait Kernels {
    /// Filters `samples` and returns the sum of the squared outputs, in Q14 counts^2: each output is the sum of products
    /// (Q15) rounded to Q7.
    ///
    /// The first output is due at sample `TAPS - 1` (those before it are history), so there are
    /// `samples.len() - (TAPS - 1)` outputs, and none of fewer samples. No sample is outside -4096..=4095, which keeps
    /// the sum of products inside i32.
    fn band_energy(taps: &Taps, samples: &[i16]) -> u64;

    /// Multiplies one frame by the window, transforms it and adds its power to `sum`.
    fn add_frame(window: &[f32; FRAME], frame: &[i16; FRAME], sum: &mut FrameSum);

    /// Squared distances of `from` to whitened means: `means` has one at the beginning of every `stride` bytes, numbers of 16
    /// bits, little-endian, as many as `from` has. Where there are fewer means than distances, the others stay.
    fn distances(from: &[i16], means: &[u8], stride: usize, distances: &mut [u64]);

    /// Sets the squared distance of each of `others` from the mean of `from`.
    fn candidate_distances(from: &Candidate, others: &mut [Candidate]);

    /// Square root of a number that is not negative, correctly rounded (IEEE 754).
    fn sqrt(x: f32) -> f32;
}

/// Plain Rust, the same on chip and PC.
#[derive(Clone, Copy, Debug, Default)]
pub struct Plain;

impl Kernels for Plain {
    fn band_energy(taps: &Taps, samples: &[i16]) -> u64 {
        samples
            .windows(TAPS)
            .map(|x| {
                let y = x
                    .iter()
                    .zip(taps.reversed())
                    .fold(0i32, |sum, (&x, &h)| sum + i32::from(x) * i32::from(h));
                let y = i64::from((y + (1 << 7)) >> 8);
                (y * y) as u64
            })
            .sum()
    }

    // with this crate, which is compiled for speed
    #[inline(never)]
    fn add_frame(window: &[f32; FRAME], frame: &[i16; FRAME], sum: &mut FrameSum) {
        let mut x = [0.0; FRAME];
        for ((x, &sample), &w) in x.iter_mut().zip(frame).zip(window) {
            *x = f32::from(sample) * w;
        }
        let bins = microfft::real::rfft_512(&mut x);
        sum.add(bins.iter().map(|bin| (bin.re, bin.im)));
    }

    fn distances(from: &[i16], means: &[u8], stride: usize, distances: &mut [u64]) {
        for (distance, mean) in distances.iter_mut().zip(means.chunks(stride.max(1))) {
            let (mean, _) = mean.as_chunks();
            let apart = from.iter().zip(mean).map(|(a, b)| {
                let apart = i64::from(*a) - i64::from(i16::from_le_bytes(*b));
                (apart * apart) as u64
            });
            *distance = apart.sum();
        }
    }

    fn candidate_distances(from: &Candidate, others: &mut [Candidate]) {
        for other in others {
            let apart = from.mean.iter().zip(&other.mean).map(|(a, b)| {
                let apart = i64::from(*a) - i64::from(*b);
                (apart * apart) as u64
            });
            other.distance = apart.sum();
        }
    }

    fn sqrt(x: f32) -> f32 {
        libm::sqrtf(x)
    }
}

/// 1.5 * 2^23: adding it leaves a number's whole part in the lowest bits.
const ROUND: f32 = 12_582_912.0;

/// e^(-x) of an `x` from 0 to 86, relative error at most 4e-7 and 8e-8 x; 0 beyond. The same operations on chip and PC.
pub fn exp_neg(x: f32) -> f32 {
    if x > 86.0 {
        return 0.0;
    }
    let octaves = x * -core::f32::consts::LOG2_E;
    let shifted = octaves + ROUND;
    let part = octaves - (shifted - ROUND);
    // 2^part for -0.5..=0.5 (Cephes, exp2f)
    let p = 1.535_336_2e-4;
    let p = p * part + 1.339_887_4e-3;
    let p = p * part + 9.618_437e-3;
    let p = p * part + 5.550_332_5e-2;
    let p = p * part + 2.402_264_8e-1;
    let p = p * part + 6.931_472e-1;
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
