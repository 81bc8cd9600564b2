//! Bayesian exploration: the posterior of every texture (eq. 1-4), and the next movement, which is the one that should
//! leave the least confusion among the textures that are still likely (eq. 7, 11-13).
//!
//! Probabilities are kept as logarithms in fixed point, and in f32. Host and chip use the same operations in the same order, so
//! they agree to the bit.

use core::fmt;
use core::marker::PhantomData;

use heapless::{Vec, VecView};
use serde::{Deserialize, Serialize};

use crate::dsp::Plain;
use crate::features::{Property, PropertySet};
use crate::fused::{FeatureSet, Observation, Vector};
use crate::table::{Action, Contents, Gaussian, MAX_ACTIONS, MAX_MOVEMENTS, Table, mean_step};
use crate::up_to;

mod confusions;
mod fused;
pub mod kernels;
mod student;

pub use confusions::{Confusions, Degrees};
use fused::{Background, Visits};
pub use kernels::Kernels;
use kernels::{Live, confused};
use student::{Shrunk, Student};

/// Textures less probable than this are left out of the expected uncertainty: each changes it by at most about twice its
/// probability, all of 117 by about 2e-4.
const NEGLIGIBLE: f32 = 1e-6;

/// Logarithm of the posterior, Q16, of a texture that is no candidate. The slides of an exploration make it neither a candidate's
/// nor overflow: at most 1024 are taken from it by each, and it is set again after four.
const OUT: i32 = -(5 << 28);
/// Logarithms of candidates are never below, those of others always.
const LEAST: i32 = -(1 << 30);
/// What is left of a candidate's when the greatest is 0: however improbable, it stays one.
const FLOOR: i32 = -(1 << 28);
/// Most that the likelihood of a slide takes from a logarithm.
const MOST: i32 = 1 << 26;
/// Slides after which the greatest logarithm is made 0 again. Four times [`MOST`] below [`FLOOR`] is not [`LEAST`] yet.
const SLIDES: u8 = 4;

/// Log-odds for "none of these" over which a texture counts as unknown, after one slide and after more (the recipe has 2 and
/// 0). In simulated worlds 21 to 24 a limit of 0 takes one in fifteen known textures for a new one; 1.5 rather than 1 or 2 was
/// chosen on the BioTac recordings, one material left out, to keep false alarms below 3 %.
const UNKNOWN_OVER: [f32; 2] = [2.0, 1.5];
/// Log-odds up to which a verdict is certain enough to learn from.
const CERTAIN: f32 = -2.0;
/// Fewest slides after which a texture may be called unknown.
const UNKNOWN_SLIDES: u8 = 2;

/// How what was felt is compared with what is known.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub enum Method {
    /// The paper's: one property per slide, Gaussians (eq. 4).
    #[default]
    Paper,
    /// One property per slide, Student's t with variances drawn towards each other.
    Student,
    /// As `Student`, with all properties of every slide.
    StudentAll,
    /// All features of every slide at once, whitened.
    Fused,
}

impl Method {
    /// The best one for a table.
    pub const fn of(contents: Contents) -> Self {
        match contents {
            Contents::Gaussians(_) => Self::StudentAll,
            Contents::Fused(..) => Self::Fused,
        }
    }

    /// Whether it can use such a table.
    pub const fn suits(self, contents: Contents) -> bool {
        matches!(
            (self, contents),
            (Self::Fused, Contents::Fused(..))
                | (
                    Self::Paper | Self::Student | Self::StudentAll,
                    Contents::Gaussians(_)
                )
        )
    }

    /// Its name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Student => "student",
            Self::StudentAll => "student-all",
            Self::Fused => "fused",
        }
    }
}

/// How the next movement is chosen.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub enum Strategy {
    /// The action of the greatest benefit (eq. 12).
    #[default]
    Bayesian,
    /// The best movement of each property in turn: the paper's uninformed cycling.
    Cycling,
    /// Any action, all equally likely.
    Random,
}

/// How to choose, and when to stop.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Config {
    /// How what was felt is compared with what is known.
    pub method: Method,
    /// How the next movement is chosen.
    pub strategy: Strategy,
    /// A texture more probable than this is the answer.
    pub threshold: f32,
    /// After this many slides the most probable texture is the answer, sure or not.
    pub max_slides: u8,
    /// Whether the answer may be that it is none of the candidates.
    pub open: bool,
}

impl Default for Config {
    /// Absolute identification in the paper: Bayesian exploration, 99 %, at most 10 movements.
    fn default() -> Self {
        Self {
            method: Method::Paper,
            strategy: Strategy::Bayesian,
            threshold: 0.99,
            max_slides: 10,
            open: false,
        }
    }
}

impl Config {
    /// Discrimination of a pair in the paper: 99.9 %.
    pub const PAIR_THRESHOLD: f32 = 0.999;
}

/// Why an exploration cannot begin.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ExplorerError {
    /// The table has more textures than the explorer has room for.
    Room {
        /// Textures of the table.
        textures: u16,
        /// Room.
        room: usize,
    },
    /// A candidate that the table does not have, or none at all.
    Candidates,
    /// No property that the rig measures was learned of every candidate, at least twice, at any one movement.
    NothingToMeasure,
    /// The rig does not measure the features that the table was learned from.
    Features(FeatureSet),
    /// The method cannot use this kind of table.
    Method(Method),
}

impl fmt::Display for ExplorerError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Room { textures, room } => write!(f, "the table has {textures} textures, and there is room for {room}"),
            Self::Candidates => f.write_str("the candidates are not textures of the table"),
            Self::NothingToMeasure => f.write_str(
                "no property that this rig measures was learned of every candidate at one movement, from two trials or more",
            ),
            Self::Features(set) => write!(
                f,
                "the table was learned from {}, and this rig does not measure them",
                set.name()
            ),
            Self::Method(Method::Fused) => f.write_str(
                "the method fused needs a table with whitened features; learn one, or take student-all",
            ),
            Self::Method(method) => write!(
                f,
                "the method {} needs a table of the three properties; this one is for the method fused",
                method.name()
            ),
        }
    }
}

impl core::error::Error for ExplorerError {}

/// Why a slide taught nothing. The exploration stands as it was.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum ObserveError {
    /// The slide has no such property, or it is not a finite number.
    Missing(Property),
    /// The slide lacks one of the features of the table.
    Features(FeatureSet),
    /// The explorer does not know the action.
    Action(Action),
}

impl fmt::Display for ObserveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing(property) => write!(f, "the slide did not give a value of {property}"),
            Self::Features(set) => write!(f, "the slide did not give {}", set.name()),
            Self::Action(action) => {
                write!(
                    f,
                    "{} of movement {} is none of the actions",
                    action.what(),
                    action.movement + 1
                )
            }
        }
    }
}

impl core::error::Error for ObserveError {}

/// An answer.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Verdict {
    /// Index of the most probable texture.
    pub texture: u16,
    /// Its posterior probability.
    pub probability: f32,
    /// Whether that exceeds the threshold, and it is rather one of the candidates than none.
    pub sure: bool,
    /// Whether it is rather none of them.
    pub unknown: bool,
    /// Log-odds of that, where the method can tell.
    pub log_odds: Option<f32>,
}

/// What an action promises.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Outlook {
    /// The action.
    pub action: Action,
    /// Uncertainty that is expected to remain after it (eq. 11), 0 to 1.
    pub uncertainty: f32,
    /// Its benefit (eq. 12), lower the more often it was made.
    pub benefit: f32,
}

/// Degree of confusion of two textures by one property (eq. 7): 1 for equal, 0 for disjoint distributions.
pub fn confusion<K: Kernels>(a: Gaussian, b: Gaussian) -> f32 {
    confused(a, b, K::sqrt)
}

/// One exploration after another with the same table and candidates; room for `N` textures.
#[derive(Clone, Debug)]
pub struct Explorer<'t, const N: usize, K = Plain> {
    table: Table<'t>,
    config: Config,
    measured: PropertySet,
    /// Logarithm of the posterior, Q16, up to a constant; below [`LEAST`] for textures that are no candidates.
    log: Vec<i32, N>,
    posterior: Vec<f32, N>,
    candidates: u16,
    actions: Vec<Action, MAX_ACTIONS>,
    /// How often each action was made.
    made: Vec<u8, MAX_ACTIONS>,
    /// Expected uncertainty of each action when nothing is known: a constant of table and candidates.
    at_first: Vec<f32, MAX_ACTIONS>,
    slides: u8,
    /// The slides of this exploration, for the methods that take their mean.
    visits: Visits,
    log_odds: Option<f32>,
    /// For Student's t: movement by movement, properties in their order.
    shrunk: Vec<Shrunk, MAX_ACTIONS>,
    /// For the fused method: what a texture that is not in the table is like, at every movement.
    backgrounds: Vec<Background, MAX_MOVEMENTS>,
    kernels: PhantomData<K>,
}

impl<'t, const N: usize, K: Kernels> Explorer<'t, N, K> {
    /// An explorer for all textures of the table, for a rig that measures `measured`.
    ///
    /// # Errors
    /// See [`ExplorerError`].
    pub fn new(
        table: Table<'t>,
        measured: PropertySet,
        config: Config,
    ) -> Result<Self, ExplorerError> {
        Self::among(table, measured, config, 0..table.textures())
    }

    /// An explorer that only considers `candidates` (Methods, "Texture Discrimination": a pair, all others at
    /// probability 0).
    ///
    /// # Errors
    /// See [`ExplorerError`].
    pub fn among(
        table: Table<'t>,
        measured: PropertySet,
        config: Config,
        candidates: impl IntoIterator<Item = u16>,
    ) -> Result<Self, ExplorerError> {
        let mut explorer = Self::empty(table);
        explorer.consider(measured, config, candidates)?;
        Ok(explorer)
    }

    /// One without candidates, for [`Explorer::consider`].
    pub(crate) fn empty(table: Table<'t>) -> Self {
        Self {
            table,
            config: Config::default(),
            measured: PropertySet::default(),
            log: Vec::new(),
            posterior: Vec::new(),
            candidates: 0,
            actions: Vec::new(),
            made: Vec::new(),
            at_first: Vec::new(),
            slides: 0,
            visits: Vec::new(),
            log_odds: None,
            shrunk: Vec::new(),
            backgrounds: Vec::new(),
            kernels: PhantomData,
        }
    }

    /// Makes an empty one what [`Explorer::among`] gives, where it lies: it is too large for a chip's stack to hold twice.
    ///
    /// # Errors
    /// See [`ExplorerError`]; it is of no use then.
    // with a method that is known while compiling, what the others take is left out
    #[inline(always)]
    pub(crate) fn consider(
        &mut self,
        measured: PropertySet,
        config: Config,
        candidates: impl IntoIterator<Item = u16>,
    ) -> Result<(), ExplorerError> {
        self.config = config;
        let table = self.table;
        let textures = table.textures();
        let log = &mut self.log;
        log.resize(textures.into(), OUT)
            .map_err(|_| ExplorerError::Room { textures, room: N })?;
        for texture in candidates {
            *log.get_mut(usize::from(texture))
                .ok_or(ExplorerError::Candidates)? = 0;
        }
        self.candidates = log.iter().filter(|&&l| l == 0).count() as u16;
        if self.candidates == 0 {
            return Err(ExplorerError::Candidates);
        }
        let method = config.method;
        if !method.suits(table.contents()) {
            return Err(ExplorerError::Method(method));
        }
        if let Contents::Fused(set, _) = table.contents()
            && !set.measured_by(measured)
        {
            return Err(ExplorerError::Features(set));
        }
        let measured = measured.and(table.measured());
        self.measured = measured;
        let learned_by = |movement, most: fn(u8) -> bool| {
            let mut candidates = log.iter().zip(0..).filter(|(l, _)| **l == 0);
            candidates.all(|(_, texture)| most(table.trials(texture, movement)))
        };
        let movements = 0..table.movements().len() as u8;
        let all_of = |movement| Action {
            movement,
            property: None,
        };
        self.actions = match method {
            Method::Paper | Method::Student => table
                .actions()
                .filter(|a| a.property.is_some_and(|p| measured.contains(p)))
                .filter(|a| learned_by(a.movement, |trials| trials >= 2))
                .collect(),
            Method::StudentAll => movements
                .filter(|&m| !measured.is_empty() && learned_by(m, |trials| trials >= 2))
                .map(all_of)
                .collect(),
            // one slide is enough, and a texture without any is not much in the way
            Method::Fused => movements
                .filter(|&m| !learned_by(m, |trials| trials == 0))
                .map(all_of)
                .collect(),
        };
        if self.actions.is_empty() {
            return Err(ExplorerError::NothingToMeasure);
        }
        if let Method::Student | Method::StudentAll = method {
            for movement in 0..table.movements().len() as u8 {
                let of = Property::ALL.map(|property| Shrunk::new(&table, movement, property));
                self.shrunk.extend(of);
            }
        }
        if method == Method::Fused {
            let backgrounds = self.actions.iter();
            let backgrounds = backgrounds.map(|a| Background::new(&table, a.movement));
            self.backgrounds.extend(backgrounds);
        }
        // as many
        self.posterior = up_to(log.iter().map(|_| 0.0));
        self.restart();
        let actions = self.actions.iter();
        self.at_first = actions.map(|a| self.uncertainty(method, *a)).collect();
        Ok(())
    }

    /// Forgets all slides: the next exploration begins, with the same candidates equally probable.
    pub fn restart(&mut self) {
        let prior = 1.0 / f32::from(self.candidates);
        self.forget();
        for (posterior, log) in self.posterior.iter_mut().zip(&self.log) {
            *posterior = if *log < LEAST { 0.0 } else { prior };
        }
        self.made = self.actions.iter().map(|_| 0).collect();
        self.slides = 0;
        self.visits.clear();
        self.log_odds = None;
    }

    /// The table.
    pub fn table(&self) -> Table<'t> {
        self.table
    }

    /// Slides made in this exploration.
    pub fn slides(&self) -> u8 {
        self.slides
    }

    /// Posterior probability of every texture of the table (eq. 3).
    pub fn posterior(&self) -> &[f32] {
        &self.posterior
    }

    /// The answer, once there is one: the threshold is exceeded, the texture is unknown, or the last slide was made. There is
    /// none before the first slide, however few the candidates.
    pub fn verdict(&self) -> Option<Verdict> {
        let best = self.best();
        let sure = best.sure && self.slides > 0;
        let unknown = best.unknown && self.slides >= UNKNOWN_SLIDES;
        (sure || unknown || self.slides >= self.config.max_slides).then_some(best)
    }

    /// Log-odds that the texture is none of the candidates, after what was felt so far; `None` where the method or the table
    /// cannot tell.
    pub fn log_odds(&self) -> Option<f32> {
        self.log_odds
    }

    /// Whether the texture is rather none of the candidates, as far as can be told.
    pub fn is_unknown(&self) -> bool {
        let [at_once, later] = UNKNOWN_OVER;
        let limit = if self.slides < UNKNOWN_SLIDES {
            at_once
        } else {
            later
        };
        self.log_odds.is_some_and(|log_odds| log_odds > limit)
    }

    /// Whether what was felt is certain enough for the probe to learn from it by itself. Never by the paper's properties
    /// alone: one in ten such lessons would be wrong.
    pub fn is_certain(&self) -> bool {
        let known = self.log_odds.is_some_and(|log_odds| log_odds <= CERTAIN);
        known && self.best().probability > self.config.threshold
    }

    /// The movements made, with the number of slides and their whitened mean: what this exploration can teach a fused table.
    pub fn felt(&self) -> impl Iterator<Item = (u8, u8, Vector)> + '_ {
        let features = match self.table.contents() {
            Contents::Fused(_, features) => usize::from(features),
            Contents::Gaussians(_) => 0,
        };
        let visits = self.visits.iter().filter(move |_| features > 0);
        visits.map(move |v| (v.movement, v.slides, v.mean(features)))
    }

    /// The most probable texture as things stand, the first of equals.
    pub fn best(&self) -> Verdict {
        let mut best = Verdict {
            texture: 0,
            probability: 0.0,
            sure: false,
            unknown: self.config.open && self.is_unknown(),
            log_odds: self.log_odds,
        };
        let rather_new = self.config.open && self.log_odds.is_some_and(|log_odds| log_odds > 0.0);
        for (&probability, texture) in self.posterior.iter().zip(0..) {
            if probability > best.probability {
                best = Verdict {
                    texture,
                    probability,
                    sure: probability > self.config.threshold && !rather_new,
                    ..best
                };
            }
        }
        best
    }

    /// Takes in a slide: what `action` looks at is compared with what every candidate would feel like (eq. 3, 4). The rest of
    /// the slide is not used.
    ///
    /// # Errors
    /// See [`ObserveError`]; nothing has changed then.
    pub fn observe(&mut self, action: Action, slide: &Observation) -> Result<(), ObserveError> {
        let made = self
            .actions
            .iter()
            .position(|&a| a == action)
            .filter(|&at| at < self.made.len());
        let made = made.ok_or(ObserveError::Action(action))?;
        match action.property {
            Some(property) => self.observe_property(action, property, slide)?,
            None if self.config.method == Method::Fused => self.observe_features(action, slide)?,
            None => self.observe_properties(action, slide)?,
        }
        if let Some(made) = self.made.get_mut(made) {
            *made = made.saturating_add(1);
        }
        self.slides = self.slides.saturating_add(1);
        Ok(())
    }

    /// The value of a property of a slide, at most twice as far out as any mean that a table can hold: squares stay finite.
    fn value(slide: &Observation, property: Property) -> Result<f32, ObserveError> {
        let reach = mean_step(property) * 65536.0;
        let x = slide.properties.get(property).filter(|x| x.is_finite());
        x.map(|x| x.clamp(-reach, reach))
            .ok_or(ObserveError::Missing(property))
    }

    /// Logarithms as before the first slide.
    fn forget(&mut self) {
        if usize::from(self.candidates) == self.log.len() {
            K::forget(&mut self.log);
        } else {
            for log in &mut self.log {
                *log = if *log < LEAST { OUT } else { 0 };
            }
        }
    }

    /// The posterior from its logarithms; the logarithm of the candidates' mean likelihood.
    fn settle(&mut self) -> f32 {
        let (top, sum) = K::posterior(&self.log, &mut self.posterior);
        let mean = sum / (1 << 30) as f32 / f32::from(self.candidates);
        top as f32 / 65536.0 + libm::logf(mean)
    }

    /// One property: its likelihood is added to what was there.
    fn observe_property(
        &mut self,
        action: Action,
        property: Property,
        slide: &Observation,
    ) -> Result<(), ObserveError> {
        let x = Self::value(slide, property)?;
        if self.slides > 0 && (self.slides.is_multiple_of(SLIDES) || self.slides == u8::MAX) {
            draw_near(&mut self.log);
        }
        if self.config.method == Method::Paper {
            let known = self.table.gaussians(action);
            K::add_gaussians(x / mean_step(property), &known, &mut self.log);
        } else {
            self.add_students(x, action.movement, property, 1);
        }
        self.settle();
        Ok(())
    }

    /// Adds the likelihood of the mean `x` of so many slides to every logarithm.
    fn add_students(&mut self, x: f32, movement: u8, property: Property, slides: u8) {
        let mut student: Option<Student> = None;
        for texture in 0..self.table.textures() {
            let Some((shrunk, known, trials)) = self.shrunk_of(texture, movement, property) else {
                continue;
            };
            let expected = shrunk.expect(known, trials, slides);
            let student = self.student(&mut student, texture, movement, property);
            let likelihood = (student.log(x, expected) * 65536.0) as i32;
            if let Some(log) = self.log.get_mut(usize::from(texture)) {
                *log += likelihood.clamp(-MOST, MOST);
            }
        }
    }

    /// All properties: the means of the slides of every movement are compared anew.
    fn observe_properties(
        &mut self,
        action: Action,
        slide: &Observation,
    ) -> Result<(), ObserveError> {
        for property in self.measured.iter() {
            Self::value(slide, property)?;
        }
        let visit = fused::visit(&mut self.visits, action.movement);
        // beyond 255 slides nothing new is learned
        if let Some(visit) = visit.filter(|visit| visit.slides < u8::MAX) {
            visit.slides += 1;
            for (property, sum) in Property::ALL.into_iter().zip(&mut visit.properties) {
                *sum += Self::value(slide, property).unwrap_or(0.0);
            }
        }
        self.forget();
        for at in 0..self.visits.len() {
            let Some(visit) = self.visits.get(at).copied() else {
                continue;
            };
            for property in self.measured.iter() {
                let Some(sum) = visit.properties.get(property.index()) else {
                    continue;
                };
                self.add_students(
                    sum / f32::from(visit.slides),
                    visit.movement,
                    property,
                    visit.slides,
                );
            }
            draw_near(&mut self.log);
        }
        self.settle();
        Ok(())
    }

    /// All features, whitened.
    fn observe_features(
        &mut self,
        action: Action,
        slide: &Observation,
    ) -> Result<(), ObserveError> {
        let Contents::Fused(set, features) = self.table.contents() else {
            return Err(ObserveError::Action(action));
        };
        let features = usize::from(features);
        let Some(vector) = slide.vector(set, features) else {
            return Err(ObserveError::Features(set));
        };
        let Some(white) = self.table.whiten(action.movement, &vector) else {
            return Err(ObserveError::Features(set));
        };
        let visit = fused::visit(&mut self.visits, action.movement);
        // beyond 255 slides nothing new is learned
        if let Some(visit) = visit.filter(|visit| visit.slides < u8::MAX) {
            visit.slides += 1;
            for (sum, z) in visit.white.iter_mut().zip(&white) {
                *sum += i32::from(*z);
            }
        }
        self.forget();
        let elsewhere = fused::add_likelihoods(
            &self.table,
            &self.visits,
            &self.backgrounds,
            &mut self.log,
            K::add_likelihoods,
        );
        let average = self.settle();
        self.log_odds =
            elsewhere.and_then(|(elsewhere, can_tell)| can_tell.then_some(elsewhere - average));
        Ok(())
    }

    /// What a property of a texture is expected to be in one slide.
    fn expected(&self, texture: u16, movement: u8, property: Property) -> Option<Gaussian> {
        if self.config.method == Method::Paper {
            let property = Some(property);
            return self.table.gaussian(texture, Action { movement, property });
        }
        let (shrunk, known, trials) = self.shrunk_of(texture, movement, property)?;
        Some(shrunk.expect(known, trials, 1))
    }

    fn shrunk_of(
        &self,
        texture: u16,
        movement: u8,
        property: Property,
    ) -> Option<(Shrunk, Gaussian, u8)> {
        let at = usize::from(movement) * Property::ALL.len() + property.index();
        let shrunk = self.shrunk.get(at)?;
        let known = self.table.gaussian(
            texture,
            Action {
                movement,
                property: Some(property),
            },
        )?;
        Some((*shrunk, known, self.table.trials(texture, movement)))
    }

    /// Student's t of a texture; `last` is that of the texture before it, which mostly has as many trials.
    fn student(
        &self,
        last: &mut Option<Student>,
        texture: u16,
        movement: u8,
        property: Property,
    ) -> Student {
        let at = usize::from(movement) * Property::ALL.len() + property.index();
        let others = self.shrunk.get(at).map_or(0.0, |shrunk| shrunk.freedom);
        let own = f32::from(self.table.trials(texture, movement)) - 1.0;
        match last {
            Some(student) if student.freedom() == others + own => *student,
            _ => *last.insert(Student::new(others + own)),
        }
    }

    /// The next action, where [`Explorer::outlook`] promises `outlook`. `random` decides for [`Strategy::Random`] and is
    /// ignored otherwise.
    pub fn choose(&self, outlook: &[Outlook], random: u32) -> Action {
        let chosen = match self.config.strategy {
            Strategy::Bayesian => {
                // the first of equals
                let best = outlook.iter().reduce(|best, next| {
                    if next.benefit > best.benefit {
                        next
                    } else {
                        best
                    }
                });
                best.map(|o| o.action)
            }
            Strategy::Cycling => {
                let turns = self.turns().count().max(1);
                self.turns().nth(usize::from(self.slides) % turns)
            }
            Strategy::Random => {
                let at = (u64::from(random) * self.actions.len() as u64) >> 32;
                self.actions.get(at as usize).copied()
            }
        };
        // there is always an action: `among` refuses to begin without
        chosen.unwrap_or(Action {
            movement: 0,
            property: None,
        })
    }

    /// What every action promises now, in their order.
    pub fn outlook(&self) -> Vec<Outlook, MAX_ACTIONS> {
        let mut promises = Vec::new();
        self.look_out(&mut promises);
        promises
    }

    /// As [`Explorer::outlook`], for those who have room for it: it is large, and not moved then.
    pub fn look_out(&self, promises: &mut Vec<Outlook, MAX_ACTIONS>) {
        promises.clear();
        let actions = self.actions.iter().zip(&self.made).zip(&self.at_first);
        for ((&action, &made), &at_first) in actions {
            let uncertainty = match self.slides {
                0 => at_first,
                _ => self.uncertainty(self.config.method, action),
            };
            // there is room: as many as there are actions
            let _ = promises.push(Outlook {
                action,
                uncertainty,
                benefit: benefit(uncertainty, made),
            });
        }
    }

    /// What cycling goes through: the best action of each property when nothing is known, properties in their order; where all
    /// is looked at, every movement.
    pub fn turns(&self) -> impl Iterator<Item = Action> {
        let all = self
            .actions
            .iter()
            .copied()
            .filter(|a| a.property.is_none());
        let each = Property::ALL.into_iter().filter_map(|property| {
            let of_property = self
                .actions
                .iter()
                .zip(&self.at_first)
                .filter(|(a, _)| a.property == Some(property));
            of_property
                .reduce(|best, next| if next.1 < best.1 { next } else { best })
                .map(|(&action, _)| action)
        });
        all.chain(each)
    }

    /// Expected uncertainty after `action` (eq. 11).
    ///
    /// Computed as eq. 10: 1 minus a sum that is close to 1 would lose the digits that decide late in an exploration.
    fn uncertainty(&self, method: Method, action: Action) -> f32 {
        let movement = action.movement;
        if method == Method::Fused {
            return fused::uncertainty::<K, N>(&self.table, movement, &self.posterior);
        }
        let mut live: Vec<Live, N> = Vec::new();
        let properties = self.gather(method, action, &self.posterior, &mut live);
        uncertainty_of(&mut live, properties, K::confuse, K::sqrt)
    }

    /// The textures that are still likely, with what is expected of the properties that `action` looks at; how many these are.
    // where a method is known while compiling, what the others take is left out here as well
    #[inline(always)]
    fn gather(
        &self,
        method: Method,
        action: Action,
        posterior: &[f32],
        live: &mut Vec<Live, N>,
    ) -> usize {
        let looked_at: PropertySet = match action.property {
            Some(property) => [property].into_iter().collect(),
            None => self.measured,
        };
        if method == Method::Paper {
            gather(&self.table, action, posterior, live);
        } else {
            let expect = |texture, property| self.expected(texture, action.movement, property);
            for (&probability, texture) in posterior.iter().zip(0..) {
                if probability >= NEGLIGIBLE {
                    let mut candidate = Live::new(probability);
                    for (slot, property) in candidate.expected.iter_mut().zip(looked_at.iter()) {
                        *slot = expect(texture, property).unwrap_or(*slot);
                    }
                    // there is room: `posterior` is no longer than N
                    let _ = live.push(candidate);
                }
            }
        }
        looked_at.iter().count()
    }
}

// The loops over all textures are not generic: so they are compiled with this crate, for speed.

/// The textures that are still likely, with what is expected of the property that is looked at.
#[inline(never)]
fn gather(table: &Table<'_>, action: Action, posterior: &[f32], live: &mut VecView<Live>) {
    let known = table.gaussians(action);
    for (&probability, texture) in posterior.iter().zip(0..) {
        if probability >= NEGLIGIBLE {
            let mut candidate = Live::new(probability);
            if let ([slot, ..], Some(known)) = (&mut candidate.expected, known.get(texture)) {
                *slot = known;
            }
            // there is room: as much as for the posterior
            let _ = live.push(candidate);
        }
    }
}

/// Expected uncertainty (eq. 11) of these textures, of which so many properties are looked at.
#[inline(never)]
fn uncertainty_of(
    live: &mut [Live],
    properties: usize,
    confuse: fn(&mut Live, &mut [Live]),
    sqrt: fn(f32) -> f32,
) -> f32 {
    let mut rest = &mut *live;
    while let Some((a, others)) = rest.split_first_mut() {
        confuse_with(a, others, properties, confuse, sqrt);
        rest = others;
    }
    let left = |c: &Live| c.probability * c.confused / (c.probability + c.confused);
    live.iter().map(left).sum()
}

/// Confusion of one texture with all others (eq. 7), by so many properties.
#[inline(always)]
fn confuse_with(
    a: &mut Live,
    others: &mut [Live],
    properties: usize,
    confuse: fn(&mut Live, &mut [Live]),
    sqrt: fn(f32) -> f32,
) {
    if properties == 1 {
        return confuse(a, others);
    }
    for b in others {
        let pairs = a.expected.iter().zip(&b.expected).take(properties);
        let confusion: f32 = pairs.map(|(a, b)| confused(*a, *b, sqrt)).product();
        a.confused += confusion * b.probability;
        b.confused += confusion * a.probability;
    }
}

/// Makes the greatest logarithm 0, so that there is room for slides to come.
#[inline(never)]
fn draw_near(log: &mut [i32]) {
    let top = log.iter().copied().max().unwrap_or(0);
    for log in log {
        *log = if *log < LEAST {
            OUT
        } else {
            (*log - top).max(FLOOR)
        };
    }
}

/// Benefit of an action that leaves `uncertainty` and was made `made` times before (eq. 12).
///
/// Eq. 13 reads alpha = 1/n, which has no value for an action that was never made; taken as infinity, all untried actions
/// would tie. Here alpha = 1/(n+1).
pub fn benefit(uncertainty: f32, made: u8) -> f32 {
    if made == 0 {
        return 1.0 - uncertainty.clamp(0.0, 1.0);
    }
    1.0 - libm::powf(uncertainty.clamp(0.0, 1.0), 1.0 / (f32::from(made) + 1.0))
}

#[cfg(test)]
mod tests;
