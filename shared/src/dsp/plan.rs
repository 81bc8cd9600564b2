//! The constants of every slide: the coefficients of the band-pass, and the angles of window and transform.

use core::f64::consts::{PI, TAU};

use microfft::Complex32;

use super::kernels::Kernels;
use crate::sensor::pressure::RATE_HZ;

/// Number of coefficients of the 66th-order filter.
pub const TAPS: usize = 67;
/// Edges of the pass band in Hz, the range of the Pacinian corpuscles that the paper imitates.
const PASS_BAND_HZ: (f64, f64) = (20.0, 700.0);

/// Samples before the one that an output is for.
pub(crate) const HISTORY: usize = TAPS - 1;
/// Samples in a frame.
pub const FRAME: usize = 512;

/// The constants of every slide: the angles of window and transform, and the loops that go through them.
#[derive(Clone, Debug)]
pub struct Plan {
    angles: Angles,
    pub(super) kernels: Kernels,
}

impl Plan {
    /// Computes them, for the plain kernels; once per boot is enough.
    pub fn new() -> Self {
        Self::with(Kernels::PLAIN)
    }

    /// As [`Plan::new`], for other kernels.
    pub fn with(kernels: Kernels) -> Self {
        let angles = angles();
        Self { angles, kernels }
    }

    /// Returns the angles for the spectrum.
    pub(crate) fn angles(&self) -> &Angles {
        &self.angles
    }
}

impl Default for Plan {
    fn default() -> Self {
        Self::new()
    }
}

/// Coefficients of the band-pass in Q15, newest sample first. They are symmetric: the filter has linear phase.
pub type Taps = [i16; TAPS];

/// Pairs of coefficients of [`HALVES`] that cover all of a filter's from an even sample on, and from an odd one.
const HALF_PAIRS: usize = TAPS.div_ceil(4) + 1;

/// See [`HALVES`].
pub type HalfFilters = [[[u32; 2]; HALF_PAIRS]; 3];

/// Two outputs by three filters of half the length (fast FIR algorithm): with the even coefficients E and the odd ones
/// O of the band-pass, and the even samples e and the odd ones o, an even output is `E e[m] + O o[m]`, and the odd one
/// after it `(E + O) (o[m] + e[m+1]) - E e[m+1] - O o[m]`. These are E + O, O and E, oldest sample first (the filter is
/// symmetric), for kernels that multiply pairs of samples: two coefficients to a word, the older sample's in the low
/// half. Of each two words the first is for an output whose oldest sample is the first of a pair, the other for the
/// output after it, which begins with the second of that pair.
pub const HALVES: HalfFilters = halves();

#[allow(clippy::indexing_slicing)] // the compiler runs it, and has no iterators
const fn halves() -> HalfFilters {
    let mut filters = [[[0; 2]; HALF_PAIRS]; 3];
    let mut pair = 0;
    while pair < HALF_PAIRS {
        let mut odd = 0;
        while odd < 2 {
            // of the filters, the older coefficient of the word
            let older = (2 * pair).wrapping_sub(odd);
            let [even_0, odd_0] = [coefficient(older, 0), coefficient(older, 1)];
            let newer = older.wrapping_add(1);
            let [even_1, odd_1] = [coefficient(newer, 0), coefficient(newer, 1)];
            filters[0][pair][odd] = word(even_0 + odd_0, even_1 + odd_1);
            filters[1][pair][odd] = word(odd_0, odd_1);
            filters[2][pair][odd] = word(even_0, even_1);
            odd += 1;
        }
        pair += 1;
    }
    filters
}

/// An even coefficient, or the odd one after it; 0 where there is none. A sum of both must fit into 16 bits, too.
#[allow(clippy::indexing_slicing)] // the compiler runs it, and has no iterators
const fn coefficient(n: usize, odd: usize) -> i16 {
    let at = n.wrapping_mul(2).wrapping_add(odd);
    if at < TAPS { BAND_PASS[at] } else { 0 }
}

const fn word(low: i16, high: i16) -> u32 {
    low as u16 as u32 | (high as u16 as u32) << 16
}

/// The band-pass, designed by the compiler.
pub const BAND_PASS: Taps = design();

/// Designs the band-pass: the ideal response, cut by a Hamming window and scaled to gain 1 in the middle of the band.
#[allow(clippy::indexing_slicing)] // the compiler runs it, and has no iterators
const fn design() -> [i16; TAPS] {
    // frequencies in cycles per sample
    let (low, high) = (
        PASS_BAND_HZ.0 / RATE_HZ as f64,
        PASS_BAND_HZ.1 / RATE_HZ as f64,
    );
    let mut response = [0.0; TAPS];
    let mut gain = 0.0;
    let mut n = 0;
    while n < TAPS {
        // samples from the centre
        let m = n as f64 - HISTORY as f64 / 2.0;
        let hamming = 0.54 - 0.46 * cos_of_turns(n as f64 / HISTORY as f64);
        response[n] = (ideal(high, m) - ideal(low, m)) * hamming;
        gain += response[n] * cos_of_turns((low + high) * m / 2.0);
        n += 1;
    }
    let mut taps = [0; TAPS];
    let mut n = 0;
    while n < TAPS {
        let tap = response[n] / gain * 32768.0;
        // to the nearest: what is converted is cut towards 0
        taps[n] = (tap + if tap < 0.0 { -0.5 } else { 0.5 }) as i16;
        n += 1;
    }
    taps
}

/// The ideal low-pass, `m` samples from its centre.
const fn ideal(edge: f64, m: f64) -> f64 {
    if m == 0.0 {
        2.0 * edge
    } else {
        // a sine is a cosine a quarter of a turn later
        cos_of_turns(edge * m - 0.25) / (PI * m)
    }
}

/// Cosine of an angle in turns, fewer than 2^31 of them: the compiler runs it, and cannot run that of `libm`.
const fn cos_of_turns(turns: f64) -> f64 {
    let turns = if turns < 0.0 { -turns } else { turns };
    let part = turns - turns as u32 as f64;
    // to an eighth of a turn, where the series below are as good as f64 is
    let half = if part > 0.5 { 1.0 - part } else { part };
    let (quarter, sign) = if half > 0.25 {
        (0.5 - half, -1.0)
    } else {
        (half, 1.0)
    };
    if quarter <= 0.125 {
        sign * series(TAU * quarter, 0)
    } else {
        let x = TAU * (0.25 - quarter);
        sign * x * series(x, 1)
    }
}

/// 1 - x^2 / ((first + 1) (first + 2)) (1 - x^2 / ((first + 3) (first + 4)) (1 - ...
const fn series(x: f64, first: u32) -> f64 {
    let mut sum = 1.0;
    let mut term = 9;
    while term > 0 {
        term -= 1;
        let n = (first + 2 * term) as f64;
        sum = 1.0 - x * x / ((n + 1.0) * (n + 2.0)) * sum;
    }
    sum
}

/// Cosine and sine of every 512th part of a turn in its first quarter: what the window and folding take.
pub type Angles = [[f32; 2]; FRAME / 4];

#[inline]
pub(super) fn angles() -> Angles {
    let mut angles = [[0.0; 2]; FRAME / 4];
    // a sine is a cosine a quarter of a turn later, and a cosine is the same on both sides of 0
    let pairs = COSINES.iter().zip(COSINES.iter().rev());
    for (angle, (cos, sin)) in angles.iter_mut().zip(pairs) {
        *angle = [*cos, *sin];
    }
    angles
}

/// Cosines of every 512th part of a turn from 0 to a quarter, computed by the compiler: what computes them takes more
/// flash than they do.
const COSINES: [f32; FRAME / 4 + 1] = cosines();

#[allow(clippy::indexing_slicing)] // the compiler runs it, and has no iterators
const fn cosines() -> [f32; FRAME / 4 + 1] {
    let mut cosines = [0.0; FRAME / 4 + 1];
    let mut n = 0;
    while n < cosines.len() {
        cosines[n] = cos_of_turns(n as f64 / FRAME as f64) as f32;
        n += 1;
    }
    cosines
}

/// A frame that was folded: a complex number for every odd bin, then the reals that the even ones are the transform of,
/// each with that half of them later.
pub type Folded = [Complex32; FRAME / 2];

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use std::vec::Vec;

    /// |H(f)|, from the definition of a filter's response.
    pub(in crate::dsp) fn gain(f_hz: f64) -> f64 {
        let w = 2.0 * PI * f_hz / f64::from(RATE_HZ);
        let taps = BAND_PASS.iter().enumerate();
        let (re, im) = taps.fold((0.0, 0.0), |(re, im), (n, &h)| {
            let h = f64::from(h) / 32768.0;
            (re + h * (w * n as f64).cos(), im - h * (w * n as f64).sin())
        });
        re.hypot(im)
    }

    #[test]
    fn angles_are_those_of_libm() {
        let turn = 2.0 * core::f64::consts::PI / FRAME as f64;
        for (n, angle) in angles().into_iter().enumerate() {
            let (sin, cos) = (turn * n as f64).sin_cos();
            assert_eq!(angle, [cos as f32, sin as f32], "{n}");
        }
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
        assert_eq!(BAND_PASS[..], taps[..]);
    }

    #[test]
    fn three_filters_of_half_the_length_are_the_band_pass() {
        let x: Vec<i32> = (0..101)
            .map(|n| (n * n * 37 + n * 101) % 8192 - 4096)
            .collect();
        let at = |n: usize| x.get(n).copied().unwrap_or(0);
        let [sums, odd, even] = HALVES;
        // the second word of a pair begins one sample later
        let filter = |pairs: &[[u32; 2]; HALF_PAIRS], m: usize, x: &dyn Fn(usize) -> i32| {
            let words = pairs
                .iter()
                .map(|pair| pair[m % 2])
                .zip((m - m % 2..).step_by(2));
            let product = |(word, n): (u32, usize)| {
                i32::from(word as i16) * x(n) + (word as i32 >> 16) * x(n + 1)
            };
            words.map(product).sum::<i32>()
        };
        for n in 0..35 {
            let y = x.iter().skip(n).zip(BAND_PASS);
            let y: i32 = y.map(|(x, h)| x * i32::from(h)).sum();
            let m = n / 2;
            let of_odd = filter(&odd, m, &|m| at(2 * m + 1));
            let of_even = |m| filter(&even, m, &|m| at(2 * m));
            let by_three = match n % 2 {
                0 => of_even(m) + of_odd,
                _ => {
                    let of_sums = filter(&sums, m, &|m| at(2 * m + 1) + at(2 * m + 2));
                    of_sums - of_even(m + 1) - of_odd
                }
            };
            assert_eq!(by_three, y, "{n}");
        }
    }
}
