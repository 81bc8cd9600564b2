//! How to explore, and why an exploration or a slide is refused.

use core::fmt;

use crate::features::{FeatureSet, Property};
use crate::table::{Action, Contents};
use serde::{Deserialize, Serialize};

/// Textures less probable than this are left out of the expected uncertainty: each changes it by at most about twice
/// its probability, all of 117 by about 2e-4. They are not reported either.
pub const NEGLIGIBLE: f32 = 1e-6;

/// The comparison of slides with the table.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub enum Method {
    /// The paper's: one property per slide, Gaussians (eq. 4).
    #[default]
    Paper,
    /// One property per slide, Student's t with variances drawn towards each other.
    Student,
    /// As `Student`, with all properties of every slide.
    StudentAll,
    /// All features of every slide at once, whitened.
    Fused,
}

impl Method {
    /// The best one for a table.
    pub const fn of(contents: Contents) -> Self {
        match contents {
            Contents::Gaussians(_) => Self::StudentAll,
            Contents::Fused(..) => Self::Fused,
        }
    }

    /// True if it can use such a table.
    pub const fn suits(self, contents: Contents) -> bool {
        matches!(
            (self, contents),
            (Self::Fused, Contents::Fused(..))
                | (
                    Self::Paper | Self::Student | Self::StudentAll,
                    Contents::Gaussians(_)
                )
        )
    }

    /// Its name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Student => "student",
            Self::StudentAll => "student-all",
            Self::Fused => "fused",
        }
    }
}

/// The choice of the next movement.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub enum Strategy {
    /// The action of the greatest benefit (eq. 12).
    #[default]
    Bayesian,
    /// The best movement of each property in turn: the paper's uninformed cycling.
    Cycling,
    /// Any action, all equally likely.
    Random,
}

/// The choice of movements, and the end.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Config {
    /// The comparison of slides with the table.
    pub method: Method,
    /// The choice of the next movement.
    pub strategy: Strategy,
    /// A texture more probable than this is the answer.
    pub threshold: f32,
    /// After this many slides the most probable texture is the answer, sure or not.
    pub max_slides: u8,
    /// True if the answer may be that it is none of the candidates.
    pub open: bool,
    /// Share of the known textures that may be taken for new ones, if the answer may be that: with a table that is
    /// calibrated, whose own share it is unless given.
    pub false_alarm: Option<f32>,
    /// True if the question is whether it is the only candidate: slides are made until [`Explorer::verification`]
    /// answers.
    ///
    /// [`Explorer::verification`]: super::Explorer::verification
    pub verify: bool,
    /// True if the probe is to learn from it by itself: a name takes two slides at least, and whole ones.
    pub learn: bool,
}

impl Default for Config {
    /// Absolute identification in the paper: Bayesian exploration, 99 %, at most 10 movements.
    fn default() -> Self {
        Self {
            method: Method::Paper,
            strategy: Strategy::Bayesian,
            threshold: 0.99,
            max_slides: 10,
            open: false,
            false_alarm: None,
            verify: false,
            learn: false,
        }
    }
}

impl Config {
    /// Discrimination of a pair in the paper: 99.9 %.
    pub const PAIR_THRESHOLD: f32 = 0.999;
}

/// The reason why an exploration cannot begin.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum ExplorerError {
    /// The table has more textures than the explorer has room for.
    #[error("the textures of the table are {textures}, and there is room for {capacity}")]
    NoSpace {
        /// Textures of the table.
        textures: u16,
        /// Room.
        capacity: usize,
    },
    /// A candidate that the table does not have, or none at all.
    #[error("the candidates are not textures of the table")]
    Candidates,
    /// No property that the rig measures was learned of every candidate, at least twice, at any one movement.
    #[error(
        "no property that this rig measures was learned of every candidate at one movement, from two trials or more"
    )]
    NothingToMeasure,
    /// The rig does not measure the features that the table was learned from.
    #[error("the table was learned from {}, and this rig does not measure them", .0.name())]
    Features(FeatureSet),
    /// The method cannot use this kind of table.
    #[error(fmt = wrong_table)]
    Method(Method),
}

fn wrong_table(method: &Method, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    match method {
        Method::Fused => f.write_str(
            "the method fused needs a table with whitened features; learn one, or take student-all",
        ),
        method => write!(
            f,
            "the method {} needs a table of the three properties; this one is for the method fused",
            method.name()
        ),
    }
}

/// The reason why a slide was not used. The exploration stands as it was.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum ObserveError {
    /// The slide has no such property, or it is not a finite number.
    #[error("the slide did not give a value of {0}")]
    Missing(Property),
    /// The slide lacks one of the features of the table.
    #[error("the slide did not give {}", .0.name())]
    Features(FeatureSet),
    /// The explorer does not know the action.
    #[error("{} of movement {} is none of the actions", .0.what(), .0.movement + 1)]
    Action(Action),
}
