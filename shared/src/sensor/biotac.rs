//! The BioTac fingertip: commands, words and properties.
//!
//! Sources, cited by these names:
//! - SPM: BioTac SP Product Manual V2, 2015 (CNCR-NTU/biotac_sp_ros, doc/), whose protocol is the BioTac's;
//! - HDR and LIB: SynTouch's biotac.h and biotac.c, 2011-2012 (kth-ros-pkg/biotac_driver, biotac_sensors/);
//! - MM: a microcontroller driver (mattmongeon/finger_force_control, calibration/pic/biotac.c).
//!
//! SPI mode 0, most significant bit first, chip select active low, 0.5 to 10 MHz (SPM 8.2, HDR). A sample is a two-byte
//! command, at least 50 us with chip select high, and a two-byte read (SPM 8.3.1.1).

mod command;
mod finger;
mod property;
#[cfg(test)]
mod tests;
mod word;

pub use command::{Channel, FULL_FRAME, GAP_US, PRESSURE_SLOTS, READ_MOSI, REST_US};
pub use finger::BioTac;
pub use property::{Ascii, Identity, IdentityBytes, Property, PropertyError, keep};
pub use word::{BadParity, ErrorCode, WordError, decode, encode, encode_error};
