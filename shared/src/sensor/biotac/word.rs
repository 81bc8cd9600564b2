//! Words: the two bytes that answer a sampling command.
//!
//! byte 0 = D11..D5, P and byte 1 = D4..D0, 0, 0, P, with odd parity in each byte (SPM, HDR).

use core::fmt;

use crate::sensor::pressure::Counts;

/// Byte 0 of an error frame. Its parity is even, so no sample begins with it.
const ERROR_FRAME: u8 = 0xA5;
/// Bits 2 and 1 of byte 1: always 0 in a sample.
const PADDING: u8 = 0b110;

/// The sample in a word.
/// Errors: in this order, so that each word has one answer:
/// - [`WordError::ErrorFrame`] if byte 0 is A5, whatever byte 1 is: an error frame may fail parity too, and read as
///   data it would be 2629;
/// - [`WordError::NoSensor`] for FF FF and 00 00. They fail the parity of both bytes, which one flipped bit of a sample
///   cannot do (it spoils one byte), so a flipped bit is never taken for a missing sensor;
/// - [`WordError::Parity`] if either byte fails;
/// - [`WordError::Padding`] if both pass with a padding bit set: two flips in byte 1, or not a sample at all.
///
/// Two flips in the same byte can give a wrong sample that passes: 80 01 and 86 01 are both good words.
pub const fn decode(word: [u8; 2]) -> Result<Counts, WordError> {
    let [byte0, byte1] = word;
    if byte0 == ERROR_FRAME {
        return Err(WordError::ErrorFrame(ErrorCode(byte1)));
    }
    if let [0x00, 0x00] | [0xFF, 0xFF] = word {
        return Err(WordError::NoSensor);
    }
    if !is_odd(byte0) || !is_odd(byte1) {
        return Err(WordError::Parity);
    }
    if byte1 & PADDING != 0 {
        return Err(WordError::Padding(byte1));
    }
    let upper = (byte0 >> 1) as u16;
    let lower = (byte1 >> 3) as u16;
    Ok(Counts::from_low_bits(upper * 32 + lower))
}

/// The word for a sample, as the sensor sends it; for simulated sensors.
pub const fn encode(counts: Counts) -> [u8; 2] {
    let value = counts.get();
    [
        with_parity((value >> 5) as u8, 1),
        with_parity((value & 0x1F) as u8, 3),
    ]
}

/// `bits` above `shift` free bits, the lowest of which makes the parity odd.
const fn with_parity(bits: u8, shift: u32) -> u8 {
    let byte = bits << shift;
    if is_odd(byte) { byte } else { byte | 1 }
}

const fn is_odd(byte: u8) -> bool {
    byte.count_ones() % 2 == 1
}

/// The reasons why a word is not a sample.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum WordError {
    #[error("sensor reports {0}")]
    ErrorFrame(ErrorCode),
    #[error("no sensor: the line stays high or low; check power, cable and chip select")]
    NoSensor,
    #[error("bad parity: a flipped bit; if most words fail, check the clock phase")]
    Parity,
    #[error(
        "padding bits set in byte 1 ({0:02X}) with good parity: not a sample; \
         if it repeats, check the clock phase"
    )]
    Padding(u8),
}

/// Byte 1 of an error frame (SPM names the first three, HDR all).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct ErrorCode(pub u8);

impl ErrorCode {
    /// The meaning; `None` of a code that no source names.
    pub(crate) const fn meaning(self) -> Option<&'static str> {
        Some(match self.0 {
            0x2D | 0x2E => {
                "read too early: leave 50 us with chip select high between command and read"
            }
            0x58 => "no such channel, or one flipped bit",
            0x52 => "the property is read-only",
            0x45 => "the command arrived with even parity: check MOSI and the clock",
            0x3F => "unknown command: check MOSI and the clock phase",
            0x5F => "nothing to send again",
            0x57 => "the property could not be written",
            _ => return None,
        })
    }
}

impl fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // of a sample whose byte 0 became A5 by one flipped bit
        let unknown = "unknown code, rather a flipped bit than an error of the sensor";
        write!(
            f,
            "A5 {:02X}: {}",
            self.0,
            self.meaning().unwrap_or(unknown)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

    const fn value(word: [u8; 2]) -> Result<u16, WordError> {
        match decode(word) {
            Ok(counts) => Ok(counts.get()),
            Err(error) => Err(error),
        }
    }

    #[test]
    fn worked_words_have_their_meaning() {
        let early = WordError::ErrorFrame(ErrorCode(0x2D));
        for (word, expected) in [
            ([0x01, 0x01], Ok(0)), // not 00 00
            ([0xFE, 0xF8], Ok(4095)),
            ([0x80, 0x01], Ok(2048)),
            ([0x7F, 0x29], Ok(2021)),
            ([0xA2, 0x08], Ok(2593)),
            ([0x86, 0x01], Ok(2144)), // parity cannot see two flips
            ([0x81, 0x01], Err(WordError::Parity)),
            ([0x80, 0x41], Err(WordError::Parity)),
            ([0x81, 0x41], Err(WordError::Parity)),
            ([0xA5, 0x2D], Err(early)),
            ([0xFF, 0xFF], Err(WordError::NoSensor)),
            ([0x00, 0x00], Err(WordError::NoSensor)),
            // one line stuck is not both
            ([0xFF, 0x00], Err(WordError::Parity)),
            ([0x00, 0xFF], Err(WordError::Parity)),
            // 07 has odd parity and both padding bits
            ([0x80, 0x07], Err(WordError::Padding(0x07))),
            ([0x80, 0x02], Err(WordError::Padding(0x02))),
            ([0x80, 0x04], Err(WordError::Padding(0x04))),
        ] {
            assert_eq!(value(word), expected, "{word:02X?}");
        }
    }

    #[test]
    fn errors_say_where_to_look() {
        let frame = |code| WordError::ErrorFrame(ErrorCode(code));
        for (error, text) in [
            (WordError::NoSensor, "chip select"),
            (WordError::Parity, "bad parity"),
            (WordError::Padding(0x07), "(07)"),
            (frame(0x2D), "A5 2D: read too early: leave 50 us"),
            (frame(0x2E), "50 us"),
            (frame(0x58), "channel"),
            (frame(0x52), "read-only"),
            (frame(0x45), "even parity"),
            (frame(0x3F), "unknown command"),
            (frame(0x5F), "again"),
            (frame(0x57), "written"),
            (frame(0x01), "A5 01: unknown code, rather a flipped bit"),
        ] {
            assert!(error.to_string().contains(text), "{error}");
        }
    }

    #[test]
    fn one_flipped_bit_never_passes_as_a_value() {
        for raw in 0..=4095 {
            for bit in 0..16 {
                let word = u16::from_be_bytes(encode(Counts::new(raw).unwrap())) ^ (1 << bit);
                match decode(word.to_be_bytes()).unwrap_err() {
                    WordError::Parity => {}
                    // the only code that a flipped bit forges is 58
                    WordError::ErrorFrame(code) if bit >= 8 => {
                        assert!(code.0 == 0x58 || code.meaning().is_none(), "{code}");
                    }
                    other => panic!("{raw} bit {bit}: {other:?}"),
                }
            }
        }
    }

    #[test]
    fn all_65536_words_have_one_meaning_each() {
        let (mut good, mut frames, mut silent, mut padding, mut parity) = (0, 0, 0, 0, 0);
        for word in 0..=u16::MAX {
            let bytes = word.to_be_bytes();
            match decode(bytes) {
                Ok(counts) => {
                    good += 1;
                    assert_eq!(encode(counts), bytes, "no value has two words");
                    // by the definition of the format, not by the code above
                    let raw = u16::from(bytes[0] / 2) * 32 + u16::from(bytes[1] / 8);
                    assert_eq!(counts.get(), raw);
                    assert_eq!(bytes[1] & 0b110, 0);
                    assert!(bytes.iter().all(|b| b.count_ones() % 2 == 1));
                }
                Err(WordError::ErrorFrame(code)) => {
                    frames += 1;
                    assert_eq!(bytes, [0xA5, code.0], "first of all checks");
                }
                Err(WordError::NoSensor) => silent += 1,
                Err(WordError::Padding(_)) => padding += 1,
                Err(WordError::Parity) => parity += 1,
            }
        }
        // 128 bytes have odd parity, 32 of them clear padding; A5 is one of the 128 even ones
        assert_eq!((good, frames, silent), (128 * 32, 256, 2));
        assert_eq!(padding, 128 * (128 - 32));
        assert_eq!(parity, 127 * 128 + 128 * 128 + 127 * 128 - 2);
    }
}
