//! The vibrations that sliding over a surface makes, and their way through the fluid.
//!
//! Three sources. The ridges follow the surface up and down: a spatial filter over the contact patch, which gives lines
//! at v/lambda (eq. 17) and distinguishes coarse from fine. Asperities too fine to be followed catch and release:
//! impulses, more of them the faster it goes, that excite the resonance of the fluid at any speed. And friction itself
//! fluctuates, with a 1/f spectrum, in proportion to the shear (PAPER after Wiertlewski 2011).

use std::f64::consts::TAU;

use super::amplifier::PA_PER_N;
use crate::conditions::TICK_S;
use crate::maths::{cbrt, pow};
use crate::surface::{Surface, VIBRATIONS_AT};

/// Distance of the ridges, mm (PAPER).
const RIDGE_MM: f64 = 0.4;
/// Half length of the contact patch at 1 N, mm; it goes with the cube root of force (Hertz). Chosen: a finger of about
/// 7 mm radius.
const PATCH_MM: f64 = 2.5;
/// Half length of the patch that the profile of a surface still has to cover, mm.
const PATCH_MAX_MM: f64 = 3.4;
/// Vibrations with the ridges gone, relative to new (chosen; PAPER: ridges "greatly enhance" them).
const WITHOUT_RIDGES: f64 = 0.3;

/// Impulses of unresolved asperities: Pa for each um of height and each root of an asperity in a millisecond, as noise
/// of one value a tick (chosen, for the levels of P_AC that sliding fingers show).
const IMPULSE_PA: f64 = 70.0;
/// Relative bandwidth of an impulse, which goes up and down again (chosen).
const IMPULSE_WIDTH: f64 = 1.25;
/// The skin comes to skip asperities that follow each other faster than this, 1/ms (chosen).
const IMPULSES_PER_MS: f64 = 1.5;
/// Fluctuations of friction grow with speed to this power (chosen).
const FRICTION_SPEED_POWER: f64 = 0.5;
/// They average out over the contact, relative to friction: as its length, the root of its area. The texture's are
/// those at 0.2 N, with a patch of this half length, mm.
const FRICTION_PATCH_MM: f64 = 1.46;

/// Resonance of the fluid at rest and its rise with the root of force, Hz and Hz/N^0.5: 200 to 350 Hz from 0 to 2 N
/// (PAPER: 200-350 Hz).
const RESONANCE_HZ: (f64, f64) = (200.0, 106.0);
/// Its damping ratio at rest, and its rise with force, 1/N (chosen).
const RESONANCE_DAMPING: (f64, f64) = (0.22, 0.08);
/// Ticks from one tuning of the resonance to the next.
const TUNE_TICKS: u32 = 16;

/// Sections that make 1/f noise of white noise, each of the same power, with corners two octaves apart over the band of
/// P_AC (3, 12, 48, 192 and 768 Hz): pole a tick, and gain.
const PINK: [(f64, f64); 5] = {
    // 2 pi 3 Hz at 13,200 ticks a second
    const POLE: f64 = TAU * 3.0 * TICK_S;
    [
        (POLE, 16.0 * GAIN),
        (4.0 * POLE, 8.0 * GAIN),
        (16.0 * POLE, 4.0 * GAIN),
        (64.0 * POLE, 2.0 * GAIN),
        (256.0 * POLE, GAIN),
    ]
};
/// Gain of the fastest section: makes the rms of the sum 1.
const GAIN: f64 = 0.6;

/// State of the vibrations.
#[derive(Default)]
pub(super) struct Vibrations {
    /// part of the vibrations that passes under this load, N
    passed: f64,
    load_n: f64,
    /// centre of the impulses' band-pass, radians a tick, and its state
    centre: f64,
    impulse: [f64; 2],
    pink: [f64; 5],
    /// the fluid's pressure, Pa, and its rate, Pa/s
    fluid: f64,
    rate: f64,
    tune_in: u32,
    stiffness: f64,
    drag: f64,
    /// half length of the patch, mm
    patch_mm: f64,
    /// displacement by the surface at a place, um, with a half length of the patch, mm, and so worn a skin: a sum over
    /// the patch, and the same while the finger is still
    contact_um: Option<([f64; 3], f64)>,
}

impl Vibrations {
    /// Displacement of the patch by the surface at `x_mm`, um. `amplitude` is that of this touch.
    pub(super) fn follow_um(
        &mut self,
        surface: &Surface,
        x_mm: f64,
        load_n: f64,
        amplitude: f64,
        wear: f64,
    ) -> f64 {
        let ridges = 1.0 - (1.0 - WITHOUT_RIDGES) * wear;
        let texture = &surface.texture;
        self.passed = amplitude * ridges * (1.0 - texture.damping) * texture.passed(load_n);
        self.load_n = load_n;
        let at = [x_mm, self.patch_mm(), wear];
        let contact_um = match self.contact_um {
            Some((same, contact_um)) if same == at => contact_um,
            // a point on every ridge and one between, which carries nothing while the ridges stand
            _ => surface.contact_um(x_mm, self.patch_mm(), RIDGE_MM / 2.0, 1.0 - wear),
        };
        self.contact_um = Some((at, contact_um));
        self.passed * contact_um
    }

    /// The finger lands on what may be another surface.
    pub(super) fn land(&mut self) {
        self.contact_um = None;
    }

    fn patch_mm(&self) -> f64 {
        self.patch_mm.clamp(RIDGE_MM, PATCH_MAX_MM)
    }

    /// Pressure of impulses and friction while sliding at `speed` (mm/s; 0 while it sticks) against `shear_n`, Pa;
    /// after [`follow_um`](Self::follow_um).
    pub(super) fn sliding_pa(
        &mut self,
        surface: &Surface,
        x_mm: f64,
        speed: f64,
        shear_n: f64,
        white: [f64; 2],
    ) -> f64 {
        let texture = &surface.texture;
        if self.tune_in == 0 {
            let hz = texture.impulse_centre_hz(speed, self.load_n);
            self.centre = (TAU * TICK_S * hz).min(1.0);
        }
        self.impulse[0] += self.centre * self.impulse[1];
        self.impulse[1] +=
            self.centre * (white[1] - self.impulse[0] - IMPULSE_WIDTH * self.impulse[1]);
        let pink = self.pink(white[0]);
        if speed == 0.0 {
            return 0.0;
        }
        let per_ms = speed / texture.fine_mm * 1e-3;
        let rate = per_ms / (1.0 + per_ms / IMPULSES_PER_MS);
        let impulses = IMPULSE_PA
            * surface.unresolved_um
            * surface.amplitude(x_mm)
            * rate.sqrt()
            * self.impulse[1];
        let speeding = pow(speed / VIBRATIONS_AT.1, FRICTION_SPEED_POWER);
        let relative = texture.friction_noise * speeding * FRICTION_PATCH_MM / self.patch_mm();
        let friction = PA_PER_N * shear_n * relative * pink;
        self.passed * texture.vibrations(speed) * (impulses + friction)
    }

    /// The next value of 1/f noise of rms 1.
    fn pink(&mut self, white: f64) -> f64 {
        let mut sum = 0.0;
        for (state, (pole, gain)) in self.pink.iter_mut().zip(PINK) {
            *state += pole * (white - *state);
            sum += gain * *state;
        }
        sum
    }

    /// A tick of the fluid under this pressure; gives the pressure that reaches the transducer, Pa.
    pub(super) fn fluid(&mut self, pressure_pa: f64, load_n: f64, detune: f64) -> f64 {
        if self.tune_in == 0 {
            self.tune_in = TUNE_TICKS;
            let omega = TAU * detune * (RESONANCE_HZ.0 + RESONANCE_HZ.1 * load_n.sqrt());
            self.stiffness = omega * omega;
            self.drag = 2.0 * omega * (RESONANCE_DAMPING.0 + RESONANCE_DAMPING.1 * load_n);
            self.patch_mm = PATCH_MM * cbrt(load_n);
        }
        self.tune_in -= 1;
        let lag = pressure_pa - self.fluid;
        self.rate += TICK_S * self.stiffness * lag;
        self.fluid += TICK_S * (self.rate + self.drag * lag);
        self.fluid
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::Noise;

    #[test]
    fn friction_noise_has_rms_1_and_falls_by_3_db_an_octave() {
        let (mut noise, mut vibrations) = (Noise::new(1, 1), Vibrations::default());
        let (mut power, mut octaves) = (0.0, [0.0; 5]);
        // differences of running values tell how much lies about each octave
        let mut slow = [0.0; 6];
        for _ in 0..2_000_000 {
            let value = vibrations.pink(noise.white()[0]);
            power += value * value / 2e6;
            for (i, state) in slow.iter_mut().enumerate() {
                *state += TAU * 20.0 * f64::from(1 << i) * TICK_S * (value - *state);
            }
            for (i, octave) in octaves.iter_mut().enumerate() {
                *octave += (slow[i + 1] - slow[i]).powi(2);
            }
        }
        assert!((power - 1.0).abs() < 0.15, "{power}");
        // 1/f has as much power in every octave
        let mean = octaves.iter().sum::<f64>() / 5.0;
        assert!(
            octaves.iter().all(|o| (o / mean - 1.0).abs() < 0.25),
            "{octaves:.0?}"
        );
    }
}
