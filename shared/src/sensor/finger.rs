//! The facts about a finger that the rest of the core needs: its name, its constants before anybody has measured them,
//! and its signals at rest.

use core::fmt;
use core::str::FromStr;

use crate::sensor::pressure::Calibration;

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
