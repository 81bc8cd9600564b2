//! Student's t in place of the paper's Gaussians: with a few trials the standard deviation of one texture is itself
//! uncertain, and what all textures have in common helps (Smyth 2004).

use crate::features::Property;
use crate::table::{Action, Gaussian, Table};

/// Degrees of freedom of what is taken as known.
const KNOWN: f32 = 1000.0;
/// Halvings of the range in which the degrees of freedom are looked for: down to the digits of an f32.
const HALVINGS: usize = 40;

/// The common part of the variances of all textures at one movement, for one property.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct ShrinkagePrior {
    pub(super) freedom: f32,
    variance: f32,
}

impl ShrinkagePrior {
    /// From the moments of the logarithms of the variances of the textures that were learned from two trials or more.
    pub(super) fn new(table: &Table<'_>, movement: u8, property: Property) -> Self {
        let action = Action::of(movement, property);
        let logs = || {
            (0..table.textures()).filter_map(|texture| {
                let gaussian = table.gaussian(texture, action)?;
                let half = f32::from(table.trials(texture, movement) - 1) / 2.0;
                let variance = (gaussian.sd * gaussian.sd).max(1e-12);
                let e = libm::logf(variance) - digamma(half) + libm::logf(half);
                Some((e, trigamma(half)))
            })
        };
        let count = logs().count() as f32;
        let (mean, expected) = logs().fold((0.0, 0.0), |(mean, expected), (e, noise)| {
            (mean + e / count, expected + noise / count)
        });
        let scatter: f32 = logs().map(|(e, _)| (e - mean) * (e - mean)).sum();
        let excess = scatter / (count - 1.0).max(1.0) - expected;
        let freedom = if excess <= trigamma(KNOWN / 2.0) {
            KNOWN
        } else {
            let (mut low, mut high) = (1e-2, KNOWN);
            for _ in 0..HALVINGS {
                let middle = (low + high) / 2.0;
                if trigamma(middle / 2.0) > excess {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            low
        };
        let half = freedom / 2.0;
        Self {
            freedom,
            variance: libm::expf(mean + digamma(half) - libm::logf(half)),
        }
    }

    pub(super) fn variance(&self, sd: f32, trials: u8) -> f32 {
        let own = f32::from(trials) - 1.0;
        (self.freedom * self.variance + own * sd * sd) / (self.freedom + own)
    }

    /// The expectation of the mean of `slides` slides: the own mean is uncertain as well.
    pub(super) fn expect(&self, known: Gaussian, trials: u8, slides: u8) -> Gaussian {
        let share = 1.0 / f32::from(slides.max(1)) + 1.0 / f32::from(trials.max(1));
        Gaussian {
            mean: known.mean,
            sd: libm::sqrtf(self.variance(known.sd, trials) * share),
        }
    }
}

#[derive(Clone, Copy)]
pub(super) struct Student {
    freedom: f32,
    norm: f32,
}

impl Student {
    pub(super) fn new(freedom: f32) -> Self {
        Self {
            freedom,
            norm: ln_gamma_step(freedom / 2.0) - 0.5 * libm::logf(freedom),
        }
    }

    pub(super) fn freedom(&self) -> f32 {
        self.freedom
    }

    pub(super) fn log(&self, x: f32, expected: Gaussian) -> f32 {
        let z = (x - expected.mean) / expected.sd;
        let tail = libm::log1pf(z * z / self.freedom);
        self.norm - libm::logf(expected.sd) - (self.freedom + 1.0) / 2.0 * tail
    }
}

/// ln Gamma(x + 1/2) - ln Gamma(x): the recurrence up to 6, then the asymptotic series. The difference of the two would
/// lose digits, and the chip 1.5 KB.
fn ln_gamma_step(mut x: f32) -> f32 {
    let mut ratio = 1.0;
    while x < 6.0 {
        ratio *= x / (x + 0.5);
        x += 1.0;
    }
    let by = 1.0 / x;
    let square = by * by;
    libm::logf(ratio) + 0.5 * libm::logf(x)
        - by * (1.0 / 8.0 - square * (1.0 / 192.0 - square / 640.0))
}

/// Derivative of ln Gamma: the recurrence up to 6, then the asymptotic series.
#[inline]
fn digamma(mut x: f32) -> f32 {
    let mut below = 0.0;
    while x < 6.0 {
        below -= 1.0 / x;
        x += 1.0;
    }
    let square = 1.0 / (x * x);
    below + libm::logf(x)
        - 0.5 / x
        - square * (1.0 / 12.0 - square * (1.0 / 120.0 - square / 252.0))
}

#[inline]
fn trigamma(mut x: f32) -> f32 {
    let mut below = 0.0;
    while x < 6.0 {
        below += 1.0 / (x * x);
        x += 1.0;
    }
    let square = 1.0 / (x * x);
    below
        + 1.0 / x
        + 0.5 * square
        + square / x * (1.0 / 6.0 - square * (1.0 / 30.0 - square / 42.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Abramowitz & Stegun, table 6.1 and 6.4.
    #[test]
    fn digamma_and_trigamma_are_those_of_the_books() {
        for (x, psi, psi1) in [
            (0.5, -1.963_510_026_021_423_f64, 4.934_802_200_544_679_f64),
            (1.0, -0.577_215_664_901_533, 1.644_934_066_848_226),
            (2.0, 0.422_784_335_098_467, 0.644_934_066_848_226),
            (10.0, 2.251_752_589_066_721, 0.105_166_335_681_686),
        ] {
            let off =
                |found: f32, exact: f64| (f64::from(found) - exact).abs() / exact.abs().max(1.0);
            assert!(off(digamma(x), psi) < 5e-7, "{x} {}", digamma(x));
            assert!(off(trigamma(x), psi1) < 5e-7, "{x} {}", trigamma(x));
        }
    }

    #[test]
    fn the_step_of_ln_gamma_is_the_difference() {
        for n in 1..4000 {
            let x = n as f32 * 0.125;
            let exact = libm::lgamma(f64::from(x) + 0.5) - libm::lgamma(f64::from(x));
            let error = f64::from(ln_gamma_step(x)) - exact;
            assert!(error.abs() < 1e-6, "{x}: {error}");
        }
    }

    /// The density integrates to 1, whatever its degrees of freedom: textures of different numbers of trials can be
    /// compared.
    #[test]
    fn the_density_is_one() {
        for freedom in [1.5, 4.0, 30.0, 900.0] {
            let student = Student::new(freedom);
            let expected = Gaussian { mean: 1.0, sd: 0.5 };
            let sum: f64 = (-400_000..400_000)
                .map(|n| f64::from(student.log(1.0 + n as f32 * 1e-3, expected)).exp() * 1e-3)
                .sum();
            // without 1/sqrt(pi), which all have
            let sum = sum / std::f64::consts::PI.sqrt();
            assert!((sum - 1.0).abs() < 3e-3, "{freedom}: {sum}");
        }
    }
}
