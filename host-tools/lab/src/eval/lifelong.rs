//! A session in the order of time: the probe learns a table from a few slides, then every later slide is an episode of
//! its own, and the probe continues to learn.

use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;
use tactus_core::explorer::{Config, VerdictKind};
use tactus_core::features::{Observation, Vector, WHITE_STEPS};
use tactus_core::table::{Action, Contents, EncodeError, Table, retell};

use crate::eval::evaluate::{EvaluateError, explorer};
use crate::eval::experiment::Experiment;
use crate::eval::verdicts::Verdicts;

/// The teacher of the probe during the session.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Learning {
    /// Nobody.
    None,
    /// Its own certain verdicts.
    Itself,
    /// These, and the user where it is not certain.
    Asking,
}

impl Learning {
    /// The probe's rule, for people.
    pub fn words(self) -> &'static str {
        match self {
            Self::None => "learning nothing",
            Self::Itself => "learning by itself",
            Self::Asking => "asking where uncertain",
        }
    }
}

/// The result of a session.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Lifelong {
    /// The teacher of the probe.
    pub learning: Learning,
    /// Episodes of one slide.
    pub episodes: usize,
    /// Share of right first guesses, before a label.
    pub accuracy: f64,
    /// Those of the texture that fared worst, and its name.
    pub worst: (f64, String),
    /// Share of the episodes that the probe was not certain of: it asks a user for the label.
    pub uncertain: f64,
    /// Share of wrong labels among those that the probe gave itself.
    pub wrong_updates: f64,
    /// Verdicts after each episode's slide.
    pub verdicts: Verdicts,
    /// The session, slide by slide.
    pub over_time: Vec<Moment>,
    /// The same for each texture.
    pub by_texture: Vec<TextureCourse>,
}

/// A moment of a session: of each texture the slide of this number.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Moment {
    /// Counts the slides of a texture and movement after those that were learned from, from 1.
    pub slide: usize,
    /// Episodes of it.
    pub episodes: usize,
    /// Distance of the slides from the table's means of their textures then: root mean square over features and
    /// episodes, in standard deviations between slides of one texture.
    pub distance_sd: f64,
    /// Shares of the verdicts.
    pub verdicts: Verdicts,
}

/// Distance of the slides of a texture from the table's mean of it, slide by slide.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct TextureCourse {
    /// Its name.
    pub texture: String,
    /// As [`Moment::distance_sd`].
    pub distance_sd: Vec<f64>,
}

/// One episode: its texture, and its result.
struct Episode {
    /// Place of the slide in its texture's session, from 0.
    time: usize,
    texture: usize,
    right: bool,
    certain: bool,
    told: VerdictKind,
    /// Mean square distance from the table's mean of the texture, over features.
    square: f64,
}

/// Plays so many sessions with every kind of learning; they differ in the order of the textures.
///
/// # Errors
/// See [`EvaluateError`]; the method must be fused.
pub fn lifelong(
    experiment: &Experiment,
    config: Config,
    sessions: u64,
    seed: u64,
    done: impl Fn() + Sync,
) -> Result<Vec<Lifelong>, EvaluateError> {
    [Learning::None, Learning::Itself, Learning::Asking]
        .into_iter()
        .map(|learning| {
            let episodes: Vec<Episode> = (0..sessions)
                .into_par_iter()
                .map(|session| {
                    let mut random = ChaCha8Rng::seed_from_u64(seed);
                    random.set_stream(session);
                    let episodes = play(experiment, config, learning, random);
                    done();
                    episodes
                })
                .collect::<Result<Vec<_>, EvaluateError>>()?
                .into_iter()
                .flatten()
                .collect();
            Ok(sum_up(learning, &episodes, experiment.names()))
        })
        .collect()
}

fn play(
    experiment: &Experiment,
    config: Config,
    learning: Learning,
    mut random: ChaCha8Rng,
) -> Result<Vec<Episode>, EvaluateError> {
    let mut bytes = experiment.run(0).learn(config.method)?;
    let mut order: Vec<usize> = (0..experiment.names().len()).collect();
    let later: Vec<_> = order.iter().map(|&t| experiment.session(t)).collect();
    let longest = later.iter().flatten().map(|(_, later)| later.len()).max();
    let mut episodes = Vec::new();
    for time in 0..longest.unwrap_or(0) {
        order.shuffle(&mut random);
        for &texture in &order {
            for (movement, (_, later)) in (0..).zip(&later[texture]) {
                let Some(slide) = later.get(time) else {
                    continue;
                };
                let (best, certain, told) = look(experiment, config, &bytes, movement, slide)?;
                let square = square(&bytes, texture, movement, slide)?;
                let label = match learning {
                    Learning::None => None,
                    Learning::Itself => certain.then_some(best),
                    Learning::Asking => Some(if certain { best } else { texture }),
                };
                if let Some(label) = label {
                    learn(&mut bytes, label, movement, slide)?;
                }
                episodes.push(Episode {
                    time,
                    square,
                    texture,
                    right: best == texture,
                    certain,
                    told,
                });
            }
        }
    }
    Ok(episodes)
}

/// The first guess from one slide, true if it is certain, and the verdict.
fn look(
    experiment: &Experiment,
    config: Config,
    bytes: &[u8],
    movement: u8,
    slide: &Observation,
) -> Result<(usize, bool, VerdictKind), EvaluateError> {
    let config = Config {
        open: true,
        ..config
    };
    let mut explorer = explorer(bytes, experiment.measured(), config, None)?;
    let action = Action {
        movement,
        property: None,
    };
    explorer
        .observe(action, slide)
        .expect("every slide has the features that the table was learned from");
    let best = explorer.best();
    Ok((best.texture.into(), explorer.is_certain(), best.kind()))
}

/// A slide as the table whitens it.
fn whitened(table: &Table<'_>, movement: u8, slide: &Observation) -> Result<Vector, EvaluateError> {
    let Contents::Fused(set, features) = table.contents() else {
        return Err(crate::eval::learn::TableError::Encode(EncodeError::Contents).into());
    };
    let vector = slide.vector(set, features.into()).unwrap_or_default();
    Ok(table.whiten(movement, &vector).unwrap_or_default())
}

/// Mean square distance of a slide from the table's mean of its texture, over features.
fn square(
    bytes: &[u8],
    texture: usize,
    movement: u8,
    slide: &Observation,
) -> Result<f64, EvaluateError> {
    let table = Table::read(bytes)?;
    let white = whitened(&table, movement, slide)?;
    let known = table.whitened(texture as u16, movement);
    let apart = white.iter().zip(known.mean);
    let apart = apart.map(|(z, mean)| f64::from(*z) - f64::from(mean));
    let sum: f64 = apart
        .map(|steps| (steps / f64::from(WHITE_STEPS)).powi(2))
        .sum();
    Ok(sum / white.len().max(1) as f64)
}

/// Learns a slide of a texture, as the probe does.
fn learn(
    bytes: &mut [u8],
    texture: usize,
    movement: u8,
    slide: &Observation,
) -> Result<(), EvaluateError> {
    let table = Table::read(bytes)?;
    let texture = texture as u16;
    let white = whitened(&table, movement, slide)?;
    let mut known = table.whitened(texture, movement);
    known.adapt(&white);
    let tally = table.tally(texture);
    retell(bytes, texture, movement, &known, tally)
        .map_err(crate::eval::learn::TableError::from)?;
    Ok(())
}

fn sum_up(learning: Learning, episodes: &[Episode], names: &[String]) -> Lifelong {
    let share = |part: usize, of: usize| part as f64 / of.max(1) as f64;
    let right = |of: &dyn Fn(&Episode) -> bool| {
        let all = episodes.iter().filter(|v| of(v));
        share(all.clone().filter(|v| v.right).count(), all.count())
    };
    let of_each = (0..names.len()).map(|texture| (right(&|v| v.texture == texture), texture));
    let worst = of_each.min_by(|a, b| a.0.total_cmp(&b.0));
    let certain = episodes.iter().filter(|v| v.certain);
    let wrong = certain.clone().filter(|v| !v.right).count();
    let times = episodes.iter().map(|v| v.time + 1).max().unwrap_or(0);
    let distance_sd = |of: &dyn Fn(&Episode) -> bool| {
        let squares: Vec<f64> = episodes
            .iter()
            .filter(|v| of(v))
            .map(|v| v.square)
            .collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    };
    let moment = |time: usize| {
        let of: Vec<&Episode> = episodes.iter().filter(|v| v.time == time).collect();
        Moment {
            slide: time + 1,
            episodes: of.len(),
            distance_sd: distance_sd(&|v| v.time == time),
            verdicts: Verdicts::of(of.iter().map(|v| (v.told, v.right))),
        }
    };
    let course = |(at, name): (usize, &String)| {
        let own = |v: &&Episode| v.texture == at;
        let times = episodes.iter().filter(own).map(|v| v.time + 1).max();
        TextureCourse {
            texture: name.clone(),
            distance_sd: (0..times.unwrap_or(0))
                .map(|time| distance_sd(&|v| v.texture == at && v.time == time))
                .collect(),
        }
    };
    Lifelong {
        over_time: (0..times).map(moment).collect(),
        by_texture: names.iter().enumerate().map(course).collect(),
        learning,
        episodes: episodes.len(),
        accuracy: right(&|_| true),
        worst: worst.map_or((0.0, String::new()), |(share, at)| {
            (share, names[at].clone())
        }),
        uncertain: share(episodes.len() - certain.clone().count(), episodes.len()),
        wrong_updates: share(wrong, certain.count()),
        verdicts: Verdicts::of(episodes.iter().map(|v| (v.told, v.right))),
    }
}
