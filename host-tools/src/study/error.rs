//! Why a study comes to nothing.

use tactus_core::features::SlideError;

use crate::eval::evaluate::EvaluateError;
use crate::eval::experiment::ExperimentError;
use crate::eval::learn::TableError;
use crate::sim::rig::SimError;

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
