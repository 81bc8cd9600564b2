//! Textures that the table does not have: how many are noticed, and how often one that it has is taken for one.

use rand::RngExt as _;
use rayon::prelude::*;
use serde::Serialize;
use tactus_core::explorer::Config;

use crate::eval::evaluate::{EvaluateError, explorer, play};
use crate::eval::experiment::{Experiment, Run};
use crate::eval::verdicts::Verdicts;

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

/// What leaving textures out comes to.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Novelty {
    /// After one slide, two, and so on.
    pub novelty: Vec<After>,
    /// What users would have been told of the textures that were left out: `new` is right, and `right` is 0.
    pub verdicts_new: Verdicts,
    /// What they would have been told of textures that the table has.
    pub verdicts_known: Verdicts,
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
) -> Result<Novelty, EvaluateError> {
    let as_told = experiment.clone().each_slide_once();
    let open = Config {
        open: true,
        ..config
    };
    let presented: Vec<_> = (0..runs)
        .into_par_iter()
        .map(|index| {
            let mut run = experiment.run(index);
            let presented = run.unknown;
            let textures = experiment.names().len();
            let other = (presented + 1 + run.random.random_range(0..textures - 1)) % textures;
            let new = episode(experiment, config, &mut run, presented)?;
            let known = episode(experiment, config, &mut run, other)?;
            let told = |left_out| {
                let run = as_told.run(index);
                let bytes = run.learn_without(open.method, left_out)?;
                let mut explorer = explorer(&bytes, as_told.measured(), open, None)?;
                let outcome = play(&mut explorer, None, open.strategy, run);
                // in this table the textures after the missing one are one place further to the front
                let place = presented.checked_sub(usize::from(presented > left_out));
                let is_right = presented != left_out && Some(outcome.identified) == place;
                Ok::<_, EvaluateError>((outcome.told, is_right))
            };
            let told = [told(presented)?, told(other)?];
            done();
            Ok(([new, known], told))
        })
        .collect::<Result<_, EvaluateError>>()?;
    let share = |which: usize, after: usize| {
        let flagged = presented.iter().filter(|(run, _)| run[which][after]);
        flagged.count() as f64 / presented.len().max(1) as f64
    };
    let after = |after| After {
        slides: after + 1,
        detections: share(0, after),
        false_alarms: share(1, after),
    };
    Ok(Novelty {
        novelty: (0..SLIDES).map(after).collect(),
        verdicts_new: Verdicts::of(presented.iter().map(|(_, told)| told[0])),
        verdicts_known: Verdicts::of(presented.iter().map(|(_, told)| told[1])),
    })
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
        let slide = run
            .slide(action.movement.into())
            .expect("slides are drawn with replacement, and there is one");
        explorer
            .observe(action, slide)
            .expect("every slide has the features that the table was learned from");
        *flag = explorer.is_unknown();
    }
    Ok(flagged)
}
