//! The BioTac as one of the sensors of the two pressures.

use core::ops::RangeInclusive;

use super::command::Channel;
use super::word::{WordError, decode};
use crate::sensor::driver::{Exchange, PressureSensor};
use crate::sensor::pressure::{self, Pressure};

/// A BioTac as a [`PressureSensor`]. Its other channels are read with [`Channel::exchange`] and [`decode`].
#[derive(Clone, Copy, Debug)]
pub struct BioTac;

impl PressureSensor for BioTac {
    type Reply = [u8; 2];
    type Error = WordError;
    /// SPM 8.2 and HDR; 1, 3 and 4.4 MHz are used in the field.
    const CLOCK_HZ: RangeInclusive<u32> = 500_000..=10_000_000;
    /// The maker's library waits this long (LIB).
    const POWER_UP_MS: u32 = 100;

    fn exchange(channel: pressure::Channel) -> Exchange<[u8; 2]> {
        Channel::from(channel).exchange()
    }

    fn decode(channel: pressure::Channel, reply: [u8; 2]) -> Result<Pressure, WordError> {
        let counts = decode(reply)?;
        Ok(Pressure { channel, counts })
    }
}
