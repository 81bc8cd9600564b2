//! From the sensor's words to pressures.
//!
//! [`PressureSensor`] is the seam: a finger is a file that implements it. [`biotac`], [`analog`] and [`mems`] are the three there are.
//! What they do on the bus is data: [`slot`]. All later rooms see [`pressure`] and what a kind of finger is like: [`FingerModel`].
//! [`paa5100je`] measures how fast a hand moves, on a bus of its own.

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
