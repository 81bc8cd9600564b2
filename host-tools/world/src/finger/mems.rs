//! An accelerometer that floats in silicone behind the skin, and a load cell.
//!
//! The accelerometer's board is a mass on the silicone between it and the core. Of the force on the skin a share passes
//! through it; the rest goes round it. Its resonance and the silicone's losses shape its acceleration.

use std::f64::consts::TAU;

use super::cell::Cell;
use super::stimulus::Stimulus;
use crate::conditions::TICK_S;
use crate::noise::Noise;

/// Mass of the board with its share of silicone and wires, kg (chosen: a board of 10 mm by 10 mm by 1 mm with parts).
const MASS_KG: f64 = 1.5e-3;
/// Its resonance, Hz: a square centimetre of silicone of 0.25 MPa (Shore 10 A to 20 A) and 5 mm is 5 kN/m, with the
/// mass 290 Hz.
const RESONANCE_HZ: f64 = 290.0;
/// Damping ratio: half of the loss factor of such silicones, 0.2 to 0.3.
const DAMPING: f64 = 0.13;
/// Share of the force on the skin that goes through the mass (chosen, for accelerations of a tenth of a g to 2 g, as
/// tools that slide over textures have: Culbertson, Unwin and Kuchenbecker 2014).
const THROUGH: f64 = 0.1;
const G: f64 = 9.806_65;

/// The finger's transducers.
pub(in super::super) struct Mems {
    pub(super) cell: Cell,
    /// Place of the mass against the core, m, and its speed.
    place: f64,
    speed: f64,
    /// along the press with gravity, g
    pub(in super::super) acceleration_g: f64,
}

impl Mems {
    pub(super) fn new(made: &mut Noise) -> Self {
        Self {
            cell: Cell::new(made),
            place: 0.0,
            speed: 0.0,
            acceleration_g: 1.0,
        }
    }

    pub(super) fn tick(&mut self, stimulus: &Stimulus, noise: &mut Noise) {
        self.cell.tick(stimulus, noise);
        let omega = TAU * RESONANCE_HZ;
        let skin_n = stimulus.force_n + stimulus.vibration_n;
        // in the frame of the core, which accelerates, too
        let core = stimulus.held.acceleration_g * G;
        let pushed = THROUGH * skin_n / MASS_KG
            - omega * (omega * self.place + 2.0 * DAMPING * self.speed)
            - core;
        self.speed += pushed * TICK_S;
        self.place += self.speed * TICK_S;
        self.acceleration_g = stimulus.held.down + (pushed + core) / G;
    }

    /// Sets its acceleration, g, at any state of its silicone.
    #[cfg(test)]
    pub(super) fn feed(&mut self, g: f64) {
        self.acceleration_g = g;
    }

    /// The cell's output at the last tick, share of its supply.
    pub(in super::super) fn cell_ratio(&self) -> f64 {
        self.cell.ratio(1.0)
    }
}
