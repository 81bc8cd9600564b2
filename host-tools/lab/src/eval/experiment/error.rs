//! Reasons why slides do not make an experiment.

use tactus_core::features::Movement;
use tactus_core::table;

use crate::eval::show::count;

/// Reasons why an experiment cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ExperimentError {
    /// Too few slides.
    #[error(
        "{texture}, {movement}: {} to train from, and --train-slides is {wanted}; ask for \
         fewer", count(*there as u64, "slide")
    )]
    Training {
        /// Name of the texture.
        texture: String,
        /// The movement.
        movement: Movement,
        /// Slides there are.
        there: usize,
        /// Slides asked for.
        wanted: usize,
    },
    /// Nothing left to test on.
    #[error(
        "{texture}, {movement}: no slide is left to test on; train on fewer slides or give more with --test"
    )]
    Test {
        /// Name of the texture.
        texture: String,
        /// The movement.
        movement: Movement,
    },
    /// As [`Self::Training`], where all of them are to be used.
    #[error(
        "{texture}, {movement}: {there} training slide; the spread of a texture's slides takes at least two"
    )]
    Few {
        /// Name of the texture.
        texture: String,
        /// The movement.
        movement: Movement,
        /// Slides there are.
        there: usize,
    },
    /// A standard deviation needs two slides.
    #[error("--train-slides {0}: the spread of a texture's slides takes at least two slides")]
    One(usize),
    /// The folder of test slides lacks something.
    #[error(
        "the test folder has no {0}, which the training folder has; give a folder of the same textures"
    )]
    Missing(String),
    /// More movements than a table holds.
    #[error("too many movements, {0}; a table holds {max} at most", max = table::MAX_MOVEMENTS)]
    Movements(usize),
}
