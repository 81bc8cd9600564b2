//! From the effects of a contact on a fingertip to the signals of its transducers: one for each kind of finger.

use super::amplifier::{Amplifiers, PA_PER_N};
use super::analog::Analog;
use super::mems::Mems;
use super::stimulus::Stimulus;
use crate::noise::Noise;

/// Pressure that the mounting's acceleration makes in a fluid, Pa for a g: a column of 10 mm of water. The lever's
/// vibration is known as such a pressure.
pub(in super::super) const FLUID_PA_PER_G: f64 = 98.0;

/// The transducers.
#[allow(clippy::large_enum_variant)]
pub(in super::super) enum Signals {
    /// A BioTac's fluid.
    Fluid(Amplifiers),
    /// A piezo disc and a load cell.
    Analog(Analog),
    /// An accelerometer in silicone and a load cell.
    Mems(Mems),
}

impl Signals {
    pub(super) fn tick(&mut self, stimulus: &Stimulus, noise: &mut Noise) {
        match self {
            Self::Fluid(amplifiers) => amplifiers.tick(stimulus.fluid_pa, stimulus.slow_pa, noise),
            Self::Analog(analog) => analog.tick(stimulus, noise),
            Self::Mems(mems) => mems.tick(stimulus, noise),
        }
    }
}

/// A pressure of the mounting or of vibrations, as a force on the skin.
pub(super) fn newtons(pressure_pa: f64) -> f64 {
    pressure_pa / PA_PER_N
}
