//! A finger of a piezo disc and a load cell, amplified, on one MCP3202: what anyone can solder.
//!
//! P_AC: a piezo disc behind the skin, two operational amplifiers, a band-pass of 10 to 1040 Hz around 1.65 V, on
//! channel 0. P_DC: a bar load cell of 1 kg behind an INA125, on channel 1. The shape is the paper's own circuit
//! (Methods, "BioTac").
//!
//! The converter samples while it is read (data sheet DS21034, 5.1), the BioTac when it is asked: in split use the two
//! differ by the gap, which shifts both channels alike.

use crate::sensor::driver::{BadWord, PressureSensor};
use crate::sensor::finger::{AtRest, FingerModel, FingerName};
use crate::sensor::mcp3202::{self, CONVERSIONS, NullBit, PORT};
use crate::sensor::pressure::{Calibration, Channel, Pressure};
use crate::sensor::slot::{Port, StartStep, Transaction};

/// The finger as a [`PressureSensor`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Analog;

impl PressureSensor for Analog {
    type Error = AnalogError;
    const MODEL: FingerModel = FingerModel {
        name: FingerName::Analog,
        // The cell: 1 mV/V at 1 kg and 3.3 V are 0.3365 mV/N; times the INA125's gain of 208, 4 + 60 kOhm / 294 Ohm
        // (its data sheet, "Setting the gain"), 70 mV/N; a count is 0.806 mV: 11.5 mN. Its zero is put to 1000 counts,
        // so that a cell that is wired the wrong way round is seen to go down. The disc's gain is set so that its
        // counts are the paper's.
        calibration: Calibration {
            pdc_no_contact: 1000.0,
            ..Calibration::PAPER
        },
        pac_shows_force: true,
        at_rest: AtRest {
            pac_noise_counts: (0.4, 8.0),
            // a cell's zero is off by a tenth of its range or less, 85 counts, and the tip on it weighs 10 g at most, 9
            // counts
            pdc_counts: (850.0, 1150.0),
        },
    };
    const PORTS: &'static [Port] = &[PORT];
    const POWER_UP_MS: u32 = 0;
    const START: &'static [StartStep] = &[];
    const SLOTS: &'static [&'static [Transaction]] =
        &[CONVERSIONS.split_at(1).0, CONVERSIONS.split_at(1).1];

    fn decode(&mut self, n: u32, answer: &[u8]) -> Result<Pressure, AnalogError> {
        let channel = Channel::of_slot(n);
        let counts = mcp3202::decode(answer)?;
        // an amplifier of a cell that lost a wire goes to an end of its range; a cell that works never comes near it
        if channel == Channel::Pdc && counts.is_clipped() {
            return Err(AnalogError::Cell(counts.get()));
        }
        Ok(Pressure { channel, counts })
    }

    fn kind(why: &AnalogError) -> Option<BadWord> {
        Some(match why {
            AnalogError::Silent(_) => BadWord::Silent,
            AnalogError::Cell(_) => BadWord::Refused,
        })
    }
}

/// The reasons why an answer is not a sample.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, thiserror::Error)]
pub enum AnalogError {
    /// The converter does not answer.
    #[error(transparent)]
    Silent(#[from] NullBit),
    /// P_DC is at an end of its range.
    #[error(
        "the load cell reads {0} counts, an end of the range: check its four wires and the converter's data line"
    )]
    Cell(u16),
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::driver::{Driver, Error};
    use crate::sensor::pressure::Counts;
    use embedded_hal_mock::eh1::delay::{CheckedDelay, Transaction as Delay};
    use embedded_hal_mock::eh1::spi::{Mock, Transaction as Spi};
    use std::{string::ToString, vec, vec::Vec};

    /// One conversion on the bus.
    fn conversion(mosi: [u8; 3], miso: [u8; 3]) -> [Spi<u8>; 3] {
        [
            Spi::transaction_start(),
            Spi::transfer_in_place(mosi.to_vec(), miso.to_vec()),
            Spi::transaction_end(),
        ]
    }

    fn bus() -> Vec<Spi<u8>> {
        // undriven bits are 1 in one and 0 in the other
        let pac = conversion([0x01, 0xA0, 0x00], [0xFF, 0xE7, 0xE5]);
        let pdc = conversion([0x01, 0xE0, 0x00], [0x00, 0x04, 0x56]);
        [pac, pdc].concat()
    }

    fn check(pac: Pressure, pdc: Pressure) {
        let calibration = Analog::MODEL.calibration;
        let pa = calibration.pascals(pac.channel, f32::from(pac.counts.get()));
        assert!((pa + 27.0 * 0.373).abs() < 0.01, "2021 counts");
        let force = calibration.force(f32::from(pdc.counts.get()));
        assert_eq!(force.mn, 110.0 * 11.5, "1110 counts");
        assert!(!force.beyond_linear);
    }

    #[test]
    fn the_driver_reads_both_pressures() {
        let delays = [
            Delay::blocking_delay_ms(0),
            Delay::blocking_delay_us(1),
            Delay::blocking_delay_us(1),
        ];
        let mut driver = Driver::new(Analog, Mock::new(&bus()), CheckedDelay::new(&delays));
        driver.power_up();
        let [pac, pdc] = [0, 1].map(|slot| driver.sample(slot).unwrap());
        check(pac, pdc);
        let (mut spi, mut delay) = driver.release();
        spi.done();
        delay.done();
    }

    #[test]
    fn the_async_driver_reads_both_pressures() {
        let delays = [Delay::async_delay_us(1), Delay::async_delay_us(1)];
        let mut driver = Driver::new(Analog, Mock::new(&bus()), CheckedDelay::new(&delays));
        let (pac, pdc) = embassy_futures::block_on(async {
            (
                driver.sample_async(0).await.unwrap(),
                driver.sample_async(1).await.unwrap(),
            )
        });
        check(pac, pdc);
        let (mut spi, mut delay) = driver.release();
        spi.done();
        delay.done();
    }

    #[test]
    fn a_line_that_nothing_drives_is_an_error() {
        let bus = conversion([0x01, 0xA0, 0x00], [0xFF; 3]);
        let delay = CheckedDelay::new(&vec![Delay::blocking_delay_us(1)]);
        let mut driver = Driver::new(Analog, Mock::new(&bus), delay);
        let error = driver.sample(0).unwrap_err();
        assert_eq!(error, Error::Sensor(AnalogError::Silent(NullBit)));
        assert!(error.to_string().contains("chip select"));
        let (mut spi, mut delay) = driver.release();
        spi.done();
        delay.done();
    }

    #[test]
    fn all_values_and_all_undriven_bits_decode_and_a_null_bit_never_does() {
        for value in 1..=4094u16 {
            let [upper, lower] = value.to_be_bytes();
            for undriven in 0..8 {
                let upper = undriven << 5 | upper;
                let sample = Analog.decode(1, &[upper, lower]).unwrap();
                assert_eq!(sample.counts.get(), value);
                assert_eq!(sample.channel, Channel::Pdc);
                assert_eq!(
                    Analog.decode(0, &[upper | 0x10, lower]),
                    Err(NullBit.into())
                );
            }
        }
        assert_eq!(
            Analog.decode(0, &[]),
            Err(NullBit.into()),
            "it did not come"
        );
    }

    #[test]
    fn a_cell_at_an_end_of_the_range_is_an_error_and_a_loud_piezo_is_not() {
        for (upper, lower) in [(0x00, 0x00), (0x0F, 0xFF)] {
            let counts = Counts::from_low_bits(u16::from_be_bytes([upper, lower]));
            assert_eq!(
                Analog.decode(1, &[upper, lower]),
                Err(AnalogError::Cell(counts.get()))
            );
            assert_eq!(Analog.decode(0, &[upper, lower]).unwrap().counts, counts);
        }
    }
}
