//! Figures of virtual explorations, with and without their verdicts: the output of `tactus evaluate`.

use serde::Serialize;
use tactus_core::explorer::Config;
use tactus_core::table::OpenSet;

use crate::eval::courses::courses;
use crate::eval::evaluate::{
    Method, Outcome, Summary, evaluate, evaluate_by, is_right_at_once, play,
};
use crate::eval::experiment::Experiment;
use crate::eval::learn::TableError;
use crate::eval::reliability::{Statements, statements};
use crate::eval::verdicts::{Updates, Verdicts};

pub use crate::eval::courses::Course;

/// The figures, and their conditions.
#[derive(Serialize)]
pub struct Evaluation {
    /// Method of the runs.
    pub method: Method,
    /// Division into slides to learn from and to test on.
    pub protocol: &'static str,
    /// Slides learned from, per texture and movement.
    pub train_slides: usize,
    /// Sentences on textures and slides that were left out, and on sessions that were tested in turn.
    pub notes: Vec<String>,
    /// Virtual explorations.
    pub runs: u64,
    /// Textures.
    pub textures: usize,
    /// A texture more probable than this is the answer.
    pub threshold: f32,
    /// Most slides of a run.
    pub max_slides: u8,
    /// Seed of all draws.
    pub seed: u64,
    /// The table's own figures; `null` where the method has none, and in explorations of known textures only.
    pub open_set: Option<OpenSet>,
    /// Shares of the verdicts: the texture may be unknown, and no slide counts twice.
    pub verdicts: Verdicts,
    /// Shares of these in which the probe would learn by itself; `null` unless it was to.
    pub updates: Option<Updates>,
    /// Mean number of slides until then.
    pub mean_slides_told: f64,
    /// Reliability of the probabilities: share of right names by the stated probability.
    pub reliability: Vec<Statements>,
    /// Share of single slides, at any movement, whose most probable texture is the right one, where the texture is one
    /// of the table's for certain: the figure of classifiers that have no other answer.
    pub one_slide_accuracy: f64,
    /// Figures of explorations whose texture is one of the table's for certain, with slides drawn with replacement: the
    /// paper's protocol.
    #[serde(flatten)]
    pub summary: Summary,
}

/// Settings of an evaluation.
#[derive(Clone, Copy, Debug)]
pub struct EvaluationRequest {
    /// Method of the runs.
    pub method: Method,
    /// The protocol's name.
    pub protocol: &'static str,
    /// Number of runs.
    pub runs: u64,
    /// The experiment's seed.
    pub seed: u64,
    /// Ends and choices of the runs.
    pub config: Config,
    /// True if the texture is one of the table's, and the explorer knows it.
    pub closed: bool,
    /// True if reliability is wanted: a third of the work.
    pub with_courses: bool,
}

/// A part of the work: it calls the function that it gets after every run.
pub type Stage<'s> = dyn FnMut(&(dyn Fn() + Sync)) -> Result<(), TableError> + 's;

/// Plays the explorations. `stage` gets the number of each stage, how many there are, and its work, which it has to do.
/// Gives the courses behind [`Evaluation::reliability`], too.
pub fn evaluation(
    experiment: Experiment,
    request: &EvaluationRequest,
    mut stage: impl FnMut([u32; 2], &mut Stage<'_>) -> Result<(), TableError>,
) -> Result<(Evaluation, Vec<Course>), TableError> {
    let EvaluationRequest {
        config,
        runs,
        method,
        ..
    } = *request;
    let stages = if request.with_courses { 3 } else { 2 };
    let mut played = Vec::new();
    stage([1, stages], &mut |done| {
        let config = Config {
            learn: false,
            ..config
        };
        played = evaluate_by(&experiment, config, runs, done, |explorer, run| {
            let at_once = is_right_at_once(explorer, run.clone());
            (play(explorer, config.strategy, run), at_once)
        })?;
        Ok(())
    })?;
    let (outcomes, at_once): (Vec<Outcome>, Vec<bool>) = played.into_iter().unzip();
    let right = at_once.iter().filter(|right| **right).count();
    let summary = Summary::new(&outcomes, &experiment.names, config.max_slides);
    let mut experiment = experiment.each_slide_once();
    let config = Config {
        open: !request.closed,
        ..config
    };
    if config.open {
        experiment.open_set = experiment.run(0).open_set(config.method, || ())?;
    }
    let mut told = Vec::new();
    stage([2, stages], &mut |done| {
        told = evaluate(&experiment, config, runs, done)?;
        Ok(())
    })?;
    let mut all = Vec::new();
    if request.with_courses {
        stage([3, stages], &mut |done| {
            all = courses(&experiment, config, runs, done)?;
            Ok(())
        })?;
    }
    let names = &experiment.names;
    let evaluation = Evaluation {
        reliability: statements(&all, config.threshold),
        method,
        protocol: request.protocol,
        train_slides: experiment.train_slides,
        notes: experiment.notes.clone(),
        runs,
        textures: names.len(),
        threshold: config.threshold,
        max_slides: config.max_slides,
        seed: request.seed,
        open_set: experiment.open_set,
        verdicts: Verdicts::of(told.iter().map(Outcome::told)),
        updates: (config.learn).then(|| Updates::of(told.iter().map(Outcome::learned))),
        mean_slides_told: Summary::new(&told, names, config.max_slides).mean_slides,
        one_slide_accuracy: right as f64 / at_once.len().max(1) as f64,
        summary,
    };
    Ok((evaluation, all))
}
