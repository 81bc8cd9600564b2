//! Tactus on a PC: recordings, learning, evaluation, verification, and simulated probes.

pub mod data;
pub mod eval;
pub mod live;
pub mod remote;
pub mod sim;
