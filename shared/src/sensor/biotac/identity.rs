//! Identity: the properties that a sensor says of itself.
//!
//! 0x61 and a code (HDR), 50 us, then the text in one read with chip select low (LIB). Text is ASCII without parity.

use core::fmt;

use super::word::{ErrorCode, WordError, decode};
use super::{GAP_US, REST_US};
use crate::sensor::slot::Transaction;

/// The bytes of the properties, before and after they are read.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct IdentityBytes {
    serial: [u8; 16],
    firmware: [u8; 4],
    flex: [u8; 2],
}

/// Puts an answer where it belongs; one that did not come leaves what was there.
pub fn keep(place: &mut [u8], answer: &[u8]) {
    let bytes = place.iter_mut().zip(answer);
    bytes.for_each(|(to, from)| *to = *from);
}

/// Asks for a property and reads it. Zeros are sent meanwhile, as LIB does.
const fn read(command: &'static [u8; 2], zeros: &'static [u8]) -> [Transaction; 2] {
    [
        Transaction::first_port(command, 0, GAP_US),
        Transaction::first_port(zeros, zeros.len() as u8, REST_US),
    ]
}

impl IdentityBytes {
    /// The reads of the properties, and where the answer of each belongs: [`keep`] puts it there.
    pub fn reads(&mut self) -> [([Transaction; 2], &mut [u8]); 3] {
        [
            (read(&[0x61, 0x15], &[0; 16]), &mut self.serial),
            (read(&[0x61, 0x13], &[0; 4]), &mut self.firmware),
            (read(&[0x61, 0x10], &[0; 2]), &mut self.flex),
        ]
    }

    /// The identity in the bytes read.
    /// Errors: the first property that is invalid, the serial number first: it tells whether a BioTac answers at all.
    pub fn decode(&self) -> Result<Identity, PropertyError> {
        let serial = Ascii::from_reply("serial number", self.serial)?;
        if !self.serial.starts_with(b"BT") {
            return Err(PropertyError::NotABioTac(serial));
        }
        Ok(Identity {
            serial,
            firmware: Ascii::from_reply("firmware version", self.firmware)?,
            flex: Ascii::from_reply("flex version", self.flex)?,
        })
    }
}

/// The identity of a sensor.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Identity {
    /// Serial number: beginning with "BT".
    pub serial: Ascii<16>,
    /// Version of the firmware.
    pub firmware: Ascii<4>,
    /// Version of the flexible circuit.
    pub flex: Ascii<2>,
}

/// A text of at most `N` printable ASCII characters; shorter ones end in NULs.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Ascii<const N: usize>([u8; N]);

impl<const N: usize> Ascii<N> {
    /// The characters.
    pub fn as_str(&self) -> &str {
        let text = self.0.split(|b| *b == 0).next().unwrap_or_default();
        // printable ASCII by construction
        core::str::from_utf8(text).unwrap_or_default()
    }

    fn from_reply(property: &'static str, reply: [u8; N]) -> Result<Self, PropertyError> {
        if reply.iter().all(|b| *b == 0x00) || reply.iter().all(|b| *b == 0xFF) {
            return Err(PropertyError::NoAnswer(property));
        }
        // A5 is no text
        if let [a, b, ..] = reply[..]
            && let Err(WordError::ErrorFrame(code)) = decode([a, b])
        {
            return Err(PropertyError::ErrorFrame(property, code));
        }
        let end = reply.iter().position(|b| *b == 0).unwrap_or(N);
        for (at, byte) in reply.into_iter().enumerate() {
            let good = if at < end {
                matches!(byte, b' '..=b'~')
            } else {
                byte == 0
            };
            if !good || end == 0 {
                let at = at as u8;
                return Err(PropertyError::NotText { property, at, byte });
            }
        }
        Ok(Self(reply))
    }
}

impl<const N: usize> fmt::Display for Ascii<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl<const N: usize> fmt::Debug for Ascii<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

/// The reasons why the answer to a property is invalid.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum PropertyError {
    #[error("no answer for the {0} (all 00 or FF): check power, cable and chip select")]
    NoAnswer(&'static str),
    #[error("sensor reports {1} when asked for its {0}")]
    ErrorFrame(&'static str, ErrorCode),
    #[error("{property} is not text (byte {at} is {byte:02X}): check SPI mode 0 and the clock")]
    NotText {
        property: &'static str,
        at: u8,
        byte: u8,
    },
    #[error(
        "serial number {0:?} does not begin with BT: something else answers on this chip select"
    )]
    NotABioTac(Ascii<16>),
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{format, string::ToString};

    const GOOD: IdentityBytes = IdentityBytes {
        serial: *b"BT0123456789ABCD",
        firmware: *b"0234",
        flex: *b"21",
    };

    #[test]
    fn each_property_is_asked_for_by_its_code_and_read_to_its_length() {
        let mut bytes = IdentityBytes::default();
        for ([command, read], place) in bytes.reads() {
            let answer: &[u8] = match command.out {
                [0x61, 0x15] => &GOOD.serial,
                [0x61, 0x13] => &GOOD.firmware,
                [0x61, 0x10] => &GOOD.flex,
                other => panic!("{other:?}"),
            };
            assert_eq!((command.gap_us, command.answer, read.gap_us), (50, 0, 10));
            assert_eq!(usize::from(read.answer), answer.len());
            assert_eq!(read.out, std::vec![0; answer.len()]);
            keep(place, answer);
        }
        let id = bytes.decode().unwrap();
        assert_eq!(id.serial.as_str(), "BT0123456789ABCD");
        assert_eq!(id.firmware.to_string(), "0234");
        assert_eq!(format!("{:?}", id.flex), "\"21\"");
    }

    #[test]
    fn what_is_no_identity_is_named() {
        let serial = |serial| IdentityBytes { serial, ..GOOD };
        let short = *b"BT-7\0\0\0\0\0\0\0\0\0\0\0\0";
        let mut behind = short;
        behind[9] = b'x';
        let mut refused = GOOD.serial;
        refused[..2].copy_from_slice(&[0xA5, 0x3F]);
        let early = IdentityBytes {
            firmware: *b"\x00234",
            ..GOOD
        };
        for (bytes, said) in [
            (serial(short), "BT-7"),
            (serial(behind), "serial number is not text (byte 9 is 78)"),
            (early, "firmware version is not text (byte 0 is 00)"),
            (serial([0x00; 16]), "no answer for the serial number"),
            (serial([0xFF; 16]), "check power, cable and chip select"),
            (serial(refused), "A5 3F: unknown command"),
            (serial(refused), "asked for its serial number"),
            (serial(*b"BU0123456789ABCD"), "\"BU0123456789ABCD\""),
        ] {
            let found = bytes.decode().map(|id| id.serial.to_string());
            let found = found.unwrap_or_else(|why| why.to_string());
            assert!(found.contains(said), "{found}");
        }
        for byte in 1..=255 {
            let flex = [b'2', byte];
            let found = IdentityBytes { flex, ..GOOD }.decode().err();
            let (property, at) = ("flex version", 1);
            let expected = PropertyError::NotText { property, at, byte };
            let is_printable = (0x20..=0x7E).contains(&byte);
            assert_eq!(found, (!is_printable).then_some(expected));
        }
    }
}
