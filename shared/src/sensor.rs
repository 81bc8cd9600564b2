//! The way from the sensor's words to pressures.
//!
//! [`PressureSensor`] is the seam: a finger is a file that implements it. The three are [`biotac`], [`analog`] and
//! [`mems`]. Their work on the bus is data: [`slot`]. Later modules see only [`pressure`] and the kind of finger:
//! [`FingerModel`]. [`paa5100je`] measures how fast a hand moves, on a bus of its own.

pub mod ads1220;
pub mod analog;
mod any;
pub mod biotac;
mod driver;
mod finger;
mod finger_code;
pub mod iis3dwb;
pub mod mcp3202;
pub mod mems;
pub mod paa5100je;
pub mod pressure;
pub mod slot;

pub use any::{AnyFinger, FingerError, FingerParts, SLOWEST_HZ, find};
pub use driver::{BadWord, Driver, Error, GRAVITY_PARTS, PressureSensor, StartError, slot_of};
pub use finger::{AtRest, FingerModel, FingerName, UnknownFinger};
pub use finger_code::FingerCode;
