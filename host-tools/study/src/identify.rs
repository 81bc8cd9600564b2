//! Identification among all textures (Table 5), and discrimination of pairs (Table 4): thousands of virtual
//! explorations, each slide drawn from the validation trials.

use serde::{Deserialize, Serialize};
use tactus_core::explorer::{Config, Explorer};
use tactus_core::features::Property;

use super::error::StudyError;
use super::published::{IDENTIFIED, PAIRS};
use super::slides::{Named, Recorded, StudyWorld};
use tactus_lab::eval::evaluate::{
    MAX_TEXTURES, Method, Outcome, Summary, evaluate, explorer, play_with,
};
use tactus_lab::eval::experiment::Experiment;
use tactus_lab::eval::verdicts::Verdicts;
use tactus_lab::sim::collection::{Collection, texture_name};

/// The ways of exploring that are compared, the paper's three and the project's own.
pub const METHODS: [Method; 4] = [Method::Cycle, Method::Random, Method::Paper, Method::Fused];
/// The short name of a way of exploring.
pub fn short_name(method: Method) -> &'static str {
    match method {
        Method::Cycle => "cycling",
        Method::Random => "random",
        Method::Paper => "Bayesian",
        _ => "fused",
    }
}

/// Movements after which there is an answer, sure or not (paper).
pub const MAX_SLIDES: u8 = 10;
/// Most movements for a pair. The paper gives no limit; no pair comes near this one.
const MAX_PAIR_SLIDES: u8 = 254;

/// Results of a way of exploring: a column of Table 5.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Column {
    /// Right answers, %.
    pub correct: f64,
    /// Explorations that were right and sure, %.
    pub converged: f64,
    /// Of the sure, those that were wrong, %.
    pub wrong_when_sure: f64,
    /// Median number of movements; one that did not converge counts 11.
    pub median: f64,
    /// Mean number of movements.
    pub mean: f64,
    /// Right answers for each texture of [`IDENTIFIED`], %.
    pub textures: Vec<f64>,
}

/// All textures with the slides to learn from, and those of [`IDENTIFIED`] with slides to test with.
///
/// # Errors
/// See [`StudyError`].
pub fn experiment(recorded: &Recorded, seed: u64) -> Result<Experiment, StudyError> {
    let Recorded {
        training,
        validation,
    } = recorded;
    let names = training.iter().map(|t| texture_name(t.texture).to_owned());
    let movements = Collection::MOVEMENTS.to_vec();
    let tested = training.iter().map(|t| {
        let validation = validation.iter().find(|v| v.texture == t.texture);
        validation.map_or_else(|| vec![Vec::new(); movements.len()], |v| v.slides.clone())
    });
    let (tested, trained) = (
        tested.collect(),
        training.iter().map(|t| t.slides.clone()).collect(),
    );
    let trials = training.iter().flat_map(|t| &t.slides).map(Vec::len).min();
    Ok(Experiment::collected(
        names.collect(),
        movements,
        trained,
        tested,
        Some(trials.unwrap_or(0)),
        seed,
    )?)
}

fn config(method: Method) -> Config {
    Config {
        method: method.method(),
        strategy: method.strategy(),
        max_slides: MAX_SLIDES,
        ..Config::default()
    }
}

/// Identification at 99 % by one way of exploring.
///
/// # Errors
/// See [`StudyError`].
pub fn identify(
    experiment: &Experiment,
    method: Method,
    simulations: u64,
    done: impl Fn() + Sync,
) -> Result<(Column, Vec<Outcome>), StudyError> {
    let outcomes = evaluate(experiment, config(method), simulations, done)?;
    let summary = Summary::new(&outcomes, experiment.names(), MAX_SLIDES);
    let right = |o: &&Outcome| o.identified == o.unknown;
    let textures = IDENTIFIED.iter().map(|&number| {
        let of: Vec<&Outcome> = outcomes
            .iter()
            .filter(|o| o.unknown + 1 == usize::from(number))
            .collect();
        percent(of.iter().copied().filter(right).count(), of.len())
    });
    let column = Column {
        correct: 100.0 * summary.accuracy,
        converged: percent(
            outcomes.iter().filter(right).filter(|o| o.sure).count(),
            outcomes.len(),
        ),
        wrong_when_sure: 100.0 * summary.wrong_when_sure,
        median: summary.median_slides,
        mean: summary.mean_slides,
        textures: textures.collect(),
    };
    Ok((column, outcomes))
}

/// A row of Table 4.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct PairRow {
    /// The textures.
    pub textures: [Named; 2],
    /// Right answers, %.
    pub correct: f64,
    /// Explorations that reached 99.9 %, in %.
    pub converged: f64,
    /// Median number of movements.
    pub median: f64,
    /// Mean number of movements.
    pub mean: f64,
    /// The paper's shares of right answers of people and of its machine, %.
    pub paper: [f64; 2],
}

/// The pairs of Table 4 at 99.9 %, by Bayesian exploration: `simulations` of each.
///
/// # Errors
/// See [`StudyError`].
pub fn pairs(
    experiment: &Experiment,
    simulations: u64,
    done: impl Fn() + Sync,
) -> Result<Vec<PairRow>, StudyError> {
    let config = Config {
        method: Method::Paper.method(),
        strategy: Method::Paper.strategy(),
        threshold: Config::PAIR_THRESHOLD,
        max_slides: MAX_PAIR_SLIDES,
        ..Config::default()
    };
    let row = |pair: &super::published::Pair| {
        let candidates = pair.textures.map(|number| u16::from(number) - 1);
        let among = experiment.clone().among(&candidates);
        let outcomes = evaluate(&among, config, simulations, &done)?;
        let summary = Summary::new(&outcomes, among.names(), MAX_PAIR_SLIDES);
        Ok(PairRow {
            textures: pair.textures.map(Named::new),
            correct: 100.0 * summary.accuracy,
            converged: 100.0 * summary.converged,
            median: summary.median_slides,
            mean: summary.mean_slides,
            paper: [pair.human, pair.machine],
        })
    };
    PAIRS.iter().map(row).collect()
}

/// Share in %; of nothing, 0.
pub(super) fn percent(part: usize, of: usize) -> f64 {
    100.0 * part as f64 / of.max(1) as f64
}

/// Identification in one world: Table 5.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Identification {
    /// Virtual explorations of each way of exploring.
    pub simulations: u64,
    /// The textures, in the order of Table 5.
    pub textures: Vec<Named>,
    /// The cycle of cycling: the best movement of each property.
    pub cycled: Vec<(usize, Property)>,
    /// The ways of exploring, as [`METHODS`].
    pub columns: Vec<Column>,
    /// Verdicts, by each way of exploring.
    pub told: Vec<ToldColumn>,
    /// Explorations by Bayesian exploration, as in fig. 10.
    pub evolutions: Vec<Evolution>,
}

/// Shares of the verdicts: `tactus identify` allows for an unknown texture, and no slide counts twice.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ToldColumn {
    /// Shares of the explorations.
    pub verdicts: Verdicts,
    /// Mean number of movements.
    pub mean: f64,
}

impl ToldColumn {
    fn run(
        experiment: &Experiment,
        method: Method,
        simulations: u64,
        done: impl Fn() + Sync,
    ) -> Result<Self, StudyError> {
        let config = Config {
            open: true,
            ..config(method)
        };
        let experiment = experiment.clone().each_slide_once();
        let outcomes = evaluate(&experiment, config, simulations, done)?;
        Ok(Self {
            verdicts: Verdicts::of(outcomes.iter().map(Outcome::told)),
            mean: Summary::new(&outcomes, experiment.names(), MAX_SLIDES).mean_slides,
        })
    }
}

/// One exploration, step by step.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Evolution {
    /// The kind that it is an example of.
    pub example: String,
    /// Number of the simulation.
    pub simulation: u64,
    /// The unknown texture.
    pub unknown: Named,
    /// The answer.
    pub identified: Named,
    /// True if it reached 99 %.
    pub sure: bool,
    /// Movement (from 0) and property of each step.
    pub steps: Vec<(u8, Property)>,
    /// Textures that were ever likely, with their probability before the first step and after each.
    pub probabilities: Vec<(Named, Vec<f32>)>,
}

/// Textures that are always less probable than this are not shown.
const LIKELY: f32 = 0.1;

impl Identification {
    /// Explores by every way.
    ///
    /// # Errors
    /// See [`StudyError`].
    pub fn run(
        experiment: &Experiment,
        simulations: u64,
        done: impl Fn() + Sync,
    ) -> Result<Self, StudyError> {
        let (mut columns, mut told) = (Vec::new(), Vec::new());
        let mut evolutions = Vec::new();
        let mut cycled = Vec::new();
        for method in METHODS {
            let (column, outcomes) = identify(experiment, method, simulations, &done)?;
            columns.push(column);
            told.push(ToldColumn::run(experiment, method, simulations, &done)?);
            if method == Method::Paper {
                let bytes = experiment.run(0).learn(method.method())?;
                let mut explorer = explorer(&bytes, experiment.measured(), config(method), None)?;
                cycled = explorer
                    .turns()
                    .filter_map(|a| Some((usize::from(a.movement), a.property?)))
                    .collect();
                evolutions = examples(&outcomes)
                    .into_iter()
                    .map(|(example, n)| evolution(experiment, &mut explorer, example, n))
                    .collect();
            }
        }
        Ok(Self {
            simulations,
            textures: IDENTIFIED.map(Named::new).to_vec(),
            cycled,
            columns,
            told,
            evolutions,
        })
    }

    /// Explorations of [`Identification::run`], for a progress bar.
    pub fn explorations(simulations: u64) -> u64 {
        2 * METHODS.len() as u64 * simulations
    }

    /// The column of a way of exploring.
    pub fn column(&self, method: Method) -> Option<&Column> {
        let at = METHODS.iter().position(|m| *m == method)?;
        self.columns.get(at)
    }
}

/// The first simulations of the four kinds that fig. 10 shows.
fn examples(outcomes: &[Outcome]) -> Vec<(&'static str, u64)> {
    fn right(o: &Outcome) -> bool {
        o.identified == o.unknown
    }
    type Is = fn(&Outcome) -> bool;
    let kinds: [(&str, Is); 4] = [
        ("identified at once", |o| {
            right(o) && o.sure && o.slides <= 3
        }),
        ("identified late", |o| right(o) && o.sure && o.slides >= 6),
        ("taken for another", |o| !right(o)),
        ("right, but not sure after 10 movements", |o| {
            right(o) && !o.sure
        }),
    ];
    let first =
        |(example, is): (&'static str, Is)| Some((example, outcomes.iter().position(is)? as u64));
    kinds.into_iter().filter_map(first).collect()
}

/// Plays a simulation again, and keeps the posterior at each step.
fn evolution(
    experiment: &Experiment,
    explorer: &mut Explorer<'_, MAX_TEXTURES>,
    example: &'static str,
    simulation: u64,
) -> Evolution {
    let run = experiment.run(simulation);
    let mut steps = Vec::new();
    let mut posteriors = vec![vec![
        1.0 / experiment.names().len() as f32;
        experiment.names().len()
    ]];
    let outcome = play_with(
        explorer,
        Method::Paper.strategy(),
        run,
        |action, explorer| {
            steps.extend(action.property.map(|property| (action.movement, property)));
            posteriors.push(explorer.posterior().to_vec());
        },
    );
    let named = |index: usize| Named::new(index as u8 + 1);
    let of = |texture: usize| posteriors.iter().map(move |p| p[texture]);
    let likely = (0..experiment.names().len())
        .filter(|&texture| of(texture).any(|p| p >= LIKELY) || texture == outcome.unknown);
    Evolution {
        example: example.to_owned(),
        simulation,
        unknown: named(outcome.unknown),
        identified: named(outcome.identified),
        sure: outcome.sure,
        steps,
        probabilities: likely.map(|t| (named(t), of(t).collect())).collect(),
    }
}

/// The results in one of several worlds.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct WorldRow {
    /// The world.
    pub seed: u64,
    /// The ways of exploring, as [`METHODS`].
    pub columns: Vec<Column>,
    /// Mean of the pairs' right answers, %.
    pub pairs: f64,
}

impl WorldRow {
    /// Identification and pairs in a world whose slides are recorded.
    ///
    /// # Errors
    /// See [`StudyError`].
    pub fn run(
        world: StudyWorld,
        recorded: &Recorded,
        simulations: u64,
        done: impl Fn() + Sync,
    ) -> Result<Self, StudyError> {
        let experiment = experiment(recorded, world.seed)?;
        let columns = METHODS
            .iter()
            .map(|&method| Ok(identify(&experiment, method, simulations, &done)?.0))
            .collect::<Result<_, StudyError>>()?;
        let rows = pairs(&experiment, of_pair(simulations), &done)?;
        Ok(Self {
            seed: world.seed,
            columns,
            pairs: rows.iter().map(|row| row.correct).sum::<f64>() / rows.len() as f64,
        })
    }

    /// Explorations of [`WorldRow::run`], for a progress bar.
    pub fn explorations(simulations: u64) -> u64 {
        METHODS.len() as u64 * simulations + PAIRS.len() as u64 * of_pair(simulations)
    }
}

/// Simulations of each pair: the eight pairs together have as many as a way of exploring, 1000 each of 8000 (paper).
pub fn of_pair(simulations: u64) -> u64 {
    (simulations / PAIRS.len() as u64).max(1)
}
