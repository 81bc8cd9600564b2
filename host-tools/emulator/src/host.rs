//! The host's side of a board: what lies under the finger, what the firmware is given, and what is made of its reports.

pub mod args;
pub mod exploration;
pub mod hand;
pub mod learned;
pub mod milestones;
pub mod progress;
pub mod talk;
pub mod under_finger;
