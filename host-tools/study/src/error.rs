//! Why a study comes to nothing.

use tactus_lab::eval::evaluate::EvaluateError;
use tactus_lab::eval::experiment::ExperimentError;
use tactus_lab::eval::learn::TableError;
use tactus_lab::sim::collection::TrialError;
use tactus_lab::sim::rig::SimError;

/// Why a study comes to nothing.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// A stage of the study came to nothing.
    #[error("{stage}")]
    Stage {
        /// Its name.
        stage: &'static str,
        /// Why.
        source: Box<StudyError>,
    },
    /// The rig of a world fails before the first texture.
    #[error(
        "world {world}: the simulated rig cannot be calibrated; another --seed makes another world"
    )]
    Calibration {
        /// The world's seed.
        world: u64,
        /// How.
        source: SimError,
    },
    /// A trial gave nothing.
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

impl StudyError {
    /// The same, and in which stage of the study.
    #[must_use]
    pub fn in_stage(self, stage: &'static str) -> Self {
        Self::Stage {
            stage,
            source: Box::new(self),
        }
    }
}
