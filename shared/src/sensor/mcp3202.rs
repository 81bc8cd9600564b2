//! Microchip's MCP3202, a converter of two channels and 12 bits: its requests and answers.

use embedded_hal::spi::MODE_0;

use crate::sensor::pressure::Counts;
use crate::sensor::slot::{Port, Transaction};

/// The port: chip select, mode and clock.
pub(super) const PORT: Port = Port {
    name: "MCP3202",
    // also 3 (DS21034, features)
    mode: MODE_0,
    // Upper end: 50000 samples a second at 2.7 V, 18 clocks each (DS21034); one read of 24 clocks takes 27 us. Lower
    // end: the held charge leaks away within 1.2 ms (DS21034, 6.2).
    clock_hz: 10_000..=900_000,
};

/// A conversion of channel 0, and one of channel 1.
///
/// Start bit at the end of byte 0, then single-ended, the channel, and most significant bit first (DS21034, fig. 6-1
/// and table 5-1). Chip select has to go high between conversions (DS21034, 3.2).
pub(super) const CONVERSIONS: [Transaction; 2] = [
    Transaction::first_port(&[0x01, 0b1010_0000, 0x00], 2, 1),
    Transaction::first_port(&[0x01, 0b1110_0000, 0x00], 2, 1),
];

/// The reading in an answer; `None` if the converter does not drive the line, or the answer did not come. Three bits
/// are not driven; then a null bit and 12 bits, the most significant first. A line that is pulled low reads as 0
/// counts.
pub fn decode(answer: &[u8]) -> Option<Counts> {
    match *answer {
        [upper, lower] if upper & 0b1_0000 == 0 => {
            Some(Counts::from_low_bits(u16::from_be_bytes([upper, lower])))
        }
        _ => None,
    }
}
