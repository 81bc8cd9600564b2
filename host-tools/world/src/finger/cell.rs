//! A bar load cell with a fingertip on its end: a spring with a mass, and a bridge that drifts.

use std::f64::consts::TAU;

use super::stimulus::Stimulus;
use crate::conditions::{TICK_S, TICKS_PER_S};
use crate::noise::Noise;

/// Rated output, share of the supply for each newton: 1 mV/V at 1 kg (usual for such bars).
const RATIO_PER_N: f64 = 1e-3 / 9.806_65;
/// Zero of the bridge, share of the rated output, at most: a tenth (usual), of which two thirds are drawn.
const ZERO_SHARE: f64 = 0.065;
/// The tip weighs 10 g, N.
const TIP_N: f64 = 0.098;
/// The tip on the bar: 0.4 mm at 1 kg (usual) are 25 kN/m, with 10 g 250 Hz; damping of glued silicone and foam
/// (chosen).
const RESONANCE_HZ: f64 = 250.0;
const DAMPING: f64 = 0.15;
/// A bar feels this share of a force across it (chosen; makers promise some per cent).
const ACROSS: f64 = 0.02;
/// Its zero drifts with temperature: deviation, N, and the time in which it wanders, s. A degree (chosen) is 1 mN for a
/// bar of 0.1 % of its range in 10 degrees (usual), and 6 mN for an INA125 of 2 uV a degree; an ADS1220 adds less than
/// a tenth of that.
const DRIFT_N: f64 = 0.006;
const DRIFT_S: f64 = 600.0;

#[derive(Clone, Debug)]
pub(in super::super) struct Cell {
    zero_n: f64,
    drift_n: f64,
    /// Force in the spring, N, and its rate.
    spring_n: f64,
    rate: f64,
    /// Response to a newton, relative to a sound cell's; below 0 where wires are exchanged.
    pub(super) gain: f64,
    /// The output, share of the supply, at the last two ticks.
    ratio: [f64; 2],
}

impl Cell {
    pub(super) fn new(made: &mut Noise) -> Self {
        let zero_n = 9.806_65 * made.between(-ZERO_SHARE, ZERO_SHARE);
        Self {
            zero_n,
            drift_n: made.within(DRIFT_N),
            spring_n: -TIP_N,
            rate: 0.0,
            gain: 1.0,
            ratio: [(zero_n - TIP_N) * RATIO_PER_N; 2],
        }
    }

    pub(super) fn tick(&mut self, stimulus: &Stimulus, noise: &mut Noise) {
        let kick = DRIFT_N * (2.0 * TICK_S / DRIFT_S).sqrt();
        self.drift_n += kick * noise.white()[0] - self.drift_n * TICK_S / DRIFT_S;
        // what presses up is positive, the tip's weight and its inertia are not
        let weight_n = TIP_N * (stimulus.held.down + stimulus.held.acceleration_g);
        let load_n = stimulus.force_n + stimulus.vibration_n + ACROSS * stimulus.shear_n - weight_n;
        let omega = TAU * RESONANCE_HZ;
        self.rate +=
            TICK_S * omega * (omega * (load_n - self.spring_n) - 2.0 * DAMPING * self.rate);
        self.spring_n += TICK_S * self.rate;
        let ratio = (self.zero_n + self.drift_n + self.gain * self.spring_n) * RATIO_PER_N;
        self.ratio = [self.ratio[1], ratio];
    }

    /// Its output between the last two ticks, share of the supply.
    pub(in super::super) fn ratio(&self, fraction: f64) -> f64 {
        self.ratio[0] + (self.ratio[1] - self.ratio[0]) * fraction.clamp(0.0, 1.0)
    }
}

const _: () = assert!(RESONANCE_HZ * 20.0 < TICKS_PER_S as f64);
