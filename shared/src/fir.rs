//! The 20-700 Hz band-pass of the paper (66th order, "Roughness of texture") and the mean power behind it (eq. 15).
//!
//! Samples and coefficients are 16-bit integers and the sums are exact, so the power does not depend on how the samples
//! were cut into blocks, nor on the machine.

use core::f64::consts::{PI, TAU};

use crate::kernels::Kernels;
use crate::pressure::RATE_HZ;

/// Number of coefficients of the 66th-order filter.
pub const TAPS: usize = 67;
/// Edges of the pass band in Hz, the range of the Pacinian corpuscles that the paper imitates.
pub const PASS_BAND_HZ: (f64, f64) = (20.0, 700.0);

const HISTORY: usize = TAPS - 1;
/// Samples filtered at once, whole sixes for kernels that take so many. No result depends on it.
const BLOCK: usize = 264;
/// Pairs of coefficients that cover all of them from an even sample on, and from an odd one.
pub const PAIRS: usize = TAPS.div_ceil(2);

/// Coefficients of the band-pass in Q15, newest sample first. They are symmetric: the filter has linear phase.
#[derive(Clone, Debug)]
pub struct Taps {
    taps: [i16; TAPS],
    pairs: [[u32; 2]; PAIRS],
}

impl Taps {
    /// Designs the band-pass: the ideal response, cut by a Hamming window and scaled to gain 1 in the middle of the band.
    pub fn band_pass() -> Self {
        let (low, high) = (
            PASS_BAND_HZ.0 / f64::from(RATE_HZ),
            PASS_BAND_HZ.1 / f64::from(RATE_HZ),
        );
        let middle = low + high;
        // both of one tap at `m` samples from the centre; frequencies in cycles per sample
        let windowed = |n: usize| {
            let m = n as f64 - HISTORY as f64 / 2.0;
            let ideal = |f: f64| {
                if m == 0.0 {
                    2.0 * f
                } else {
                    // a sine is a cosine a quarter of a turn later
                    cos_of_turns(f * m - 0.25) / (PI * m)
                }
            };
            let hamming = 0.54 - 0.46 * cos_of_turns(n as f64 / HISTORY as f64);
            ((ideal(high) - ideal(low)) * hamming, m)
        };
        let gain: f64 = (0..TAPS)
            .map(windowed)
            .map(|(h, m)| h * cos_of_turns(middle * m / 2.0))
            .sum();
        let mut taps = [0; TAPS];
        for (n, tap) in taps.iter_mut().enumerate() {
            *tap = libm::round(windowed(n).0 / gain * 32768.0) as i16;
        }
        let mut pairs = [[0; 2]; PAIRS];
        let at = |n: Option<usize>| n.and_then(|n| taps.iter().rev().nth(n)).copied();
        let word = |low: Option<i16>, high: Option<i16>| {
            let half = |tap: Option<i16>| u32::from(tap.unwrap_or(0) as u16);
            half(low) | half(high) << 16
        };
        for (pair, n) in pairs.iter_mut().zip((0..).step_by(2)) {
            *pair = [
                word(at(Some(n)), at(Some(n + 1))),
                word(at(n.checked_sub(1)), at(Some(n))),
            ];
        }
        Self { taps, pairs }
    }

    /// The coefficients in Q15, newest sample first.
    pub fn as_slice(&self) -> &[i16; TAPS] {
        &self.taps
    }

    /// The coefficients in Q15, oldest sample first.
    pub(crate) fn reversed(&self) -> impl Iterator<Item = &i16> {
        self.taps.iter().rev()
    }

    /// The same two to a word, the older sample's in the low half, for kernels that multiply pairs of samples. Of each two
    /// words the first is for an output whose oldest sample is the first of a pair, the other for the output after it, which
    /// begins with the second of that pair.
    pub fn pairs(&self) -> &[[u32; 2]; PAIRS] {
        &self.pairs
    }
}

/// Cosine of an angle in turns, fewer than 2^31 of them. That of `libm` takes angles of any size in radians, and 5 KB of flash
/// to tell how many turns they are.
pub(crate) fn cos_of_turns(turns: f64) -> f64 {
    let turns = if turns < 0.0 { -turns } else { turns };
    let part = turns - f64::from(turns as u32);
    // to an eighth of a turn, where the series below are as good as f64 is
    let half = if part > 0.5 { 1.0 - part } else { part };
    let (quarter, sign) = if half > 0.25 {
        (0.5 - half, -1.0)
    } else {
        (half, 1.0)
    };
    let series = |x: f64, first: u32| {
        // 1 - x^2 / ((first + 1) (first + 2)) (1 - x^2 / ((first + 3) (first + 4)) (1 - ...
        (0..9).rev().fold(1.0, |sum, term| {
            let n = f64::from(first + 2 * term);
            1.0 - x * x / ((n + 1.0) * (n + 2.0)) * sum
        })
    };
    if quarter <= 0.125 {
        sign * series(TAU * quarter, 0)
    } else {
        let x = TAU * (0.25 - quarter);
        sign * x * series(x, 1)
    }
}
/// Samples that begin at a whole word, for kernels that read two at once.
#[derive(Clone, Debug)]
#[repr(align(4))]
struct Words([i16; HISTORY + BLOCK]);

/// Mean power of the band-passed signal (eq. 15), sample by sample.
#[derive(Clone, Debug)]
pub struct BandPower {
    /// The last `HISTORY` samples before the block, then the block.
    samples: Words,
    /// How many samples of the block are there.
    filled: usize,
    energy: u64,
    outputs: u32,
}

impl Default for BandPower {
    /// A filter at rest: every earlier sample was 0.
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
    pub fn prime<K: Kernels>(&mut self, taps: &Taps, samples: &[i16]) {
        self.flush::<K>(taps);
        let (energy, outputs) = (self.energy, self.outputs);
        let last = samples.len().saturating_sub(HISTORY);
        self.push::<K>(taps, samples.get(last..).unwrap_or_default());
        self.flush::<K>(taps);
        (self.energy, self.outputs) = (energy, outputs);
    }

    /// Filters samples (counts about the still baseline; beyond what 12 bits can differ by they are clipped) and counts
    /// their power.
    pub fn push<K: Kernels>(&mut self, taps: &Taps, samples: &[i16]) {
        let mut samples = samples;
        while !samples.is_empty() {
            samples = self.take(samples);
            if self.filled >= BLOCK {
                self.flush::<K>(taps);
            }
        }
    }

    /// Takes as many samples as the block has room for, and gives the others back.
    fn take<'s>(&mut self, samples: &'s [i16]) -> &'s [i16] {
        let room = self.samples.0.get_mut(HISTORY + self.filled..);
        let room = room.unwrap_or_default();
        let many = samples.len().min(room.len());
        let (now, later) = samples.split_at_checked(many).unwrap_or_default();
        for (slot, &sample) in room.iter_mut().zip(now) {
            *slot = sample.clamp(-4096, 4095);
        }
        self.filled += many;
        later
    }

    /// Sum of squares of all outputs in Q14 counts^2, and their number.
    fn flush<K: Kernels>(&mut self, taps: &Taps) {
        let filled = self.filled.min(BLOCK);
        self.energy += K::band_energy(
            taps,
            self.samples.0.get(..HISTORY + filled).unwrap_or_default(),
        );
        self.outputs += filled as u32;
        self.samples.0.copy_within(filled..filled + HISTORY, 0);
        self.filled = 0;
    }

    /// Mean power in counts^2 of all samples pushed so far, and `None` before the first.
    pub fn mean<K: Kernels>(&mut self, taps: &Taps) -> Option<f32> {
        self.flush::<K>(taps);
        (self.outputs > 0)
            .then(|| (self.energy as f64 / (1u32 << 14) as f64 / f64::from(self.outputs)) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::Plain;
    use proptest::prelude::*;
    use std::vec::Vec;

    /// |H(f)|, from the definition of a filter's response.
    fn gain(f_hz: f64) -> f64 {
        let w = 2.0 * PI * f_hz / f64::from(RATE_HZ);
        let (re, im) = Taps::band_pass().as_slice().iter().enumerate().fold(
            (0.0, 0.0),
            |(re, im), (n, &h)| {
                let h = f64::from(h) / 32768.0;
                (re + h * (w * n as f64).cos(), im - h * (w * n as f64).sin())
            },
        );
        re.hypot(im)
    }

    #[test]
    fn cosine_of_turns_is_libms() {
        for n in -4000..4000 {
            let turns = f64::from(n) / 1024.0 + 1e-3;
            let cos = libm::cos(TAU * turns);
            assert!((cos_of_turns(turns) - cos).abs() < 4e-15, "{turns}");
        }
        for (turns, cos) in [
            (0.0, 1.0),
            (0.25, 0.0),
            (-0.5, -1.0),
            (0.75, 0.0),
            (7.0, 1.0),
        ] {
            assert_eq!(cos_of_turns(turns), cos);
        }
    }

    #[test]
    fn the_taps_are_those_of_the_formula_with_libm() {
        let [low, high] = [20.0 / 2200.0, 700.0 / 2200.0];
        let response = |n: i32| {
            let m = f64::from(n) - 33.0;
            let ideal = |f: f64| match n {
                33 => 2.0 * f,
                _ => libm::sin(2.0 * PI * f * m) / (PI * m),
            };
            (ideal(high) - ideal(low)) * (0.54 - 0.46 * libm::cos(2.0 * PI * f64::from(n) / 66.0))
        };
        let gain: f64 = (0..67)
            .map(|n| response(n) * libm::cos(PI * (low + high) * (f64::from(n) - 33.0)))
            .sum();
        let taps: Vec<i16> = (0..67)
            .map(|n| libm::round(response(n) / gain * 32768.0) as i16)
            .collect();
        assert_eq!(Taps::band_pass().as_slice()[..], taps[..]);
    }

    #[test]
    fn passes_20_to_700_hz() {
        assert!((gain(360.0) - 1.0).abs() < 1e-3, "gain 1 in the middle");
        for f in [100.0, 200.0, 330.0, 600.0] {
            assert!((gain(f) - 1.0).abs() < 0.02, "{f} Hz: {}", gain(f));
        }
        for f in [770.0, 800.0, 1000.0, 1100.0] {
            assert!(gain(f) < 0.01, "{f} Hz: {}", gain(f));
        }
        assert!((gain(700.0) - 0.5).abs() < 0.02, "half at the edge");
        assert!(
            (gain(0.0) - 0.41).abs() < 0.01,
            "66th order is too short to stop DC: {}",
            gain(0.0)
        );
    }

    #[test]
    fn coefficients_are_symmetric() {
        let taps = Taps::band_pass();
        assert!(taps.as_slice().iter().eq(taps.reversed()));
    }

    #[test]
    fn power_of_a_sine_in_the_band_is_half_its_square() {
        let sine: Vec<i16> = (0..4400)
            .map(|n| {
                (3000.0 * (2.0 * PI * 300.0 / f64::from(RATE_HZ) * f64::from(n)).sin()).round()
                    as i16
            })
            .collect();
        let taps = Taps::band_pass();
        let mut power = BandPower::default();
        let (lead, rest) = sine.split_at(2200);
        power.prime::<Plain>(&taps, lead);
        power.push::<Plain>(&taps, rest);
        let expected = 4.5e6 * gain(300.0) * gain(300.0);
        let ratio = f64::from(power.mean::<Plain>(&taps).unwrap()) / expected;
        // samples are whole counts
        assert!((ratio - 1.0).abs() < 5e-4, "{ratio}");
    }

    #[test]
    fn full_scale_neither_overflows_nor_wraps() {
        // the worst input: the sign of every coefficient
        let taps = Taps::band_pass();
        let worst: Vec<i16> = taps
            .reversed()
            .map(|&h| if h < 0 { i16::MIN } else { i16::MAX })
            .collect();
        let mut power = BandPower::default();
        power.prime::<Plain>(&taps, &worst[..66]);
        power.push::<Plain>(&taps, &worst[66..]);
        let y: f64 = taps
            .as_slice()
            .iter()
            .map(|&h| f64::from(h).abs() / 32768.0 * if h < 0 { 4096.0 } else { 4095.0 })
            .sum();
        let got = f64::from(power.mean::<Plain>(&taps).unwrap());
        assert!((got / (y * y) - 1.0).abs() < 1e-4, "{got} {}", y * y);
    }

    #[test]
    fn no_samples_no_power() {
        assert_eq!(BandPower::default().mean::<Plain>(&Taps::band_pass()), None);
    }

    proptest! {
        #[test]
        fn power_does_not_depend_on_the_blocks(samples in proptest::collection::vec(-3000i16..3000, 1..700), cuts in proptest::collection::vec(1usize..200, 1..20)) {
            let taps = Taps::band_pass();
            // straight from the definition, in f64
            let at = |n: isize| usize::try_from(n).ok().and_then(|n| samples.get(n)).map_or(0.0, |&x| f64::from(x));
            let oracle = (0..samples.len() as isize).map(|n| {
                let y: f64 = taps.as_slice().iter().enumerate().map(|(k, &h)| f64::from(h) / 32768.0 * at(n - k as isize)).sum();
                y * y
            }).sum::<f64>() / samples.len() as f64;

            let mut whole = BandPower::default();
            whole.push::<Plain>(&taps, &samples);
            let whole = whole.mean::<Plain>(&taps).unwrap();
            // every output is rounded by at most half of 1/128 count
            let bound = 2.0 / 256.0 * oracle.sqrt() + 1e-4;
            prop_assert!((f64::from(whole) - oracle).abs() <= bound, "{whole} {oracle}");

            let mut cut = BandPower::default();
            let mut rest = &samples[..];
            for n in cuts.iter().cycle() {
                if rest.is_empty() { break; }
                let (now, later) = rest.split_at((*n).min(rest.len()));
                cut.push::<Plain>(&taps, now);
                rest = later;
            }
            prop_assert_eq!(cut.mean::<Plain>(&taps), Some(whole));
        }
    }
}
