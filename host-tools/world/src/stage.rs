//! The stage that slides the sample under the fingertip: a brushed DC motor on a screw, behind an H-bridge, with a
//! quadrature encoder, two limit switches and a current amplifier.
//!
//! The paper's stage (ANT130, Aerotech) is a linear motor whose controller tells its current; ours is the one of the
//! list of parts (docs/src/rig.md). Its current is that of the unloaded stage plus the shear force over
//! [`FORCE_N_PER_A`], as the paper found by weights on the inclined stage.
//!
//! ```text
//! mass dv/dt = K i + shear - friction(x, v)      K = 2 pi Kt / lead, in N/A and in V s/m
//! R i        = duty x supply - K v               (L/R is 35 us, less than a tick)
//! ```
//! The two are solved together for the speed at the end of the tick, so that a steady speed is exact. That is a bridge
//! which shorts the motor while its PWM is low (*slow decay*), as the parts list wants it. One that is off meanwhile
//! (*fast decay*) lets the current run back into the supply and then stop: `decays_fast`.

use std::f64::consts::TAU;

use super::conditions::TICK_S;
use super::maths::{exp, ln, sin};
use super::noise::Noise;
use super::ripple::{self, PwmPhase};

/// Supply of the H-bridge, V (chosen).
pub const SUPPLY_V: f64 = 12.0;
/// Motor, leads, shunt and bridge, ohm (chosen, like a 24 V motor of 23 mm: 7.1 ohm and 26.1 mNm/A), so that a jammed
/// stage draws 1.6 A, which the amplifier still measures.
pub(crate) const RESISTANCE_OHM: f64 = 7.5;
/// Torque per current, Nm/A (chosen, see above).
pub(crate) const TORQUE_NM_PER_A: f64 = 0.0261;
/// Inductance over resistance of the motor, s (facts of the motor chosen above).
pub(crate) const TIME_CONSTANT_S: f64 = 35e-6;
/// Period of the bridge's PWM, s.
pub(crate) const PWM_S: f64 = 50e-6;
/// Way of the stage per revolution of the screw, mm (chosen).
pub(crate) const LEAD_MM: f64 = 10.0;
/// Force per current, N/A, and back-EMF per speed, V s/m: 16.4.
pub const FORCE_N_PER_A: f64 = TAU * TORQUE_NM_PER_A / (LEAD_MM * 1e-3);
/// Table and sample, 0.8 kg, and rotor and screw, 1.1e-6 kg m^2, as seen through the screw (chosen).
pub(crate) const MASS_KG: f64 = 0.8 + 1.1e-6 * (TAU / (LEAD_MM * 1e-3)) * (TAU / (LEAD_MM * 1e-3));
/// Coulomb friction of the moving stage, N (chosen): 37 mA.
pub(crate) const COULOMB_N: f64 = 0.6;
/// Friction of the standing stage in units of [`COULOMB_N`], falling to 1 over [`STRIBECK_MM_S`] (chosen).
pub(crate) const BREAKAWAY: f64 = 1.2;
/// Speed over which the friction of rest is lost, mm/s (chosen; well below the slowest slide).
pub(crate) const STRIBECK_MM_S: f64 = 1.0;
/// Viscous friction, N s/m (chosen): 0.2 N at 100 mm/s.
pub(crate) const VISCOUS_N_S_PER_M: f64 = 2.0;
/// Variation of the Coulomb friction over the travel: share, and wavelength in mm (chosen): once per revolution of the
/// screw, and over its length.
pub(crate) const FRICTION_WAVES: [(f64, f64); 2] = [(0.02, LEAD_MM), (0.02, 63.0)];
/// Standard deviation of the Coulomb friction from trial to trial, share (chosen).
pub(crate) const FRICTION_SPREAD: f64 = 0.01;
/// Current ripple: the torque constant falls and rises by this share (chosen)...
pub(crate) const RIPPLE: f64 = 0.02;
/// ... this often per revolution, by commutation (5 segments).
pub(crate) const RIPPLES_PER_TURN: f64 = 10.0;

/// A stage that vibrates lifts and lowers the sample so often per revolution of the screw, with these shares of the
/// amplitude (chosen): the screw's runout, the commutation (100 Hz at 100 mm/s), the nut's thread.
pub(crate) const VIBRATIONS: [(f64, f64); 3] = [(1.0, 1.0), (RIPPLES_PER_TURN, 0.3), (32.0, 0.1)];
/// Speed at which a vibration has its amplitude, mm/s; at others it is in proportion.
pub(crate) const VIBRATION_MM_S: f64 = 100.0;

/// Way between the hard stops, mm (chosen). Positions count from the lower one.
pub const TRAVEL_MM: f64 = 85.0;
/// Place where the sample of [`SAMPLE_MM`] begins: in the middle of the travel.
pub const SAMPLE_AT_MM: f64 = 5.0;
/// Length of a sample (paper, Textures).
pub const SAMPLE_MM: f64 = 75.0;
/// Distance from each hard stop at which its limit switch closes, mm: 1 mm beyond the sample (chosen). From 100 mm/s a
/// shorted motor runs on for 3 mm, a reversed one for 0.3.
pub(crate) const LIMIT_MM: f64 = 4.0;
/// Way between closing and opening of a limit switch, mm (chosen).
pub(crate) const LIMIT_HYSTERESIS_MM: f64 = 0.1;

/// Current amplifier: 20 V/V over 50 mohm (INA240A1), its output at half the reference without current.
pub(crate) const ADC_V_PER_A: f64 = 1.0;
/// Reference of the 12-bit converter, V.
pub(crate) const ADC_REFERENCE_V: f64 = 3.3;
/// L/R of a resistor in the place of the motor, s (chosen: 22 ohm of wire, and a metre of cable).
pub(crate) const RESISTOR_TIME_CONSTANT_S: f64 = 0.1e-6;
/// A hand pushes the stage at this speed, mm/s (chosen).
pub(crate) const HAND_MM_S: f64 = 30.0;

/// Noise of a reading, counts rms (chosen).
pub(crate) const ADC_NOISE_COUNTS: f64 = 1.5;
/// Largest error of the zero, counts, and of the gain (chosen; offset of amplifier and resistors, shunt of 0.5 %).
pub(crate) const ADC_ERRORS: (f64, f64) = (8.0, 0.005);
/// Stream of the seeds that the stage draws from.
const STREAM: u64 = 0x57a6;

/// The stage, its motor, its bridge and its amplifier.
#[derive(Clone, Debug, Default)]
pub struct Stage {
    duty: f64,
    /// the bridge's enable: without it the motor has no current and the stage coasts
    pub(super) enabled: bool,
    /// something holds it (fault)
    pub(super) jammed: bool,
    /// the bridge is off while its PWM is low (a bridge, or a setting of it, that the parts list warns of)
    pub(super) decays_fast: bool,
    /// in the place of the motor, ohm
    pub(super) resistor: Option<f64>,
    pushed_mm: Option<f64>,
    /// amplitude of the sample's way up and down at [`VIBRATION_MM_S`], um; the paper's stage does not vibrate
    pub(super) vibration_um: f64,
    /// from the lower hard stop, at the end of the last tick, and at its begin
    pub(super) position_mm: f64,
    position_before_mm: f64,
    pub(super) speed_mm_s: f64,
    /// of the motor; positive drives to higher positions
    pub(super) current_a: f64,
    limits: (bool, bool),
    /// switches that a person holds actuated
    pub(super) held: (bool, bool),
    friction_scale: f64,
    friction_phase: [f64; 2],
    ripple_phase: f64,
    adc_offset: f64,
    adc_gain: f64,
    noise_seed: u64,
    along: Along,
}

/// Values that depend on the position alone: sines, which take longer than the rest of a tick, and the stage often
/// stands.
#[derive(Clone, Copy, Default, Debug)]
struct Along {
    force_n_per_a: f64,
    /// of sliding, relative to its mean
    friction: f64,
}

impl Stage {
    /// A stage that stands at `position_mm`. What differs between stages is drawn from `world_seed`, what differs
    /// between trials from `trial_seed`.
    pub fn new(position_mm: f64, world_seed: u64, trial_seed: u64) -> Self {
        let mut stage = Noise::new(world_seed, STREAM);
        let mut trial = Noise::new(trial_seed, STREAM);
        let position_mm = position_mm.clamp(0.0, TRAVEL_MM);
        let mut stage = Self {
            position_mm,
            position_before_mm: position_mm,
            friction_scale: 1.0 + FRICTION_SPREAD * trial.normal(),
            friction_phase: [stage.between(0.0, TAU), stage.between(0.0, TAU)],
            ripple_phase: stage.between(0.0, TAU),
            adc_offset: stage.between(-ADC_ERRORS.0, ADC_ERRORS.0),
            adc_gain: 1.0 + stage.between(-ADC_ERRORS.1, ADC_ERRORS.1),
            noise_seed: trial.uniform().to_bits(),
            ..Self::default()
        };
        stage.along = stage.along();
        stage.switch_limits();
        stage
    }

    /// Duty of the bridge, -1 to 1; positive drives to higher positions. 0 shorts the motor, which brakes it.
    pub(crate) fn set_duty(&mut self, duty: f64) {
        self.duty = if duty.is_finite() {
            duty.clamp(-1.0, 1.0)
        } else {
            0.0
        };
    }

    /// A hand pushes the stage to a place, and leaves it there.
    pub fn push(&mut self, to_mm: f64) {
        self.pushed_mm = Some(to_mm.clamp(0.0, TRAVEL_MM));
    }

    fn follow_hand(&mut self, to_mm: f64) {
        self.position_before_mm = self.position_mm;
        let most_mm = HAND_MM_S * TICK_S;
        let way_mm = (to_mm - self.position_mm).clamp(-most_mm, most_mm);
        self.position_mm += way_mm;
        self.current_a = 0.0;
        if self.position_mm == to_mm {
            self.pushed_mm = None;
        }
        self.along = self.along();
        self.switch_limits();
    }

    /// Mean current over a period of the PWM, A: driven by the supply, then against it through the diodes until there
    /// is none.
    fn fast_current_a(&self) -> f64 {
        let emf_v = self.along.force_n_per_a * self.speed_mm_s * 1e-3 * self.duty.signum();
        let on_s = self.duty.abs() * PWM_S;
        // where the current goes to, on and off
        let to_a = (SUPPLY_V - emf_v) / RESISTANCE_OHM;
        let back_a = (-SUPPLY_V - emf_v) / RESISTANCE_OHM;
        let peak_a = to_a * (1.0 - exp(-on_s / TIME_CONSTANT_S));
        if peak_a <= 0.0 {
            return 0.0;
        }
        let off_s = TIME_CONSTANT_S * ln((peak_a - back_a) / -back_a);
        let mean_a = if off_s < PWM_S - on_s {
            // its charge: what flows to the end values, less what the inductance keeps, which is nothing at both ends
            (to_a * on_s + back_a * off_s) / PWM_S
        } else {
            (SUPPLY_V * (2.0 * self.duty.abs() - 1.0) - emf_v) / RESISTANCE_OHM
        };
        mean_a * self.duty.signum()
    }

    /// Lets one tick pass, the finger pushing the stage with `shear_n` (positive to higher positions).
    pub fn tick(&mut self, shear_n: f64) {
        if let Some(to_mm) = self.pushed_mm {
            self.follow_hand(to_mm);
            return;
        }
        let force_n_per_a = self.along.force_n_per_a;
        if let Some(ohm) = self.resistor {
            let drive_v = if self.enabled {
                self.duty * SUPPLY_V
            } else {
                0.0
            };
            self.current_a = drive_v / ohm;
        }
        let (drive_v, conductance) =
            match (self.enabled && self.resistor.is_none(), self.decays_fast) {
                (false, _) => (0.0, 0.0),
                (true, false) => (self.duty * SUPPLY_V, 1.0 / RESISTANCE_OHM),
                // as much at the speed of now, which a tick changes little
                (true, true) => (self.fast_current_a() * RESISTANCE_OHM, 1.0 / RESISTANCE_OHM),
            };
        // what a faster motor lacks of its current, per V of back-EMF
        let braking = if self.decays_fast { 0.0 } else { conductance };
        let v = self.speed_mm_s * 1e-3;
        // as if there were no dry friction ...
        let push_n = force_n_per_a * drive_v * conductance + shear_n;
        self.position_before_mm = self.position_mm;
        if self.speed_mm_s == 0.0 && push_n == 0.0 {
            if self.resistor.is_none() {
                self.current_a = drive_v * conductance;
            }
            return;
        }
        let drag = force_n_per_a * force_n_per_a * braking + VISCOUS_N_S_PER_M;
        let inertia = MASS_KG / TICK_S + drag;
        let free = (MASS_KG / TICK_S * v + push_n) / inertia;
        // ... which then takes its share, but reverses no motion
        let dry = self.dry_friction_n() / inertia;
        let after = if self.jammed || free.abs() <= dry {
            0.0
        } else {
            free - dry * free.signum()
        };
        if self.resistor.is_none() {
            self.current_a = drive_v * conductance - force_n_per_a * after * braking;
        }
        self.position_mm += after * 1e3 * TICK_S;
        self.speed_mm_s = after * 1e3;
        if !(0.0..=TRAVEL_MM).contains(&self.position_mm) {
            self.position_mm = self.position_mm.clamp(0.0, TRAVEL_MM);
            self.speed_mm_s = 0.0;
        }
        if self.position_mm != self.position_before_mm {
            self.along = self.along();
        }
        self.switch_limits();
    }

    /// Height of the sample above its place on a stage that does not vibrate, mm.
    pub(crate) fn heave_mm(&self) -> f64 {
        let amplitude_um = self.vibration_um * self.speed_mm_s.abs() / VIBRATION_MM_S;
        if amplitude_um == 0.0 {
            return 0.0;
        }
        let turns = self.position_mm / LEAD_MM;
        let waves = VIBRATIONS.map(|(per_turn, share)| {
            share * sin(turns * per_turn * TAU + per_turn * self.ripple_phase)
        });
        amplitude_um * 1e-3 * waves.iter().sum::<f64>()
    }

    /// Position within the last tick: 0 is its begin, 1 its end.
    pub(crate) fn position_at_mm(&self, fraction: f64) -> f64 {
        self.position_before_mm + (self.position_mm - self.position_before_mm) * fraction
    }

    /// Place of the finger on the sample, mm from its edge. The last point of a sample continues to the hard stop: a
    /// finger never falls off the edge.
    pub(crate) fn on_sample_mm(&self) -> f64 {
        (self.position_mm - SAMPLE_AT_MM).clamp(0.0, SAMPLE_MM)
    }

    /// The limit switches at the lower and the upper end.
    pub fn limits(&self) -> (bool, bool) {
        (self.limits.0 || self.held.0, self.limits.1 || self.held.1)
    }

    /// Reading of the converter for the mean current at a time: two readings at the same time are the same.
    pub fn adc(&self, now_ns: u64) -> u16 {
        self.reading(self.current_a, now_ns)
    }

    /// Reading of the converter at this place in a period of the bridge's PWM.
    pub(crate) fn adc_within(&self, now_ns: u64, phase: PwmPhase) -> u16 {
        self.reading(self.current_a + self.ripple_a(phase), now_ns)
    }

    /// By how much the current at a place in a period of the bridge's PWM is above its mean, A.
    fn ripple_a(&self, phase: PwmPhase) -> f64 {
        if !self.enabled {
            return 0.0;
        }
        let direction = self.duty.signum();
        let emf_v = self.along.force_n_per_a * self.speed_mm_s * 1e-3 * direction;
        let low_v = if self.decays_fast { -SUPPLY_V } else { 0.0 };
        if let Some(ohm) = self.resistor {
            let ends = ripple::Ends {
                high_a: SUPPLY_V / ohm,
                low_a: 0.0,
                stops: false,
                time_constant_s: RESISTOR_TIME_CONSTANT_S,
            };
            return direction * ripple::above_mean_a(ends, self.duty.abs(), phase);
        }
        let ends = ripple::Ends {
            high_a: (SUPPLY_V - emf_v) / RESISTANCE_OHM,
            low_a: (low_v - emf_v) / RESISTANCE_OHM,
            stops: self.decays_fast,
            time_constant_s: TIME_CONSTANT_S,
        };
        direction * ripple::above_mean_a(ends, self.duty.abs(), phase)
    }

    fn reading(&self, current_a: f64, now_ns: u64) -> u16 {
        let counts_per_v = 4096.0 / ADC_REFERENCE_V;
        let reading = 2048.0
            + current_a * ADC_V_PER_A * self.adc_gain * counts_per_v
            + self.adc_offset
            + ADC_NOISE_COUNTS * gauss(self.noise_seed ^ now_ns);
        reading.round().clamp(0.0, 4095.0) as u16
    }

    fn along(&self) -> Along {
        let turns = self.position_mm / LEAD_MM;
        let ripple = sin(turns * RIPPLES_PER_TURN * TAU + self.ripple_phase);
        let over_travel: f64 = FRICTION_WAVES
            .iter()
            .zip(self.friction_phase)
            .map(|((share, wave_mm), phase)| share * sin(self.position_mm / wave_mm * TAU + phase))
            .sum();
        Along {
            force_n_per_a: FORCE_N_PER_A * (1.0 + RIPPLE * ripple),
            friction: 1.0 + over_travel,
        }
    }

    fn dry_friction_n(&self) -> f64 {
        let slow = match self.speed_mm_s.abs() {
            // it often stands, and much faster there is nothing left beside 1 in an f64
            0.0 => 1.0,
            speed if speed > 40.0 * STRIBECK_MM_S => 0.0,
            speed => exp(-speed / STRIBECK_MM_S),
        };
        COULOMB_N * self.friction_scale * self.along.friction * (1.0 + (BREAKAWAY - 1.0) * slow)
    }

    fn switch_limits(&mut self) {
        let closed = |was: bool, from_stop_mm: f64| {
            from_stop_mm < LIMIT_MM + if was { LIMIT_HYSTERESIS_MM } else { 0.0 }
        };
        self.limits = (
            closed(self.limits.0, self.position_mm),
            closed(self.limits.1, TRAVEL_MM - self.position_mm),
        );
    }
}

/// A number from the standard normal distribution, near enough for noise, that depends on `seed` alone.
fn gauss(seed: u64) -> f64 {
    // the finaliser of SplitMix64, twice: neighbouring seeds have nothing in common
    let mut bits = seed;
    for _ in 0..2 {
        bits = bits.wrapping_add(0x9E37_79B9_7F4A_7C15);
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        bits ^= bits >> 31;
    }
    // the sum of four uniform 16-bit draws, scaled to a standard deviation of 1
    let sum: u64 = (0..4).map(|i| (bits >> (16 * i)) & 0xFFFF).sum();
    (sum as f64 - 2.0 * 65535.0) / (65536.0 * (4.0f64 / 12.0).sqrt())
}

#[cfg(test)]
mod tests;
