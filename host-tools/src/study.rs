//! The paper's whole study on the simulated rig: the pilot that finds the movements, the training, the eight pairs, and the
//! identification among all 117 textures, beside the published numbers.

pub mod identify;
pub mod published;
pub mod slides;

use crate::evaluate::EvaluateError;
use crate::experiment::ExperimentError;
use crate::learn::TableError;
use crate::simulated::SimError;
use tactus_core::features::SlideError;

/// Why a study comes to nothing.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// A rig failed.
    #[error("the simulated rig failed: {0}")]
    Rig(#[from] SimError),
    /// A slide has no properties.
    #[error("a slide of the simulated rig has no properties: {0}")]
    Slide(#[from] SlideError),
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
