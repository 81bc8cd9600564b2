//! What host and probe say to each other: [`Request`]s to the probe, [`Report`]s from it.
//!
//! A frame is a message in postcard's format and the CRC-32 (ISO-HDLC, little-endian) of it, both in COBS, and a 0. A 0
//! is nowhere else, so that after any disturbance the next frame is understood again. A frame that is damaged, too long
//! or no message is counted and dropped: see [`Receiver`].

pub mod bringup;
mod command;
mod event;
mod failure;
mod frame;
mod prompt;
mod sparse;
mod text;

pub use crate::explorer::ExpectedOutcome;
pub use crate::rig::arm::{ArmMovement, ArmOrder, ArmReport, ArmState, ArmTask};
pub use command::{Command, Forget, Identify, PART, Request, Train};
pub use event::{
    Counts, Event, Live, MAX_EXPECTED_OUTCOMES, Phase, Report, Reset, SlideReport, Status,
    TextureLearned, Verdict,
};
pub use failure::{Failure, LEAST_TRIALS, MemoryError, Rejection, TrainingError};
pub use frame::{FrameError, MAX_FRAME, MAX_MESSAGE, PROTOCOL, Receiver, TooLong, decode, encode};
pub use prompt::{Again, Prompt};
pub use text::{Text, text};

#[cfg(test)]
mod tests;
