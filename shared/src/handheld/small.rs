//! The plain kernels without the methods that a handheld's tables never use: its image shall fit a small chip.

use core::mem::MaybeUninit;

use crate::dsp::{Angles, Complex32, FRAME, Folded, Kernels as Signals, Plain, Taps};
use crate::explorer::Kernels;
use crate::explorer::kernels::{Candidate, LiveGaussian, Spread};
use crate::table::Gaussians;

/// [`Plain`], for tables with whitened features only.
#[derive(Clone, Copy, Debug, Default)]
pub struct Small;

impl Signals for Small {
    fn clip(samples: &[i16], clipped: &mut [i16]) {
        Plain::clip(samples, clipped);
    }

    fn band_energy(taps: &Taps, samples: &[i16]) -> u64 {
        Plain::band_energy(taps, samples)
    }

    fn fold_frame<'r>(
        angles: &Angles,
        frame: &[i16; FRAME],
        buffer: &'r mut MaybeUninit<Folded>,
    ) -> &'r mut Folded {
        Plain::fold_frame(angles, frame, buffer)
    }

    fn fold(angles: &Angles, reals: &[Complex32], folded: &mut [Complex32]) {
        Plain::fold(angles, reals, folded);
    }

    fn add_power(bins: &[Complex32], sums: &mut [f32]) {
        Plain::add_power(bins, sums);
    }
}

impl Kernels for Small {
    const ONLY_FUSED: bool = true;

    fn reset_to_prior(logs: &mut [i32]) {
        Plain::reset_to_prior(logs);
    }

    fn add_likelihoods(
        from: &[i16],
        means: &[u8],
        stride: usize,
        spread: &Spread,
        logs: &mut [i32],
    ) -> usize {
        Plain::add_likelihoods(from, means, stride, spread, logs)
    }

    fn add_gaussians(_: f32, _: &Gaussians<'_>, _: &mut [i32]) {}

    fn posterior(logs: &[i32], posterior: &mut [f32]) -> (i32, f32) {
        Plain::posterior(logs, posterior)
    }

    fn confuse_whitened(a: &mut Candidate, others: &mut [Candidate], fewer: u8) {
        Plain::confuse_whitened(a, others, fewer);
    }

    fn confuse(_: &mut LiveGaussian, _: &mut [LiveGaussian]) {}

    fn sqrt(x: f32) -> f32 {
        Plain::sqrt(x)
    }
}
