//! The BioTac as one of the sensors of the two pressures.

use embedded_hal::spi::MODE_0;

use super::command::PRESSURE_SLOTS;
use super::word::{WordError, decode};
use crate::sensor::driver::{BadWord, PressureSensor};
use crate::sensor::finger::{AtRest, FingerModel, FingerName};
use crate::sensor::pressure::{Calibration, Channel, Pressure};
use crate::sensor::slot::{Port, StartStep, Transaction};

/// A BioTac as a [`PressureSensor`]. Its other channels are read with
/// [`Channel::transactions`](super::Channel::transactions) and [`decode`].
#[derive(Clone, Copy, Debug, Default)]
pub struct BioTac;

const SLOTS: [[Transaction; 2]; 2] = {
    let [pac, pdc] = PRESSURE_SLOTS;
    [pac.transactions(), pdc.transactions()]
};

impl PressureSensor for BioTac {
    type Error = WordError;
    const MODEL: FingerModel = FingerModel {
        name: FingerName::Biotac,
        calibration: Calibration::PAPER,
        pac_shows_force: true,
        at_rest: AtRest {
            pac_noise_counts: (1.0, 8.0),
            pdc_counts: (2000.0, 3200.0),
        },
    };
    const PORTS: &'static [Port] = &[Port {
        name: "BioTac",
        mode: MODE_0,
        // SPM 8.2 and HDR; 1, 3 and 4.4 MHz are used in the field
        clock_hz: 500_000..=10_000_000,
    }];
    /// The maker's library waits this long (LIB).
    const POWER_UP_MS: u32 = 100;
    const START: &'static [StartStep] = &[];
    const SLOTS: &'static [&'static [Transaction]] = &[&SLOTS[0], &SLOTS[1]];
    /// The command A1 starts a streaming mode, which only 5 s without clock end (SPM); a tenth more for its own clock.
    const DEAF_MS: u32 = 5500;

    fn decode(&mut self, n: u32, answer: &[u8]) -> Result<Pressure, WordError> {
        // an answer that did not come
        let word = answer.try_into().map_err(|_| WordError::NoSensor)?;
        Ok(Pressure {
            channel: Channel::of_slot(n),
            counts: decode(word)?,
        })
    }

    fn kind(why: &WordError) -> Option<BadWord> {
        Some(match why {
            WordError::Parity(_) | WordError::Padding(_) => BadWord::Garbled,
            WordError::ErrorFrame(_) => BadWord::Refused,
            WordError::NoSensor => BadWord::Silent,
        })
    }
}
