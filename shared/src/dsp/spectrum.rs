//! The averaged spectrum of the unfiltered P_AC (Hann windows of 512 samples, hop 256), its centroid (eq. 18), its band
//! powers, and the mean over frames of the logarithms of the power in each of [`FUSED_EDGES`].
//!
//! Only powers are wanted, so a frame need not be transformed as a whole and unpacked. The odd bins of n reals are a
//! complex transform of n/4 values, each bin or its mirror image; the even ones are the transform of n/2 reals.
//! [`Kernels::fold`] makes these of those, and after three times what is left is short. The transforms themselves are
//! microfft's, or equal to them.
//!
//! The mean of the slide is to be removed before the windows, but it is known only at the end. A Hann window has three
//! non-zero bins, so the mean only reaches bins 0 and 1 of each frame, and [`SpectrumSum::finish`] takes it out again
//! by linearity.

use core::mem::MaybeUninit;
use core::ops::Range;

use super::kernels::Kernels;
use super::plan::{FRAME, Folded, Plan};
use crate::sensor::pressure::RATE_HZ;

/// Samples from one frame to the next.
pub const HOP: usize = 256;
/// Bins of the single-sided spectrum, both ends included.
pub const BINS: usize = FRAME / 2 + 1;
/// Width of a bin in Hz.
pub const BIN_HZ: f32 = RATE_HZ as f32 / FRAME as f32;

/// Number of bands of the fused way of deciding.
pub const FUSED_BANDS: usize = 26;
/// Their edges, from 4.3 to 1000 Hz, from 17 Hz on in nearly equal ratios, as half-open ranges of bins.
pub const FUSED_EDGES: [usize; FUSED_BANDS + 1] = [
    1, 2, 4, 5, 6, 7, 8, 9, 11, 13, 16, 19, 22, 26, 31, 37, 43, 51, 60, 71, 84, 100, 118, 140, 166,
    197, 233,
];
/// Added to the mean power of a band of them in each frame, counts^2 per bin, before the logarithm: what rounding to
/// whole counts adds to every bin, and a little more.
const FUSED_FLOOR: f32 = 0.1;

/// Bins of the single-sided spectrum but the last, in the order in which a frame's transforms give them: 1, 5, 9 and so
/// on, where those beyond the last are the mirror images of 255, 251 and so on; 2, 10, 18; 4, 20, 36; 0, 8, 16.
const ORDER: [usize; BINS - 1] = order();
/// The band of each of them in [`FUSED_EDGES`]; [`FUSED_BANDS`] for none.
const BAND_OF: [u8; BINS - 1] = band_of();
/// Bands with room for the bins of none, a power of 2.
const SLOTS: usize = (FUSED_BANDS + 1).next_power_of_two();

#[allow(clippy::indexing_slicing)] // the compiler runs it, and has no iterators
const fn order() -> [usize; BINS - 1] {
    let mut bins = [0; BINS - 1];
    let (mut slot, mut apart) = (0, 1);
    while slot < BINS - 1 {
        let places = if apart < 8 {
            FRAME / 4 / apart
        } else {
            FRAME / 16
        };
        let mut place = 0;
        while place < places {
            let bin = if apart < 8 {
                apart * (4 * place + 1)
            } else {
                8 * place
            };
            bins[slot] = if bin < BINS { bin } else { FRAME - bin };
            (slot, place) = (slot + 1, place + 1);
        }
        apart *= 2;
    }
    bins
}

#[allow(clippy::indexing_slicing)] // the compiler runs it, and has no iterators
const fn band_of() -> [u8; BINS - 1] {
    let mut bands = [FUSED_BANDS as u8; BINS - 1];
    let mut slot = 0;
    while slot < BINS - 1 {
        let mut band = 0;
        while band < FUSED_BANDS {
            if FUSED_EDGES[band] <= ORDER[slot] && ORDER[slot] < FUSED_EDGES[band + 1] {
                bands[slot] = band as u8;
            }
            band += 1;
        }
        slot += 1;
    }
    bands
}

/// Factors that make the sums of the powers of the bands' bins their means in counts^2.
const SHARES: [f32; FUSED_BANDS] = shares();

#[allow(clippy::indexing_slicing)] // the compiler runs it, and has no iterators
const fn shares() -> [f32; FUSED_BANDS] {
    let mut shares = [0.0; FUSED_BANDS];
    let mut band = 0;
    while band < FUSED_BANDS {
        let bins = (FUSED_EDGES[band + 1] - FUSED_EDGES[band]) as f32;
        shares[band] = 1.0 / (bins * WINDOW_POWER);
        band += 1;
    }
    shares
}

/// Sum of the squares of the window, which is twice Hann's: his is 3/8 of its length.
const WINDOW_POWER: f32 = 4.0 * FRAME as f32 * 3.0 / 8.0;
/// Transform of the window itself at bins 0 and 1; it is 0 from bin 2 on.
const WINDOW_BIN_0: f32 = FRAME as f32;
const WINDOW_BIN_1: f32 = -(FRAME as f32) / 2.0;

/// Sums over frames: the power of every bin in counts^2, and the two complex bins that the mean of the slide reaches;
/// and products over frames of the power of every band.
#[derive(Clone, Debug)]
struct FrameSum {
    /// In [`ORDER`].
    powers: [f32; BINS - 1],
    last: f32,
    /// Sum of the real parts of bins 0 and 1 (the Hann window's own bins are real).
    real: [f32; 2],
    frames: u32,
    products: [Product; FUSED_BANDS],
    /// Room for the powers of some bins of a frame: clearing it anew for each costs instructions.
    of_a_frame: [f32; FRAME / 4],
}

impl FrameSum {
    const ZERO: Self = Self {
        powers: [0.0; BINS - 1],
        last: 0.0,
        real: [0.0; 2],
        frames: 0,
        products: [Product::ONE; FUSED_BANDS],
        of_a_frame: [0.0; FRAME / 4],
    };

    fn add(&mut self, plan: &Plan, folded: &mut Folded) {
        let Kernels {
            fold,
            transform,
            transform_reals,
            add_power,
            ..
        } = plan.kernels;
        let angles = plan.angles();
        let mut bands = [0.0; SLOTS];
        let powers = &mut self.of_a_frame;
        let (mut sums, mut band_of) = (&mut self.powers[..], &BAND_OF[..]);
        let mut add_power = |bins: &[microfft::Complex32]| {
            let many = bins.len();
            let sums = sums.split_off_mut(..many).unwrap_or_default();
            let band_of = band_of.split_off(..many).unwrap_or_default();
            let powers = powers.get_mut(..many).unwrap_or_default();
            add_power(bins, powers, sums);
            add_to_bands(&mut bands, powers, band_of);
        };
        let ([odd, reals], _) = folded.as_chunks_mut::<{ FRAME / 4 }>() else {
            return;
        };
        transform(angles, odd);
        let first = odd.first().copied().unwrap_or_default();
        add_power(odd);

        fold(angles, reals, odd);
        let ([odd, reals_2], _) = odd.as_chunks_mut::<{ FRAME / 8 }>() else {
            return;
        };
        transform(angles, odd);
        add_power(odd);

        let ([folded, ..], _) = reals.as_chunks_mut::<{ FRAME / 8 }>() else {
            return;
        };
        fold(angles, reals_2, folded);
        let ([odd, reals], _) = folded.as_chunks_mut::<{ FRAME / 16 }>() else {
            return;
        };
        transform(angles, odd);
        add_power(odd);

        let mut rest = [0.0; FRAME / 8];
        let ([early, late], _) = rest.as_chunks_mut::<{ FRAME / 16 }>() else {
            return;
        };
        for ((early, late), pair) in early.iter_mut().zip(late).zip(reals) {
            (*early, *late) = (pair.re, pair.im);
        }
        let eights = transform_reals(angles, &mut rest);
        // the first of them has that of the last bin, which is real as well, in place of its imaginary part
        let mut mean = 0.0;
        if let Some(ends) = eights.first_mut() {
            mean = ends.re;
            self.last += ends.im * ends.im;
            ends.im = 0.0;
        }
        add_power(eights);
        let [real_0, real_1] = &mut self.real;
        *real_0 += mean;
        *real_1 += first.re;
        // of bin 1 without the frame's own mean, as far as a band has it
        let real = first.re - mean / WINDOW_BIN_0 * WINDOW_BIN_1;
        let without_mean = real * real + first.im * first.im;
        let [lowest, ..] = &mut bands;
        *lowest = without_mean;
        for ((product, band), share) in self.products.iter_mut().zip(&bands).zip(&SHARES) {
            product.multiply(band * share + FUSED_FLOOR);
        }
        self.frames += 1;
    }

    fn power(&self) -> [f32; BINS] {
        let mut power = [0.0; BINS];
        for (bin, sum) in ORDER.into_iter().zip(self.powers) {
            if let Some(to) = power.get_mut(bin) {
                *to = sum;
            }
        }
        let [.., last] = &mut power;
        *last = self.last;
        power
    }
}

/// Adds powers, of which there are a multiple of four, to their bands.
#[inline(never)]
fn add_to_bands(bands: &mut [f32; SLOTS], powers: &[f32], band_of: &[u8]) {
    let mut add = |power: f32, band: u8| {
        if let Some(band) = bands.get_mut(usize::from(band) % SLOTS) {
            *band += power;
        }
    };
    let (powers, _) = powers.as_chunks::<4>();
    let (band_of, _) = band_of.as_chunks::<4>();
    for (&[a, b, c, d], &[of_a, of_b, of_c, of_d]) in powers.iter().zip(band_of) {
        add(a, of_a);
        add(b, of_b);
        add(c, of_c);
        add(d, of_d);
    }
}

/// A product of many positive numbers, of which only the logarithm is wanted: that costs one logarithm, not one each.
#[derive(Clone, Copy, Debug)]
struct Product {
    /// From 1 to 2.
    mantissa: f32,
    exponent: i32,
}

impl Product {
    const ONE: Self = Self {
        mantissa: 1.0,
        exponent: 0,
    };

    /// Multiplies by a normal number.
    fn multiply(&mut self, by: f32) {
        let bits = (self.mantissa * by).to_bits();
        self.exponent += (bits >> 23) as i32 - 127;
        self.mantissa = f32::from_bits(bits & 0x7f_ffff | 127 << 23);
    }

    fn ln(self) -> f32 {
        libm::logf(self.mantissa) + self.exponent as f32 * core::f32::consts::LN_2
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
            sum: FrameSum::ZERO,
            total: 0,
            samples: 0,
        }
    }
}

impl SpectrumSum {
    /// Takes samples, in blocks of any size. None is outside -16384..=16383.
    pub fn push(&mut self, plan: &Plan, samples: &[i16]) {
        let mut samples = samples;
        self.samples += samples.len() as u32;
        while !samples.is_empty() {
            samples = self.fill(samples);
            if self.filled >= FRAME {
                let mut buffer = MaybeUninit::uninit();
                let fold = plan.kernels.fold_frame;
                let folded = fold(plan.angles(), &self.frame, &mut buffer);
                self.sum.add(plan, folded);
                self.frame.copy_within(HOP.., 0);
                self.filled = FRAME - HOP;
            }
        }
    }

    fn fill<'s>(&mut self, samples: &'s [i16]) -> &'s [i16] {
        let buffer = self.frame.get_mut(self.filled..).unwrap_or_default();
        let many = samples.len().min(buffer.len());
        let (now, later) = samples.split_at_checked(many).unwrap_or_default();
        let (buffer, _) = buffer.split_at_mut_checked(many).unwrap_or_default();
        // four at a time; a frame's sum is in 32 bits
        let mut total = 0;
        let (fours, last) = now.as_chunks();
        let (four_slots, last_slots) = buffer.as_chunks_mut();
        for (slots, four) in four_slots.iter_mut().zip(fours) {
            let [a, b, c, d] = *four;
            *slots = *four;
            total += i32::from(a) + i32::from(b) + i32::from(c) + i32::from(d);
        }
        for (slot, &sample) in last_slots.iter_mut().zip(last) {
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
        let mut psd = self.sum.power();
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
        let fused_bands = self.sum.products.map(|product| product.ln() / frames);
        Some(Spectrum {
            frames: self.sum.frames,
            psd,
            fused_bands,
        })
    }
}

/// The averaged power spectrum of a slide: mean |X|^2 over the sum of the squared window, in counts^2 per bin.
#[derive(Clone, PartialEq, Debug)]
pub struct Spectrum {
    frames: u32,
    psd: [f32; BINS],
    fused_bands: [f32; FUSED_BANDS],
}

impl Spectrum {
    /// A spectrum of so many frames, of these powers in counts^2 per bin and these mean logarithms: one that was kept
    /// somewhere.
    pub fn new(frames: u32, psd: [f32; BINS], fused_bands: [f32; FUSED_BANDS]) -> Self {
        Self {
            frames,
            psd,
            fused_bands,
        }
    }

    /// Number of frames that it is the average of.
    pub fn frames(&self) -> u32 {
        self.frames
    }

    /// Power of every bin; bin k is at `k * BIN_HZ`.
    pub fn psd(&self) -> &[f32; BINS] {
        &self.psd
    }

    /// Mean over frames of the natural logarithm of the power in each band of [`FUSED_EDGES`], counts^2 per bin, the
    /// mean of each frame removed and 0.1 added: a burst in one frame weighs no more than its frame, silence has a
    /// value, and what is far below a count has hardly any.
    pub fn fused_bands(&self) -> &[f32; FUSED_BANDS] {
        &self.fused_bands
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
    use proptest::prelude::*;
    use std::vec::Vec;

    fn spectrum(samples: &[i16]) -> Spectrum {
        let mut sum = SpectrumSum::default();
        sum.push(&Plan::new(), samples);
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
    fn window_constants_are_those_of_the_window() {
        let turn = 2.0 * core::f64::consts::PI / FRAME as f64;
        let w: Vec<f64> = (0..FRAME).map(|n| 1.0 - (turn * n as f64).cos()).collect();
        let dot = |f: &dyn Fn(usize) -> f64| (0..FRAME).map(|n| w[n] * f(n)).sum::<f64>();
        assert!((dot(&|n| w[n]) - f64::from(WINDOW_POWER)).abs() < 1e-9);
        assert!((dot(&|_| 1.0) - f64::from(WINDOW_BIN_0)).abs() < 1e-9);
        let turn = |k: f64| move |n: usize| (turn * k * n as f64).cos();
        assert!((dot(&turn(1.0)) - f64::from(WINDOW_BIN_1)).abs() < 1e-9);
        assert!(dot(&turn(2.0)).abs() < 1e-9);
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
        sum.push(&Plan::new(), &[1; FRAME - 1]);
        assert_eq!(sum.finish(), None);
        assert_eq!(sum.samples(), 511);
    }

    proptest! {
        #[test]
        fn spectrum_does_not_depend_on_the_blocks(samples in proptest::collection::vec(-2048i16..2048, 512..2500),
            cuts in proptest::collection::vec(1usize..600, 1..20)) {
            let mut cut = SpectrumSum::default();
            let mut rest = &samples[..];
            for n in cuts.iter().cycle() {
                if rest.is_empty() { break; }
                let (now, later) = rest.split_at((*n).min(rest.len()));
                cut.push(&Plan::new(), now);
                rest = later;
            }
            prop_assert_eq!(cut.finish(), Some(spectrum(&samples)));
        }
    }
}
