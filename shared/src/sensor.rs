//! The way from the sensor's words to pressures.
//!
//! A finger is a file with its [`FingerParts`] and a decoder: [`biotac`], [`analog`] and [`mems`]. Its work on the bus
//! is data: [`slot`]. Later modules see only [`pressure`] and the kind of finger: [`FingerModel`]. [`paa5100je`]
//! measures how fast a hand moves, on a bus of its own.

mod ads1220;
pub mod analog;
pub mod biotac;
mod find;
mod finger;
mod finger_code;
mod iis3dwb;
pub mod mcp3202;
pub mod mems;
pub mod paa5100je;
pub mod pressure;
pub mod slot;

pub use find::{SLOWEST_HZ, find};
pub use finger::{
    AnyFinger, AtRest, BadWord, FingerError, FingerModel, FingerName, FingerParts, GRAVITY_PARTS,
    UnknownFinger,
};
pub use finger_code::FingerCode;
