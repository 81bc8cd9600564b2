//! Bayesian exploration: the posterior of every texture (eq. 1-4), and the next movement, which is the one that should
//! leave the least confusion among the textures that are still likely (eq. 7, 11-13).
//!
//! Probabilities are kept as logarithms and in f32. Host and chip use the same operations in the same order, so they
//! agree to the bit.

use core::fmt;
use core::marker::PhantomData;

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::features::{Properties, Property, PropertySet};
use crate::kernels::{Kernels, Plain};
use crate::table::{Action, Gaussian, MAX_ACTIONS, Table, mean_step};

/// Textures less probable than this are left out of the expected uncertainty: each changes it by at most about twice its
/// probability, all of 117 by about 2e-4.
const NEGLIGIBLE: f32 = 1e-6;

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
    /// How the next movement is chosen.
    pub strategy: Strategy,
    /// A texture more probable than this is the answer.
    pub threshold: f32,
    /// After this many slides the most probable texture is the answer, sure or not.
    pub max_slides: u8,
}

impl Default for Config {
    /// Absolute identification in the paper: Bayesian exploration, 99 %, at most 10 movements.
    fn default() -> Self {
        Self {
            strategy: Strategy::Bayesian,
            threshold: 0.99,
            max_slides: 10,
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
}

impl fmt::Display for ExplorerError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Room { textures, room } => write!(f, "the table has {textures} textures, and there is room for {room}"),
            Self::Candidates => f.write_str("the candidates are not textures of the table"),
            Self::NothingToMeasure => f.write_str(
                "no property that this rig measures was learned of every candidate at one movement, from two trials or more",
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
    /// The explorer does not know the action.
    Action(Action),
}

impl fmt::Display for ObserveError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing(property) => write!(f, "the slide did not give a value of {property}"),
            Self::Action(action) => {
                write!(
                    f,
                    "{} of movement {} is none of the actions",
                    action.property,
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
    /// Whether that exceeds the threshold.
    pub sure: bool,
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
    let variances = a.sd * a.sd + b.sd * b.sd;
    let apart = a.mean - b.mean;
    K::sqrt(2.0 * a.sd * b.sd / variances) * libm::expf(-apart * apart / (4.0 * variances))
}

/// A texture that is still likely, while an expected uncertainty is computed.
#[derive(Clone, Copy, Debug)]
struct Candidate {
    probability: f32,
    expected: Gaussian,
    /// Sum over all others of confusion times probability: the numerator of eq. 8.
    confused: f32,
}

/// One exploration after another with the same table and candidates; room for `N` textures.
#[derive(Clone, Debug)]
pub struct Explorer<'t, const N: usize, K = Plain> {
    table: Table<'t>,
    config: Config,
    /// Logarithm of the posterior, up to a constant; minus infinity for textures that are no candidates.
    log: Vec<f32, N>,
    posterior: Vec<f32, N>,
    candidates: u16,
    actions: Vec<Action, MAX_ACTIONS>,
    /// How often each action was made.
    made: Vec<u8, MAX_ACTIONS>,
    /// Expected uncertainty of each action when nothing is known: a constant of table and candidates.
    at_first: Vec<f32, MAX_ACTIONS>,
    slides: u8,
    work: Vec<Candidate, N>,
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
        let textures = table.textures();
        let mut log = Vec::new();
        log.resize(textures.into(), f32::NEG_INFINITY)
            .map_err(|_| ExplorerError::Room { textures, room: N })?;
        for texture in candidates {
            *log.get_mut(usize::from(texture))
                .ok_or(ExplorerError::Candidates)? = 0.0;
        }
        let candidates = log.iter().filter(|&&l| l == 0.0).count() as u16;
        if candidates == 0 {
            return Err(ExplorerError::Candidates);
        }
        let learned = |movement| {
            log.iter()
                .zip(0..)
                .all(|(&l, texture)| l < 0.0 || table.trials(texture, movement) >= 2)
        };
        let actions: Vec<Action, MAX_ACTIONS> = table
            .actions()
            .filter(|a| measured.contains(a.property) && learned(a.movement))
            .collect();
        if actions.is_empty() {
            return Err(ExplorerError::NothingToMeasure);
        }
        let mut explorer = Self {
            table,
            config,
            posterior: log.clone(),
            log,
            candidates,
            made: Vec::new(),
            at_first: Vec::new(),
            actions,
            slides: 0,
            work: Vec::new(),
            kernels: PhantomData,
        };
        explorer.restart();
        explorer.at_first = explorer
            .actions
            .clone()
            .into_iter()
            .map(|a| explorer.uncertainty(a))
            .collect();
        Ok(explorer)
    }

    /// Forgets all slides: the next exploration begins, with the same candidates equally probable.
    pub fn restart(&mut self) {
        let prior = 1.0 / f32::from(self.candidates);
        for (log, posterior) in self.log.iter_mut().zip(&mut self.posterior) {
            if *log > f32::NEG_INFINITY {
                *log = 0.0;
                *posterior = prior;
            } else {
                *posterior = 0.0;
            }
        }
        self.made = self.actions.iter().map(|_| 0).collect();
        self.slides = 0;
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

    /// The answer, once there is one: the threshold is exceeded, or the last slide was made. There is none before the
    /// first slide, however few the candidates.
    pub fn verdict(&self) -> Option<Verdict> {
        let best = self.best();
        let sure = best.sure && self.slides > 0;
        (sure || self.slides >= self.config.max_slides).then_some(best)
    }

    /// The most probable texture as things stand, the first of equals.
    pub fn best(&self) -> Verdict {
        let mut best = Verdict {
            texture: 0,
            probability: 0.0,
            sure: false,
        };
        for (&probability, texture) in self.posterior.iter().zip(0..) {
            if probability > best.probability {
                best = Verdict {
                    texture,
                    probability,
                    sure: probability > self.config.threshold,
                };
            }
        }
        best
    }

    /// Takes in a slide: the property of `action` is compared with what every candidate would feel like (eq. 3, 4). The
    /// other properties of the slide are not used.
    ///
    /// # Errors
    /// See [`ObserveError`]; nothing has changed then.
    pub fn observe(&mut self, action: Action, slide: &Properties) -> Result<(), ObserveError> {
        let made = self
            .actions
            .iter()
            .position(|&a| a == action)
            .and_then(|at| self.made.get_mut(at));
        let made = made.ok_or(ObserveError::Action(action))?;
        let x = slide
            .get(action.property)
            .filter(|x| x.is_finite())
            .ok_or(ObserveError::Missing(action.property))?;
        *made = made.saturating_add(1);
        self.slides = self.slides.saturating_add(1);
        // twice beyond any mean that a table can hold: squares stay finite
        let reach = mean_step(action.property) * 65536.0;
        let x = x.clamp(-reach, reach);
        let mut top = f32::NEG_INFINITY;
        for (log, texture) in self.log.iter_mut().zip(0..) {
            if *log > f32::NEG_INFINITY
                && let Some(expected) = self.table.gaussian(texture, action)
            {
                let z = (x - expected.mean) / expected.sd;
                *log -= libm::logf(expected.sd) + 0.5 * z * z;
                top = top.max(*log);
            }
        }
        let mut total = 0.0;
        for (log, posterior) in self.log.iter_mut().zip(&mut self.posterior) {
            // a slide takes at most 1e12 from a candidate: however improbable, it stays one
            *log -= top;
            *posterior = libm::expf(*log);
            total += *posterior;
        }
        for posterior in &mut self.posterior {
            *posterior /= total;
        }
        Ok(())
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
                let turns = self.best_of_each().count().max(1);
                self.best_of_each().nth(usize::from(self.slides) % turns)
            }
            Strategy::Random => {
                let at = (u64::from(random) * self.actions.len() as u64) >> 32;
                self.actions.get(at as usize).copied()
            }
        };
        // there is always an action: `among` refuses to begin without
        chosen.unwrap_or(Action {
            movement: 0,
            property: Property::Roughness,
        })
    }

    /// What every action promises now, in the order of [`Action::index`].
    pub fn outlook(&mut self) -> Vec<Outlook, MAX_ACTIONS> {
        let actions = self.actions.clone().into_iter().zip(self.made.clone());
        let promise = |action, made, uncertainty| Outlook {
            action,
            uncertainty,
            benefit: benefit(uncertainty, made),
        };
        if self.slides == 0 {
            let known = self.at_first.iter();
            actions
                .zip(known)
                .map(|((action, made), &u)| promise(action, made, u))
                .collect()
        } else {
            actions
                .map(|(action, made)| promise(action, made, self.uncertainty(action)))
                .collect()
        }
    }

    /// The best action of each property when nothing is known, properties in their order.
    pub fn best_of_each(&self) -> impl Iterator<Item = Action> {
        Property::ALL.into_iter().filter_map(|property| {
            let of_property = self
                .actions
                .iter()
                .zip(&self.at_first)
                .filter(|(a, _)| a.property == property);
            of_property
                .reduce(|best, next| if next.1 < best.1 { next } else { best })
                .map(|(&action, _)| action)
        })
    }

    /// Expected uncertainty after `action` (eq. 11).
    ///
    /// Computed as eq. 10: 1 minus a sum that is close to 1 would lose the digits that decide late in an exploration.
    fn uncertainty(&mut self, action: Action) -> f32 {
        self.work.clear();
        for (&probability, texture) in self.posterior.iter().zip(0..) {
            if probability >= NEGLIGIBLE
                && let Some(expected) = self.table.gaussian(texture, action)
            {
                // there is room: `work` is as long as `posterior`
                let _ = self.work.push(Candidate {
                    probability,
                    expected,
                    confused: 0.0,
                });
            }
        }
        let mut rest = self.work.as_mut_slice();
        while let Some((a, others)) = rest.split_first_mut() {
            for b in others.iter_mut() {
                let confusion = confusion::<K>(a.expected, b.expected);
                a.confused += confusion * b.probability;
                b.confused += confusion * a.probability;
            }
            rest = others;
        }
        self.work
            .iter()
            .map(|c| c.probability * c.confused / (c.probability + c.confused))
            .sum()
    }
}

/// Benefit of an action that leaves `uncertainty` and was made `made` times before (eq. 12).
///
/// Eq. 13 reads alpha = 1/n, which has no value for an action that was never made; taken as infinity, all untried actions
/// would tie. Here alpha = 1/(n+1).
pub fn benefit(uncertainty: f32, made: u8) -> f32 {
    1.0 - libm::powf(uncertainty.clamp(0.0, 1.0), 1.0 / (f32::from(made) + 1.0))
}

#[cfg(test)]
mod tests;
