//! The inner loops of a slide. A chip may bring faster ones without touching the core: they are functions of a
//! [`super::Plan`].

use core::mem::MaybeUninit;

use microfft::Complex32;
use microfft::complex::{cfft_32, cfft_64, cfft_128};
use microfft::real::rfft_64;

use super::plan::{Angles, FRAME, Folded, TAPS, Taps};

/// The loops that cost the time of a slide. [`Kernels::PLAIN`] is the reference: other ones give the same integers,
/// and the same floats to the bit.
#[derive(Clone, Copy, Debug)]
pub struct Kernels {
    /// Copies samples; beyond what 12 bits can differ by, -4096..=4095, they are clipped. There are as many of both.
    pub clip: fn(samples: &[i16], clipped: &mut [i16]),

    /// Filters samples and returns the sum of the squared outputs, in Q14 counts^2: each output is the sum of products
    /// (Q15) rounded to Q7.
    ///
    /// The first output is due at sample `TAPS - 1` (those before it are history), so there are
    /// `samples.len() - (TAPS - 1)` outputs, and none of fewer samples. No sample is outside -4096..=4095, which keeps
    /// the sum of products inside i32.
    pub band_energy: fn(taps: &Taps, samples: &[i16]) -> u64,

    /// Multiplies a frame by twice the Hann window, 1 - cos(2 pi n / N), and folds it as [`Kernels::fold`] does. No
    /// sample is outside -16384..=16383, so that sums of two are 16 bits.
    pub fold_frame: for<'r> fn(
        angles: &Angles,
        frame: &[i16; FRAME],
        buffer: &'r mut MaybeUninit<Folded>,
    ) -> &'r mut Folded,

    /// Halves the transform of reals, of which each of `reals` has one and that half of them later: the first half of
    /// `folded`, transformed, is bins 1, 5, 9 and so on, and the other one has the reals, in such pairs again, whose
    /// bins are 0, 2, 4 and so on (decimation in frequency). Both are as long as each other, a power of 2 from 8 to
    /// 128.
    pub fold: fn(angles: &Angles, reals: &[Complex32], folded: &mut [Complex32]),

    /// Transforms 32, 64 or 128 values in place, as microfft does (decimation in time, radix 2); others stay as they
    /// are. The sign of a 0 is open.
    pub transform: fn(angles: &Angles, values: &mut [Complex32]),

    /// Returns the lower half of the transform of reals, as microfft does: that of the last bin, which is real, is the
    /// imaginary part of the first one.
    pub transform_reals:
        for<'r> fn(angles: &Angles, reals: &'r mut Reals) -> &'r mut [Complex32; FRAME / 16],

    /// Writes |X|^2 of each bin, and adds it to its sum.
    pub add_power: fn(bins: &[Complex32], powers: &mut [f32], sums: &mut [f32]),
}

impl Kernels {
    /// Plain Rust, the same on chip and PC.
    pub const PLAIN: Self = Self {
        clip,
        band_energy,
        fold_frame,
        fold,
        transform: |_, values| transform(values),
        transform_reals: |_, reals| transform_reals(reals),
        add_power,
    };
}

/// A frame that was folded three times.
pub type Reals = [f32; FRAME / 8];

fn transform_reals(reals: &mut Reals) -> &mut [Complex32; FRAME / 16] {
    rfft_64(reals)
}

fn transform(values: &mut [Complex32]) {
    match values.len() {
        128 => in_place(values, cfft_128),
        64 => in_place(values, cfft_64),
        32 => in_place(values, cfft_32),
        _ => {}
    }
}

#[inline]
fn in_place<const N: usize>(
    values: &mut [Complex32],
    cfft: fn(&mut [Complex32; N]) -> &mut [Complex32; N],
) {
    if let Ok(values) = values.try_into() {
        cfft(values);
    }
}

fn clip(samples: &[i16], clipped: &mut [i16]) {
    for (slot, &sample) in clipped.iter_mut().zip(samples) {
        *slot = sample.clamp(-4096, 4095);
    }
}

fn band_energy(taps: &Taps, samples: &[i16]) -> u64 {
    samples
        .windows(TAPS)
        .map(|x| {
            // no sum overflows; asked each time, a build with such checks would take eight times as long
            let y = x.iter().zip(taps.iter().rev()).fold(0i32, |sum, (&x, &h)| {
                sum.wrapping_add(i32::from(x) * i32::from(h))
            });
            let y = i64::from((y + (1 << 7)) >> 8);
            (y * y) as u64
        })
        .sum()
}

fn fold_frame<'r>(
    angles: &Angles,
    frame: &[i16; FRAME],
    buffer: &'r mut MaybeUninit<Folded>,
) -> &'r mut Folded {
    let folded = buffer.write([Complex32::new(0.0, 0.0); FRAME / 2]);
    let ([odd, even], _) = folded.as_chunks_mut::<{ FRAME / 4 }>() else {
        return folded;
    };
    let ([a, b, c, d], _) = frame.as_chunks::<{ FRAME / 4 }>() else {
        return folded;
    };
    let x = a.iter().zip(b).zip(c.iter().zip(d)).zip(angles);
    for ((((a, b), (c, d)), &[cos, sin]), (odd, even)) in x.zip(odd.iter_mut().zip(even)) {
        let [a, b, c, d] = [a, b, c, d].map(|x| i32::from(*x));
        let [sum, apart, sum_1, apart_1] = [a + c, a - c, b + d, b - d].map(|x| x as f32);
        // the windows of a, b, c and d are 1 - cos, 1 + sin, 1 + cos and 1 - sin
        even.re = sum - cos * apart;
        even.im = sum_1 + sin * apart_1;
        *odd = turned(apart - cos * sum, apart_1 + sin * sum_1, [cos, sin]);
    }
    folded
}

fn fold(angles: &Angles, reals: &[Complex32], folded: &mut [Complex32]) {
    let half = reals.len() / 2;
    let (a, b) = reals.split_at_checked(half).unwrap_or_default();
    let (odd, even) = folded.split_at_mut_checked(half).unwrap_or_default();
    let angles = angles.iter().step_by((angles.len() / half.max(1)).max(1));
    let x = a.iter().zip(b).zip(angles);
    for (((a, b), angle), (odd, even)) in x.zip(odd.iter_mut().zip(even)) {
        *even = Complex32::new(a.re + a.im, b.re + b.im);
        *odd = turned(a.re - a.im, b.re - b.im, *angle);
    }
}

fn add_power(bins: &[Complex32], powers: &mut [f32], sums: &mut [f32]) {
    for ((bin, power), sum) in bins.iter().zip(powers).zip(sums) {
        *power = bin.re * bin.re + bin.im * bin.im;
        *sum += *power;
    }
}

/// (p - iq) (cos - i sin), each product and sum rounded.
#[inline]
fn turned(p: f32, q: f32, [cos, sin]: [f32; 2]) -> Complex32 {
    Complex32::new(p * cos - q * sin, -(p * sin) - q * cos)
}
