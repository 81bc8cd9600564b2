//! What a tick of a contact does to a fingertip, and how the finger is held meanwhile.

/// What a tick of a contact does to a fingertip.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Felt {
    /// Pressure in a fluid, Pa, and its slow part.
    pub(in super::super) fluid_pa: f64,
    pub(in super::super) slow_pa: f64,
    /// Force on the skin, N, and what vibration adds to it.
    pub(in super::super) force_n: f64,
    pub(in super::super) vibration_n: f64,
    /// Shear on the skin, N.
    pub(in super::super) shear_n: f64,
    /// How the mounting moves, and how it hangs.
    pub(in super::super) held: Held,
}

/// How a finger is held: what only transducers with a mass feel.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Held {
    /// Acceleration of the mounting towards the sample, g.
    pub acceleration_g: f64,
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
