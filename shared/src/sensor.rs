//! From the sensor's words to pressures.
//!
//! [`PressureSensor`] is the seam: a sensor is a file that implements it. [`biotac`] and [`mcp3202`] are the two there are.
//! What they do on the bus is data: [`slot`]. All later rooms see [`pressure`] only.

pub mod biotac;
mod driver;
pub mod mcp3202;
pub mod pressure;
pub mod slot;

pub use driver::{Driver, Error, PressureSensor, slot_of};
