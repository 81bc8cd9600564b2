//! Textures that the table does not have: how many are noticed, and how often one that it has is taken for one.

use rand::RngExt as _;
use rayon::prelude::*;
use serde::Serialize;
use tactus_core::explorer::Config;

use crate::eval::evaluate::{EvaluateError, explorer};
use crate::eval::experiment::{Experiment, Run};

/// Slides after which it is counted.
pub const SLIDES: usize = 3;

/// What is counted after so many slides.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct After {
    /// Slides of the episode.
    pub slides: usize,
    /// Share of the textures that were left out of the table and are noticed.
    pub detections: f64,
    /// Share of the textures of the table that are taken for new ones.
    pub false_alarms: f64,
}

/// Leaves one texture after the other out of the table, and presents it; and one that was not left out beside it.
///
/// # Errors
/// See [`EvaluateError`].
pub fn leave_one_out(
    experiment: &Experiment,
    config: Config,
    runs: u64,
    done: impl Fn() + Sync,
) -> Result<Vec<After>, EvaluateError> {
    let flagged: Vec<[[bool; SLIDES]; 2]> = (0..runs)
        .into_par_iter()
        .map(|index| {
            let mut run = experiment.run(index);
            let presented = run.unknown;
            let textures = experiment.names().len();
            let other = (presented + 1 + run.random.random_range(0..textures - 1)) % textures;
            let new = episode(experiment, config, &mut run, presented)?;
            let known = episode(experiment, config, &mut run, other)?;
            done();
            Ok([new, known])
        })
        .collect::<Result<_, EvaluateError>>()?;
    let share = |which: usize, after: usize| {
        let count = flagged.iter().filter(|run| run[which][after]).count();
        count as f64 / flagged.len().max(1) as f64
    };
    Ok((0..SLIDES)
        .map(|after| After {
            slides: after + 1,
            detections: share(0, after),
            false_alarms: share(1, after),
        })
        .collect())
}

/// Slides over the run's texture with a table that lacks `left_out`: whether it is taken for unknown after each slide.
fn episode(
    experiment: &Experiment,
    config: Config,
    run: &mut Run<'_>,
    left_out: usize,
) -> Result<[bool; SLIDES], EvaluateError> {
    let bytes = run.learn_without(config.method, left_out)?;
    let mut explorer = explorer(&bytes, experiment.measured(), config, None)?;
    let mut flagged = [false; SLIDES];
    for flag in &mut flagged {
        let expected = explorer.expected_outcomes();
        let action = explorer.choose(&expected, 0);
        let slide = run.slide(action.movement.into());
        explorer
            .observe(action, slide)
            .expect("every slide has the features that the table was learned from");
        *flag = explorer.is_unknown();
    }
    Ok(flagged)
}
