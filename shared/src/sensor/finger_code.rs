//! Kinds of fingers as tables and messages name them: one byte, so that the name of a later day is read and passed on.

use core::fmt;
use core::str::FromStr;

use super::finger::{FingerName, UnknownFinger};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A kind of finger: on the line and in tables its number, in text its name.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct FingerCode(pub u8);

/// The prefix of a number that has no name.
const NAMELESS: &str = "finger-";

impl FingerCode {
    /// SynTouch's BioTac; also the finger of all tables, recordings and messages that do not say.
    pub const BIOTAC: Self = Self::of(FingerName::Biotac);
    /// Of the `mems`.
    pub const MEMS: Self = Self::of(FingerName::Mems);
    /// A sensor of somebody else: a table says its name, and no probe has it.
    pub const OTHER: Self = Self(u8::MAX);

    /// The number of a finger: its place among [`FingerName::ALL`].
    pub const fn of(finger: FingerName) -> Self {
        Self(finger as u8)
    }
}

impl fmt::Display for FingerCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match FingerName::ALL.get(usize::from(self.0)) {
            Some(name) => f.write_str(name.as_str()),
            None => write!(f, "{NAMELESS}{}", self.0),
        }
    }
}

impl FromStr for FingerCode {
    type Err = UnknownFinger;

    fn from_str(name: &str) -> Result<Self, UnknownFinger> {
        let number = || name.strip_prefix(NAMELESS)?.parse().ok().map(Self);
        let known = name.parse().ok().map(Self::of);
        known.or_else(number).ok_or(UnknownFinger)
    }
}

impl Serialize for FingerCode {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        if to.is_human_readable() {
            to.collect_str(self)
        } else {
            to.serialize_u8(self.0)
        }
    }
}

impl<'d> Deserialize<'d> for FingerCode {
    fn deserialize<D: Deserializer<'d>>(from: D) -> Result<Self, D::Error> {
        if from.is_human_readable() {
            let name = heapless::String::<16>::deserialize(from)?;
            name.parse().map_err(D::Error::custom)
        } else {
            u8::deserialize(from).map(Self)
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString as _;

    use super::*;

    #[test]
    fn every_number_has_a_name_that_is_found_again() {
        for code in 0..=u8::MAX {
            let code = FingerCode(code);
            assert_eq!(code.to_string().parse(), Ok(code));
        }
        for name in ["", "BioTac", "finger-", "finger-256", "mems "] {
            assert_eq!(name.parse::<FingerCode>(), Err(UnknownFinger));
        }
        assert_eq!(FingerCode::MEMS.to_string(), "mems");
        assert_eq!(FingerCode(77).to_string(), "finger-77");
    }

    #[test]
    fn on_the_line_it_is_a_byte() {
        let bytes = postcard::to_slice(&FingerCode(200), &mut [0; 4]).map(|bytes| bytes.to_vec());
        assert_eq!(bytes, Ok(std::vec![200]));
        assert_eq!(postcard::from_bytes(&[200]), Ok(FingerCode(200)));
    }
}
