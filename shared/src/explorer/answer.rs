//! What is said to "the same as this one?".

use serde::{Deserialize, Serialize};

/// The comparison with the only candidate of an exploration.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Verification {
    /// ln of how much likelier the slides are of another texture, whichever, than of this one.
    pub score: f32,
    /// Score above which it is another one: as many of the slides of this one are above it as
    /// [`Config::false_alarm`](super::Config::false_alarm) says.
    pub limit: f32,
    /// The answer.
    pub answer: Answer,
}

/// True if it is the same.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Answer {
    /// It is.
    Same,
    /// It is another one, or this one changed beyond what the table expects.
    Different,
    /// More slides would tell.
    Unsure,
}
