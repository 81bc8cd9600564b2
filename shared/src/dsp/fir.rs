//! The 20-700 Hz band-pass of the paper (66th order, "Roughness of texture") and the mean power behind it (eq. 15).
//!
//! Samples and coefficients are 16-bit integers and the sums are exact, so the power does not depend on how the samples
//! were cut into blocks, nor on the machine.

use super::kernels::Kernels;
use super::plan::{BAND_PASS, HISTORY, Plan};

/// Samples filtered at once, whole twelves for kernels that take so many. No result depends on it.
const BLOCK: usize = 264;
/// Samples that begin at a whole word, for kernels that read two at once.
#[derive(Clone, Debug)]
#[repr(align(4))]
struct Words([i16; HISTORY + BLOCK]);

/// Mean power of the band-passed signal (eq. 15), sample by sample.
#[derive(Clone, Debug)]
pub struct BandPower {
    /// The last `HISTORY` samples before the block, then the block.
    samples: Words,
    filled: usize,
    energy: u64,
    outputs: u32,
}

impl Default for BandPower {
    fn default() -> Self {
        Self {
            samples: Words([0; HISTORY + BLOCK]),
            filled: 0,
            energy: 0,
            outputs: 0,
        }
    }
}

impl BandPower {
    /// Takes samples into the filter's memory without counting their power: what comes before the steady window.
    pub(crate) fn prime(&mut self, plan: &Plan, samples: &[i16]) {
        self.flush(plan);
        let (energy, outputs) = (self.energy, self.outputs);
        let last = samples.len().saturating_sub(HISTORY);
        self.push(plan, samples.get(last..).unwrap_or_default());
        self.flush(plan);
        (self.energy, self.outputs) = (energy, outputs);
    }

    /// Filters samples (counts about the still baseline; beyond what 12 bits can differ by they are clipped) and counts
    /// their power.
    pub fn push(&mut self, plan: &Plan, samples: &[i16]) {
        let mut samples = samples;
        while !samples.is_empty() {
            samples = self.take(&plan.kernels, samples);
            if self.filled >= BLOCK {
                self.flush(plan);
            }
        }
    }

    fn take<'s>(&mut self, kernels: &Kernels, samples: &'s [i16]) -> &'s [i16] {
        let buffer = self.samples.0.get_mut(HISTORY + self.filled..);
        let buffer = buffer.unwrap_or_default();
        let many = samples.len().min(buffer.len());
        let (now, later) = samples.split_at_checked(many).unwrap_or_default();
        (kernels.clip)(now, buffer.get_mut(..many).unwrap_or_default());
        self.filled += many;
        later
    }

    /// Sum of squares of all outputs in Q14 counts^2, and their number.
    fn flush(&mut self, plan: &Plan) {
        let filled = self.filled.min(BLOCK);
        self.energy += (plan.kernels.band_energy)(
            &BAND_PASS,
            self.samples.0.get(..HISTORY + filled).unwrap_or_default(),
        );
        self.outputs += filled as u32;
        self.samples.0.copy_within(filled..filled + HISTORY, 0);
        self.filled = 0;
    }

    /// Mean power in counts^2 of all samples pushed so far, and `None` before the first.
    pub fn mean(&mut self, plan: &Plan) -> Option<f32> {
        self.flush(plan);
        (self.outputs > 0)
            .then(|| (self.energy as f64 / (1u32 << 14) as f64 / f64::from(self.outputs)) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::super::plan::tests::gain;
    use super::*;
    use crate::sensor::pressure::RATE_HZ;
    use core::f64::consts::PI;
    use proptest::prelude::*;
    use std::vec::Vec;

    #[test]
    fn power_of_a_sine_in_the_band_is_half_its_square() {
        let sine: Vec<i16> = (0..4400)
            .map(|n| {
                (3000.0 * (2.0 * PI * 300.0 / f64::from(RATE_HZ) * f64::from(n)).sin()).round()
                    as i16
            })
            .collect();
        let plan = Plan::new();
        let mut power = BandPower::default();
        let (lead, rest) = sine.split_at(2200);
        power.prime(&plan, lead);
        power.push(&plan, rest);
        let expected = 4.5e6 * gain(300.0) * gain(300.0);
        let ratio = f64::from(power.mean(&plan).unwrap()) / expected;
        // samples are whole counts
        assert!((ratio - 1.0).abs() < 5e-4, "{ratio}");
    }

    #[test]
    fn full_scale_neither_overflows_nor_wraps() {
        // the worst input: the sign of every coefficient
        let plan = Plan::new();
        let worst: Vec<i16> = BAND_PASS
            .iter()
            .rev()
            .map(|&h| if h < 0 { i16::MIN } else { i16::MAX })
            .collect();
        let mut power = BandPower::default();
        power.prime(&plan, &worst[..66]);
        power.push(&plan, &worst[66..]);
        let y: f64 = BAND_PASS
            .iter()
            .map(|&h| f64::from(h).abs() / 32768.0 * if h < 0 { 4096.0 } else { 4095.0 })
            .sum();
        let got = f64::from(power.mean(&plan).unwrap());
        assert!((got / (y * y) - 1.0).abs() < 1e-4, "{got} {}", y * y);
    }

    #[test]
    fn no_samples_no_power() {
        assert_eq!(BandPower::default().mean(&Plan::new()), None);
    }

    proptest! {
        #[test]
        fn power_does_not_depend_on_the_blocks(samples in proptest::collection::vec(-3000i16..3000, 1..700),
            cuts in proptest::collection::vec(1usize..200, 1..20)) {
            let plan = Plan::new();
            // straight from the definition, in f64
            let at = |n: isize| usize::try_from(n).ok().and_then(|n| samples.get(n)).map_or(0.0, |&x| f64::from(x));
            let oracle = (0..samples.len() as isize).map(|n| {
                let taps = BAND_PASS.iter().enumerate();
                let y: f64 = taps.map(|(k, &h)| f64::from(h) / 32768.0 * at(n - k as isize)).sum();
                y * y
            }).sum::<f64>() / samples.len() as f64;

            let mut whole = BandPower::default();
            whole.push(&plan, &samples);
            let whole = whole.mean(&plan).unwrap();
            // every output is rounded by at most half of 1/128 count
            let bound = 2.0 / 256.0 * oracle.sqrt() + 1e-4;
            prop_assert!((f64::from(whole) - oracle).abs() <= bound, "{whole} {oracle}");

            let mut cut = BandPower::default();
            let mut rest = &samples[..];
            for n in cuts.iter().cycle() {
                if rest.is_empty() { break; }
                let (now, later) = rest.split_at((*n).min(rest.len()));
                cut.push(&plan, now);
                rest = later;
            }
            prop_assert_eq!(cut.mean(&plan), Some(whole));
        }
    }
}
