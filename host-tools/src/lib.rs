//! Tactus on a PC: recordings, replays of them, virtual explorations, and what the command `tactus` shows.

pub mod bringup;
pub mod data;
pub mod eval;
pub mod link;
pub mod live;
pub mod remote;
pub mod sim;
#[cfg(feature = "study")]
pub mod study;
