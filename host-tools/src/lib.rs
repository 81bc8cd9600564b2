//! Tactus on a PC.
pub mod import;
pub mod properties;
pub mod recordings;
pub mod rows;
