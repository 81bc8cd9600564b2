//! Random numbers of the world. They come from ChaCha, so that a seed gives the same world everywhere.

use std::f64::consts::TAU;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::maths::{cos, exp, ln};

/// A stream of random numbers.
#[derive(Clone, Debug)]
pub struct Noise(ChaCha8Rng);

impl Default for Noise {
    fn default() -> Self {
        Self::new(0, 0)
    }
}

impl Noise {
    /// The stream number `stream` of `seed`; different streams have nothing in common.
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(stream);
        Self(rng)
    }

    /// Uniform in 0..1.
    pub fn uniform(&mut self) -> f64 {
        self.0.random()
    }

    /// Uniform between `low` and `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Standard normal (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let (u, v) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * ln(u)).sqrt() * cos(TAU * v)
    }

    /// `median` times a log-normal factor of deviation `spread`, at most two and a half of which are drawn.
    pub fn about(&mut self, median: f64, spread: f64) -> f64 {
        median * exp(self.within(spread))
    }

    /// Normal with mean 0, cut at two and a half deviations.
    pub fn within(&mut self, deviation: f64) -> f64 {
        deviation * self.normal().clamp(-2.5, 2.5)
    }

    /// Two independent numbers of mean 0 and variance 1 for noise at every tick: sums of two uniform ones, which
    /// filters make normal, and ten times as fast as [`normal`](Self::normal).
    pub fn white(&mut self) -> [f64; 2] {
        // each sum of two 16-bit numbers: mean 65535, variance 2 * 65536^2 / 12
        const DEVIATION: f64 = 65_536.0 * 0.408_248_290_463_863;
        let bits: u64 = self.0.random();
        let sum = |shift: u32| {
            f64::from((bits >> shift) as u16) + f64::from((bits >> (shift + 16)) as u16)
        };
        [0, 32].map(|shift| (sum(shift) - 65_535.0) / DEVIATION)
    }
}
