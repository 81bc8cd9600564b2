//! Identification among all textures (Table 5), and discrimination of pairs (Table 4): thousands of virtual
//! explorations, each slide drawn from the validation trials.

use serde::Serialize;
use tactus_core::explorer::Config;

use super::published::{IDENTIFIED, PAIRS};
use super::slides::{Named, Recorded};
use tactus_lab::eval::evaluate::{Method, Outcome, Summary, evaluate};
use tactus_lab::eval::experiment::Experiment;
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
#[derive(Clone, PartialEq, Debug, Serialize)]
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
pub fn experiment(recorded: &Recorded, seed: u64) -> anyhow::Result<Experiment> {
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
fn identify(
    experiment: &Experiment,
    method: Method,
    simulations: u64,
    done: impl Fn() + Sync,
) -> anyhow::Result<Column> {
    let outcomes = evaluate(experiment, config(method), simulations, done)?;
    let summary = Summary::new(&outcomes, &experiment.names, MAX_SLIDES);
    let right = |o: &&Outcome| o.identified == o.unknown;
    let textures = IDENTIFIED.iter().map(|&number| {
        let of: Vec<&Outcome> = outcomes
            .iter()
            .filter(|o| o.unknown + 1 == usize::from(number))
            .collect();
        percent(of.iter().copied().filter(right).count(), of.len())
    });
    Ok(Column {
        correct: 100.0 * summary.accuracy,
        converged: percent(
            outcomes.iter().filter(right).filter(|o| o.sure).count(),
            outcomes.len(),
        ),
        wrong_when_sure: 100.0 * summary.wrong_when_sure,
        median: summary.median_slides,
        mean: summary.mean_slides,
        textures: textures.collect(),
    })
}

/// A row of Table 4.
#[derive(Clone, PartialEq, Debug, Serialize)]
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
pub fn pairs(
    experiment: &Experiment,
    simulations: u64,
    done: impl Fn() + Sync,
) -> anyhow::Result<Vec<PairRow>> {
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
        let summary = Summary::new(&outcomes, &among.names, MAX_PAIR_SLIDES);
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

/// Mean of the right answers, %.
pub fn pairs_mean(rows: &[PairRow]) -> f64 {
    rows.iter().map(|row| row.correct).sum::<f64>() / rows.len().max(1) as f64
}

/// Share in %; of nothing, 0.
fn percent(part: usize, of: usize) -> f64 {
    100.0 * part as f64 / of.max(1) as f64
}

/// Identification in one world: Table 5.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Identification {
    /// Virtual explorations of each way of exploring.
    pub simulations: u64,
    /// The textures, in the order of Table 5.
    pub textures: Vec<Named>,
    /// The ways of exploring, as [`METHODS`].
    pub columns: Vec<Column>,
}

impl Identification {
    /// Explores by every way.
    pub fn run(
        experiment: &Experiment,
        simulations: u64,
        done: impl Fn() + Sync,
    ) -> anyhow::Result<Self> {
        let columns = METHODS
            .iter()
            .map(|&method| identify(experiment, method, simulations, &done))
            .collect::<Result<_, _>>()?;
        Ok(Self {
            simulations,
            textures: IDENTIFIED.map(Named::new).to_vec(),
            columns,
        })
    }

    /// Explorations of [`Identification::run`], for a progress bar.
    pub fn explorations(simulations: u64) -> u64 {
        METHODS.len() as u64 * simulations
    }

    /// The column of a way of exploring.
    pub fn column(&self, method: Method) -> Option<&Column> {
        let at = METHODS.iter().position(|m| *m == method)?;
        self.columns.get(at)
    }
}

/// Simulations of each pair: the eight pairs together have as many as a way of exploring, 1000 each of 8000 (paper).
pub fn of_pair(simulations: u64) -> u64 {
    (simulations / PAIRS.len() as u64).max(1)
}
