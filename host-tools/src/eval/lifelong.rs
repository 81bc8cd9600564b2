//! A session in the order of time: the probe learns a table from a few slides, then every later slide is an episode of its
//! own, and the probe continues to learn.

use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;
use tactus_core::explorer::{Config, Told};
use tactus_core::features::Observation;
use tactus_core::table::{Action, Contents, EncodeError, Table, retell};

use crate::eval::evaluate::{EvaluateError, explorer};
use crate::eval::experiment::Experiment;
use crate::eval::verdicts::Verdicts;

/// From whom the probe learns during the session.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Learning {
    /// From nobody.
    None,
    /// From its own certain verdicts.
    Itself,
    /// From these, and from the user where it is not certain.
    Asking,
}

/// What a session comes to.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Lifelong {
    /// From whom the probe learned.
    pub learning: Learning,
    /// Episodes of one slide.
    pub episodes: usize,
    /// Right first guesses, before anybody was asked.
    pub accuracy: f64,
    /// Those of the texture that fared worst, and its name.
    pub worst: (f64, String),
    /// Share of the episodes that the probe was not certain of: it asks a user for the label.
    pub uncertain: f64,
    /// Share of wrong labels among those that the probe gave itself.
    pub wrong_updates: f64,
    /// What the user would have been told after each episode's slide.
    pub verdicts: Verdicts,
}

/// One episode: what was presented, and what became of it.
struct Episode {
    texture: usize,
    right: bool,
    certain: bool,
    told: Told,
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
                let label = match learning {
                    Learning::None => None,
                    Learning::Itself => certain.then_some(best),
                    Learning::Asking => Some(if certain { best } else { texture }),
                };
                if let Some(label) = label {
                    learn(&mut bytes, label, movement, slide)?;
                }
                episodes.push(Episode {
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

/// The first guess from one slide, whether it is certain, and what the user is told.
fn look(
    experiment: &Experiment,
    config: Config,
    bytes: &[u8],
    movement: u8,
    slide: &Observation,
) -> Result<(usize, bool, Told), EvaluateError> {
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
    Ok((best.texture.into(), explorer.is_certain(), best.told()))
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
    let Contents::Fused(set, features) = table.contents() else {
        return Err(crate::eval::learn::TableError::Encode(EncodeError::Contents).into());
    };
    let vector = slide.vector(set, features.into()).unwrap_or_default();
    let white = table.whiten(movement, &vector).unwrap_or_default();
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
    Lifelong {
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
