//! The effects of a tick of a contact on a fingertip, and the hold of the finger meanwhile.

/// The effects of a tick of a contact on a fingertip.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Stimulus {
    /// Pressure in a fluid, Pa, and its slow part.
    pub(in super::super) fluid_pa: f64,
    pub(in super::super) slow_pa: f64,
    /// Force on the skin, N, and what vibration adds to it.
    pub(in super::super) force_n: f64,
    pub(in super::super) vibration_n: f64,
    /// Shear on the skin, N.
    pub(in super::super) shear_n: f64,
    pub(in super::super) held: Held,
}

/// The hold of a finger: felt only by transducers with a mass.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Held {
    /// Acceleration of the mounting towards the sample, g.
    pub(crate) acceleration_g: f64,
    /// Share of gravity in that direction: 1 hanging straight down.
    pub down: f64,
}

impl Held {
    /// By a stiff lever, straight down.
    pub const STILL: Self = Self {
        acceleration_g: 0.0,
        down: 1.0,
    };
}
