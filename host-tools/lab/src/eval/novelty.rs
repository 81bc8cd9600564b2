//! Textures that the table does not have: the share that is noticed, and the share of known textures that are taken for
//! unknown ones.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use rand::RngExt as _;
use rayon::prelude::*;
use serde::Serialize;
use tactus_core::explorer::{Config, VerdictKind};
use tactus_core::table::OpenSet;

use crate::eval::evaluate::{explorer, play};
use crate::eval::experiment::{Experiment, Run};
use crate::eval::learn::TableError;
use crate::eval::verdicts::{Updates, Verdicts};

/// Slides after which it is counted.
pub const SLIDES: usize = 3;

/// Verdicts after so many slides, independent of earlier ones.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct After {
    /// Slides of the episode.
    pub slides: usize,
    /// Textures of the table.
    pub known: Verdicts,
    /// Textures that were left out of it: `new` is right, and no name is.
    pub unknown: Verdicts,
}

/// The result of leaving textures out.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Novelty {
    /// The table's own figures.
    pub open_set: Option<OpenSet>,
    /// After one slide, two, and so on.
    pub novelty: Vec<After>,
    /// Verdicts on the textures that were left out: `new` is right, and `right` is 0.
    pub verdicts_new: Verdicts,
    /// Verdicts on textures that the table has.
    pub verdicts_known: Verdicts,
    /// Shares of explorations of textures that were left out in which the probe would learn by itself, all wrongly;
    /// `null` unless it was to.
    pub updates_new: Option<Updates>,
}

/// Leaves one texture after the other out of the table, and presents it; and one that was not left out beside it.
pub fn leave_one_out(
    experiment: &Experiment,
    config: Config,
    runs: u64,
    done: impl Fn() + Sync,
) -> Result<Novelty, TableError> {
    let mut experiment = experiment.clone();
    experiment.open_set = experiment.run(0).open_set(config.method, || ())?;
    let experiment = &experiment;
    // where every run learns from the same slides, there is one table for each texture that is out
    let tables: Mutex<HashMap<usize, Arc<Vec<u8>>>> = Mutex::default();
    let lock = || tables.lock().unwrap_or_else(PoisonError::into_inner);
    let table = |run: &Run<'_>, out: usize| {
        let there = lock().get(&out).cloned();
        if let Some(table) = there {
            return Ok(table);
        }
        let learned = Arc::new(run.learn_without(config.method, &[out])?);
        if experiment.is_fixed() {
            lock().insert(out, Arc::clone(&learned));
        }
        Ok::<_, TableError>(learned)
    };
    let as_told = experiment.clone().each_slide_once();
    let open = Config {
        open: true,
        ..config
    };
    let presented: Vec<_> = (0..runs)
        .into_par_iter()
        .panic_fuse()
        .map(|index| {
            let mut run = experiment.run_alone(index);
            let presented = run.unknown;
            let textures = experiment.names.len();
            let other = presented + 1 + run.random.random_range(0..textures - 1);
            let outs = [presented, other % textures];
            let tables = [table(&run, outs[0])?, table(&run, outs[1])?];
            let new = episode(experiment, open, &mut run, outs[0], &tables[0])?;
            let known = episode(experiment, open, &mut run, outs[1], &tables[1])?;
            let told = |out: usize, bytes: &[u8]| {
                let run = as_told.run_alone(index);
                let mut explorer = explorer(bytes, as_told.measured, open, None)?;
                let outcome = play(&mut explorer, open.strategy, run);
                let is_right = place(presented, out) == Some(outcome.identified);
                Ok::<_, TableError>((outcome.told, is_right, outcome.learns))
            };
            let told = [told(outs[0], &tables[0])?, told(outs[1], &tables[1])?];
            done();
            Ok(([new, known], told))
        })
        .collect::<Result<_, TableError>>()?;
    let told = |which: usize, after: usize| {
        Verdicts::of(presented.iter().map(|(run, _)| run[which][after]))
    };
    let after = |after| After {
        slides: after + 1,
        known: told(1, after),
        unknown: told(0, after),
    };
    Ok(Novelty {
        open_set: experiment.open_set,
        novelty: (0..SLIDES).map(after).collect(),
        verdicts_new: Verdicts::of_unknown(presented.iter().map(|(_, told)| told[0].0)),
        verdicts_known: Verdicts::of(presented.iter().map(|(_, told)| (told[1].0, told[1].1))),
        updates_new: (config.learn)
            .then(|| Updates::of(presented.iter().map(|(_, told)| (told[0].2, false)))),
    })
}

/// Index of a texture in a table without the one that is left out; `None`: it is that one.
fn place(texture: usize, out: usize) -> Option<usize> {
    (texture != out).then(|| texture - usize::from(out < texture))
}

/// Slides over the run's texture with a table without the one that is left out: the verdict after each, and true if the
/// most probable texture is the right one.
fn episode(
    experiment: &Experiment,
    config: Config,
    run: &mut Run<'_>,
    out: usize,
    bytes: &[u8],
) -> Result<[(VerdictKind, bool); SLIDES], TableError> {
    let mut explorer = explorer(bytes, experiment.measured, config, None)?;
    let place = place(run.unknown, out);
    let mut told = [(VerdictKind::Undecided, false); SLIDES];
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
        let is_right = place == Some(best.texture.into());
        *told = (best.kind(), is_right);
    }
    Ok(told)
}
