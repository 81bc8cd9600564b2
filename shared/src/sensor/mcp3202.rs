//! The paper's own circuit on a two-channel 12-bit converter, for those without a BioTac.
//!
//! A piezoresistive transducer, a gain of 10 for P_DC, a band-pass of 10-1040 Hz and a further gain of 99.1 for P_AC
//! around 1.65 V (Methods, "BioTac"), and a Microchip MCP3202 on 3.3 V that measures both: P_AC on channel 0, P_DC on
//! channel 1. Counts are then the BioTac's, and [`Calibration::PAPER`](crate::sensor::pressure::Calibration::PAPER) is where
//! the calibration starts.
//!
//! The converter samples while it is read (data sheet DS21034, 5.1), the BioTac when it is asked: in split use the two
//! differ by the gap, which shifts both channels alike.

use embedded_hal::spi::MODE_0;

use crate::sensor::driver::PressureSensor;
use crate::sensor::pressure::{Channel, Counts, Pressure};
use crate::sensor::slot::{Port, Transaction};

/// An MCP3202 as a [`PressureSensor`].
#[derive(Clone, Copy, Debug)]
pub struct Mcp3202;

/// Start bit at the end of byte 0, then single-ended, the channel, and most significant bit first (DS21034, fig. 6-1 and
/// table 5-1). Chip select has to go high between conversions (DS21034, 3.2).
const SLOTS: [[Transaction; 1]; 2] = [
    [Transaction::first_port(&[0x01, 0b1010_0000, 0x00], 2, 1)],
    [Transaction::first_port(&[0x01, 0b1110_0000, 0x00], 2, 1)],
];

impl PressureSensor for Mcp3202 {
    type Error = NullBit;
    const PORTS: &'static [Port] = &[Port {
        mode: MODE_0,
        // Upper end: 50000 samples a second at 2.7 V, 18 clocks each (DS21034); one read of 24 clocks takes 27 us. Lower end:
        // the held charge leaks away within 1.2 ms (DS21034, 6.2).
        clock_hz: 10_000..=900_000,
    }];
    const POWER_UP_MS: u32 = 0;
    const SLOTS: &'static [&'static [Transaction]] = &[&SLOTS[0], &SLOTS[1]];

    /// Three bits are not driven; then a null bit and 12 bits, the most significant first.
    fn decode(&mut self, n: u32, answer: &[u8]) -> Result<Pressure, NullBit> {
        match *answer {
            [upper, lower] if upper & 0b1_0000 == 0 => Ok(Pressure {
                channel: Channel::of_slot(n),
                counts: Counts::from_low_bits(u16::from_be_bytes([upper, lower])),
            }),
            // an answer that did not come is none, either
            _ => Err(NullBit),
        }
    }
}

/// The bit before the sample was 1: the converter does not drive the line.
///
/// A line that is pulled low reads as 0 counts instead; [`Counts::is_clipped`] tells.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, thiserror::Error)]
#[error("no converter answers (null bit is 1): check power, cable, chip select and SPI mode 0")]
pub struct NullBit;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::driver::{Driver, Error};
    use crate::sensor::pressure::Calibration;
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
        let pdc = conversion([0x01, 0xE0, 0x00], [0x00, 0x0A, 0x8F]);
        [pac, pdc].concat()
    }

    fn check(pac: Pressure, pdc: Pressure) {
        let calibration = Calibration::PAPER;
        let pa = calibration.pascals(pac.channel, f32::from(pac.counts.get()));
        assert!((pa + 27.0 * 0.373).abs() < 0.01, "2021 counts");
        let force = calibration.force(f32::from(pdc.counts.get()));
        assert_eq!(force.mn, 110.0 * 11.5, "2703 counts");
        assert!(!force.beyond_linear);
    }

    #[test]
    fn the_driver_reads_both_pressures() {
        let delays = [
            Delay::blocking_delay_ms(0),
            Delay::blocking_delay_us(1),
            Delay::blocking_delay_us(1),
        ];
        let mut driver = Driver::new(Mcp3202, Mock::new(&bus()), CheckedDelay::new(&delays));
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
        let mut driver = Driver::new(Mcp3202, Mock::new(&bus()), CheckedDelay::new(&delays));
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
        let mut driver = Driver::new(Mcp3202, Mock::new(&bus), delay);
        let error = driver.sample(0).unwrap_err();
        assert_eq!(error, Error::Sensor(NullBit));
        assert!(error.to_string().contains("chip select"));
        let (mut spi, mut delay) = driver.release();
        spi.done();
        delay.done();
    }

    #[test]
    fn all_values_and_all_undriven_bits_decode_and_a_null_bit_never_does() {
        for value in 0..=4095u16 {
            let [upper, lower] = value.to_be_bytes();
            for undriven in 0..8 {
                let upper = undriven << 5 | upper;
                let sample = Mcp3202.decode(1, &[upper, lower]).unwrap();
                assert_eq!(sample.counts.get(), value);
                assert_eq!(sample.channel, Channel::Pdc);
                assert_eq!(Mcp3202.decode(0, &[upper | 0x10, lower]), Err(NullBit));
            }
        }
        assert_eq!(Mcp3202.decode(0, &[]), Err(NullBit), "it did not come");
    }
}
