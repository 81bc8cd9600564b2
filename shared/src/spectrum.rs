//! The averaged spectrum of the unfiltered P_AC (Hann windows of 512 samples, hop 256), its centroid (eq. 18) and its band
//! powers.
//!
//! The mean of the slide is to be removed before the windows, but it is known only at the end. A Hann window has three
//! non-zero bins, so the mean only reaches bins 0 and 1 of each frame, and [`SpectrumSum::finish`] takes it out again by
//! linearity.

use core::ops::Range;

use microfft::Complex32;

use crate::fir::cos_of_turns;
use crate::kernels::Kernels;
use crate::pressure::RATE_HZ;

/// Samples in a frame.
pub const FRAME: usize = 512;
/// Samples from one frame to the next.
pub const HOP: usize = 256;
/// Bins of the single-sided spectrum, both ends included.
pub const BINS: usize = FRAME / 2 + 1;
/// Width of a bin in Hz.
pub const BIN_HZ: f32 = RATE_HZ as f32 / FRAME as f32;

/// Sum of the squares of the Hann window: 3/8 of its length.
const WINDOW_POWER: f32 = FRAME as f32 * 3.0 / 8.0;
/// Transform of the Hann window itself at bins 0 and 1; it is 0 from bin 2 on.
const WINDOW_BIN_0: f32 = FRAME as f32 / 2.0;
const WINDOW_BIN_1: f32 = -(FRAME as f32) / 4.0;

/// The Hann window of [`FRAME`] samples, periodic: 0.5 - 0.5 cos(2 pi n / N).
pub fn hann() -> [f32; FRAME] {
    let mut window = [0.0; FRAME];
    for (n, w) in window.iter_mut().enumerate() {
        *w = (0.5 - 0.5 * cos_of_turns(n as f64 / FRAME as f64)) as f32;
    }
    window
}

/// Sums over frames: the power of every bin, and the two complex bins that the mean of the slide reaches.
#[derive(Clone, Debug)]
pub struct FrameSum {
    /// Sum of |X|^2 of every bin, in counts^2.
    power: [f32; BINS],
    /// Sum of the real parts of bins 0 and 1 (the Hann window's own bins are real).
    real: [f32; 2],
    frames: u32,
}

impl FrameSum {
    /// Adds one transformed frame: bins 0 to 255, with bin 256, which is real, in place of bin 0's imaginary part.
    pub fn add(&mut self, bins: &[Complex32; FRAME / 2]) {
        let [first, rest @ .., last] = &mut self.power;
        let [ends, bins @ ..] = bins;
        let [second, ..] = bins;
        *first += ends.re * ends.re;
        *last += ends.im * ends.im;
        let [real_0, real_1] = &mut self.real;
        *real_0 += ends.re;
        *real_1 += second.re;
        let add = |sum: &mut f32, bin: &Complex32| *sum += bin.re * bin.re + bin.im * bin.im;
        let (fives, _) = rest.as_chunks_mut::<5>();
        for (sums, bins) in fives.iter_mut().zip(bins.as_chunks::<5>().0) {
            for (sum, bin) in sums.iter_mut().zip(bins) {
                add(sum, bin);
            }
        }
        self.frames += 1;
    }
}

/// The spectrum of a slide while its samples arrive.
#[derive(Clone, Debug)]
pub struct SpectrumSum {
    frame: [i16; FRAME],
    filled: usize,
    sum: FrameSum,
    /// Sum and number of all samples, also of those behind the last whole frame.
    total: i64,
    samples: u32,
}

impl Default for SpectrumSum {
    fn default() -> Self {
        Self {
            frame: [0; FRAME],
            filled: 0,
            sum: FrameSum {
                power: [0.0; BINS],
                real: [0.0; 2],
                frames: 0,
            },
            total: 0,
            samples: 0,
        }
    }
}

impl SpectrumSum {
    /// Takes samples, in blocks of any size.
    pub fn push<K: Kernels>(&mut self, window: &[f32; FRAME], samples: &[i16]) {
        let mut samples = samples;
        self.samples += samples.len() as u32;
        while !samples.is_empty() {
            samples = self.fill(samples);
            if self.filled >= FRAME {
                K::add_frame(window, &self.frame, &mut self.sum);
                self.frame.copy_within(HOP.., 0);
                self.filled = FRAME - HOP;
            }
        }
    }

    /// Takes as many samples as the frame has room for; the others.
    // not generic: compiled with this crate, for speed
    #[inline(never)]
    fn fill<'s>(&mut self, samples: &'s [i16]) -> &'s [i16] {
        let room = self.frame.get_mut(self.filled..).unwrap_or_default();
        let many = samples.len().min(room.len());
        let (now, later) = samples.split_at_checked(many).unwrap_or_default();
        // a frame's sum is in 32 bits
        let mut total = 0;
        for (slot, &sample) in room.iter_mut().zip(now) {
            *slot = sample;
            total += i32::from(sample);
        }
        self.total += i64::from(total);
        self.filled += many;
        later
    }

    /// Number of samples taken.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// The averaged spectrum with the mean of all samples removed; `None` before the first whole frame.
    pub fn finish(&self) -> Option<Spectrum> {
        if self.sum.frames == 0 {
            return None;
        }
        let frames = self.sum.frames as f32;
        let mean = (self.total as f64 / f64::from(self.samples)) as f32;
        let mut psd = self.sum.power;
        // |X - m W|^2 summed over frames, for the two bins where W is not 0
        let [first, second, ..] = &mut psd;
        for ((power, real), w) in [first, second]
            .into_iter()
            .zip(self.sum.real)
            .zip([WINDOW_BIN_0, WINDOW_BIN_1])
        {
            let m = mean * w;
            // rounding must not leave a negative power
            *power = (*power - 2.0 * m * real + frames * m * m).max(0.0);
        }
        for power in &mut psd {
            *power /= frames * WINDOW_POWER;
        }
        Some(Spectrum { psd })
    }
}

/// The averaged power spectrum of a slide: mean |X|^2 over the sum of the squared window, in counts^2 per bin.
#[derive(Clone, PartialEq, Debug)]
pub struct Spectrum {
    psd: [f32; BINS],
}

impl Spectrum {
    /// Power of every bin; bin k is at `k * BIN_HZ`.
    pub fn psd(&self) -> &[f32; BINS] {
        &self.psd
    }

    /// Spectral centroid in Hz (eq. 18); `None` for a signal without any power.
    pub fn centroid_hz(&self) -> Option<f32> {
        let (moment, power) = self
            .psd
            .iter()
            .enumerate()
            .fold((0.0, 0.0), |(moment, power), (k, p)| {
                (moment + k as f32 * p, power + p)
            });
        (power > 0.0).then(|| moment / power * BIN_HZ)
    }

    /// Mean power of the bins in `bins`, and 0 where there are none.
    pub fn band(&self, bins: Range<usize>) -> f32 {
        let band = self.psd.get(bins).unwrap_or_default();
        if band.is_empty() {
            0.0
        } else {
            band.iter().sum::<f32>() / band.len() as f32
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::Plain;
    use proptest::prelude::*;
    use std::vec::Vec;

    fn spectrum(samples: &[i16]) -> Spectrum {
        let mut sum = SpectrumSum::default();
        sum.push::<Plain>(&hann(), samples);
        sum.finish().unwrap()
    }

    fn sine(f_hz: f64, amplitude: f64, offset: f64, n: usize) -> Vec<i16> {
        (0..n)
            .map(|n| {
                (offset
                    + amplitude
                        * (2.0 * core::f64::consts::PI * f_hz / f64::from(RATE_HZ) * n as f64)
                            .sin())
                .round() as i16
            })
            .collect()
    }

    #[test]
    fn the_window_is_that_of_libms_cosine() {
        let turn = 2.0 * core::f64::consts::PI / FRAME as f64;
        for (n, w) in hann().into_iter().enumerate() {
            assert_eq!(w, (0.5 - 0.5 * libm::cos(turn * n as f64)) as f32, "{n}");
        }
    }

    #[test]
    fn window_constants_are_those_of_the_window() {
        let w = hann();
        let dot = |f: &dyn Fn(usize) -> f64| {
            w.iter()
                .enumerate()
                .map(|(n, &w)| f64::from(w) * f(n))
                .sum::<f64>()
        };
        assert!((dot(&|n| f64::from(w[n])) - f64::from(WINDOW_POWER)).abs() < 1e-4);
        assert!((dot(&|_| 1.0) - f64::from(WINDOW_BIN_0)).abs() < 1e-4);
        let turn = |k: f64| {
            move |n: usize| (2.0 * core::f64::consts::PI * k * n as f64 / FRAME as f64).cos()
        };
        assert!((dot(&turn(1.0)) - f64::from(WINDOW_BIN_1)).abs() < 1e-4);
        assert!(dot(&turn(2.0)).abs() < 1e-4);
    }

    #[test]
    fn centroid_of_a_sine_is_its_frequency() {
        for f in [60.0, 250.0, 900.0] {
            let centroid = spectrum(&sine(f, 1000.0, 0.0, 6000)).centroid_hz().unwrap();
            assert!((f64::from(centroid) - f).abs() < 0.2, "{f}: {centroid}");
        }
    }

    #[test]
    fn total_power_is_the_variance() {
        // white: both sides of the spectrum together hold the variance (Parseval), each bin the same
        let mut x = 1u32;
        let noise: Vec<i16> = (0..20_000)
            .map(|_| {
                x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (x >> 20) as i16 - 2048
            })
            .collect();
        let variance = 4096.0f32 * 4096.0 / 12.0;
        let s = spectrum(&noise);
        assert!(
            (s.band(2..256) / variance - 1.0).abs() < 0.05,
            "{}",
            s.band(2..256) / variance
        );
    }

    #[test]
    fn an_offset_does_not_count() {
        let (plain, lifted) = (
            spectrum(&sine(200.0, 500.0, 0.0, 5000)),
            spectrum(&sine(200.0, 500.0, 300.0, 5000)),
        );
        let total: f32 = plain.psd().iter().sum();
        for (k, (a, b)) in plain.psd().iter().zip(lifted.psd()).enumerate() {
            assert!((a - b).abs() < 1e-4 * total, "bin {k}: {a} {b}");
        }
    }

    #[test]
    fn bands_beyond_the_spectrum_are_empty() {
        let s = spectrum(&sine(200.0, 500.0, 0.0, 512));
        assert_eq!(s.band(300..310), 0.0);
        assert_eq!(s.band(7..7), 0.0);
        assert!(s.band(40..53) > 0.0);
    }

    #[test]
    fn silence_has_no_centroid_and_less_than_a_frame_no_spectrum() {
        assert_eq!(spectrum(&[0; FRAME]).centroid_hz(), None);
        let mut sum = SpectrumSum::default();
        sum.push::<Plain>(&hann(), &[1; FRAME - 1]);
        assert_eq!(sum.finish(), None);
        assert_eq!(sum.samples(), 511);
    }

    proptest! {
        #[test]
        fn spectrum_does_not_depend_on_the_blocks(samples in proptest::collection::vec(-2048i16..2048, 512..2500), cuts in proptest::collection::vec(1usize..600, 1..20)) {
            let mut cut = SpectrumSum::default();
            let mut rest = &samples[..];
            for n in cuts.iter().cycle() {
                if rest.is_empty() { break; }
                let (now, later) = rest.split_at((*n).min(rest.len()));
                cut.push::<Plain>(&hann(), now);
                rest = later;
            }
            prop_assert_eq!(cut.finish(), Some(spectrum(&samples)));
        }
    }
}
