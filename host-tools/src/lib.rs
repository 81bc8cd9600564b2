//! Tactus on a PC.
pub mod recordings;
pub mod rows;
