//! The inner loops, behind one type parameter: a chip may bring faster ones without touching the core.
//!
//! [`Plain`] is the reference. Another implementation must give the same integers, and the same floats to the bit.

use crate::fir::{TAPS, Taps};
use crate::spectrum::{FRAME, FrameSum};

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

    fn add_frame(window: &[f32; FRAME], frame: &[i16; FRAME], sum: &mut FrameSum) {
        let mut x = [0.0; FRAME];
        for ((x, &sample), &w) in x.iter_mut().zip(frame).zip(window) {
            *x = f32::from(sample) * w;
        }
        let bins = microfft::real::rfft_512(&mut x);
        sum.add(bins.iter().map(|bin| (bin.re, bin.im)));
    }

    fn sqrt(x: f32) -> f32 {
        libm::sqrtf(x)
    }
}
