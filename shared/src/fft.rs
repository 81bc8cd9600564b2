//! The power of 512 windowed samples: a complex transform of 256 points, radix 4, whose result is taken apart into that of
//! the real samples while its power is summed.
//!
//! The complex numbers are pairs of samples. Everything is twice as large as its definition has it, since halving the sums
//! and differences of the last step would cost; a factor of 2 rounds nothing.

use crate::spectrum::{BINS, FRAME};

/// Points of the complex transform.
const POINTS: usize = FRAME / 2;
/// Butterflies of each stage but the last: a quarter of what is left to transform.
const FIRST: usize = POINTS / 4;
const SECOND: usize = FIRST / 4;
const THIRD: usize = SECOND / 4;

type Complex = [f32; 2];

/// e^(-2 pi i n / of).
const fn twiddle(n: usize, of: usize) -> Complex {
    let x = -2.0 * core::f64::consts::PI * n as f64 / of as f64;
    // at most 3/4 of a turn: 40 terms leave nothing that an f32 could show
    let (mut cos, mut sin, mut term, mut k) = (0.0, 0.0, 1.0, 0);
    while k < 40 {
        match k % 4 {
            0 => cos += term,
            1 => sin += term,
            2 => cos -= term,
            _ => sin -= term,
        }
        k += 1;
        term *= x / k as f64;
    }
    [cos as f32, sin as f32]
}

/// First, second and third power of the factors of a stage.
const fn twiddles<const Q: usize>() -> [[Complex; 3]; Q] {
    let mut all = [[[0.0; 2]; 3]; Q];
    let mut n = 0;
    while n < Q {
        let of = 4 * Q;
        all[n] = [twiddle(n, of), twiddle(2 * n, of), twiddle(3 * n, of)];
        n += 1;
    }
    all
}

static FIRST_TWIDDLES: [[Complex; 3]; FIRST] = twiddles();
static SECOND_TWIDDLES: [[Complex; 3]; SECOND] = twiddles();
static THIRD_TWIDDLES: [[Complex; 3]; THIRD] = twiddles();

/// Where the transform leaves bin k: the digits of k in base 4, the last first.
const fn place(k: usize) -> u8 {
    ((k & 3) << 6 | (k >> 2 & 3) << 4 | (k >> 4 & 3) << 2 | k >> 6 & 3) as u8
}

/// For bins k from 1: where bins k and 256 - k of the complex transform are, and the factor of k in the real one.
static PAIRS: [([u8; 2], Complex); POINTS / 2 - 1] = {
    let mut pairs = [([0; 2], [0.0; 2]); POINTS / 2 - 1];
    let mut n = 0;
    while n < pairs.len() {
        let k = n + 1;
        pairs[n] = ([place(k), place(POINTS - k)], twiddle(k, FRAME));
        n += 1;
    }
    pairs
};

/// Adds |2 X|^2 of every bin of the windowed frame to `power`; twice the real parts of bins 0 and 1.
pub(crate) fn add_power(
    window: &[f32; FRAME],
    frame: &[i16; FRAME],
    power: &mut [f32; BINS],
) -> [f32; 2] {
    let mut z = [[0.0; 2]; POINTS];
    let pairs = frame.as_chunks().0.iter().zip(window.as_chunks().0);
    for (z, (&[even, odd], &[w_even, w_odd])) in z.iter_mut().zip(pairs) {
        *z = [f32::from(even) * w_even, f32::from(odd) * w_odd];
    }
    stage(&mut z, &FIRST_TWIDDLES);
    stage(&mut z, &SECOND_TWIDDLES);
    stage(&mut z, &THIRD_TWIDDLES);
    for four in z.as_chunks_mut().0 {
        let [a, b, c, d] = four;
        [*a, *b, *c, *d] = butterfly(*a, *b, *c, *d);
    }
    take_apart(&z, power)
}

/// Sums and differences of four numbers a quarter of the transform apart.
#[inline(always)]
fn butterfly(a: Complex, b: Complex, c: Complex, d: Complex) -> [Complex; 4] {
    let (even, odd) = (add(a, c), add(b, d));
    let (across, [re, im]) = (sub(a, c), sub(b, d));
    // times -i
    let turned = [im, -re];
    [
        add(even, odd),
        add(across, turned),
        sub(even, odd),
        sub(across, turned),
    ]
}

#[inline(always)]
fn add(a: Complex, b: Complex) -> Complex {
    [a[0] + b[0], a[1] + b[1]]
}

#[inline(always)]
fn sub(a: Complex, b: Complex) -> Complex {
    [a[0] - b[0], a[1] - b[1]]
}

#[inline(always)]
fn times(a: Complex, b: Complex) -> Complex {
    [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
}

/// One stage of the decimation in frequency.
#[inline(always)]
fn stage<const Q: usize>(z: &mut [Complex; POINTS], twiddles: &[[Complex; 3]; Q]) {
    for block in z.chunks_exact_mut(4 * Q) {
        let mut quarters = block.chunks_exact_mut(Q);
        let (Some(a), Some(b), Some(c), Some(d)) = (
            quarters.next(),
            quarters.next(),
            quarters.next(),
            quarters.next(),
        ) else {
            return;
        };
        let numbers = a.iter_mut().zip(b).zip(c).zip(d);
        for ((((a, b), c), d), [first, second, third]) in numbers.zip(twiddles) {
            let [y0, y1, y2, y3] = butterfly(*a, *b, *c, *d);
            *a = y0;
            *b = times(y1, *first);
            *c = times(y2, *second);
            *d = times(y3, *third);
        }
    }
}

/// From the transform of pairs to that of the samples: with E and O those of the even and the odd ones, and w the factor of
/// bin k, bin k is E + w O and bin 256 - k the conjugate of E - w O.
fn take_apart(z: &[Complex; POINTS], power: &mut [f32; BINS]) -> [f32; 2] {
    let [[re, im], ..] = *z;
    let (zero, nyquist) = (2.0 * (re + im), 2.0 * (re - im));
    let [re, im] = z[usize::from(const { place(POINTS / 2) })];
    let middle = 4.0 * (re * re + im * im);
    let [first, low @ .., last] = power;
    *first += zero * zero;
    *last += nyquist * nyquist;
    let (low, high) = low.split_at_mut(POINTS / 2 - 1);
    if let [at_middle, ..] = high {
        *at_middle += middle;
    }
    let mut one = None;
    for ((low, high), &([k, other], w)) in low.iter_mut().zip(high.iter_mut().rev()).zip(&PAIRS) {
        let ([kr, ki], [or, oi]) = (z[usize::from(k)], z[usize::from(other)]);
        let even = [kr + or, ki - oi];
        // (Z[k] - conj Z[256 - k]) / i
        let odd = times([ki + oi, or - kr], w);
        let [re, im] = add(even, odd);
        *low += re * re + im * im;
        one.get_or_insert(re);
        let [re, im] = sub(even, odd);
        *high += re * re + im * im;
    }
    [zero, one.unwrap_or(0.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    /// The definition, in f64.
    fn bins(frame: &[i16], window: &[f32]) -> Vec<(f64, f64)> {
        (0..BINS)
            .map(|k| {
                let parts = frame.iter().zip(window).enumerate();
                parts.fold((0.0, 0.0), |(re, im), (n, (&x, &w))| {
                    let phase =
                        -2.0 * std::f64::consts::PI * ((k * n) % FRAME) as f64 / FRAME as f64;
                    let x = f64::from(x) * f64::from(w);
                    (re + x * phase.cos(), im + x * phase.sin())
                })
            })
            .collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn it_is_the_transform_of_the_definition(frame in proptest::collection::vec(-4096i16..4096, FRAME), offset in -3000i16..3000) {
            let frame: Vec<i16> = frame.iter().map(|x| x / 2 + offset / 2).collect();
            let frame: &[i16; FRAME] = frame.first_chunk().unwrap();
            let window = crate::spectrum::hann();
            let mut power = [1.0; BINS];
            let [zero, one] = add_power(&window, frame, &mut power);
            let exact = bins(frame, &window);
            // rounding errors of an f32 transform are small against its largest numbers
            let largest = exact.iter().map(|(re, im)| re.hypot(*im)).fold(0.0, f64::max);
            let error = 1e-6 * largest;
            prop_assert!((f64::from(zero) / 2.0 - exact[0].0).abs() < error);
            prop_assert!((f64::from(one) / 2.0 - exact[1].0).abs() < error);
            for (k, (power, (re, im))) in power.iter().zip(exact).enumerate() {
                let (got, exact) = (((f64::from(*power) - 1.0).max(0.0)).sqrt() / 2.0, re.hypot(im));
                prop_assert!((got - exact).abs() < error + 1e-3, "{k}: {got} {exact}");
            }
        }
    }
}
