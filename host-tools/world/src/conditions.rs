//! The time step of the simulated world, and the conditions under which it is entered.

/// Ticks of the world in a second: three for each of the 4400 slots in which the sensor is asked for a sample (PAPER:
/// both pressures at 2200 Hz).
pub(crate) const TICKS_PER_S: u32 = 13_200;
/// Length of a tick, s.
pub(crate) const TICK_S: f64 = 1.0 / 13_200.0;

/// Difference between one touch of a texture and the next, unless a world is made with another: see
/// [`Conditions::variation`]. Chosen.
pub const TRIAL_VARIATION: f64 = 1.0;

/// The conditions under which a world is entered; no seed decides them.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Conditions {
    /// Difference between one touch of a texture and the next: a factor on the deviations of the contact's state, drawn
    /// at every touch (see [`finger`](crate::finger)), and on the heterogeneity of the samples (see
    /// `surface`). 0 leaves the start position and the noise of the sensor as the only differences.
    pub variation: f64,
    /// Wear of the skin to begin with: 0 is new, at 1 its ridges are gone.
    pub wear: f64,
}

impl Default for Conditions {
    fn default() -> Self {
        Self {
            variation: TRIAL_VARIATION,
            wear: 0.0,
        }
    }
}
