//! What performs a movement: the seam [`Rig`], and what stands behind it on a rig with a stage and a lever.
//!
//! A property means something only for the movement that made it, so moving and sensing are one act.
//!
//! What is done every millisecond is `#[inline]` here: so it is compiled with the firmware, which is optimised for
//! size, and not with the kernels of this crate.

pub mod arm;
mod ascent;
pub mod calibration;
pub mod control;
pub mod fault;
pub mod force;
pub mod guard;
pub mod lever;
pub mod over_link;
pub mod phase;
pub mod pins;
mod progress;
pub mod skin;
mod slide;
pub mod slide_path;
pub mod stage;
pub mod steps;
pub mod timeout;
pub mod turning;
pub mod unloaded;
pub mod weigh;
use crate::features::{PropertySet, Slide};

pub use fault::{FAULTS, Fault};
pub use phase::{Ended, HIGH_FORCE_MN, Phase, Refused, RigError, most_mn};

/// Slides in a row that came to nothing, after which an exploration ends: each movement is tried twice, so these are
/// three movements.
pub const MAX_REJECTED: u8 = 6;

/// True if no more of a slide is needed.
pub type Enough<'a> = &'a mut dyn FnMut(&mut Slide<'_>) -> bool;

/// A board, a simulator or a recording: it makes one movement and delivers the samples.
#[allow(async_fn_in_trait)] // no executor of this project moves tasks between threads
pub trait Rig {
    /// The reason why a movement failed.
    type Error;

    /// The properties that this rig can measure.
    fn measures(&self) -> PropertySet;

    /// The largest contact force that this rig makes a movement with, mN.
    fn most_mn(&self) -> u16 {
        HIGH_FORCE_MN
    }

    /// Makes the movement of `slide`: presses, measures the still finger, slides, and gives it all samples in blocks.
    /// The finger may still be on its way up: see [`Rig::lifted`].
    /// Errors: the movement failed. The stage then stands still and the finger is lifted.
    async fn perform(&mut self, slide: &mut Slide<'_>) -> Result<(), Self::Error>;

    /// As [`Rig::perform`]; the slide ends as soon as `enough`, asked after each of its blocks, says that no more of it
    /// is needed, and takes in none of what comes after that. A rig that makes all slides to their end does not ask.
    /// Errors: as [`Rig::perform`].
    async fn perform_until(
        &mut self,
        slide: &mut Slide<'_>,
        _enough: Enough<'_>,
    ) -> Result<(), Self::Error> {
        self.perform(slide).await
    }

    /// Waits until the finger is lifted, which takes longer than it takes to judge the slide. For a rig whose movements
    /// end with that, or that has no finger, there is nothing to wait for.
    /// Errors: the finger was not lifted as it should; it is now, unless that is what fails.
    async fn lifted(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }

    /// True if a movement can be tried again after this failure, once the rig has done by itself what that takes. One
    /// that needs a person cannot.
    async fn recover(&mut self, _failed: &Self::Error) -> bool {
        false
    }
}
