//! The host's side of a board: what lies under the finger, what the firmware is told, and what is made of what it says.

pub mod args;
pub mod exploration;
pub mod learned;
pub mod progress;
pub mod talk;
pub mod under_finger;
