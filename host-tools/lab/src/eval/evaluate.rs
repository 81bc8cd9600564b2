//! Thousands of virtual explorations, and their sums.

use std::collections::HashMap;

use rand::{Rng as _, RngExt as _};
use rayon::prelude::*;
use serde::Serialize;
use tactus_core::explorer::{self, Config, Explorer, Strategy, VerdictKind};
use tactus_core::features::PropertySet;
use tactus_core::rig::MAX_REJECTED;
use tactus_core::table::{Action, MAX_TEXTURES, Table};

use crate::eval::experiment::{Experiment, Run};
use crate::eval::learn::TableError;

/// The method of a run: its comparison and its choice of movements.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[cfg_attr(feature = "arguments", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// All features of every slide at once, whitened; the movement chosen by Bayesian exploration.
    Fused,
    /// As fused, one movement after the other.
    FusedCycle,
    /// As fused, any movement at random.
    FusedRandom,
    /// The three properties of every slide, Student's t.
    StudentAll,
    /// One property per slide, Student's t.
    Student,
    /// The paper's: one property per slide, the movement chosen by Bayesian exploration.
    Paper,
    /// The paper's likelihoods, the best movement of each property in turn.
    Cycle,
    /// The paper's likelihoods, any movement and property at random.
    Random,
}

impl Method {
    /// The comparison of the core's explorer.
    pub fn method(self) -> explorer::Method {
        match self {
            Self::Fused | Self::FusedCycle | Self::FusedRandom => explorer::Method::Fused,
            Self::StudentAll => explorer::Method::StudentAll,
            Self::Student => explorer::Method::Student,
            Self::Paper | Self::Cycle | Self::Random => explorer::Method::Paper,
        }
    }

    /// The choice of the core's explorer.
    pub fn strategy(self) -> Strategy {
        match self {
            Self::Fused | Self::StudentAll | Self::Student | Self::Paper => Strategy::Bayesian,
            Self::FusedCycle | Self::Cycle => Strategy::Cycling,
            Self::FusedRandom | Self::Random => Strategy::Random,
        }
    }

    /// The best one for the contents of a table.
    pub fn of(method: explorer::Method) -> Self {
        match method {
            explorer::Method::Fused => Self::Fused,
            explorer::Method::StudentAll => Self::StudentAll,
            explorer::Method::Student => Self::Student,
            explorer::Method::Paper => Self::Paper,
        }
    }
}

/// The end of one run.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Outcome {
    /// The texture that was to be identified.
    pub unknown: usize,
    /// The answer.
    pub identified: usize,
    /// True if the threshold was exceeded.
    pub sure: bool,
    /// The verdict.
    pub told: VerdictKind,
    /// Slides made.
    pub slides: u8,
    /// True if it would have been called unknown, had that been an answer.
    pub unknown_like: bool,
    /// True if the probe would learn from it by itself.
    pub learns: bool,
}

impl Outcome {
    /// The verdict, and true if the most probable texture is the right one.
    pub fn told(&self) -> (VerdictKind, bool) {
        (self.told, self.identified == self.unknown)
    }

    /// True if the probe would learn from it by itself, and true if it would learn the right texture.
    pub fn learned(&self) -> (bool, bool) {
        (self.learns, self.identified == self.unknown)
    }
}

/// Plays one run to its end.
pub fn play<const N: usize>(
    explorer: &mut Explorer<'_, N>,
    strategy: Strategy,
    run: Run<'_>,
) -> Outcome {
    play_with(explorer, strategy, run, |_, _| ())
}

/// Returns true if the most probable texture after one slide is the right one. The movement, and with some methods the
/// property looked at, is any.
pub(crate) fn is_right_at_once<const N: usize>(
    explorer: &mut Explorer<'_, N>,
    mut run: Run<'_>,
) -> bool {
    explorer.restart();
    let mut outcomes = explorer.expected_outcomes();
    while !outcomes.is_empty() {
        let drawn = run.random.random_range(0..outcomes.len());
        let action = outcomes.swap_remove(drawn).action;
        // a part that is tested may have no slide at a movement
        let Some(slide) = run.slide(action.movement.into()) else {
            continue;
        };
        explorer
            .observe(action, slide)
            .expect("every slide has the properties that the explorer was told of");
        return usize::from(explorer.best().texture) == run.unknown;
    }
    false
}

/// As [`play`]; `each` gets every action and the explorer after it.
pub(crate) fn play_with<const N: usize>(
    explorer: &mut Explorer<'_, N>,
    strategy: Strategy,
    mut run: Run<'_>,
    mut each: impl FnMut(Action, &Explorer<'_, N>),
) -> Outcome {
    explorer.restart();
    let mut failed = 0;
    let verdict = loop {
        if let Some(verdict) = explorer.verdict() {
            break verdict;
        }
        // only Bayesian exploration looks ahead
        let expected = match strategy {
            Strategy::Bayesian => explorer.expected_outcomes(),
            _ => Default::default(),
        };
        let action = explorer.choose(&expected, run.random.next_u32());
        let Some(slide) = run.slide(action.movement.into()) else {
            // as the core explores on a rig: once more, then another movement, and then it ends with the present
            // posterior
            failed += 1;
            if !explorer.reject(action) || failed == MAX_REJECTED {
                break explorer.best();
            }
            continue;
        };
        failed = 0;
        explorer
            .observe(action, slide)
            .expect("every slide has the properties that the explorer was told of");
        each(action, explorer);
    };
    Outcome {
        unknown: run.unknown,
        identified: verdict.texture.into(),
        sure: verdict.sure,
        told: verdict.kind(),
        slides: explorer.slides(),
        unknown_like: explorer.is_unknown(),
        learns: explorer.may_learn(),
    }
}

/// Plays `runs` runs on all cores; `done` is called after each. The outcomes are in the order of the runs, and the same
/// for any number of threads.
pub fn evaluate(
    experiment: &Experiment,
    config: Config,
    runs: u64,
    done: impl Fn() + Sync,
) -> Result<Vec<Outcome>, TableError> {
    evaluate_by(experiment, config, runs, done, |explorer, run| {
        play(explorer, config.strategy, run)
    })
}

/// Plays `runs` runs on all cores, each by `play`: see [`evaluate`].
pub(super) fn evaluate_by<T: Send>(
    experiment: &Experiment,
    config: Config,
    runs: u64,
    done: impl Fn() + Sync,
    play: impl Fn(&mut Explorer<'_, MAX_TEXTURES>, Run<'_>) -> T + Sync,
) -> Result<Vec<T>, TableError> {
    let learn = |run| experiment.run(run).learn(config.method);
    let run = |explorer: &mut Explorer<'_, MAX_TEXTURES>, index| {
        let outcome = play(explorer, experiment.run(index));
        done();
        outcome
    };
    // where every run learns from the same slides, one table serves all
    if experiment.is_fixed() {
        let bytes = learn(0)?;
        let explorer = explorer(
            &bytes,
            experiment.measured,
            config,
            experiment.candidates.as_deref(),
        )?;
        let run = |explorer: &mut Box<_>, index| run(explorer, index);
        let all = (0..runs).into_par_iter().panic_fuse();
        return Ok(all.map_init(|| explorer.clone(), run).collect());
    }
    let rounds = experiment.rounds(runs).into_par_iter().panic_fuse();
    let played = rounds.map(|runs| {
        let bytes = learn(runs.start)?;
        let mut explorer = explorer(
            &bytes,
            experiment.measured,
            config,
            experiment.candidates.as_deref(),
        )?;
        let played = runs.map(|index| run(&mut explorer, index));
        Ok(played.collect())
    });
    let played: Result<Vec<Vec<T>>, TableError> = played.collect();
    Ok(played?.into_iter().flatten().collect())
}

/// An explorer on the heap: it is large, and the threads' stacks are not. Without `candidates`, all textures are.
/// Errors: the table does not read, or cannot be explored.
#[inline(never)]
pub fn explorer<'b>(
    bytes: &'b [u8],
    measured: PropertySet,
    config: Config,
    candidates: Option<&[u16]>,
) -> Result<Box<Explorer<'b, MAX_TEXTURES>>, TableError> {
    let table = Table::read(bytes)?;
    Ok(Box::new(match candidates {
        Some(candidates) => Explorer::among(table, measured, config, candidates.iter().copied())?,
        None => Explorer::new(table, measured, config)?,
    }))
}

/// Two textures, and how often the first was taken for the second.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Confused {
    /// The unknown texture.
    pub texture: String,
    /// The answer.
    pub identified: String,
    /// Share of all runs, 0 to 1.
    pub share: f64,
}

/// The figures of an evaluation.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Summary {
    /// Right answers over runs.
    pub accuracy: f64,
    /// Share of the runs that stopped by the threshold.
    pub converged: f64,
    /// Wrong answers among those.
    pub wrong_when_sure: f64,
    /// Median number of slides; a run that did not converge counts one more than the limit.
    pub median_slides: f64,
    /// Mean number of slides.
    pub mean_slides: f64,
    /// Share of the runs that would have been called unknown after their last slide, had that been an answer.
    pub like_unknown: f64,
    /// The most confused pairs, most often first, ten at most.
    pub confused: Vec<Confused>,
}

impl Summary {
    /// Sums up outcomes, of which there is at least one.
    pub fn new(outcomes: &[Outcome], names: &[String], max_slides: u8) -> Self {
        let share = |part: usize, of: usize| {
            if of == 0 {
                0.0
            } else {
                part as f64 / of as f64
            }
        };
        let right = outcomes
            .iter()
            .filter(|o| o.identified == o.unknown)
            .count();
        let sure = outcomes.iter().filter(|o| o.sure).count();
        let wrong = outcomes
            .iter()
            .filter(|o| o.sure && o.identified != o.unknown)
            .count();
        let mut slides: Vec<f64> = outcomes
            .iter()
            .map(|o| {
                f64::from(if o.sure {
                    o.slides
                } else {
                    max_slides.saturating_add(1)
                })
            })
            .collect();
        slides.sort_by(f64::total_cmp);
        let middle = |at: usize| slides.get(at).copied().unwrap_or(0.0);
        let made: f64 = outcomes.iter().map(|o| f64::from(o.slides)).sum();
        let mut pairs: HashMap<(usize, usize), usize> = HashMap::new();
        for o in outcomes.iter().filter(|o| o.identified != o.unknown) {
            *pairs.entry((o.unknown, o.identified)).or_default() += 1;
        }
        let mut pairs: Vec<_> = pairs.into_iter().collect();
        pairs.sort_by_key(|&(pair, count)| (std::cmp::Reverse(count), pair));
        Self {
            accuracy: share(right, outcomes.len()),
            converged: share(sure, outcomes.len()),
            wrong_when_sure: share(wrong, sure),
            median_slides: (middle(outcomes.len().saturating_sub(1) / 2)
                + middle(outcomes.len() / 2))
                / 2.0,
            mean_slides: made / outcomes.len().max(1) as f64,
            like_unknown: share(
                outcomes.iter().filter(|o| o.unknown_like).count(),
                outcomes.len(),
            ),
            confused: pairs
                .into_iter()
                .take(10)
                .map(|((unknown, identified), count)| Confused {
                    texture: names[unknown].clone(),
                    identified: names[identified].clone(),
                    share: share(count, outcomes.len()),
                })
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn summary_counts_as_the_protocols_say() {
        let outcome = |unknown, identified, sure, slides| Outcome {
            unknown,
            identified,
            sure,
            told: if sure {
                VerdictKind::Sure
            } else {
                VerdictKind::Undecided
            },
            slides,
            unknown_like: slides == 4,
            learns: false,
        };
        let names = ["a".to_owned(), "b".to_owned(), "c".to_owned()];
        let outcomes = [
            outcome(0, 0, true, 3),
            outcome(1, 1, true, 5),
            outcome(0, 1, true, 4),
            outcome(2, 2, false, 10),
            outcome(1, 0, false, 10),
            outcome(0, 1, false, 10),
        ];
        let s = Summary::new(&outcomes, &names, 10);
        assert_eq!((s.accuracy, s.converged), (0.5, 0.5));
        assert_eq!(s.wrong_when_sure, 1.0 / 3.0, "of the sure ones only");
        assert_eq!(s.median_slides, 8.0, "3 4 5 11 11 11");
        assert_eq!(s.mean_slides, 7.0);
        assert_eq!(s.like_unknown, 1.0 / 6.0);
        let pairs: Vec<_> = s
            .confused
            .iter()
            .map(|c| (c.texture.as_str(), c.identified.as_str(), c.share))
            .collect();
        assert_eq!(pairs, [("a", "b", 2.0 / 6.0), ("b", "a", 1.0 / 6.0)]);
        assert_eq!(Summary::new(&outcomes[..3], &names, 10).median_slides, 4.0);
    }
}
