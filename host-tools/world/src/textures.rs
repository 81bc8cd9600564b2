//! The 117 textures of the paper's Table 1: physical parameters, drawn from their group's distribution.
//!
//! The medians are chosen, each from such materials' figures (yarn counts of cloth, grain of wood, finish of metal) and
//! from the paper's remarks about it by name (Table 2 and Results). The paper's measurements of them are in no table,
//! so a world is one of many possible collections of 117 such textures.

mod names;
mod recipes;

#[cfg(test)]
pub(crate) use names::Group;
pub use names::{Named, TEXTURES};

use super::lever::{LIMIT_MM, TOP_MM};
use super::maths::{pow, square};
use super::noise::Noise;
use recipes::recipe;

#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Weave {
    /// Period, mm.
    pub(crate) wavelength_mm: f64,
    /// Rms height of all harmonics together, um.
    pub(crate) rms_um: f64,
    /// Relative deviation of one period from the next.
    pub jitter: f64,
    /// Number of its harmonics.
    pub(crate) harmonics: u32,
    /// Their amplitudes fall as 1/k to this power.
    pub(crate) falloff: f64,
}

/// Longest wavelength of the relief relative to the one from which it is flat (chosen).
const LONGEST: f64 = 2.0;

/// Physical parameters of one texture.
#[derive(Clone, PartialEq, Debug)]
pub struct Texture {
    /// Its number in Table 1.
    pub number: u8,
    /// Coefficient of kinetic friction against the skin's silicone at `FRICTION_AT`.
    pub friction: f64,
    /// Friction goes with load to this power: about -1/3 for smooth surfaces (Hertz), 0 for rough ones (Amontons).
    pub(crate) friction_load: f64,
    /// Friction goes with speed to this power.
    pub(crate) friction_speed: f64,
    /// Half the curvature of ln(friction) over ln(speed).
    pub(crate) friction_bend: f64,
    /// By how much static friction exceeds kinetic friction, relative.
    pub(crate) stiction: f64,
    /// Rms of the 1/f fluctuation of friction, relative to it.
    pub(crate) friction_noise: f64,
    /// Rms height of the finest asperities, um.
    pub(crate) fine_um: f64,
    /// Wavelength about which they lie, mm.
    pub(crate) fine_mm: f64,
    /// Centre of the spectrum of the impulses with which those asperities catch and release at the load of
    /// `VIBRATIONS_AT`, Hz: hard ones are short.
    pub(crate) impulse_hz: f64,
    /// It goes with load to this power: the contact of an asperity grows as it is pressed, or its edge gets steeper.
    pub(crate) impulse_load: f64,
    /// Half the curvature of its ln over ln(speed): at other speeds others of the asperities catch.
    pub(crate) impulse_bend: f64,
    /// Rms height of the random relief, um.
    pub(crate) relief_um: f64,
    /// Wavelength above which its spectrum is flat, mm.
    pub(crate) relief_mm: f64,
    /// Power density of the relief falls with spatial frequency to this power.
    pub(crate) relief_exponent: f64,
    /// The periodic part, if it has one.
    pub(crate) weave: Option<Weave>,
    /// Share of the vibrations that the material swallows, 0..1.
    pub(crate) damping: f64,
    /// Vibrations fall as 1 / (1 + F / this), N: soon where the skin is soon clamped, later where it sinks in.
    pub(crate) clamped_n: f64,
    /// Vibrations of catching asperities and of friction go with speed to this power beyond what all textures' do.
    pub(crate) vibration_speed: f64,
    /// Half the curvature of ln(vibrations) over ln(speed).
    pub(crate) vibration_bend: f64,
    /// Deviation of ln(local height amplitude) over the sample.
    pub(crate) heterogeneity: f64,
    /// Thickness, mm; at most `FITS_MM`.
    pub(crate) thickness_mm: f64,
    /// Compliance under the finger, mm/N.
    pub compliance_mm_per_n: f64,
}

impl Texture {
    /// Relative power density of the relief at a wavelength in mm: 1/f^a at short wavelengths, flat about `relief_mm`,
    /// and nothing much at [`LONGEST`] times that and more: samples lie flat on their magnets.
    pub(super) fn relief(&self, wavelength_mm: f64) -> f64 {
        let short = pow(self.relief_mm / wavelength_mm, self.relief_exponent);
        let long = square(square(wavelength_mm / (LONGEST * self.relief_mm)));
        1.0 / (1.0 + short + long)
    }
}

/// Samples are cut to this thickness, mm: half a millimetre below the homed finger (chosen).
const FITS_MM: f64 = TOP_MM - LIMIT_MM - 0.5;

/// Deviations of ln(parameter) among the textures of a group, or of one texture among worlds.
struct Spread {
    friction: f64,
    height: f64,
    wavelength: f64,
    /// of what load and speed do, relative to the deviations below
    movement: f64,
}

/// Of a texture of which only the group is known (chosen).
const GROUP_SPREAD: Spread = Spread {
    friction: 0.22,
    height: 0.45,
    wavelength: 0.25,
    movement: 1.0,
};
/// Deviations of a texture about which the paper or its name tells more (chosen).
const HINTED_SPREAD: Spread = Spread {
    friction: 0.08,
    height: 0.15,
    wavelength: 0.10,
    movement: 0.6,
};
/// Deviation of the powers with which friction goes with load and with speed, and of the curvature of ln(friction) over
/// ln(speed): an elastomer's friction on a dry surface rises or falls towards a peak at a speed of that surface
/// (chosen).
const FRICTION_POWERS: (f64, f64, f64) = (0.15, 0.18, 0.12);
/// Friction goes with the heights of a texture, relative to its kind's, to this power (chosen; PAPER Table 3: the
/// rougher, the less traction).
const SMOOTHER: f64 = -0.4;
/// Load at which the vibrations of an ordinary texture have fallen to half, N (chosen; PAPER: "greater forces tend to
/// dampen vibrations"), and the deviation of its ln among textures.
pub(super) const CLAMPED_N: (f64, f64) = (0.6, 0.5);
/// Deviation of the power with which vibrations go with speed, and of how that power changes with ln(speed): what
/// catches at one speed is skipped at another (chosen).
const VIBRATION_SPEED: (f64, f64) = (0.45, 0.2);
/// Deviation of ln(centre of the impulses' spectrum) (chosen).
const IMPULSE_SPREAD: f64 = 0.3;
/// Deviation of the power with which that centre goes with load, and of its bend over speed (chosen; PAPER: by and
/// large it does not scale with speed).
const IMPULSE_POWERS: (f64, f64) = (0.25, 0.15);
/// Deviation of a period from the next in cloth (chosen).
const CLOTH_JITTER: f64 = 0.03;
/// The same in moulded, machined or extruded textures (chosen).
const GRATING_JITTER: f64 = 0.001;

/// Draws the parameters of texture `number` in the world `seed`.
///
/// # Panics
/// If `number` is not in 1..=117.
pub fn draw(number: u8, seed: u64) -> Texture {
    let named = TEXTURES[usize::from(number) - 1];
    let mut noise = Noise::new(seed, u64::from(number));
    let noise = &mut noise;
    let (medians, hinted) = recipe(named);
    let spread = if hinted { HINTED_SPREAD } else { GROUP_SPREAD };

    let height = noise.about(1.0, spread.height);
    let fine_um = noise.about(medians.fine.0 * height, 0.5 * spread.height);
    let relief_um = noise.about(medians.relief.0 * height, 0.5 * spread.height);
    let weave = (medians.weave.0 > 0.0).then(|| Weave {
        wavelength_mm: noise.about(
            medians.weave.1,
            if medians.grating { 0.1 } else { 1.0 } * spread.wavelength,
        ),
        rms_um: noise.about(medians.weave.0 * height, 0.5 * spread.height),
        jitter: if medians.grating {
            GRATING_JITTER
        } else {
            CLOTH_JITTER
        },
        harmonics: 8,
        falloff: noise.between(1.0, 2.0),
    });
    // smooth surfaces touch all over (Hertz: -1/3), rough ones at points whose number grows with load (Amontons: 0)
    let smoothness = 1.0 / (1.0 + fine_um);
    // the smoother of two surfaces of a kind has the more contact
    let friction = noise.about(medians.friction, spread.friction) * pow(height, SMOOTHER);
    let friction_load = -0.15 * smoothness * noise.between(0.7, 1.3);
    let movement = spread.movement;
    Texture {
        number,
        friction,
        friction_speed: 0.04 + noise.within(movement * FRICTION_POWERS.1),
        stiction: noise.between(0.05, 0.25),
        friction_noise: noise.about(medians.friction_noise, 0.2),
        fine_um,
        fine_mm: noise.about(medians.fine.1, spread.wavelength),
        impulse_hz: noise.about(medians.impulse_hz, IMPULSE_SPREAD),
        relief_um,
        relief_mm: noise.about(medians.relief.1, spread.wavelength),
        relief_exponent: medians.relief_exponent + noise.between(-0.4, 0.4),
        weave,
        damping: medians.damping,
        heterogeneity: noise.about(medians.heterogeneity, 0.3),
        thickness_mm: noise.about(medians.thickness_mm, 0.2).min(FITS_MM),
        compliance_mm_per_n: noise.about(medians.compliance_mm_per_n, 0.2),
        friction_load: friction_load + noise.within(movement * FRICTION_POWERS.0),
        friction_bend: noise.within(movement * FRICTION_POWERS.2),
        impulse_load: noise.within(movement * IMPULSE_POWERS.0),
        impulse_bend: noise.within(movement * IMPULSE_POWERS.1),
        clamped_n: noise.about(CLAMPED_N.0, movement * CLAMPED_N.1),
        vibration_speed: noise.within(movement * VIBRATION_SPEED.0),
        vibration_bend: noise.within(movement * VIBRATION_SPEED.1),
    }
}
