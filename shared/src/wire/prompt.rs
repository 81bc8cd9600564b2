//! What a person is asked to do by a probe without motors, and what was wrong with what they did.

use core::fmt;

use serde::{Deserialize, Serialize};

/// What is wrong with a slide by hand.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Again {
    /// Pressed too hard.
    TooHard,
    /// Pressed too lightly.
    TooLight,
    /// It ended before its time.
    TooShort,
    /// It was not made at one pace.
    TooUneven,
    /// A word of the sensor was lost or damaged.
    Disturbed,
}

impl Again {
    /// In words.
    pub const fn why(self) -> &'static str {
        match self {
            Self::TooHard => "too hard",
            Self::TooLight => "too light",
            Self::TooShort => "too short",
            Self::TooUneven => "too uneven",
            Self::Disturbed => "disturbed",
        }
    }
}

impl fmt::Display for Again {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.why())
    }
}

/// What the person who holds the probe is asked to do. The display says the same.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Prompt {
    /// Lift the finger and hold it in the air.
    Lift,
    /// Press the finger on the sample and keep it still.
    Press,
    /// Slide now: 5 cm in 2 s.
    Slide,
    /// The slide was no good: lift the finger, then press again.
    Again(Again),
    /// Put a weight of so many mN on the finger and keep it still.
    Weigh(u16),
    /// Keep the finger still, pointing straight down or up.
    Still,
    /// Turn the finger over, so that it points the other way, and keep it still.
    TurnOver,
}

impl fmt::Display for Prompt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lift => f.write_str("lift the finger and hold it in the air"),
            Self::Press => f.write_str("press the finger on the sample and keep it still"),
            Self::Slide => f.write_str("slide now: 5 cm in 2 s"),
            Self::Again(why) => {
                write!(f, "that was {why}: lift the finger, then press again")
            }
            Self::Weigh(mn) => write!(f, "put {mn} mN on the finger and keep it still"),
            Self::Still => f.write_str("keep the finger still, pointing straight down"),
            Self::TurnOver => {
                f.write_str("turn it over, so that it points straight up, and keep it still")
            }
        }
    }
}
