//! What the next movement is chosen for: certainty, or certainty per second. The core has no clock: what a slide takes follows
//! from its movement. For hosts only; the images have none of this.

use crate::features::Movement;

/// What the next movement is chosen for.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub enum Objective {
    /// The greatest benefit (eq. 12), whatever it takes: the paper's.
    #[default]
    Bits,
    /// The most bits per second ([`bits`](crate::explorer::ExpectedOutcome::bits)), where slides take so long.
    BitsPerSecond(SlideTime),
}

/// How long slides take: so far at the speed of the movement, and what comes before and after.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SlideTime {
    /// Longest distance at the speed of the movement, mm.
    pub longest_mm: f32,
    /// Longest time at that speed, s.
    pub longest_s: f32,
    /// Approach, pressing, ramps, lifting and the way back, s: whatever the movement.
    pub overhead_s: f32,
}

impl SlideTime {
    /// What a slide of this movement takes, s.
    pub fn seconds(&self, movement: Movement) -> f32 {
        (self.longest_mm / movement.speed_mm_s()).min(self.longest_s) + self.overhead_s
    }
}
