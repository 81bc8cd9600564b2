//! A finger of a piezo disc and a load cell, amplified, on one MCP3202: what anyone can solder.
//!
//! P_AC: a piezo disc behind the skin, two operational amplifiers, a band-pass of 10 to 1040 Hz around 1.65 V, on
//! channel 0. P_DC: a bar load cell of 1 kg behind an INA125, on channel 1. The shape is the paper's own circuit
//! (Methods, "BioTac").
//!
//! The converter samples while it is read (data sheet DS21034, 5.1), the BioTac when it is asked: in split use the two
//! differ by the gap, which shifts both channels alike.

use core::ops::RangeInclusive;

use super::finger::{AtRest, FingerError, FingerModel, FingerName, FingerParts};
use super::mcp3202::{self, CONVERSIONS};
use super::pressure::{Calibration, Channel, Pressure};

/// The finger on its bus.
pub const PARTS: FingerParts = FingerParts {
    model: FingerModel {
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
    },
    ports: &[mcp3202::PORT],
    power_up_ms: 0,
    start: &[],
    slots: &[CONVERSIONS.split_at(1).0, CONVERSIONS.split_at(1).1],
    deaf_ms: 0,
    feels_gravity: false,
};

/// P_DC of a sound cell, counts: from below what one in balance has in the air, to above 1 kg on it. Without a wire the
/// INA125 goes to an end of its output, which is neither 0 nor 4095: some 0.1 V above ground, 130 counts, or 0.8 to
/// 1.2 V below its supply, 3100 to 2600 counts.
const SOUND: RangeInclusive<u16> = 600..=2300;

pub(super) fn sample(n: u32, answer: &[u8]) -> Result<Pressure, FingerError> {
    let channel = Channel::of_slot(n);
    let counts = mcp3202::decode(answer).ok_or(FingerError::NullBit)?;
    if channel == Channel::Pdc && !SOUND.contains(&counts.get()) {
        return Err(FingerError::Clipped(counts.get()));
    }
    Ok(Pressure { channel, counts })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    #[test]
    fn all_values_and_all_undriven_bits_decode_and_a_null_bit_never_does() {
        for value in SOUND {
            let [upper, lower] = value.to_be_bytes();
            for undriven in 0..8 {
                let upper = undriven << 5 | upper;
                let pressure = sample(1, &[upper, lower]).unwrap();
                assert_eq!(pressure.counts.get(), value);
                assert_eq!(pressure.channel, Channel::Pdc);
                assert_eq!(sample(0, &[upper | 0x10, lower]), Err(FingerError::NullBit));
            }
        }
        assert_eq!(sample(0, &[]), Err(FingerError::NullBit), "it did not come");
        assert!(FingerError::NullBit.to_string().contains("chip select"));
    }

    #[test]
    fn a_cell_at_an_end_of_its_amplifier_is_an_error_and_a_loud_piezo_is_not() {
        for counts in [0, 130, 599, 2301, 2606, 3100, 4095_u16] {
            let answer = counts.to_be_bytes();
            assert_eq!(sample(1, &answer), Err(FingerError::Clipped(counts)));
            assert_eq!(sample(0, &answer).unwrap().counts.get(), counts);
        }
    }
}
