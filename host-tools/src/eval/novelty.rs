//! Textures that the table does not have: how many are noticed, and how often one that it has is taken for one.

use rand::RngExt as _;
use rayon::prelude::*;
use serde::Serialize;
use tactus_core::explorer::{Config, Told};

use crate::eval::evaluate::{EvaluateError, explorer, play};
use crate::eval::experiment::{Experiment, Run};
use crate::eval::verdicts::Verdicts;

/// Slides after which it is counted.
pub const SLIDES: usize = 3;

/// What users would be told after so many slides, whatever was told before.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct After {
    /// Slides of the episode.
    pub slides: usize,
    /// Of textures of the table.
    pub known: Verdicts,
    /// Of textures that were left out of it.
    pub unknown: OfUnknown,
}

/// Shares of what is told of a texture that the table does not have, 0 to 1; they add up to 1.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct OfUnknown {
    /// Told that it is none of the textures known: right.
    pub new: f64,
    /// Told that it is like one of them, but not as that was learned: noticed, too.
    pub changed: f64,
    /// Told to be one of them, as sure.
    pub wrong: f64,
    /// Told "not sure".
    pub undecided: f64,
}

impl OfUnknown {
    /// Share that was noticed, as new or as changed.
    pub fn noticed(&self) -> f64 {
        self.new + self.changed
    }
}

impl After {
    /// What is told of textures that were left out, in the words of those that were not: `right` is 0.
    pub fn unknown(&self) -> Verdicts {
        let OfUnknown {
            new,
            changed,
            wrong,
            undecided,
        } = self.unknown;
        Verdicts {
            right: 0.0,
            new,
            changed,
            wrong,
            undecided,
        }
    }
}

impl From<Verdicts> for OfUnknown {
    fn from(told: Verdicts) -> Self {
        Self {
            new: told.new,
            changed: told.changed,
            // no name is right
            wrong: told.right + told.wrong,
            undecided: told.undecided,
        }
    }
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
            let new = episode(experiment, open, &mut run, presented)?;
            let known = episode(experiment, open, &mut run, other)?;
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
    let told = |which: usize, after: usize| {
        Verdicts::of(presented.iter().map(|(run, _)| run[which][after]))
    };
    let after = |after| After {
        slides: after + 1,
        known: told(1, after),
        unknown: told(0, after).into(),
    };
    Ok(Novelty {
        novelty: (0..SLIDES).map(after).collect(),
        verdicts_new: Verdicts::of(presented.iter().map(|(_, told)| told[0])),
        verdicts_known: Verdicts::of(presented.iter().map(|(_, told)| told[1])),
    })
}

/// Slides over the run's texture with a table that lacks `left_out`: what is told after each, and whether the most probable
/// texture is the right one.
fn episode(
    experiment: &Experiment,
    config: Config,
    run: &mut Run<'_>,
    left_out: usize,
) -> Result<[(Told, bool); SLIDES], EvaluateError> {
    let bytes = run.learn_without(config.method, left_out)?;
    let mut explorer = explorer(&bytes, experiment.measured(), config, None)?;
    // in this table the textures after the missing one are one place further to the front
    let place = run.unknown.checked_sub(usize::from(run.unknown > left_out));
    let mut told = [(Told::Undecided, false); SLIDES];
    for told in &mut told {
        let expected = explorer.expected_outcomes();
        let action = explorer.choose(&expected, 0);
        let slide = run
            .slide(action.movement.into())
            .expect("slides are drawn with replacement, and there is one");
        explorer
            .observe(action, slide)
            .expect("every slide has the features that the table was learned from");
        let best = explorer.best();
        let is_right = run.unknown != left_out && Some(best.texture.into()) == place;
        *told = (best.told(), is_right);
    }
    Ok(told)
}
