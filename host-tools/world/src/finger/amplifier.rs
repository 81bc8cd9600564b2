//! From the pressure of the fluid to the two signals' counts.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use super::skin::N_PER_COUNT;
use crate::conditions::{TICK_S, TICKS_PER_S};
use crate::maths::{exp, tan};
use crate::noise::Noise;

/// P_AC for each count, Pa (PAPER: 2.16 mV/Pa, 12 bits over 3.3 V).
pub(crate) const PAC_PA_PER_COUNT: f64 = 3300.0 / 4096.0 / 2.16;
/// P_DC for each count, Pa (PAPER: 21.8 mV/kPa).
const PDC_PA_PER_COUNT: f64 = 3300.0 / 4096.0 / 21.8 * 1000.0;
/// Pressure of the fluid for each newton on the skin, Pa/N: a P_DC count (PAPER: 36.96 Pa) is 11.5 mN (PAPER fig. 3).
pub(crate) const PA_PER_N: f64 = PDC_PA_PER_COUNT / N_PER_COUNT;
/// Noise of P_AC, Pa rms (PAPER: 1.2 mV, given there as 0.52 Pa).
const PAC_NOISE_PA: f64 = 0.52;

/// Band of P_AC, Hz (PAPER).
const BAND_HZ: (f64, f64) = (10.0, 1040.0);
/// P_AC at rest, counts (OUT: 2040 to 2045).
const PAC_REST: (f64, f64) = (2040.0, 2045.0);
/// P_DC at rest, counts (OUT: 2583 to 2695).
const PDC_REST: (f64, f64) = (2583.0, 2695.0);
/// Noise of P_DC before it is rounded, counts rms (OUT: at most 0.5 after).
const PDC_NOISE: f64 = 0.3;
/// Highest count of 12 bits.
const FULL: f64 = 4095.0;

/// P_DC's rest follows the temperature of the finger, about a value of that finger (OUT: three fingers, each steady):
/// its deviation, counts, and the times, s, over which the air wanders and the finger follows. Chosen.
const DRIFT_COUNTS: f64 = 2.0;
const AIR_S: f64 = 600.0;
const WARM_S: f64 = 60.0;
/// Ticks from one step of the drift to the next: 10 ms.
const DRIFT_TICKS: u32 = TICKS_PER_S / 100;

pub(in super::super) struct Amplifiers {
    pac_rest: f64,
    pdc_rest: f64,
    /// temperature of the air and of the finger, in counts of P_DC
    air: f64,
    warm: f64,
    drift_in: u32,
    /// gain of P_DC relative to a sound amplifier's, and its factor per tick (faults)
    pdc_gain: f64,
    pdc_kept: f64,
    high_pass: HighPass,
    low_pass: LowPass,
    /// P_AC and P_DC without noise, counts, at the last two ticks
    pac: [f64; 2],
    pdc: [f64; 2],
}

impl Amplifiers {
    /// Amplifiers that rest where `made` has it, at the temperature that `noise` draws.
    pub(super) fn new(made: &mut Noise, noise: &mut Noise) -> Self {
        let pac_rest = made.between(PAC_REST.0, PAC_REST.1);
        let pdc_rest = made.between(
            PDC_REST.0 + 2.0 * DRIFT_COUNTS,
            PDC_REST.1 - 2.0 * DRIFT_COUNTS,
        );
        let warm = noise.within(DRIFT_COUNTS);
        Self {
            pac_rest,
            pdc_rest,
            air: warm,
            warm,
            drift_in: 0,
            pdc_gain: 1.0,
            pdc_kept: 1.0,
            high_pass: HighPass::default(),
            low_pass: LowPass::new(BAND_HZ.1),
            pac: [pac_rest; 2],
            pdc: [pdc_rest + warm; 2],
        }
    }

    /// From now on the gain of P_DC falls to 1/e in this time.
    pub(in super::super) fn fade_pdc(&mut self, seconds: f64) {
        self.pdc_kept = exp(-TICK_S / seconds);
    }

    pub(in super::super) fn weaken_pdc(&mut self, gain: f64) {
        self.pdc_gain = gain;
    }

    pub(super) fn mend(&mut self) {
        (self.pdc_gain, self.pdc_kept) = (1.0, 1.0);
    }

    /// A tick with this pressure in the fluid, and this slow part of it.
    pub(super) fn tick(&mut self, fluid_pa: f64, slow_pa: f64, noise: &mut Noise) {
        if self.drift_in == 0 {
            self.drift_in = DRIFT_TICKS;
            let dt = f64::from(DRIFT_TICKS) * TICK_S;
            let kick = DRIFT_COUNTS * (2.0 * dt / AIR_S).sqrt();
            self.air += -self.air * dt / AIR_S + kick * noise.normal();
            self.warm += (self.air - self.warm) * dt / WARM_S;
        }
        self.drift_in -= 1;
        let band = self.low_pass.tick(self.high_pass.tick(fluid_pa));
        self.pac = [self.pac[1], self.pac_rest + band / PAC_PA_PER_COUNT];
        self.pdc_gain *= self.pdc_kept;
        self.pdc = [
            self.pdc[1],
            self.pdc_rest + self.warm + self.pdc_gain * (slow_pa / PDC_PA_PER_COUNT),
        ];
    }

    pub(super) fn sample_pac(&mut self, fraction: f64, noise: &mut Noise) -> u16 {
        counts(between(self.pac, fraction) + self.pac_noise(noise))
    }

    pub(super) fn pac_noise(&self, noise: &mut Noise) -> f64 {
        PAC_NOISE_PA / PAC_PA_PER_COUNT * noise.normal()
    }

    /// Reading of the converter at a P_AC so far from its rest, counts, and true if it was cut.
    pub(super) fn convert_pac(&self, about_rest: f64) -> (u16, bool) {
        let value = self.pac_rest.round() + about_rest;
        (counts(value), !(0.0..=FULL).contains(&value))
    }

    pub(super) fn sample_pdc(&mut self, fraction: f64, noise: &mut Noise) -> u16 {
        counts(between(self.pdc, fraction) + PDC_NOISE * noise.normal())
    }
}

pub(super) fn between([a, b]: [f64; 2], fraction: f64) -> f64 {
    a + (b - a) * fraction.clamp(0.0, 1.0)
}

fn counts(value: f64) -> u16 {
    value.round().clamp(0.0, FULL) as u16
}

/// The lower end of the band: first order.
#[derive(Default)]
pub(super) struct HighPass {
    slow: f64,
}

impl HighPass {
    pub(super) fn tick(&mut self, x: f64) -> f64 {
        self.slow += (x - self.slow) * (2.0 * PI * BAND_HZ.0 * TICK_S);
        x - self.slow
    }
}

/// The upper end of the band: second order, Butterworth (chosen; the paper says "anti-aliasing").
pub(super) struct LowPass {
    b: f64,
    a: [f64; 2],
    z: [f64; 2],
}

impl LowPass {
    pub(super) fn new(hz: f64) -> Self {
        let k = tan(PI * hz * TICK_S);
        let norm = 1.0 / (1.0 + k / FRAC_1_SQRT_2 + k * k);
        Self {
            b: k * k * norm,
            a: [
                2.0 * (k * k - 1.0) * norm,
                (1.0 - k / FRAC_1_SQRT_2 + k * k) * norm,
            ],
            z: [0.0; 2],
        }
    }

    pub(super) fn tick(&mut self, x: f64) -> f64 {
        let y = self.b * x + self.z[0];
        self.z[0] = 2.0 * self.b * x - self.a[0] * y + self.z[1];
        self.z[1] = self.b * x - self.a[1] * y;
        y
    }
}
