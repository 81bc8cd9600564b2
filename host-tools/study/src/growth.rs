//! How identification grows with the number of textures, in the simulated world: textures of one rig's collection and of those
//! of the worlds after it, since Table 1 names no more than 117.

use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;
use tactus_core::dsp::Plan;
use tactus_core::explorer::{Config, Method, NEGLIGIBLE, Strategy, Told};
use tactus_core::features::Observation;
use tactus_core::rig::calibration::RigCalibration;

use super::error::StudyError;
use crate::chart::{Chart, DrawError, Figure, MARKS, Series};
use tactus_lab::eval::evaluate::{EvaluateError, Outcome, explorer, play_with};
use tactus_lab::eval::experiment::Experiment;
use tactus_lab::eval::seconds::{self, mean_seconds};
use tactus_lab::eval::show::count;
use tactus_lab::sim::collection::{Collection, Trial, calibrated, record_texture, texture_name};
use tactus_world::world::Setup;

/// Trials of each texture and movement that a table is learned from ...
const LEARNED: usize = 5;
/// ... and those that are shown.
const SHOWN: usize = 3;
/// Textures that no table has.
pub const STRANGERS: usize = 40;
/// Explorations of known textures at each number of them, at least ...
const EXPLORATIONS: usize = 2000;
/// ... of which so many go with one table, or one with each texture: other tables are of other textures.
const WITH_A_TABLE: usize = 100;
/// Textures of a world.
const OF_A_WORLD: usize = 117;

/// A texture and its slides, per movement.
type Slides = (String, Vec<Vec<Observation>>);

/// Textures that were recorded under one finger.
#[derive(Clone, Debug)]
pub struct Pool {
    seed: u64,
    textures: Vec<Slides>,
    /// Textures of which the rig could not make all slides.
    pub left_out: usize,
}

/// What came of explorations among so many textures.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Row {
    /// Textures of a table.
    pub textures: usize,
    /// Tables, each of other textures where there are as many.
    pub tables: usize,
    /// Explorations of known textures.
    pub explorations: usize,
    /// Mean number of slides.
    pub slides: f64,
    /// Mean time that the rig takes, s.
    pub seconds: f64,
    /// Textures that are still likely after the first slide (mean): the work of a choice grows with their square.
    pub live: f64,
    /// The right name was told as sure, 0 to 1.
    pub right: f64,
    /// Wrong names among those told as sure, 0 to 1.
    pub wrong_when_sure: f64,
    /// Known textures that were told to be none of those known, 0 to 1.
    pub false_alarms: f64,
    /// Explorations of textures that the table does not have that were told so, 0 to 1.
    pub new_noticed: f64,
}

impl Pool {
    /// Records so many textures of a world and of those after it, all under the finger, motors and amplifier of the first.
    ///
    /// # Errors
    /// The rig cannot be calibrated.
    pub fn record(seed: u64, textures: usize, done: impl Fn() + Sync) -> Result<Self, StudyError> {
        let collection = Collection {
            seed,
            textures: Vec::new(),
            trials: 0,
        };
        let calibration =
            calibrated(collection.setup(1, 0)).map_err(|source| StudyError::Calibration {
                world: seed,
                source,
            })?;
        let plan = Plan::new();
        let all: Vec<Option<Slides>> = (0..textures)
            .into_par_iter()
            .map(|at| {
                let slides = record(&collection, at, calibration, &plan);
                done();
                slides
            })
            .collect();
        let left_out = all.iter().filter(|slides| slides.is_none()).count();
        Ok(Self {
            seed,
            textures: all.into_iter().flatten().collect(),
            left_out,
        })
    }

    /// Explores among so many of the textures, but for the last [`STRANGERS`]: with tables of several draws of them, until there
    /// are enough explorations.
    ///
    /// # Errors
    /// See [`EvaluateError`].
    pub fn explore(&self, textures: usize, done: impl Fn() + Sync) -> Result<Row, EvaluateError> {
        let (known, strangers) = self
            .textures
            .split_at(self.textures.len().saturating_sub(STRANGERS));
        let textures = textures.min(known.len());
        let with_a_table = WITH_A_TABLE.max(textures);
        let tables = EXPLORATIONS.div_ceil(with_a_table);
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(textures as u64);
        let mut order: Vec<usize> = (0..known.len()).collect();
        let (mut of_known, mut of_strangers, mut live) = (Vec::new(), Vec::new(), 0);
        for table in 0..tables {
            order.shuffle(&mut random);
            let drawn: Vec<&Slides> = order[..textures].iter().map(|&at| &known[at]).collect();
            let table = Played::new(&drawn, self.seed.wrapping_add(table as u64))?;
            let (outcomes, likely) = table.play(&table.experiment, with_a_table, &done)?;
            of_known.extend(outcomes);
            live += likely;
            let strangers: Vec<&Slides> = strangers.iter().collect();
            if !strangers.is_empty() {
                let shown = shown(&strangers, self.seed);
                of_strangers.extend(table.play(&shown, STRANGERS, &done)?.0);
            }
        }
        let share = |outcomes: &[Outcome], is: fn(&Outcome) -> bool| {
            let count = outcomes.iter().filter(|outcome| is(outcome)).count();
            count as f64 / outcomes.len().max(1) as f64
        };
        let is_new: fn(&Outcome) -> bool = |o| o.told == Told::New;
        let sure = share(&of_known, |o| o.told == Told::Sure);
        let right = share(&of_known, |o| o.told() == (Told::Sure, true));
        let count = of_known.len().max(1) as f64;
        let slides: f64 = of_known.iter().map(|o| f64::from(o.slides)).sum();
        Ok(Row {
            textures,
            tables,
            explorations: of_known.len(),
            slides: slides / count,
            seconds: mean_seconds(&of_known, &Collection::MOVEMENTS, seconds::RIG),
            live: live as f64 / count,
            right,
            wrong_when_sure: if sure > 0.0 {
                (sure - right) / sure
            } else {
                0.0
            },
            false_alarms: share(&of_known, is_new),
            new_noticed: share(&of_strangers, is_new),
        })
    }
}

/// All slides of a texture; `None` where the rig could not make them.
fn record(
    collection: &Collection,
    at: usize,
    calibration: RigCalibration,
    plan: &Plan,
) -> Option<Slides> {
    let texture = (at % OF_A_WORLD) as u8 + 1;
    let world = collection.seed.wrapping_add((at / OF_A_WORLD) as u64);
    let setup = Setup {
        samples_of: Some(world),
        shimmed: true,
        ..collection.setup(texture, (at / OF_A_WORLD) as u64)
    };
    let trials = LEARNED + SHOWN;
    let made = record_texture(setup, calibration, &Collection::MOVEMENTS, trials as u32).ok()?;
    let measured: Option<Vec<Observation>> = (1..)
        .zip(&made)
        .map(|(trial, slide)| {
            let at = Trial {
                world,
                texture,
                slide: Some((slide.movement, trial)),
            };
            at.measure(plan, slide).ok()
        })
        .collect();
    let slides = measured?.chunks(trials).map(<[_]>::to_vec).collect();
    Some((format!("{} {world}", texture_name(texture)), slides))
}

/// Which of the trials: the first are learned from, the last are shown.
fn part(textures: &[&Slides], from: usize, to: usize) -> Vec<Vec<Vec<Observation>>> {
    let of = |slides: &Vec<Observation>| slides[from..to].to_vec();
    let textures = textures.iter();
    textures
        .map(|(_, slides)| slides.iter().map(of).collect())
        .collect()
}

fn names(textures: &[&Slides]) -> Vec<String> {
    textures.iter().map(|(name, _)| name.clone()).collect()
}

/// Textures to show to a table that is there, no slide twice.
fn shown(textures: &[&Slides], seed: u64) -> Experiment {
    let slides = part(textures, LEARNED, LEARNED + SHOWN);
    let movements = Collection::MOVEMENTS.to_vec();
    Experiment::shown(names(textures), movements, slides, seed).each_slide_once()
}

/// A table, and the textures that it was learned from.
struct Played {
    bytes: Vec<u8>,
    experiment: Experiment,
}

impl Played {
    fn new(textures: &[&Slides], seed: u64) -> Result<Self, EvaluateError> {
        let experiment = Experiment::collected(
            names(textures),
            Collection::MOVEMENTS.to_vec(),
            part(textures, 0, LEARNED),
            part(textures, LEARNED, LEARNED + SHOWN),
            Some(LEARNED),
            seed,
        )
        .expect("every texture has all slides")
        .each_slide_once();
        let bytes = experiment.run(0).learn(Method::Fused)?;
        Ok(Self { bytes, experiment })
    }

    /// Explores textures of `shown`; how that ended, and how many textures were still likely after the first slides, all
    /// together.
    fn play(
        &self,
        shown: &Experiment,
        runs: usize,
        done: &(impl Fn() + Sync),
    ) -> Result<(Vec<Outcome>, usize), EvaluateError> {
        let config = Config {
            method: Method::Fused,
            open: true,
            ..Config::default()
        };
        let ready = explorer(&self.bytes, self.experiment.measured(), config, None)?;
        let one = |explorer: &mut Box<_>, index| {
            let mut live = 0;
            let run = shown.run(index);
            let outcome = play_with(explorer, None, Strategy::Bayesian, run, |_, explorer| {
                if explorer.slides() == 1 {
                    let likely = explorer.posterior().iter().filter(|p| **p >= NEGLIGIBLE);
                    live = likely.count();
                }
            });
            done();
            (outcome, live)
        };
        let runs = (0..runs as u64).into_par_iter();
        let played: Vec<_> = runs.map_init(|| ready.clone(), one).collect();
        let live = played.iter().map(|(_, live)| live).sum();
        Ok((
            played.into_iter().map(|(outcome, _)| outcome).collect(),
            live,
        ))
    }
}

/// Explorations that [`Pool::explore`] plays among so many textures.
pub fn explorations(textures: usize) -> usize {
    let with_a_table = WITH_A_TABLE.max(textures);
    EXPLORATIONS.div_ceil(with_a_table) * (with_a_table + STRANGERS)
}

/// What is told, and slides with the time they take, by the number of textures.
///
/// # Errors
/// See [`DrawError`].
pub fn figures(rows: &[Row]) -> Result<Vec<Figure>, DrawError> {
    let text = |x: f64| {
        let row = rows.get((x.round() as usize).wrapping_sub(1));
        row.map_or_else(String::new, |row| row.textures.to_string())
    };
    let curve = |at: usize, name: &str, unit: &str, of: fn(&Row) -> f64| {
        let mut curve = Series::curve(at, MARKS[at % MARKS.len()], name, Vec::new());
        for (n, row) in rows.iter().enumerate() {
            curve.points.push((n as f64 + 1.0, of(row)));
            let (value, textures) = (of(row), count(row.textures as u64, "texture"));
            curve
                .says
                .push(format!("{textures}: {value:.1}{unit} {name}"));
        }
        curve
    };
    let chart = |title: &str, y: &'static str, series: Vec<Series>| {
        let points = series.iter().flat_map(|s| &s.points);
        let top = 1.1 * points.map(|p| p.1).fold(0.1, f64::max);
        Chart {
            y_range: (0.0, top),
            x_marks: rows.len(),
            x_text: &text,
            ..Chart::new(
                title,
                "textures of the table",
                y,
                (0.5, rows.len() as f64 + 0.5),
                series,
            )
        }
    };
    let told = vec![
        curve(0, "the right name, told as sure", " %", |r| 100.0 * r.right),
        curve(1, "wrong among the sure", " %", |r| {
            100.0 * r.wrong_when_sure
        }),
        curve(2, "new textures noticed", " %", |r| 100.0 * r.new_noticed),
    ];
    let slides = vec![curve(0, "slides", "", |r| r.slides)];
    let seconds = vec![curve(0, "seconds", "", |r| r.seconds)];
    let live = vec![curve(0, "textures", "", |r| r.live)];
    Ok(vec![
        chart(
            "What is told, by the number of textures",
            "explorations (%)",
            told,
        )
        .figure("growth-told")?,
        chart("Slides until the answer", "slides (mean)", slides).figure("growth-slides")?,
        chart("Time until the answer", "seconds (mean)", seconds).figure("growth-seconds")?,
        chart(
            "Still likely after the first slide",
            "textures (mean)",
            live,
        )
        .figure("growth-live")?,
    ])
}
