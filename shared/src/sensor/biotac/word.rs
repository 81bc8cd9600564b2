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
///
/// # Errors
/// In this order, so that each word has one answer:
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
        return Err(WordError::ErrorFrame(ErrorCode::from_byte(byte1)));
    }
    if let [0x00, 0x00] | [0xFF, 0xFF] = word {
        return Err(WordError::NoSensor);
    }
    match (is_odd(byte0), is_odd(byte1)) {
        (false, true) => return Err(WordError::Parity(BadParity::Byte0)),
        (true, false) => return Err(WordError::Parity(BadParity::Byte1)),
        (false, false) => return Err(WordError::Parity(BadParity::Both)),
        (true, true) => {}
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

/// The error frame for a code, as the sensor sends it; for simulated sensors.
pub const fn encode_error(code: ErrorCode) -> [u8; 2] {
    [ERROR_FRAME, code.byte()]
}

/// `bits` above `shift` free bits, the lowest of which makes the parity odd.
pub(super) const fn with_parity(bits: u8, shift: u32) -> u8 {
    let byte = bits << shift;
    if is_odd(byte) { byte } else { byte | 1 }
}

const fn is_odd(byte: u8) -> bool {
    byte.count_ones() % 2 == 1
}

/// The reasons why a word is not a sample.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, thiserror::Error)]
pub enum WordError {
    /// The sensor reports an error in the command or its timing.
    #[error("sensor reports {0}")]
    ErrorFrame(ErrorCode),
    /// FF FF or 00 00: nothing drives the line.
    #[error("no sensor: the line stays high or low; check power, cable and chip select")]
    NoSensor,
    /// A byte has even parity.
    #[error("bad parity in {}: a flipped bit; if most words fail, check the clock phase", .0.place())]
    Parity(BadParity),
    /// Good parity with a padding bit set; holds byte 1.
    #[error(
        "padding bits set in byte 1 ({0:02X}) with good parity: not a sample; \
         if it repeats, check the clock phase"
    )]
    Padding(u8),
}

/// Which bytes of a word have even parity.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum BadParity {
    /// Byte 0 alone.
    Byte0,
    /// Byte 1 alone.
    Byte1,
    /// Both bytes.
    Both,
}

impl BadParity {
    const fn place(self) -> &'static str {
        match self {
            Self::Byte0 => "byte 0",
            Self::Byte1 => "byte 1",
            Self::Both => "both bytes",
        }
    }
}

/// Byte 1 of an error frame (SPM names the first three, HDR all).
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum ErrorCode {
    /// 2D: the answer to a sampling command was read too early.
    SamplingDelay,
    /// 58: no such channel.
    Channel,
    /// 52: the property cannot be written.
    ReadOnly,
    /// 45: the command had even parity.
    Parity,
    /// 3F: no such command.
    UnknownCommand,
    /// 2E: the answer to a command was read too early.
    Delay,
    /// 5F: nothing to send again.
    NothingToResend,
    /// 57: the property could not be written.
    WriteFailed,
    /// Any other byte. Rather a sample of which one flipped bit made byte 0 an A5 than a new code of the sensor.
    Unknown(u8),
}

impl ErrorCode {
    /// The code in byte 1 of an error frame.
    pub const fn from_byte(byte1: u8) -> Self {
        match byte1 {
            0x2D => Self::SamplingDelay,
            0x58 => Self::Channel,
            0x52 => Self::ReadOnly,
            0x45 => Self::Parity,
            0x3F => Self::UnknownCommand,
            0x2E => Self::Delay,
            0x5F => Self::NothingToResend,
            0x57 => Self::WriteFailed,
            other => Self::Unknown(other),
        }
    }

    /// Byte 1 of the error frame.
    pub const fn byte(self) -> u8 {
        match self {
            Self::SamplingDelay => 0x2D,
            Self::Channel => 0x58,
            Self::ReadOnly => 0x52,
            Self::Parity => 0x45,
            Self::UnknownCommand => 0x3F,
            Self::Delay => 0x2E,
            Self::NothingToResend => 0x5F,
            Self::WriteFailed => 0x57,
            Self::Unknown(byte1) => byte1,
        }
    }

    /// Returns whether the read came too soon after the command.
    pub const fn is_too_early(self) -> bool {
        matches!(self, Self::SamplingDelay | Self::Delay)
    }
}

impl fmt::Display for ErrorCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self {
            Self::SamplingDelay | Self::Delay => {
                "read too early: leave 50 us with chip select high between command and read"
            }
            Self::Channel => "no such channel, or one flipped bit",
            Self::ReadOnly => "the property is read-only",
            Self::Parity => "the command arrived with even parity: check MOSI and the clock",
            Self::UnknownCommand => "unknown command: check MOSI and the clock phase",
            Self::NothingToResend => "nothing to send again",
            Self::WriteFailed => "the property could not be written",
            Self::Unknown(_) => "unknown code, rather a flipped bit than an error of the sensor",
        };
        write!(f, "A5 {:02X}: {text}", self.byte())
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
        assert_eq!(value([0x01, 0x01]), Ok(0), "zero is not 00 00");
        assert_eq!(value([0xFE, 0xF8]), Ok(4095));
        assert_eq!(value([0x80, 0x01]), Ok(2048));
        assert_eq!(value([0x7F, 0x29]), Ok(2021));
        assert_eq!(value([0xA2, 0x08]), Ok(2593));
        let parity = |bad| Err(WordError::Parity(bad));
        assert_eq!(value([0x81, 0x01]), parity(BadParity::Byte0));
        assert_eq!(value([0x80, 0x41]), parity(BadParity::Byte1));
        assert_eq!(value([0x81, 0x41]), parity(BadParity::Both));
        assert_eq!(value([0x86, 0x01]), Ok(2144), "parity cannot see two flips");
        let early = WordError::ErrorFrame(ErrorCode::SamplingDelay);
        assert_eq!(value([0xA5, 0x2D]), Err(early));
        assert_eq!(value([0xFF, 0xFF]), Err(WordError::NoSensor));
        assert_eq!(value([0x00, 0x00]), Err(WordError::NoSensor));
        // one line stuck is not both
        assert_eq!(value([0xFF, 0x00]), parity(BadParity::Both));
        assert_eq!(value([0x00, 0xFF]), parity(BadParity::Both));
        // 07 has odd parity and both padding bits
        assert_eq!(value([0x80, 0x07]), Err(WordError::Padding(0x07)));
        assert_eq!(value([0x80, 0x02]), Err(WordError::Padding(0x02)));
        assert_eq!(value([0x80, 0x04]), Err(WordError::Padding(0x04)));
    }

    #[test]
    fn every_error_code_has_its_name_and_its_text() {
        let codes = [
            (0x2D, ErrorCode::SamplingDelay, "50 us"),
            (0x58, ErrorCode::Channel, "channel"),
            (0x52, ErrorCode::ReadOnly, "read-only"),
            (0x45, ErrorCode::Parity, "even parity"),
            (0x3F, ErrorCode::UnknownCommand, "unknown command"),
            (0x2E, ErrorCode::Delay, "50 us"),
            (0x5F, ErrorCode::NothingToResend, "again"),
            (0x57, ErrorCode::WriteFailed, "written"),
        ];
        for byte1 in 0..=255 {
            let known = codes.iter().find(|(b, ..)| *b == byte1);
            let code = known.map_or(ErrorCode::Unknown(byte1), |(_, code, _)| *code);
            assert_eq!(ErrorCode::from_byte(byte1), code);
            assert_eq!(encode_error(code), [0xA5, byte1]);
            assert_eq!(
                value([0xA5, byte1]),
                Err(WordError::ErrorFrame(code)),
                "first of all checks"
            );
            assert_eq!(code.is_too_early(), byte1 == 0x2D || byte1 == 0x2E);
        }
        for (byte1, code, text) in codes {
            let shown = WordError::ErrorFrame(code).to_string();
            assert!(shown.contains(text), "{shown}");
            assert!(shown.contains(&std::format!("A5 {byte1:02X}")), "{shown}");
        }
        let unknown = ErrorCode::Unknown(0x01).to_string();
        assert!(unknown.contains("A5 01") && unknown.contains("flipped bit"));
    }

    #[test]
    fn errors_say_where_to_look() {
        for (error, text) in [
            (WordError::NoSensor, "chip select"),
            (WordError::Parity(BadParity::Byte0), "byte 0"),
            (WordError::Parity(BadParity::Byte1), "byte 1"),
            (WordError::Parity(BadParity::Both), "both bytes"),
            (WordError::Padding(0x07), "(07)"),
        ] {
            assert!(error.to_string().contains(text), "{error}");
        }
    }

    #[test]
    fn all_4096_values_survive_the_wire() {
        for raw in 0..=4095 {
            let word = encode(Counts::new(raw).unwrap());
            assert_eq!(value(word), Ok(raw));
            assert_eq!(word[1] & 0b110, 0);
            // by the definition of the format, not by the code above
            assert_eq!(u16::from(word[0] / 2) * 32 + u16::from(word[1] / 8), raw);
            assert!(word.iter().all(|b| b.count_ones() % 2 == 1));
        }
    }

    #[test]
    fn one_flipped_bit_never_passes_as_a_value() {
        let (mut byte0, mut byte1, mut frames, mut bad_channel) = (0, 0, 0, 0);
        for raw in 0..=4095 {
            for bit in 0..16 {
                let word = u16::from_be_bytes(encode(Counts::new(raw).unwrap())) ^ (1 << bit);
                match decode(word.to_be_bytes()).unwrap_err() {
                    WordError::Parity(BadParity::Byte0) if bit >= 8 => byte0 += 1,
                    WordError::Parity(BadParity::Byte1) if bit < 8 => byte1 += 1,
                    WordError::ErrorFrame(code) if bit >= 8 => {
                        frames += 1;
                        match code {
                            ErrorCode::Unknown(_) => {}
                            ErrorCode::Channel => bad_channel += 1,
                            other => panic!("a flipped bit forges {other:?}"),
                        }
                    }
                    other => panic!("{raw} bit {bit}: {other:?}"),
                }
            }
        }
        // 8 bytes lie one flip from A5, all of odd parity, each with 32 lower halves; one of those is 58
        assert_eq!(frames, 8 * 32);
        assert_eq!(bad_channel, 8);
        assert_eq!(byte0, 4096 * 8 - frames);
        assert_eq!(byte1, 4096 * 8);
    }

    #[test]
    fn all_65536_words_have_one_meaning_each() {
        let (mut good, mut frames, mut silent, mut padding) = (0, 0, 0, 0);
        let mut parity = [0; 3];
        for word in 0..=u16::MAX {
            match decode(word.to_be_bytes()) {
                Ok(counts) => {
                    good += 1;
                    assert_eq!(encode(counts), word.to_be_bytes(), "no value has two words");
                }
                Err(WordError::ErrorFrame(_)) => frames += 1,
                Err(WordError::NoSensor) => silent += 1,
                Err(WordError::Padding(_)) => padding += 1,
                Err(WordError::Parity(bad)) => parity[bad as usize] += 1,
            }
        }
        // 128 bytes have odd parity, 32 of them clear padding; A5 is one of the 128 even ones
        assert_eq!(good, 128 * 32);
        assert_eq!(frames, 256);
        assert_eq!(silent, 2);
        assert_eq!(padding, 128 * (128 - 32));
        assert_eq!(parity, [127 * 128, 128 * 128, 127 * 128 - 2]);
        assert_eq!(
            good + frames + silent + padding + parity.iter().sum::<i32>(),
            65536
        );
    }
}
