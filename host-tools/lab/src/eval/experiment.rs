//! The experiment behind every quoted figure: slides to learn a table from, and slides of the unknown texture.
//!
//! A run is one virtual exploration: one texture is unknown, in turn, and each slide that an explorer asks for is drawn
//! from that texture's test slides: with replacement, as in the reference program, or each once, as `identify` has it.
//! Runs go in rounds, in which every texture is the unknown one once. The training slides of a round are drawn anew,
//! and its runs share the table: learning one takes a hundred times as long as a run.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;
use tactus_core::features::{FeatureSet, Movement, Observation, Properties, PropertySet};
use tactus_core::table::{self, OpenSet};

use crate::data::properties::PropertyTable;
use crate::data::replay::MeasuredSlide;
use crate::eval::enough::Enough;
use crate::eval::learn::Expected;
use crate::eval::show::count;

mod division;
mod protocol;
mod run;

use division::Division;
pub use protocol::Protocol;
pub use run::Run;

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

/// Sessions or runs that are named, at most.
const MOST_LISTED: usize = 12;

#[derive(Clone, PartialEq, Debug, Default)]
struct Pool {
    /// Slides from which training slides are drawn, in the order of time.
    train: Vec<Observation>,
    /// Slides of the unknown texture; without them, the rest after training.
    test: Option<Vec<Observation>>,
    /// The part of each slide of `train`, where parts are tested in turn; else empty.
    parts: Vec<usize>,
}

impl Pool {
    /// The slides to learn from while a part is tested.
    fn to_learn(&self, part: usize) -> Vec<usize> {
        match self.parts.is_empty() {
            true => (0..self.train.len()).collect(),
            false => self.places(|of| of != part),
        }
    }

    fn places(&self, is_wanted: impl Fn(usize) -> bool) -> Vec<usize> {
        let parts = self.parts.iter().enumerate();
        parts
            .filter(|(_, part)| is_wanted(**part))
            .map(|(at, _)| at)
            .collect()
    }
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
    /// Textures that are unknown in turn, for each part that is tested in turn; else one part for all.
    unknowns: Vec<Vec<usize>>,
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
    /// Figures that every table gets.
    pub(crate) open_set: Option<OpenSet>,
    once: bool,
    seed: u64,
    /// Sentences on what was left out of the recordings, or lowered, and on what is tested in turn.
    pub notes: Vec<String>,
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
            unknowns: vec![(0..names.len()).collect()],
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
            open_set: None,
            once: false,
            seed,
            notes: Vec::new(),
        }
    }

    /// Recorded slides. Without a second folder the test slides come from the first; those of the second from which is
    /// learned are left out. Textures with too few slides are left out, or fewer slides are learned from: see
    /// [`notes`](Self::notes).
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
        let division = Division::new(&names, observed, test, protocol, train_slides)?;
        let mut movements: Vec<Movement> = Vec::new();
        for slide in observed.iter().flatten() {
            if !movements.contains(&slide.movement) {
                movements.push(slide.movement);
            }
        }
        let has = |texture, movement| division.of(texture, movement).can_learn();
        let Enough {
            textures,
            movements,
            slides,
            mut notes,
        } = Enough::of(&names, &movements, train_slides, has).ok_or_else(|| {
            ExperimentError(
                "no texture has two slides to learn from and another to test on: record more of each, or try another \
                 --protocol"
                    .to_owned(),
            )
        })?;
        let mut left_out = 0;
        let pools: Vec<Vec<Pool>> = textures
            .iter()
            .map(|&texture| {
                let of = movements.iter().map(|&movement| {
                    let divided = division.of(texture, movement);
                    left_out += divided.left_out;
                    divided.pool(protocol, slides)
                });
                of.collect()
            })
            .collect();
        if left_out > 0 {
            let left_out = count(left_out as u64, "slide");
            notes.push(format!(
                "Left out of the test, as they may be learned from: {left_out}."
            ));
        }
        let unknowns = match division.parts.as_slice() {
            [] => vec![(0..textures.len()).collect()],
            parts => {
                let listed = parts
                    .iter()
                    .map(|[session, run]| format!("{session} {run}"));
                let listed: Vec<String> = listed.map(|part| part.trim().to_owned()).collect();
                let listed = listed.iter().take(MOST_LISTED).map(String::as_str);
                let more = if parts.len() > MOST_LISTED {
                    ", ..."
                } else {
                    ""
                };
                let listed = listed.collect::<Vec<_>>().join(", ");
                let turns = count(parts.len() as u64, "part");
                notes.push(format!("Tested in turn: {turns}, {listed}{more}."));
                let has = |part: usize, pools: &[Pool]| {
                    pools.iter().any(|pool| pool.parts.contains(&part))
                };
                let of = |part| (0..pools.len()).filter(|&t| has(part, &pools[t])).collect();
                (0..parts.len()).map(of).collect()
            }
        };
        let kept = textures.iter().map(|&texture| &observed[texture]);
        let measured = kept
            .flatten()
            .chain(test.iter().flat_map(|(_, slides)| slides.iter().flatten()));
        let measured = measured.fold(PropertySet::ALL, |set, s| {
            set.and(s.measurement.properties.measured())
        });
        let names = textures
            .iter()
            .map(|&texture| names[texture].clone())
            .collect();
        Ok(Self {
            drawn: protocol != Protocol::Drift,
            measured,
            unknowns,
            notes,
            ..Self::of(names, movements, pools, slides, seed)
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
            parts: Vec::new(),
        };
        let pools = train.into_iter().zip(test);
        let pools = pools.map(|(train, test)| train.into_iter().zip(test).map(pool).collect());
        let pools = pools.collect();
        Ok(Self {
            unknowns: vec![unknowns],
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
            test: Some(slides),
            ..Pool::default()
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
        let among = |there: &[usize]| {
            let textures = textures.iter().copied().map(usize::from);
            textures.filter(|texture| there.contains(texture)).collect()
        };
        Self {
            unknowns: self.unknowns.iter().map(|there| among(there)).collect(),
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

    /// Textures that are unknown in turn in a round of this number; its runs learn from the same slides.
    fn unknowns_of(&self, round: u64) -> &[usize] {
        &self.unknowns[(round % self.unknowns.len() as u64) as usize]
    }

    /// The number of the round that a run belongs to, and of the run in it.
    fn round_of(&self, run: u64) -> (u64, usize) {
        let all: u64 = self
            .unknowns
            .iter()
            .map(|textures| textures.len() as u64)
            .sum();
        let mut rest = (run % all) as usize;
        let mut round = run / all * self.unknowns.len() as u64;
        for textures in &self.unknowns {
            if rest < textures.len() {
                break;
            }
            rest -= textures.len();
            round += 1;
        }
        (round, rest)
    }

    /// Runs that learn from the same slides where these are drawn, one after the other.
    pub fn rounds(&self, runs: u64) -> Vec<Range<u64>> {
        let (mut rounds, mut begin) = (Vec::new(), 0);
        for round in 0.. {
            if begin >= runs {
                break;
            }
            let end = begin + self.unknowns_of(round).len() as u64;
            if end > begin {
                rounds.push(begin..end.min(runs));
            }
            begin = end;
        }
        rounds
    }

    /// Draws run number `run`. The same number gives the same run, whichever thread asks for it.
    pub fn run(&self, run: u64) -> Run<'_> {
        // runs count from below, rounds from above
        let (round, _) = self.round_of(run);
        let mut of_round = self.stream(u64::MAX - round);
        let begun = self.begin(run);
        Run {
            orders: self.orders(begun.part, &mut of_round),
            ..begun
        }
    }

    /// As [`Experiment::run`], with training slides of its own: for callers that learn a table for each run anyway.
    /// Runs are independent then.
    pub fn run_alone(&self, run: u64) -> Run<'_> {
        let mut alone = self.begin(run);
        alone.orders = self.orders(alone.part, &mut alone.random);
        alone
    }

    fn stream(&self, number: u64) -> ChaCha8Rng {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(number);
        random
    }

    fn begin(&self, run: u64) -> Run<'_> {
        let (round, at) = self.round_of(run);
        Run {
            experiment: self,
            part: (round % self.unknowns.len() as u64) as usize,
            orders: HashMap::new(),
            shown: HashSet::new(),
            unknown: self.unknowns_of(round)[at],
            random: self.stream(run),
        }
    }

    /// In which order slides are taken, by movement and how many there are.
    fn orders(&self, part: usize, random: &mut ChaCha8Rng) -> HashMap<(usize, usize), Vec<usize>> {
        // As in the reference program, the same places in the session are drawn for all textures: slides of one place
        // share what the session did to them.
        let mut orders: HashMap<(usize, usize), Vec<usize>> = HashMap::new();
        if self.drawn {
            for (movement, pool) in self.pools.iter().flat_map(|pools| pools.iter().enumerate()) {
                let slides = pool.to_learn(part).len();
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

#[cfg(test)]
mod tests;
