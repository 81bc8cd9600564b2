//! The fingers: names, constants before anybody has measured them, parts on the bus, and decoders behind one type.

use core::fmt;
use core::str::FromStr;

use super::analog;
use super::biotac::{self, WordError};
use super::mems::{self, Mems};
use super::pressure::{Calibration, Pressure};
use super::slot::{Port, StartStep, Transaction};

/// The fingers, by their names in commands, tables and messages.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
pub enum FingerName {
    /// SynTouch's BioTac.
    #[default]
    Biotac,
    /// A piezo disc and a load cell, amplified, on one MCP3202.
    Analog,
    /// An IIS3DWB accelerometer, and a load cell on an ADS1220.
    Mems,
}

impl FingerName {
    /// All of them, by their numbers ([`super::FingerCode`]): new ones go to the end.
    pub const ALL: [Self; 3] = [Self::Biotac, Self::Analog, Self::Mems];

    /// Its name, at most eight letters of ASCII.
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Biotac => "biotac",
            Self::Analog => "analog",
            Self::Mems => "mems",
        }
    }

    /// Its parts on the bus.
    pub const fn parts(self) -> &'static FingerParts {
        match self {
            Self::Biotac => &biotac::PARTS,
            Self::Analog => &analog::PARTS,
            Self::Mems => &mems::PARTS,
        }
    }
}

impl fmt::Display for FingerName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl FromStr for FingerName {
    type Err = UnknownFinger;

    fn from_str(name: &str) -> Result<Self, UnknownFinger> {
        let mut all = Self::ALL.into_iter();
        all.find(|finger| finger.as_str() == name)
            .ok_or(UnknownFinger)
    }
}

/// No finger has this name.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("no finger has this name: there are biotac, analog and mems")]
pub struct UnknownFinger;

/// A kind of finger, as everything behind its words needs it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct FingerModel {
    /// Its name.
    pub name: FingerName,
    /// The constants of a typical one, until this one's are measured.
    pub calibration: Calibration,
    /// True if P_AC is P_DC's pressure behind a high-pass of 10 Hz, so that it shows a press which P_DC does not.
    /// Otherwise only a sprung mount protects the finger from a dead P_DC.
    pub pac_shows_force: bool,
    /// The signals when nobody touches it.
    pub at_rest: AtRest,
}

/// The limits of a sound finger's signals in the air.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct AtRest {
    /// Least and most noise of P_AC, counts rms: less is a dead converter, more is a bad ground.
    pub pac_noise_counts: (f32, f32),
    /// Least and most P_DC, counts.
    pub pdc_counts: (f32, f32),
}

impl FingerModel {
    /// A force in counts of P_DC of a typical finger of this kind, for thresholds: they do not follow the calibration
    /// of one piece, which may be wrong.
    pub const fn counts(&self, mn: f32) -> f32 {
        mn / self.calibration.force_mn_per_count
    }
}

/// A finger on its bus: one chip or several, and the transactions with them.
#[derive(Clone, Copy, Debug)]
pub struct FingerParts {
    /// The kind of finger.
    pub model: FingerModel,
    /// Its parts, each with a chip select of its own.
    pub ports: &'static [Port],
    /// Shortest time from power-up to the first slot, ms.
    pub power_up_ms: u32,
    /// The start-up list after that. A part that has lost its power needs it again.
    pub start: &'static [StartStep],
    /// The transactions of each slot of a cycle, which then begins again; a slot gives the sample of
    /// [`Channel::of_slot`](super::pressure::Channel::of_slot).
    pub slots: &'static [&'static [Transaction]],
    /// Time without clock after which a finger answers again that took noise for a command, ms; 0: no such command.
    pub deaf_ms: u32,
    /// True if it has an accelerometer: see [`AnyFinger::gravity`].
    pub feels_gravity: bool,
}

impl FingerParts {
    /// The transactions of slot `n`.
    pub fn slot(&self, n: u32) -> &'static [Transaction] {
        let number = n as usize % self.slots.len().max(1);
        self.slots.get(number).copied().unwrap_or_default()
    }
}

/// The decoder of a finger, with its memory of the slots before.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // there is one
pub enum AnyFinger {
    /// A BioTac's.
    BioTac,
    /// A piezo disc's and a load cell's.
    Analog,
    /// An accelerometer's and a load cell's.
    Mems(Mems),
}

impl AnyFinger {
    /// The decoder of a finger of which nothing was read yet.
    pub const fn new(name: FingerName) -> Self {
        match name {
            FingerName::Biotac => Self::BioTac,
            FingerName::Analog => Self::Analog,
            FingerName::Mems => Self::Mems(Mems::new()),
        }
    }

    /// The sample of slot `n` in its answers.
    /// Errors: the answers are not a sample. It is lost: there is no older value to use.
    #[inline]
    pub fn decode(&mut self, n: u32, answer: &[u8]) -> Result<Pressure, FingerError> {
        match self {
            Self::BioTac => Ok(biotac::sample(n, answer)?),
            Self::Analog => analog::sample(n, answer),
            Self::Mems(finger) => finger.sample(n, answer),
        }
    }

    /// Gravity along the finger in its last answers, [`GRAVITY_PARTS`] of a count of P_AC; `None` from a finger that
    /// does not feel it.
    #[inline]
    pub fn gravity(&self) -> Option<i32> {
        match self {
            Self::Mems(finger) => finger.gravity(),
            Self::BioTac | Self::Analog => None,
        }
    }
}

/// Parts of a count in [`AnyFinger::gravity`]: whole numbers for interrupts.
pub const GRAVITY_PARTS: f32 = 16.0;

/// The kinds of answers that are not samples, as all fingers count them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum BadWord {
    /// The answer was damaged on its way.
    Garbled,
    /// The finger says that it has no sample.
    Refused,
    /// Nothing answers.
    Silent,
}

/// The reasons why an answer of a finger is not a sample.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum FingerError {
    /// A BioTac's word is invalid.
    #[error(transparent)]
    BioTac(#[from] WordError),
    #[error("no converter answers (null bit is 1): check power, cable, chip select and SPI mode 0")]
    NullBit,
    #[error(
        "the load cell reads {0} counts, which no sound one does: check its four wires and the converter's data line"
    )]
    Clipped(u16),
    #[error("no part of the finger answers: check its plug, its power and the data line")]
    Silent,
    #[error("the finger has just begun")]
    Begins,
    #[error(
        "the IIS3DWB accelerometer is off: check its power and its wires, then switch off and on"
    )]
    Off,
    #[error(
        "the ADS1220 of the load cell says the same again and again: check its power, its wires and SPI mode 1"
    )]
    Stale,
    #[error("the load cell is at an end of the ADS1220's range: check its four wires")]
    Cell,
}

impl FingerError {
    /// The counter for such an answer; `None` if the finger has just begun.
    pub fn kind(&self) -> Option<BadWord> {
        Some(match self {
            Self::BioTac(WordError::Parity | WordError::Padding(_)) => BadWord::Garbled,
            Self::BioTac(WordError::ErrorFrame(_)) => BadWord::Refused,
            Self::BioTac(WordError::NoSensor) | Self::NullBit | Self::Silent => BadWord::Silent,
            Self::Clipped(_) | Self::Off | Self::Stale | Self::Cell => BadWord::Refused,
            Self::Begins => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_again_and_no_others() {
        for finger in FingerName::ALL {
            assert_eq!(finger.as_str().parse(), Ok(finger));
            assert!(finger.as_str().len() <= 8 && finger.as_str().is_ascii());
        }
        for name in ["", "BioTac", "piezo", "mems "] {
            assert_eq!(name.parse::<FingerName>(), Err(UnknownFinger));
        }
    }
}
