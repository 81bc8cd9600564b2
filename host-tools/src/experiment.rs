//! What every quoted figure means: which slides a table is learned from, and which the unknown texture shows.
//!
//! A run is one virtual exploration. Its training slides are drawn anew, one texture is unknown (in turn), and each slide
//! that an explorer asks for is drawn with replacement from that texture's test slides.

use std::collections::HashMap;

use rand::seq::SliceRandom as _;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::features::{Properties, PropertySet};
use tactus_core::movement::Movement;
use tactus_core::table::{self, EncodeError, Experience};

use crate::properties::PropertyTable;
use crate::replay::Felt;

/// How slides are divided into training and test.
#[derive(Clone, Copy, PartialEq, Eq, Debug, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Protocol {
    /// Training slides at random from all of a session, tested on the rest: optimistic.
    Interleaved,
    /// Training slides at random from the first 19 of 34 (of another number, the same share), tested on the later ones;
    /// with --test, trained on slide numbers below 30 and tested on those above 34.
    Blocked,
    /// Trained on the first slides of a session, tested on all later ones; with --test, on all of that folder.
    Drift,
}

/// Slides of a session that [`Protocol::Blocked`] trains from, out of [`SESSION`].
const BLOCKED_TRAINING: usize = 19;
/// Slides of a session in data/biotac.
const SESSION: usize = 34;
/// Where a second folder brings the test slides, blocked trains on slide numbers below this ...
const BLOCKED_BELOW: u32 = 30;
/// ... and tests on numbers above this.
const BLOCKED_ABOVE: u32 = 34;

/// Why an experiment cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ExperimentError {
    /// Too few slides.
    #[error(
        "{texture}, {movement}: {there} slides to train from, and --train-slides is {wanted}; ask for fewer"
    )]
    Training {
        /// Name of the texture.
        texture: String,
        /// The movement.
        movement: Movement,
        /// Slides there are.
        there: usize,
        /// Slides asked for.
        wanted: usize,
    },
    /// Nothing left to test on.
    #[error(
        "{texture}, {movement}: no slide is left to test on; train on fewer slides or give more with --test"
    )]
    Test {
        /// Name of the texture.
        texture: String,
        /// The movement.
        movement: Movement,
    },
    /// A standard deviation needs two slides.
    #[error("--train-slides {0}: a standard deviation takes at least two slides")]
    One(usize),
    /// The folder of test slides lacks something.
    #[error(
        "the test folder has no {0}, which the training folder has; give a folder of the same textures"
    )]
    Missing(String),
    /// More movements than a table holds.
    #[error("{0} movements; a table holds {max} at most", max = table::MAX_MOVEMENTS)]
    Movements(usize),
    /// The table cannot hold what was felt.
    #[error("the table cannot be written")]
    Encode(#[from] EncodeError),
}

/// Slides of one texture and movement.
#[derive(Clone, PartialEq, Debug, Default)]
struct Pool {
    /// What training slides are drawn from, in the order of time.
    train: Vec<Properties>,
    /// What the unknown texture shows; without it, what training has left over.
    test: Option<Vec<Properties>>,
}

/// A set of textures with a way to divide their slides.
#[derive(Clone, Debug)]
pub struct Experiment {
    names: Vec<String>,
    movements: Vec<Movement>,
    /// Per texture and movement.
    pools: Vec<Vec<Pool>>,
    /// Textures that can be the unknown one.
    unknowns: Vec<usize>,
    /// Training slides per texture and movement.
    train_slides: usize,
    /// Training slides are drawn; otherwise they are the first.
    drawn: bool,
    measured: PropertySet,
    seed: u64,
}

impl Experiment {
    /// Recorded slides. Without a second folder the test slides come from the first.
    ///
    /// # Errors
    /// See [`ExperimentError`].
    pub fn recorded(
        names: Vec<String>,
        felt: &[Vec<Felt>],
        test: Option<(&[String], &[Vec<Felt>])>,
        protocol: Protocol,
        train_slides: usize,
        seed: u64,
    ) -> Result<Self, ExperimentError> {
        if train_slides < 2 {
            return Err(ExperimentError::One(train_slides));
        }
        let mut movements: Vec<Movement> = Vec::new();
        for slide in felt.iter().flatten() {
            if !movements.contains(&slide.movement) {
                movements.push(slide.movement);
            }
        }
        let of = |slides: &[Felt], movement| -> Vec<(u32, Properties)> {
            let same = slides.iter().filter(|s| s.movement == movement);
            same.map(|s| (s.number, s.measurement.properties)).collect()
        };
        let properties =
            |slides: &[(u32, Properties)]| slides.iter().map(|s| s.1).collect::<Vec<_>>();
        let pool = |texture: usize, movement: Movement| {
            let mut train = of(&felt[texture], movement);
            let mut tested = match test {
                None => None,
                Some((others, slides)) => {
                    let other = others.iter().position(|name| *name == names[texture]);
                    let other =
                        other.ok_or_else(|| ExperimentError::Missing(names[texture].clone()))?;
                    Some(of(&slides[other], movement))
                }
            };
            match (protocol, &mut tested) {
                (Protocol::Interleaved, _) | (Protocol::Drift, Some(_)) => {}
                (Protocol::Blocked, Some(tested)) => {
                    train.retain(|s| s.0 < BLOCKED_BELOW);
                    tested.retain(|s| s.0 > BLOCKED_ABOVE);
                }
                (Protocol::Blocked, None) => {
                    let first = (train.len() * BLOCKED_TRAINING + SESSION / 2) / SESSION;
                    tested = Some(train.split_off(first));
                }
                (Protocol::Drift, None) => {
                    tested = Some(train.split_off(train_slides.min(train.len())));
                }
            }
            let there = train.len();
            let pool = Pool {
                train: properties(&train),
                test: tested.as_deref().map(properties),
            };
            let texture = || names[texture].clone();
            if there < train_slides {
                return Err(ExperimentError::Training {
                    texture: texture(),
                    movement,
                    there,
                    wanted: train_slides,
                });
            }
            if pool.test.as_ref().map_or(there - train_slides, Vec::len) == 0 {
                return Err(ExperimentError::Test {
                    texture: texture(),
                    movement,
                });
            }
            Ok(pool)
        };
        let pools = (0..felt.len())
            .map(|texture| movements.iter().map(|&m| pool(texture, m)).collect())
            .collect::<Result<_, _>>()?;
        let slides = felt
            .iter()
            .flatten()
            .chain(test.iter().flat_map(|(_, slides)| slides.iter().flatten()));
        let measured = slides.fold(PropertySet::ALL, |set, s| {
            set.and(s.measurement.properties.measured())
        });
        Ok(Self {
            unknowns: (0..names.len()).collect(),
            names,
            movements,
            pools,
            train_slides,
            drawn: protocol != Protocol::Drift,
            measured,
            seed,
        })
    }

    /// Slides that were cut into properties elsewhere: per texture and movement, those to train from and those to test
    /// with. Textures without test slides are never the unknown one. Without `train_slides`, all training slides are used,
    /// else the first so many.
    ///
    /// The movements have no force and speed; they stand in the table as the first cells of the grid.
    ///
    /// # Errors
    /// See [`ExperimentError`].
    pub fn given(
        set: &PropertyTable,
        train_slides: Option<usize>,
        seed: u64,
    ) -> Result<Self, ExperimentError> {
        if set.movements.len() > table::MAX_MOVEMENTS {
            return Err(ExperimentError::Movements(set.movements.len()));
        }
        let there = set.train.iter().flatten().map(Vec::len).min().unwrap_or(0);
        let train_slides = train_slides.unwrap_or(there);
        if train_slides < 2 {
            return Err(ExperimentError::One(train_slides));
        }
        let movements: Vec<Movement> = Movement::grid().take(set.movements.len()).collect();
        if let (true, [texture, ..], [movement, ..]) =
            (train_slides > there, &set.textures[..], &movements[..])
        {
            let (texture, movement) = (texture.clone(), *movement);
            return Err(ExperimentError::Training {
                texture,
                movement,
                there,
                wanted: train_slides,
            });
        }
        let wrap = |trials: &[[f32; 3]]| {
            trials
                .iter()
                .map(|t| Properties::new(t.map(Some)))
                .collect::<Vec<_>>()
        };
        let pools = set
            .train
            .iter()
            .zip(&set.validate)
            .map(|(train, validate)| {
                let pairs = train.iter().zip(validate);
                pairs
                    .map(|(train, test)| Pool {
                        train: wrap(train),
                        test: Some(wrap(test)),
                    })
                    .collect()
            });
        let tested = |validate: &[Vec<[f32; 3]>]| validate.iter().all(|trials| !trials.is_empty());
        Ok(Self {
            names: set.textures.clone(),
            movements,
            pools: pools.collect(),
            unknowns: (0..set.textures.len())
                .filter(|&t| tested(&set.validate[t]))
                .collect(),
            train_slides,
            drawn: false,
            measured: PropertySet::ALL,
            seed,
        })
    }

    /// Names of the textures.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The movements.
    pub fn movements(&self) -> &[Movement] {
        &self.movements
    }

    /// The properties that every slide has.
    pub fn measured(&self) -> PropertySet {
        self.measured
    }

    /// Training slides per texture and movement.
    pub fn train_slides(&self) -> usize {
        self.train_slides
    }

    /// Whether every run learns from the same slides.
    pub fn is_fixed(&self) -> bool {
        !self.drawn
    }

    /// Draws run number `run`. The same number gives the same run, whichever thread asks for it.
    pub fn run(&self, run: u64) -> Run<'_> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(run);
        let unknown = self.unknowns[(run % self.unknowns.len() as u64) as usize];
        let mut shown: Vec<Vec<Properties>> = Vec::new();
        // As in the reference program, the same places in the session are drawn for all textures: slides of one place share
        // what the session did to them.
        let mut orders: HashMap<(usize, usize), Vec<usize>> = HashMap::new();
        let mut training = Vec::with_capacity(self.pools.len());
        for (texture, pools) in self.pools.iter().enumerate() {
            let mut of_texture = Vec::with_capacity(pools.len());
            for (movement, pool) in pools.iter().enumerate() {
                let order = orders
                    .entry((movement, pool.train.len()))
                    .or_insert_with(|| {
                        let mut order: Vec<usize> = (0..pool.train.len()).collect();
                        if self.drawn {
                            order.shuffle(&mut random);
                        }
                        order
                    });
                let (learned, rest) = order.split_at(self.train_slides);
                let slides = |at: &[usize]| at.iter().map(|&i| pool.train[i]).collect::<Vec<_>>();
                if texture == unknown {
                    shown.push(pool.test.clone().unwrap_or_else(|| slides(rest)));
                }
                of_texture.push(slides(learned));
            }
            training.push(of_texture);
        }
        Run {
            experiment: self,
            training,
            unknown,
            shown,
            random,
        }
    }
}

/// One virtual exploration, ready to begin.
#[derive(Clone, Debug)]
pub struct Run<'e> {
    experiment: &'e Experiment,
    /// Training slides per texture and movement.
    pub training: Vec<Vec<Vec<Properties>>>,
    /// The texture to be identified.
    pub unknown: usize,
    /// Its test slides, per movement.
    shown: Vec<Vec<Properties>>,
    /// Drawn from for the slides; an explorer's own random choices go through it too.
    pub random: ChaCha8Rng,
}

impl Run<'_> {
    /// The texture table learned from the training slides, as bytes.
    ///
    /// # Errors
    /// See [`EncodeError`].
    pub fn learn(&self) -> Result<Vec<u8>, EncodeError> {
        let Experiment {
            names,
            movements,
            measured,
            ..
        } = self.experiment;
        let experience: Vec<Vec<Experience>> = self
            .training
            .iter()
            .map(|movements| {
                movements
                    .iter()
                    .map(|slides| learned(*measured, slides))
                    .collect()
            })
            .collect();
        encode(*measured, movements, names, &experience)
    }

    /// One more slide of the unknown texture.
    pub fn slide(&mut self, movement: usize) -> Properties {
        let slides = &self.shown[movement];
        slides[self.random.random_range(0..slides.len())]
    }
}

/// What these slides teach. All of them have the properties of `measured`.
pub fn learned(measured: PropertySet, slides: &[Properties]) -> Experience {
    let mut experience = Experience::default();
    for slide in slides {
        // a slide that lacks a property was not counted into `measured`
        let _ = experience.learn(measured, slide);
    }
    experience
}

/// Writes a table of any size.
///
/// # Errors
/// See [`EncodeError`].
pub fn encode(
    measured: PropertySet,
    movements: &[Movement],
    names: &[String],
    experience: &[Vec<Experience>],
) -> Result<Vec<u8>, EncodeError> {
    let textures = names
        .iter()
        .zip(experience)
        .map(|(name, experience)| table::Texture { name, experience });
    let length = table::encoded_len(
        names.len(),
        movements.len(),
        names.iter().map(|n| n.len() + 1).sum(),
    );
    let mut bytes = vec![0; length];
    table::encode(&mut bytes, measured, movements, textures)?;
    Ok(bytes)
}
