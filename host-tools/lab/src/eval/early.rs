//! What it brings to end a slide as soon as the verdict is certain, and what it costs.
//!
//! Each exploration is played once, with slides to their end, and before each slide is observed the explorer looks at its first
//! parts, by a table that was learned from the first parts of the training slides. So both ways see the same slides, up to the one
//! that would have ended early, and that is the last.

use serde::Serialize;
use tactus_core::explorer::{Config, Explorer, Look, Told};
use tactus_core::features::{Movement, Observation};
use tactus_core::table::Action;

use super::evaluate::{EvaluateError, MAX_TEXTURES, Outcome, evaluate_from, play_looking};
use super::experiment::{Experiment, Run};
use super::learn::{TableError, know_lengths};
use crate::data::replay::{CutSlide, MeasuredSlide};

/// The slides as their first parts of the `n`th length. What stands for one that is not longer says nothing: see [`is_longer`].
pub fn of_length(slides: &[Vec<CutSlide>], n: usize) -> Vec<Vec<MeasuredSlide>> {
    let cut = |slide: &CutSlide| {
        let mut cut = slide.whole.clone();
        if let Some(first) = &slide.first[n] {
            cut.measurement.clone_from(first);
        }
        cut
    };
    let rows = slides.iter();
    rows.map(|row| row.iter().map(cut).collect()).collect()
}

/// Whether all slides of a movement last longer than the `n`th length.
pub fn is_longer(slides: &[Vec<CutSlide>], movement: Movement, n: usize) -> bool {
    let mut all = slides.iter().flatten();
    all.all(|slide| slide.whole.movement != movement || slide.first[n].is_some())
}

/// An experiment with whole slides, and the same one with the first parts of these slides.
pub struct Lengths {
    whole: Experiment,
    shorter: Vec<Shorter>,
    /// Mean length of a slide at constant speed, s, per movement.
    seconds: Vec<f64>,
}

struct Shorter {
    ms: u16,
    experiment: Experiment,
    /// A bit for each movement whose slides are longer.
    movements: u64,
}

impl Lengths {
    /// From slides and their first parts, of these lengths in ms, the shortest first; `make` makes an experiment of one of them.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn new<E>(
        lengths_ms: &[u16],
        slides: &[Vec<CutSlide>],
        make: impl Fn(&[Vec<MeasuredSlide>]) -> Result<Experiment, E>,
    ) -> Result<Self, E> {
        let rows = slides
            .iter()
            .map(|row| row.iter().map(|slide| slide.whole.clone()).collect());
        let whole = make(&rows.collect::<Vec<Vec<_>>>())?;
        let at = |movement| {
            let all = slides.iter().flatten();
            all.filter(move |slide| slide.whole.movement == movement)
        };
        let shorter = lengths_ms.iter().enumerate().map(|(n, &ms)| {
            let movements = (0..).zip(whole.movements());
            let longer = movements.filter(|(_, movement)| is_longer(slides, **movement, n));
            Ok(Shorter {
                ms,
                movements: longer.map(|(at, _)| 1_u64 << at).sum(),
                experiment: make(&of_length(slides, n))?,
            })
        });
        let shorter = shorter.collect::<Result<_, E>>()?;
        let seconds = whole.movements().iter().map(|&movement| {
            let sum: f64 = at(movement).map(|slide| f64::from(slide.seconds)).sum();
            sum / at(movement).count().max(1) as f64
        });
        Ok(Self {
            seconds: seconds.collect(),
            shorter,
            whole,
        })
    }

    /// The experiment with whole slides.
    pub fn whole(&self) -> &Experiment {
        &self.whole
    }

    /// The table of a run, with what shorter slides say.
    fn learn(&self, run: u64, config: Config) -> Result<Vec<u8>, TableError> {
        let learn = |of: &Experiment| of.run(run).learn(config.method);
        let shorter = self.shorter.iter();
        let shorter = shorter.map(|s| Ok((s.ms, learn(&s.experiment)?, s.movements)));
        let shorter = shorter.collect::<Result<Vec<_>, TableError>>()?;
        Ok(know_lengths(&learn(&self.whole)?, &shorter)?)
    }
}

/// One exploration, and where it could have ended.
#[derive(Clone, PartialEq, Debug)]
pub struct Looked {
    /// How it ended with whole slides.
    pub outcome: Outcome,
    /// Seconds of sliding until then, at constant speed.
    pub seconds: f64,
    /// What was seen at each length of each slide, in the order of time, and the seconds of sliding until then.
    pub looks: Vec<(Look, f64)>,
}

/// Plays `runs` explorations; `done` is called after each.
///
/// # Errors
/// See [`EvaluateError`].
///
/// # Panics
/// A slide lacks a property that the experiment says all have.
pub fn look(
    lengths: &Lengths,
    config: Config,
    runs: u64,
    done: impl Fn() + Sync,
) -> Result<Vec<Looked>, EvaluateError> {
    let learn = |run| lengths.learn(run, config);
    evaluate_from(
        &lengths.whole,
        config,
        runs,
        done,
        learn,
        |explorer, confusions, run| {
            let (mut seconds, mut looks) = (0.0, Vec::new());
            let before = |explorer: &mut Explorer<'_, MAX_TEXTURES>,
                          run: &Run<'_>,
                          action: Action,
                          slide: usize| {
                let movement = usize::from(action.movement);
                for (shorter, n) in lengths.shorter.iter().zip(1..) {
                    let observed = run.drawn(&shorter.experiment, movement, slide);
                    let look = look_at(explorer, action, n, observed);
                    looks.extend(look.map(|look| (look, seconds + f64::from(shorter.ms) / 1e3)));
                }
                seconds += lengths.seconds[movement];
            };
            let strategy = config.strategy;
            let outcome = play_looking(explorer, confusions, strategy, run, before, |_, _| ());
            Looked {
                outcome,
                seconds,
                looks,
            }
        },
    )
}

fn look_at<const N: usize>(
    explorer: &mut Explorer<'_, N>,
    action: Action,
    n: u8,
    slide: &Observation,
) -> Option<Look> {
    explorer
        .look(action, n, slide)
        .expect("the first part of a slide has what the whole has")
}

/// How explorations ended, one way or the other.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Ended {
    /// Mean seconds of sliding at constant speed until the verdict.
    pub seconds: f64,
    /// Share of the explorations in which the right name was told as sure.
    pub right: f64,
    /// Share of wrong names among those that were told as sure.
    pub wrong_when_sure: f64,
}

/// What changes when slides may end at a doubt.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Change {
    /// Most doubt with which a slide ends early.
    pub doubt: f64,
    /// Share of the explorations whose last slide ended early.
    pub early: f64,
    /// How they end then.
    pub ended: Ended,
    /// By how much that differs from whole slides.
    pub difference: Ended,
    /// Standard errors of these differences; explorations of one round, which share a table, count as one.
    pub error: Ended,
}

/// One exploration as numbers: seconds, whether it was sure, whether it was right when sure, whether wrong when sure.
#[derive(Clone, Copy, Default)]
struct Sums {
    seconds: f64,
    sure: f64,
    right: f64,
    wrong: f64,
}

impl Sums {
    fn new(seconds: f64, sure: bool, right: bool) -> Self {
        let one = |is: bool| f64::from(u8::from(is));
        Self {
            seconds,
            sure: one(sure),
            right: one(sure && right),
            wrong: one(sure && !right),
        }
    }

    fn ended(self, runs: f64) -> Ended {
        Ended {
            seconds: self.seconds / runs,
            right: self.right / runs,
            wrong_when_sure: self.wrong / self.sure.max(1.0),
        }
    }

    fn add(self, other: Self) -> Self {
        Self {
            seconds: self.seconds + other.seconds,
            sure: self.sure + other.sure,
            right: self.right + other.right,
            wrong: self.wrong + other.wrong,
        }
    }
}

impl Looked {
    fn whole(&self) -> Sums {
        let Outcome {
            told,
            unknown,
            identified,
            ..
        } = self.outcome;
        Sums::new(self.seconds, told == Told::Sure, unknown == identified)
    }

    /// The first look at which the slide could have ended.
    fn early(&self, doubt: f64) -> Option<&(Look, f64)> {
        let mut looks = self.looks.iter();
        looks.find(|(look, _)| look.is_enough(doubt as f32))
    }

    fn cut(&self, doubt: f64) -> Sums {
        self.early(doubt).map_or(self.whole(), |(look, seconds)| {
            Sums::new(
                *seconds,
                true,
                usize::from(look.texture) == self.outcome.unknown,
            )
        })
    }
}

/// How explorations end with whole slides.
pub fn whole(looked: &[Looked]) -> Ended {
    let all = looked.iter().map(Looked::whole);
    all.fold(Sums::default(), Sums::add)
        .ended(looked.len() as f64)
}

/// What changes when slides may end at this doubt; so many explorations one after the other share a table.
pub fn change(looked: &[Looked], round: usize, doubt: f64) -> Change {
    let runs = looked.len().max(1) as f64;
    let sum = |of: &dyn Fn(&Looked) -> Sums| looked.iter().map(of).fold(Sums::default(), Sums::add);
    let (before, after) = (sum(&Looked::whole), sum(&|l| l.cut(doubt)));
    let [was, is] = [before, after].map(|sums| sums.ended(runs));
    // what a run adds to the difference: of shares among the sure, linearized
    let of_run = |looked: &Looked| {
        let (a, b) = (looked.cut(doubt), looked.whole());
        let share = |one: Sums, all: Sums, share: f64| {
            (one.wrong - share * one.sure) * runs / all.sure.max(1.0)
        };
        [
            a.seconds - b.seconds - (is.seconds - was.seconds),
            a.right - b.right - (is.right - was.right),
            share(a, after, is.wrong_when_sure) - share(b, before, was.wrong_when_sure),
        ]
    };
    let rounds = looked.chunks(round.max(1));
    let count = rounds.len() as f64;
    let mut squares = [0.0; 3];
    for round in rounds {
        let mut sums = [0.0; 3];
        for run in round.iter().map(of_run) {
            sums.iter_mut().zip(run).for_each(|(sum, one)| *sum += one);
        }
        let each = squares.iter_mut().zip(sums);
        each.for_each(|(square, sum)| *square += sum * sum);
    }
    let [seconds, right, wrong_when_sure] =
        squares.map(|square| (square * count / (count - 1.0).max(1.0)).sqrt() / runs);
    Change {
        doubt,
        early: looked.iter().filter(|l| l.early(doubt).is_some()).count() as f64 / runs,
        ended: is,
        difference: Ended {
            seconds: is.seconds - was.seconds,
            right: is.right - was.right,
            wrong_when_sure: is.wrong_when_sure - was.wrong_when_sure,
        },
        error: Ended {
            seconds,
            right,
            wrong_when_sure,
        },
    }
}

#[cfg(test)]
mod tests {
    use tactus_core::explorer::Method;
    use tactus_core::table::MAX_MOVEMENTS;

    use super::*;
    use crate::data::recordings::RecordingSet;
    use crate::data::replay::measure_cut;
    use crate::eval::evaluate::evaluate;
    use crate::eval::experiment::Protocol;

    #[test]
    fn looking_changes_no_exploration() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/simulated");
        let set = RecordingSet::open(folder.as_ref()).unwrap();
        let names: Vec<String> = set.textures().iter().map(|t| t.name.clone()).collect();
        let lengths_ms = [500, 700, 60_000];
        let slides = measure_cut(&set, &lengths_ms, |_| ()).unwrap();
        let lengths = Lengths::new(&lengths_ms, &slides, |measured| {
            let interleaved = Protocol::Interleaved;
            Experiment::recorded(names.clone(), measured, None, interleaved, 2, 1)
                .map(Experiment::each_slide_once)
        });
        let lengths = lengths.unwrap();
        assert_eq!(lengths.shorter[2].movements, 0, "no slide lasts a minute");
        for method in [Method::Fused, Method::Paper] {
            let config = Config {
                method,
                open: true,
                ..Config::default()
            };
            let looked = look(&lengths, config, 90, || ()).unwrap();
            let outcomes = evaluate(lengths.whole(), config, 90, || ()).unwrap();
            assert!(looked.iter().map(|l| l.outcome).eq(outcomes));
            let looks: usize = looked.iter().map(|l| l.looks.len()).sum();
            assert!(looks >= 90, "{method:?}: {looks}");
            for l in &looked {
                assert!(l.looks.is_sorted_by(|a, b| a.1 < b.1));
                assert!(l.looks.iter().all(|(_, at)| *at < l.seconds));
            }
        }
    }

    fn looked(told: Told, identified: usize, looks: &[(u16, f32, bool, f64)]) -> Looked {
        Looked {
            outcome: Outcome {
                unknown: 1,
                identified,
                sure: told == Told::Sure,
                told,
                slides: 2,
                made: [0; MAX_MOVEMENTS],
                unknown_like: false,
            },
            seconds: 6.0,
            looks: looks
                .iter()
                .map(|&(texture, doubt, known, at)| {
                    let look = Look {
                        texture,
                        doubt,
                        known,
                    };
                    (look, at)
                })
                .collect(),
        }
    }

    #[test]
    fn a_slide_ends_at_the_first_look_that_is_certain_enough() {
        let all = [
            // right both ways, and at once
            looked(Told::Sure, 1, &[(1, 0.001, true, 1.0), (1, 0.0, true, 2.0)]),
            // too doubtful, then new, then wrong
            looked(
                Told::Sure,
                1,
                &[
                    (2, 0.02, true, 1.0),
                    (2, 0.0, false, 2.0),
                    (2, 0.01, true, 4.0),
                ],
            ),
            // never certain: as with whole slides
            looked(Told::Undecided, 1, &[(1, 0.5, false, 1.0)]),
            // wrong in the end, right before
            looked(Told::Sure, 0, &[(1, 0.002, true, 3.0)]),
        ];
        let before = whole(&all);
        assert_eq!((before.seconds, before.right), (6.0, 0.5));
        assert!((before.wrong_when_sure - 1.0 / 3.0).abs() < 1e-12);
        let change = change(&all, 1, 0.01);
        assert_eq!(change.early, 0.75);
        assert_eq!((change.ended.seconds, change.ended.right), (3.5, 0.5));
        assert!((change.ended.wrong_when_sure - 1.0 / 3.0).abs() < 1e-12);
        assert_eq!(
            (change.difference.seconds, change.difference.right),
            (-2.5, 0.0)
        );
        // seconds saved: 5, 2, 0, 3; their standard error by the book
        let sd = ([2.5_f64, -0.5, -2.5, 0.5]
            .iter()
            .map(|d| d * d)
            .sum::<f64>()
            / 3.0)
            .sqrt();
        assert!((change.error.seconds - sd / 2.0).abs() < 1e-12);
        // one round only says nothing of how rounds differ
        assert!(super::change(&all, 4, 0.01).error.seconds.abs() < 1e-12);
        // who doubts more ends none early
        let strict = super::change(&all, 1, 1e-9);
        assert_eq!((strict.early, strict.difference.seconds), (0.25, -1.0));
    }
}
