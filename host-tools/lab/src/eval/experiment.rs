//! The experiment behind every quoted figure: slides to learn a table from, and slides of the unknown texture.
//!
//! A run is one virtual exploration: one texture is unknown, in turn, and each slide that an explorer asks for is drawn
//! from that texture's test slides: with replacement, as in the reference program, or each once, as `identify` has it.
//! Runs go in rounds, in which every texture is the unknown one once. The training slides of a round are drawn anew,
//! and its runs share the table: learning one takes a hundred times as long as a run.

use std::collections::{HashMap, HashSet};

use rand::seq::SliceRandom as _;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::explorer::Method;
use tactus_core::features::{FeatureSet, Movement, Observation, Properties, PropertySet};
use tactus_core::table;

use crate::data::properties::PropertyTable;
use crate::data::replay::MeasuredSlide;
use crate::eval::learn::{Expected, TableError, learn_for};
use crate::eval::show::count;

mod protocol;

pub use protocol::Protocol;

/// A reason why slides do not make an experiment.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct ExperimentError(String);

impl ExperimentError {
    /// More movements than a table holds.
    pub fn movements(number: usize) -> Self {
        let max = table::MAX_MOVEMENTS;
        Self(format!(
            "too many movements, {number}; a table holds {max} at most"
        ))
    }

    fn one(slides: usize) -> Self {
        Self(format!(
            "--train-slides {slides}: the spread of a texture's slides takes at least two slides"
        ))
    }

    fn training(texture: &str, movement: Movement, there: usize, wanted: usize) -> Self {
        let there = count(there as u64, "slide");
        Self(format!(
            "{texture}, {movement}: {there} to train from, and --train-slides is {wanted}; ask for fewer"
        ))
    }
}

/// Slides of a session that [`Protocol::Blocked`] trains from, out of [`SESSION`].
const BLOCKED_TRAINING: usize = 19;
const SESSION: usize = 34;
/// Limit of the slide numbers that blocked trains on, where a second folder brings the test slides ...
const BLOCKED_BELOW: u32 = 30;
const BLOCKED_ABOVE: u32 = 34;

#[derive(Clone, PartialEq, Debug, Default)]
struct Pool {
    /// Slides from which training slides are drawn, in the order of time.
    train: Vec<Observation>,
    /// Slides of the unknown texture; without them, the rest after training.
    test: Option<Vec<Observation>>,
}

/// A set of textures with a way to divide their slides.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// Names of the textures.
    pub names: Vec<String>,
    /// The movements.
    pub movements: Vec<Movement>,
    /// Per texture and movement.
    pools: Vec<Vec<Pool>>,
    unknowns: Vec<usize>,
    /// Textures that the unknown one can be, as far as the explorer knows; all, unless given.
    pub candidates: Option<Vec<u16>>,
    /// Training slides per texture and movement; the fewest of any, where all are used.
    pub train_slides: usize,
    /// Training slides are drawn; otherwise they are the first.
    drawn: bool,
    /// All training slides are used, as many as there happen to be; not with drawn ones.
    all: bool,
    /// The properties that every slide has.
    pub measured: PropertySet,
    /// Features of the fused method; the best there are, unless given.
    features: Option<FeatureSet>,
    expected: Expected,
    once: bool,
    seed: u64,
}

impl Experiment {
    /// Any of all textures is unknown, every slide has all properties, and the first slides are learned from.
    fn of(
        names: Vec<String>,
        movements: Vec<Movement>,
        pools: Vec<Vec<Pool>>,
        train_slides: usize,
        seed: u64,
    ) -> Self {
        Self {
            unknowns: (0..names.len()).collect(),
            names,
            movements,
            pools,
            candidates: None,
            train_slides,
            drawn: false,
            all: false,
            measured: PropertySet::ALL,
            features: None,
            expected: Expected::default(),
            once: false,
            seed,
        }
    }

    /// Recorded slides. Without a second folder the test slides come from the first.
    pub fn recorded(
        names: Vec<String>,
        observed: &[Vec<MeasuredSlide>],
        test: Option<(&[String], &[Vec<MeasuredSlide>])>,
        protocol: Protocol,
        train_slides: usize,
        seed: u64,
    ) -> Result<Self, ExperimentError> {
        if train_slides < 2 {
            return Err(ExperimentError::one(train_slides));
        }
        let mut movements: Vec<Movement> = Vec::new();
        for slide in observed.iter().flatten() {
            if !movements.contains(&slide.movement) {
                movements.push(slide.movement);
            }
        }
        let of = |slides: &[MeasuredSlide], movement| -> Vec<(u32, Observation)> {
            let same = slides.iter().filter(|s| s.movement == movement);
            same.map(|s| (s.number, Observation::from(&s.measurement)))
                .collect()
        };
        let properties =
            |slides: &[(u32, Observation)]| slides.iter().map(|s| s.1.clone()).collect::<Vec<_>>();
        let pool = |texture: usize, movement: Movement| {
            let mut train = of(&observed[texture], movement);
            let mut tested = match test {
                None => None,
                Some((others, slides)) => {
                    let other = others.iter().position(|name| *name == names[texture]);
                    let other = other.ok_or_else(|| {
                        let name = &names[texture];
                        ExperimentError(format!(
                            "the test folder has no {name}, which the training folder has; give a folder of the same \
                             textures"
                        ))
                    })?;
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
            let texture = &names[texture];
            if there < train_slides {
                return Err(ExperimentError::training(
                    texture,
                    movement,
                    there,
                    train_slides,
                ));
            }
            if pool.test.as_ref().map_or(there - train_slides, Vec::len) == 0 {
                return Err(ExperimentError(format!(
                    "{texture}, {movement}: no slide is left to test on; train on fewer slides or give more with --test"
                )));
            }
            Ok(pool)
        };
        let pools = (0..observed.len())
            .map(|texture| movements.iter().map(|&m| pool(texture, m)).collect())
            .collect::<Result<_, _>>()?;
        let slides = observed
            .iter()
            .flatten()
            .chain(test.iter().flat_map(|(_, slides)| slides.iter().flatten()));
        let measured = slides.fold(PropertySet::ALL, |set, s| {
            set.and(s.measurement.properties.measured())
        });
        Ok(Self {
            drawn: protocol != Protocol::Drift,
            measured,
            ..Self::of(names, movements, pools, train_slides, seed)
        })
    }

    /// Slides that were cut into properties elsewhere: per texture and movement, those to train from and those to test
    /// with. Textures without test slides are never the unknown one. Without `train_slides`, all training slides are
    /// used, not necessarily equally many, else the first so many.
    ///
    /// The movements have no force and speed; they stand in the table as the first cells of the grid.
    pub fn given(
        set: &PropertyTable,
        train_slides: Option<usize>,
        seed: u64,
    ) -> Result<Self, ExperimentError> {
        if set.movements.len() > table::MAX_MOVEMENTS {
            return Err(ExperimentError::movements(set.movements.len()));
        }
        let wrap = |sets: &[Vec<Vec<[f32; 3]>>]| -> Vec<Vec<Vec<Observation>>> {
            let slide = |t: &[f32; 3]| Observation::from(Properties::new(t.map(Some)));
            let slides = |trials: &Vec<[f32; 3]>| trials.iter().map(slide).collect();
            sets.iter()
                .map(|texture| texture.iter().map(slides).collect())
                .collect()
        };
        Self::collected(
            set.textures.clone(),
            Movement::grid().take(set.movements.len()).collect(),
            wrap(&set.train),
            wrap(&set.validate),
            train_slides,
            seed,
        )
    }

    /// Slides that were divided when they were collected: per texture and movement, those to train from, of which all
    /// or the first `train_slides` are used, and those to test with. Textures without test slides are never the unknown
    /// one. A table holds [`table::MAX_MOVEMENTS`] movements.
    pub fn collected(
        names: Vec<String>,
        movements: Vec<Movement>,
        train: Vec<Vec<Vec<Observation>>>,
        test: Vec<Vec<Vec<Observation>>>,
        train_slides: Option<usize>,
        seed: u64,
    ) -> Result<Self, ExperimentError> {
        if let Some(one @ ..2) = train_slides {
            return Err(ExperimentError::one(one));
        }
        for (texture, row) in names.iter().zip(&train) {
            let wanted = train_slides.unwrap_or(2);
            let short = |(_, trials): &(_, &Vec<_>)| trials.len() < wanted;
            if let Some((&movement, trials)) = movements.iter().zip(row).find(short) {
                let there = trials.len();
                return Err(match train_slides {
                    Some(wanted) => ExperimentError::training(texture, movement, there, wanted),
                    None => ExperimentError(format!(
                        "{texture}, {movement}: {there} training slide; the spread of a texture's slides takes at \
                         least two"
                    )),
                });
            }
        }
        let fewest = train.iter().flatten().map(Vec::len).min().unwrap_or(0);
        let tested = |slides: &Vec<Vec<_>>| slides.iter().all(|trials| !trials.is_empty());
        let unknowns = (0..names.len()).filter(|&t| tested(&test[t])).collect();
        let pool = |(train, test)| Pool {
            train,
            test: Some(test),
        };
        let pools = train.into_iter().zip(test);
        let pools = pools.map(|(train, test)| train.into_iter().zip(test).map(pool).collect());
        let pools = pools.collect();
        Ok(Self {
            unknowns,
            all: train_slides.is_none(),
            ..Self::of(
                names,
                movements,
                pools,
                train_slides.unwrap_or(fewest),
                seed,
            )
        })
    }

    /// Slides to show to a table that is there, per texture and movement; none of them is to be learned from.
    pub fn shown(
        names: Vec<String>,
        movements: Vec<Movement>,
        slides: Vec<Vec<Vec<Observation>>>,
        seed: u64,
    ) -> Self {
        let pool = |slides| Pool {
            train: Vec::new(),
            test: Some(slides),
        };
        let pools = slides.into_iter();
        let pools = pools.map(|texture| texture.into_iter().map(pool).collect());
        Self {
            all: true,
            ..Self::of(names, movements, pools.collect(), 0, seed)
        }
    }

    /// The same with fused tables that expect this.
    #[must_use]
    pub fn expecting(self, expected: Expected) -> Self {
        Self { expected, ..self }
    }

    /// The same with other features for the fused method.
    #[must_use]
    pub fn with_features(self, features: Option<FeatureSet>) -> Self {
        Self { features, ..self }
    }

    /// The same, and no run shows a slide twice: as with [`crate::data::replay::Replay`], a movement without a slide
    /// left is not made.
    #[must_use]
    pub(crate) fn each_slide_once(self) -> Self {
        Self { once: true, ..self }
    }

    /// The same among a few textures only: one of them is unknown, and the explorer knows that it is one of them.
    #[must_use]
    pub fn among(self, textures: &[u16]) -> Self {
        Self {
            unknowns: textures.iter().copied().map(usize::from).collect(),
            candidates: Some(textures.to_vec()),
            ..self
        }
    }

    /// All slides of a texture in the order of time, by movement: those to learn from, and those after them.
    pub fn session(&self, texture: usize) -> Vec<(&[Observation], &[Observation])> {
        let pools = self.pools.get(texture).map_or(&[][..], Vec::as_slice);
        pools
            .iter()
            .map(|pool| {
                let later = pool.test.as_deref().unwrap_or_default();
                (pool.train.as_slice(), later)
            })
            .collect()
    }

    /// Returns true if every run learns from the same slides.
    pub fn is_fixed(&self) -> bool {
        !self.drawn
    }

    /// Runs of a round: so many, one after the other, learn from the same slides, where these are drawn.
    pub fn round(&self) -> u64 {
        self.unknowns.len() as u64
    }

    /// Draws run number `run`. The same number gives the same run, whichever thread asks for it.
    pub fn run(&self, run: u64) -> Run<'_> {
        // runs count from below, rounds from above
        let mut of_round = self.stream(u64::MAX - run / self.round());
        Run {
            orders: self.orders(&mut of_round),
            ..self.begin(run)
        }
    }

    /// As [`Experiment::run`], with training slides of its own: for callers that learn a table for each run anyway.
    /// Runs are independent then.
    pub fn run_alone(&self, run: u64) -> Run<'_> {
        let mut alone = self.begin(run);
        alone.orders = self.orders(&mut alone.random);
        alone
    }

    fn stream(&self, number: u64) -> ChaCha8Rng {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(number);
        random
    }

    fn begin(&self, run: u64) -> Run<'_> {
        Run {
            experiment: self,
            orders: HashMap::new(),
            shown: HashSet::new(),
            unknown: self.unknowns[(run % self.round()) as usize],
            random: self.stream(run),
        }
    }

    /// In which order slides are taken, by movement and how many there are.
    fn orders(&self, random: &mut ChaCha8Rng) -> HashMap<(usize, usize), Vec<usize>> {
        // As in the reference program, the same places in the session are drawn for all textures: slides of one place
        // share what the session did to them.
        let mut orders: HashMap<(usize, usize), Vec<usize>> = HashMap::new();
        if self.drawn {
            for (movement, pool) in self.pools.iter().flat_map(|pools| pools.iter().enumerate()) {
                let slides = pool.train.len();
                orders.entry((movement, slides)).or_insert_with(|| {
                    let mut order: Vec<usize> = (0..slides).collect();
                    order.shuffle(random);
                    order
                });
            }
        }
        orders
    }
}

/// One virtual exploration, ready to begin.
#[derive(Clone, Debug)]
pub struct Run<'e> {
    experiment: &'e Experiment,
    /// In which order slides are taken, by movement and how many there are; that of time, where nothing is drawn.
    orders: HashMap<(usize, usize), Vec<usize>>,
    /// Slides that were shown, by movement and place, where each is shown once.
    shown: HashSet<(usize, usize)>,
    /// The texture to be identified.
    pub unknown: usize,
    /// Drawn from for the slides; an explorer's own random choices go through it too.
    pub random: ChaCha8Rng,
}

impl<'e> Run<'e> {
    /// Training slides per texture and movement.
    pub fn training(&self) -> Vec<Vec<Vec<Observation>>> {
        let of = |(movement, pool): (usize, &Pool)| {
            let learned = match self.experiment.all {
                true => 0..pool.train.len(),
                false => 0..self.experiment.train_slides,
            };
            let slides = learned.map(|n| pool.train[self.place(movement, pool, n)].clone());
            slides.collect()
        };
        let pools = self.experiment.pools.iter();
        pools
            .map(|pools| pools.iter().enumerate().map(of).collect())
            .collect()
    }

    /// Place of the `n`th slide of a pool: the training slides come first, then those to test with.
    fn place(&self, movement: usize, pool: &Pool, n: usize) -> usize {
        let order = self.orders.get(&(movement, pool.train.len()));
        order.map_or(n, |order| order[n])
    }

    /// The texture table learned from the training slides, as bytes.
    pub fn learn(&self, method: Method) -> Result<Vec<u8>, TableError> {
        let of = self.experiment;
        learn_for(
            &of.expected,
            method,
            of.features,
            &of.names,
            &of.movements,
            &self.training(),
        )
    }

    pub(crate) fn learn_without(
        &self,
        method: Method,
        out: &[usize],
    ) -> Result<Vec<u8>, TableError> {
        let of = self.experiment;
        let all = (0..).zip(of.names.iter().cloned().zip(self.training()));
        let kept = all.filter(|(texture, _)| !out.contains(texture));
        let (names, training): (Vec<_>, Vec<_>) = kept.map(|(_, of)| of).unzip();
        let expected = &of.expected;
        learn_for(
            expected,
            method,
            of.features,
            &names,
            &of.movements,
            &training,
        )
    }

    /// One more slide of the unknown texture; `None` where each is shown once, and all of this movement were.
    pub fn slide(&mut self, movement: usize) -> Option<&'e Observation> {
        let n = self.draw(movement)?;
        let of = self.experiment;
        let pool = &of.pools[self.unknown][movement];
        Some(match &pool.test {
            Some(test) => &test[n],
            None => &pool.train[self.place(movement, pool, of.train_slides + n)],
        })
    }

    pub(super) fn draw(&mut self, movement: usize) -> Option<usize> {
        let pool = &self.experiment.pools[self.unknown][movement];
        let learned = self.experiment.train_slides;
        let slides = match &pool.test {
            Some(test) => test.len(),
            None => pool.train.len() - learned,
        };
        if self
            .shown
            .iter()
            .filter(|slide| slide.0 == movement)
            .count()
            == slides
        {
            return None;
        }
        loop {
            // drawn again until it is a new one: so the first slide of a run is the same either way
            let n = self.random.random_range(0..slides);
            if !self.experiment.once || self.shown.insert((movement, n)) {
                break Some(n);
            }
        }
    }
}
