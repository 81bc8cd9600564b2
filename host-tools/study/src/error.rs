//! Reasons why a study fails.

use tactus_lab::eval::evaluate::EvaluateError;
use tactus_lab::eval::experiment::ExperimentError;
use tactus_lab::eval::learn::TableError;
use tactus_lab::sim::collection::TrialError;
use tactus_lab::sim::rig::SimError;

/// Reasons why a study fails.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The rig of a world fails before the first texture.
    #[error(
        "world {world}: the simulated rig cannot be calibrated; another --seed makes another world"
    )]
    Calibration {
        /// The world's seed.
        world: u64,
        /// The rig's error.
        source: SimError,
    },
    /// A trial failed.
    #[error(transparent)]
    Trial(#[from] TrialError),
    /// The table cannot be learned.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The slides cannot be divided.
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
    /// Explorations failed.
    #[error(transparent)]
    Evaluate(#[from] EvaluateError),
}
