//! A piezo disc behind the skin with two amplifiers, and a load cell with one, as voltages before a converter.
//!
//! A disc gives charge for a change of force; with the amplifier's input that is a high-pass. It gives more when it is
//! loaded, since the skin then covers more of it, and its charge drifts with warmth (pyroelectricity), which the
//! high-pass takes away.

use super::amplifier::{HighPass, LowPass, between};
use super::cell::Cell;
use super::stimulus::Stimulus;
use crate::noise::Noise;

/// Supply of bridge and converter, V.
pub(super) const SUPPLY_V: f64 = 3.3;
/// Voltage of P_AC for each newton within its band: the paper's second gain of 99.1 above 0.0701 V/N (chosen, so that
/// its counts are a BioTac's).
pub(super) const PAC_V_PER_N: f64 = 99.1 * SUPPLY_V / 4096.0 / 0.0115;
/// Its upper corner, Hz; the lower one is the high-pass's 10 Hz.
const UPPER_HZ: f64 = 1040.0;
/// Gain grows with the load by this share for each newton (chosen).
const LOADED_PER_N: f64 = 0.05;
/// Mass of the skin in front of the disc, kg (chosen: 2 mm of silicone on 3 cm^2).
const SKIN_KG: f64 = 0.7e-3;
/// Noise of the two amplifiers, V rms (chosen: 1.5 counts, the paper's).
const PAC_NOISE_V: f64 = 1.2e-3;
/// Offset of the amplifiers about half of the supply, V (chosen).
const OFFSET_V: f64 = 0.01;
/// Charge by warmth: rate, V/s at the amplifier's output before its high-pass (chosen).
const PYRO_V_PER_S: f64 = 0.05;

/// Gain of the INA125, and where its reference pin puts a bridge in balance, V.
const CELL_GAIN: f64 = 208.0;
const BALANCE_V: f64 = 1000.0 * SUPPLY_V / 4096.0;
/// Ends of its output, V: near ground, and 0.8 V below its supply (its data sheet, "Output").
const SWING_V: (f64, f64) = (0.1, SUPPLY_V - 0.8);
/// Noise of P_DC, V rms (chosen: 0.3 counts).
const CELL_NOISE_V: f64 = 0.24e-3;

/// The finger's transducers.
pub(in super::super) struct Analog {
    pub(super) cell: Cell,
    high_pass: HighPass,
    low_pass: LowPass,
    offset_v: f64,
    pyro_v: f64,
    pac_v: [f64; 2],
    pub(in super::super) wire_cut: bool,
}

impl Analog {
    pub(super) fn new(made: &mut Noise) -> Self {
        let offset_v = SUPPLY_V / 2.0 + made.within(OFFSET_V);
        Self {
            cell: Cell::new(made),
            high_pass: HighPass::default(),
            low_pass: LowPass::new(UPPER_HZ),
            offset_v,
            pyro_v: 0.0,
            pac_v: [offset_v; 2],
            wire_cut: false,
        }
    }

    pub(super) fn tick(&mut self, stimulus: &Stimulus, noise: &mut Noise) {
        self.cell.tick(stimulus, noise);
        self.pyro_v += PYRO_V_PER_S * crate::conditions::TICK_S * noise.white()[1];
        let loaded = 1.0 + LOADED_PER_N * stimulus.force_n;
        // the skin in front of the disc has a mass: what shakes the mounting presses it on the disc
        let shaken_n = SKIN_KG * 9.806_65 * stimulus.held.acceleration_g;
        let force_n = stimulus.force_n + stimulus.vibration_n + shaken_n;
        let volts = PAC_V_PER_N * loaded * force_n + self.pyro_v;
        let band = self.low_pass.tick(self.high_pass.tick(volts));
        self.pac_v = [self.pac_v[1], self.offset_v + band];
    }

    /// Voltage of a channel, 0 is P_AC, between the last two ticks.
    pub(super) fn volts(&self, channel: u8, fraction: f64, noise: &mut Noise) -> f64 {
        if channel == 0 {
            return between(self.pac_v, fraction) + PAC_NOISE_V * noise.normal();
        }
        let (low_v, high_v) = SWING_V;
        let bridge_v = self.cell.ratio(fraction) * SUPPLY_V;
        // with an open input the amplifier goes to an end (chosen: the upper one, as nothing presses there)
        let out_v = match self.wire_cut {
            true => high_v,
            false => BALANCE_V + CELL_GAIN * bridge_v,
        };
        out_v.clamp(low_v, high_v) + CELL_NOISE_V * noise.normal()
    }
}
