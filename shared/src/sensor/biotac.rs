//! The BioTac fingertip: commands, words and identity.
//!
//! Sources, cited by these names:
//! - SPM: BioTac SP Product Manual V2, 2015 (CNCR-NTU/biotac_sp_ros, doc/), whose protocol is the BioTac's;
//! - HDR and LIB: SynTouch's biotac.h and biotac.c, 2011-2012 (kth-ros-pkg/biotac_driver, biotac_sensors/);
//! - MM: a microcontroller driver (mattmongeon/finger_force_control, calibration/pic/biotac.c).
//!
//! SPI mode 0, most significant bit first, chip select active low, 0.5 to 10 MHz (SPM 8.2, HDR). A sample is a two-byte
//! command, at least 50 us with chip select high, and a two-byte read (SPM 8.3.1.1).

mod identity;
mod word;

use embedded_hal::spi::MODE_0;

use super::finger::{AtRest, FingerModel, FingerName, FingerParts};
use super::pressure::{Calibration, Channel, Pressure};
use super::slot::{Port, Transaction};

pub use identity::{Ascii, Identity, IdentityBytes, PropertyError, keep};
pub use word::{ErrorCode, WordError, decode, encode};

/// Shortest time between a command and the read of its answer, us (SPM 8.3.1.1). Earlier, the answer is an error frame.
const GAP_US: u32 = 50;
/// Time left after a read, us: 10 in HDR and MM; SPM fig. 14 has 5.
const REST_US: u32 = 10;

/// The sample of a channel: its command (0x80, the number of SPM table 7, odd parity in the lowest bit; then a byte
/// that is ignored, 0 as in LIB), and the read 50 us later.
const fn transactions(command: &'static [u8; 2]) -> [Transaction; 2] {
    [
        Transaction::first_port(command, 0, GAP_US),
        Transaction::first_port(&[0x00, 0x01], 2, REST_US),
    ]
}

/// A BioTac on its bus.
pub const PARTS: FingerParts = FingerParts {
    model: FingerModel {
        name: FingerName::Biotac,
        calibration: Calibration::PAPER,
        pac_shows_force: true,
        at_rest: AtRest {
            pac_noise_counts: (1.0, 8.0),
            pdc_counts: (2000.0, 3200.0),
        },
    },
    ports: &[Port {
        name: "BioTac",
        mode: MODE_0,
        // SPM 8.2 and HDR; 1, 3 and 4.4 MHz are used in the field
        clock_hz: 500_000..=10_000_000,
    }],
    // the maker's library waits this long (LIB)
    power_up_ms: 100,
    start: &[],
    slots: &[&transactions(&[0x80, 0]), &transactions(&[0x83, 0])],
    // The command A1 starts a streaming mode, which only 5 s without clock end (SPM); a tenth more for its own clock.
    deaf_ms: 5500,
    feels_gravity: false,
};

pub(super) fn sample(n: u32, answer: &[u8]) -> Result<Pressure, WordError> {
    // an answer that did not come
    let word = answer.try_into().map_err(|_| WordError::NoSensor)?;
    Ok(Pressure {
        channel: Channel::of_slot(n),
        counts: decode(word)?,
    })
}
