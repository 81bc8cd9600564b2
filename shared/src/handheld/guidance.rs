//! What a person who presses and slides is told.

use core::fmt;
use core::ops::RangeInclusive;

use crate::features::Observation;

/// The force that is asked for, mN: about [`super::judge::MOVEMENT`]'s, as wide as people hold it without looking.
pub const ZONE_MN: RangeInclusive<f32> = 300.0..=750.0;

/// What is wrong with a slide.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Again {
    /// Pressed too hard.
    TooHard,
    /// Pressed too lightly.
    TooLight,
    /// It ended before its time.
    TooShort,
    /// It was not made at one pace.
    TooUneven,
    /// A word of the sensor was lost or damaged.
    Disturbed,
}

impl Again {
    /// In words.
    pub const fn why(self) -> &'static str {
        match self {
            Self::TooHard => "too hard",
            Self::TooLight => "too light",
            Self::TooShort => "too short",
            Self::TooUneven => "too uneven",
            Self::Disturbed => "disturbed",
        }
    }
}

impl fmt::Display for Again {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.why())
    }
}

/// What happens in a touch.
#[derive(Clone, PartialEq, Debug)]
pub enum Event {
    /// P_DC without contact is known.
    Zeroed,
    /// The finger is down.
    Down,
    /// It is pressed well and still: it may slide.
    Still,
    /// It has slid well.
    Slid(Observation),
    /// It has not; it is to be lifted.
    Again(Again),
    /// It is up.
    Up,
    /// No word of the sensor can be read.
    Silent,
    /// P_AC does not change.
    Frozen,
}

/// What a touch is at.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Phase {
    /// In the air.
    Air,
    /// Down, and to be pressed well and kept still.
    Press,
    /// Well pressed and still: to be slid.
    Slide,
    /// Sliding.
    Sliding,
    /// It is over: to be lifted.
    Lift,
}

/// A touch as it is shown.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct View {
    /// What it is at.
    pub phase: Phase,
    /// Contact force, mN.
    pub force_mn: f32,
    /// How much of the slide is done, 0 to 1.
    pub progress: f32,
}
