//! Properties: what a sensor says about itself.
//!
//! 0x61 and a code, 50 us, then the text in one read with chip select low (LIB). Text is ASCII without parity.

use core::fmt;

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;
use embedded_hal_async::delay::DelayNs as AsyncDelayNs;
use embedded_hal_async::spi::SpiDevice as AsyncSpiDevice;

use super::command::{GAP_US, REST_US};
use super::finger::BioTac;
use super::word::{ErrorCode, WordError, decode};
use crate::sensor::driver::{Driver, Error};
use crate::sensor::slot::{MAX_BYTES, Transaction};

/// Asks for a property.
const READ: u8 = 0x61;

/// A property that can be read (HDR). The discriminant is its code.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[repr(u8)]
pub enum Property {
    /// Version of the flexible circuit, 2 characters.
    Flex = 0x10,
    /// Version of the firmware, 4 characters.
    Firmware = 0x13,
    /// Serial number, 16 characters, the first two "BT".
    Serial = 0x15,
    /// Clock of the processor in kHz, 2 bytes, big-endian.
    CpuSpeed = 0x61,
    /// Sampling rate, 2 bytes.
    SamplingRate = 0x70,
}

impl Property {
    /// The bytes that ask for it.
    const fn command(self) -> &'static [u8; 2] {
        match self {
            Self::Flex => &[READ, Self::Flex as u8],
            Self::Firmware => &[READ, Self::Firmware as u8],
            Self::Serial => &[READ, Self::Serial as u8],
            Self::CpuSpeed => &[READ, Self::CpuSpeed as u8],
            Self::SamplingRate => &[READ, Self::SamplingRate as u8],
        }
    }

    /// The transactions that read `N` bytes of this property. Zeros are sent meanwhile, as LIB does.
    const fn read<const N: usize>(self) -> [Transaction; 2] {
        const { assert!(N <= MAX_BYTES) };
        [
            Transaction::first_port(self.command(), 0, GAP_US),
            Transaction::first_port(const { &[0; N] }, N as u8, REST_US),
        ]
    }
}

impl fmt::Display for Property {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Flex => "flex version",
            Self::Firmware => "firmware version",
            Self::Serial => "serial number",
            Self::CpuSpeed => "CPU speed",
            Self::SamplingRate => "sampling rate",
        })
    }
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

    fn from_reply(property: Property, reply: [u8; N]) -> Result<Self, PropertyError> {
        check_answer(property, &reply)?;
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

/// Refuses silence and error frames.
fn check_answer(property: Property, reply: &[u8]) -> Result<(), PropertyError> {
    if reply.iter().all(|b| *b == 0x00) || reply.iter().all(|b| *b == 0xFF) {
        return Err(PropertyError::NoAnswer(property));
    }
    // A5 is no text; a CPU speed of 42.2 to 42.5 MHz would be taken for an error too
    if let [a, b, ..] = *reply
        && let Err(WordError::ErrorFrame(code)) = decode([a, b])
    {
        return Err(PropertyError::ErrorFrame(property, code));
    }
    Ok(())
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
    /// Clock of the processor, kHz.
    pub cpu_khz: u16,
    /// Sampling rate as the sensor says it, big-endian; `None` if it does not. HDR lists it but LIB never reads it, so
    /// its unit and order are unproven and nothing should depend on it.
    pub sampling_rate: Option<u16>,
}

/// The bytes of the properties, before and after they are read.
///
/// [`IdentityBytes::reads`] says what to do, [`IdentityBytes::decode`] what came of it: the drivers do no more than
/// perform the reads in between.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct IdentityBytes {
    serial: [u8; 16],
    firmware: [u8; 4],
    flex: [u8; 2],
    cpu_speed: [u8; 2],
    sampling_rate: [u8; 2],
}

/// Puts an answer where it belongs; one that did not come leaves what was there.
pub fn keep(place: &mut [u8], answer: &[u8]) {
    let bytes = place.iter_mut().zip(answer);
    bytes.for_each(|(to, from)| *to = *from);
}

impl IdentityBytes {
    /// The reads of the properties, and where the answer of each belongs: [`keep`] puts it there.
    pub fn reads(&mut self) -> [([Transaction; 2], &mut [u8]); 5] {
        [
            (Property::Serial.read::<16>(), &mut self.serial),
            (Property::Firmware.read::<4>(), &mut self.firmware),
            (Property::Flex.read::<2>(), &mut self.flex),
            (Property::CpuSpeed.read::<2>(), &mut self.cpu_speed),
            (Property::SamplingRate.read::<2>(), &mut self.sampling_rate),
        ]
    }

    /// The identity in the bytes read.
    ///
    /// # Errors
    /// The first property that is not what it should be, the serial number first: it tells whether a BioTac answers at
    /// all.
    pub fn decode(&self) -> Result<Identity, PropertyError> {
        let serial = Ascii::from_reply(Property::Serial, self.serial)?;
        if !self.serial.starts_with(b"BT") {
            return Err(PropertyError::NotABioTac(serial));
        }
        let firmware = Ascii::from_reply(Property::Firmware, self.firmware)?;
        let flex = Ascii::from_reply(Property::Flex, self.flex)?;
        check_answer(Property::CpuSpeed, &self.cpu_speed)?;
        let rate_said = check_answer(Property::SamplingRate, &self.sampling_rate).is_ok();
        Ok(Identity {
            serial,
            firmware,
            flex,
            cpu_khz: u16::from_be_bytes(self.cpu_speed),
            sampling_rate: rate_said.then_some(u16::from_be_bytes(self.sampling_rate)),
        })
    }
}

impl<SPI: SpiDevice, D: DelayNs> Driver<BioTac, SPI, D> {
    /// Asks the sensor what it is.
    ///
    /// # Errors
    /// [`Error::Bus`], or [`Error::Sensor`] if the answers are not those of a BioTac.
    pub fn identity(&mut self) -> Result<Identity, Error<SPI::Error, PropertyError>> {
        let mut bytes = IdentityBytes::default();
        for (transactions, place) in bytes.reads() {
            keep(place, &self.perform(&transactions).map_err(Error::Bus)?);
        }
        bytes.decode().map_err(Error::Sensor)
    }
}

impl<SPI: AsyncSpiDevice, D: AsyncDelayNs> Driver<BioTac, SPI, D> {
    /// As [`Driver::identity`].
    ///
    /// # Errors
    /// [`Error::Bus`], or [`Error::Sensor`] if the answers are not those of a BioTac.
    pub async fn identity_async(&mut self) -> Result<Identity, Error<SPI::Error, PropertyError>> {
        let mut bytes = IdentityBytes::default();
        for (transactions, place) in bytes.reads() {
            let answer = self.perform_async(&transactions).await;
            keep(place, &answer.map_err(Error::Bus)?);
        }
        bytes.decode().map_err(Error::Sensor)
    }
}

/// The reasons why the answer to a property is invalid.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, thiserror::Error)]
pub enum PropertyError {
    /// All bytes are 00 or all are FF.
    #[error("no answer for the {0} (all 00 or FF): check power, cable and chip select")]
    NoAnswer(Property),
    /// The sensor reports an error.
    #[error("sensor reports {1} when asked for its {0}")]
    ErrorFrame(Property, ErrorCode),
    /// `byte`, the one at index `at`, is no printable character, or comes after the text has ended.
    #[error("{property} is not text (byte {at} is {byte:02X}): check SPI mode 0 and the clock")]
    NotText {
        /// The property that was read.
        property: Property,
        /// Index of the byte.
        at: u8,
        /// The byte.
        byte: u8,
    },
    /// The serial number is text but does not begin with "BT".
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
        cpu_speed: [0x3E, 0x80],
        sampling_rate: [0x11, 0x30],
    };

    #[test]
    fn a_biotac_says_who_it_is() {
        let id = GOOD.decode().unwrap();
        assert_eq!(id.serial.as_str(), "BT0123456789ABCD");
        assert_eq!(id.firmware.to_string(), "0234");
        assert_eq!(format!("{:?}", id.flex), "\"21\"");
        assert_eq!(id.cpu_khz, 16_000, "big-endian");
        assert_eq!(id.sampling_rate, Some(4400));
    }

    #[test]
    fn each_property_is_asked_for_by_its_code_and_read_to_its_length() {
        let mut bytes = IdentityBytes::default();
        let asked = bytes.reads().map(|([command, read], place)| {
            assert!(read.out.iter().all(|byte| *byte == 0));
            assert_eq!((read.out.len(), command.answer), (place.len(), 0));
            (command.out, command.gap_us, read.answer, read.gap_us)
        });
        assert_eq!(
            asked,
            [
                (&[0x61, 0x15][..], 50, 16, 10),
                (&[0x61, 0x13], 50, 4, 10),
                (&[0x61, 0x10], 50, 2, 10),
                (&[0x61, 0x61], 50, 2, 10),
                (&[0x61, 0x70], 50, 2, 10),
            ]
        );
    }

    #[test]
    fn short_text_ends_in_nuls() {
        let mut bytes = GOOD;
        bytes.serial = *b"BT-7\0\0\0\0\0\0\0\0\0\0\0\0";
        assert_eq!(bytes.decode().unwrap().serial.as_str(), "BT-7");
        bytes.serial[9] = b'x';
        let after_the_end = PropertyError::NotText {
            property: Property::Serial,
            at: 9,
            byte: b'x',
        };
        assert_eq!(bytes.decode(), Err(after_the_end));
        let mut bytes = GOOD;
        bytes.firmware = *b"\x00234";
        assert!(matches!(
            bytes.decode(),
            Err(PropertyError::NotText {
                property: Property::Firmware,
                at: 0,
                byte: 0
            })
        ));
    }

    #[test]
    fn every_byte_that_is_not_printable_is_garbage() {
        for byte in 1..=255 {
            let mut bytes = GOOD;
            bytes.flex[1] = byte;
            let expected = PropertyError::NotText {
                property: Property::Flex,
                at: 1,
                byte,
            };
            assert_eq!(
                bytes.decode().err(),
                (!(0x20..=0x7E).contains(&byte)).then_some(expected)
            );
        }
    }

    #[test]
    fn silence_is_no_answer() {
        for level in [0x00, 0xFF] {
            let silent = IdentityBytes {
                serial: [level; 16],
                ..GOOD
            };
            let error = silent.decode().unwrap_err();
            assert_eq!(error, PropertyError::NoAnswer(Property::Serial));
            assert!(error.to_string().contains("chip select"));
            let no_speed = IdentityBytes {
                cpu_speed: [level; 2],
                ..GOOD
            };
            let expected = PropertyError::NoAnswer(Property::CpuSpeed);
            assert_eq!(no_speed.decode(), Err(expected));
            let no_rate = IdentityBytes {
                sampling_rate: [level; 2],
                ..GOOD
            };
            assert_eq!(no_rate.decode().unwrap().sampling_rate, None);
        }
    }

    #[test]
    fn error_frames_are_reported_as_such() {
        let mut bytes = GOOD;
        bytes.serial[..2].copy_from_slice(&[0xA5, 0x3F]);
        let refused = PropertyError::ErrorFrame(Property::Serial, ErrorCode::UnknownCommand);
        assert_eq!(bytes.decode(), Err(refused));
        assert!(refused.to_string().contains("A5 3F"));
        assert!(refused.to_string().contains("serial number"));
        let mut bytes = GOOD;
        bytes.cpu_speed = [0xA5, 0x2E];
        let early = PropertyError::ErrorFrame(Property::CpuSpeed, ErrorCode::Delay);
        assert_eq!(bytes.decode(), Err(early));
    }

    #[test]
    fn another_device_is_not_a_biotac() {
        let mut bytes = GOOD;
        bytes.serial[1] = b'U';
        let error = bytes.decode().unwrap_err();
        assert!(matches!(error, PropertyError::NotABioTac(_)));
        assert!(error.to_string().contains("\"BU0123456789ABCD\""));
    }

    #[test]
    fn errors_name_the_property() {
        for (property, name) in [
            (Property::Flex, "flex version"),
            (Property::Firmware, "firmware version"),
            (Property::Serial, "serial number"),
            (Property::CpuSpeed, "CPU speed"),
            (Property::SamplingRate, "sampling rate"),
        ] {
            let (at, byte) = (3, 0x80);
            let error = PropertyError::NotText { property, at, byte };
            assert!(error.to_string().contains(name));
            assert!(error.to_string().contains("byte 3 is 80"));
        }
    }
}
