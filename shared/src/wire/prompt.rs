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
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum Prompt {
    #[error("lift the finger and hold it in the air")]
    Lift,
    #[error("press the finger on the sample and keep it still")]
    Press,
    #[error("slide now: 5 cm in 2 s")]
    Slide,
    #[error("that was {0}: lift the finger, then press again")]
    Again(Again),
    #[error("put {0} mN on the finger and keep it still")]
    Weigh(u16),
    #[error("keep the finger still, pointing straight down")]
    Still,
    #[error("turn it over, so that it points straight up, and keep it still")]
    TurnOver,
    #[error("press the blue button on the board: movements may press with up to 2 N then")]
    Button,
}
