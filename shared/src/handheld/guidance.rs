//! Guidance of a person who presses and slides.

use core::ops::RangeInclusive;

use crate::features::Observation;

/// The zone of force to keep, mN: about [`super::judge::MOVEMENT`]'s, as wide as people hold it without looking.
pub(crate) const ZONE_MN: RangeInclusive<f32> = 300.0..=750.0;

pub use crate::wire::Again;

/// Events of a touch.
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
    /// The slide failed; the finger is to be lifted.
    Again(Again),
    /// It is up.
    Up,
    /// No word of the sensor can be read.
    Silent,
    /// P_AC does not change.
    Frozen,
}

/// Phases of a touch.
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

/// The way of a slide so far, by a sensor of motion.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub enum Way {
    /// There is none.
    #[default]
    NoSensor,
    /// Not all of it was seen.
    Unseen,
    /// In parts of all of it.
    Seen(f32),
}

/// A touch as it is shown.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct View {
    /// Its phase.
    pub phase: Phase,
    /// Contact force, mN.
    pub force_mn: f32,
    /// Part of the slide that is done, 0 to 1.
    pub progress: f32,
    /// The way of the slide so far.
    pub way: Way,
}
