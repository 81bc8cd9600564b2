//! What a probe does when it is asked, the same on the chip, on the emulated board and in a PC's simulated probe:
//! requests come to [`receive`], those that wait for their turn go to [`Probe::serve`]. What a probe runs on is behind
//! [`seams`].

pub(crate) mod calibrate;
mod dispatch;
pub mod explore;
mod identify;
mod memory;
pub mod seams;
pub mod servo_rig;
mod status;
pub mod teach;
mod train;
pub mod training;
mod transfer;

pub use calibrate::restore;
pub use dispatch::{Probe, Turn, receive, turn};
pub(crate) use identify::candidates;
pub use identify::{Identification, event_of, identify};
pub use memory::Memory;
pub use status::{RigState, TableInUse, Watch};
pub use train::train;

#[cfg(test)]
mod tests;
