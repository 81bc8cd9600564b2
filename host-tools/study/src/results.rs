//! All results of a study, and the one parameter of its worlds.

use serde::Serialize;

use super::identify::{Identification, PairRow, WorldRow};
use super::pilot::Pilot;
use super::signals::Signals;
use super::training::Training;

/// The variation of trials in the study's worlds: its one free parameter. Set on worlds 1 to 10, by
/// `tactus study identify --seeds 1-10 --variation X`, so that Bayesian exploration is right about as often as in the
/// paper (95.4 %).
pub const VARIATION: f64 = 1.2;

/// All results of a study: study.json.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Study {
    /// Of this program.
    pub version: &'static str,
    /// The command that makes it again.
    pub command: String,
    /// The world.
    pub seed: u64,
    /// Variation of its trials.
    pub variation: f64,
    /// Virtual explorations of each way of exploring; each pair has an eighth.
    pub simulations: u64,
    /// The pilot study.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pilot: Option<Pilot>,
    /// The training.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub training: Option<Training>,
    /// The eight pairs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pairs: Option<Vec<PairRow>>,
    /// The identification among all textures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub identification: Option<Identification>,
    /// The sensor's signals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub signals: Option<Signals>,
    /// The same in other worlds.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub worlds: Vec<WorldRow>,
}
