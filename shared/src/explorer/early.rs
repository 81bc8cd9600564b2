//! The decision to end a slide before its end: the posterior after what it has said so far, by a table that knows
//! slides of that length.
//!
//! A probability that is read again and again while a slide goes on is above a threshold more often by chance than one
//! that is read once. So it is read at a few lengths only, and has to be more certain than at the end of a slide.

use super::config::{Method, ObserveError};
use super::novelty::NoveltyModel;
use super::posterior::{Explorer, LEAST};
use crate::features::Observation;
use crate::table::Action;

/// The first part of a slide, after the slides before it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Look {
    /// The most probable texture.
    pub texture: u16,
    /// Probability of all others together.
    pub doubt: f32,
    /// True if it is probable enough, and looks like one of the candidates, and as that was learned.
    pub known: bool,
}

impl Look {
    pub(crate) fn is_enough(&self, most_doubt: f32) -> bool {
        self.known && self.doubt <= most_doubt
    }
}

/// Most doubt with which a slide ends early, unless somebody says otherwise; `None` for a method that makes all slides
/// to their end.
///
/// Gaussians that were learned from five slides are surer than they may be, the more so when the finger has drifted:
/// however small the doubt, the paper's method is wrong more often when it is asked more often.
pub const fn most_doubt(method: Method) -> Option<f32> {
    match method {
        Method::Fused => Some(1e-5),
        Method::Paper | Method::Student | Method::StudentAll => None,
    }
}

impl<const N: usize> Explorer<'_, N> {
    /// What the exploration would say if the slide of an action ended now, at the `n`th length of the table, from 1.
    /// The exploration stands as it was. `None`: the table does not know how slides of that length are for every
    /// candidate, or the method cannot tell.
    pub fn look(
        &mut self,
        action: Action,
        n: u8,
        slide: &Observation,
    ) -> Result<Option<Look>, ObserveError> {
        let Some((_, part)) = self.part(action, n) else {
            return Ok(None);
        };
        let (log, posterior) = (self.log.clone(), self.posterior.clone());
        let (log_odds, slides, visits) = (self.log_odds, self.slides, self.episode.len());
        let agreed = self.agreed;
        let look = self.compare(part, slide).map(|()| {
            self.slides = slides.saturating_add(1);
            self.as_it_stands()
        });
        (self.log, self.posterior) = (log, posterior);
        (self.log_odds, self.slides, self.agreed) = (log_odds, slides, agreed);
        // one that was there before is another one's: a slide that ended early is the last of its exploration
        self.episode.truncate(visits);
        look.map(Some)
    }

    /// Takes in a slide of an action that ended at the `n`th length. Whether it did: otherwise the table does not know
    /// that length.
    pub fn observe_early(
        &mut self,
        action: Action,
        n: u8,
        slide: &Observation,
    ) -> Result<bool, ObserveError> {
        let Some((made, part)) = self.part(action, n) else {
            return Ok(false);
        };
        self.compare(part, slide)?;
        self.count(made, action);
        Ok(true)
    }

    fn as_it_stands(&self) -> Look {
        let (mut texture, mut most, mut doubt) = (0, 0.0, 0.0);
        for (&probability, at) in self.posterior.iter().zip(0..) {
            if probability > most {
                doubt += most;
                (texture, most) = (at, probability);
            } else {
                doubt += probability;
            }
        }
        let sure = most > self.config.threshold;
        let known = sure && self.fits() && !self.is_changed();
        Look {
            texture,
            doubt,
            known,
        }
    }

    fn part(&mut self, action: Action, n: u8) -> Option<(usize, Action)> {
        let least = match (self.config.method, action.property) {
            (Method::Fused, None) => 1,
            (Method::Paper, Some(_)) => 2,
            _ => return None,
        };
        if self.candidates < 2 || self.config.verify || self.config.learn {
            return None;
        }
        let made = self.actions.iter().position(|&a| a == action)?;
        let movement = self.table.at_length(action.movement, n)?;
        let mut candidates = self.log.iter().zip(0..).filter(|(log, _)| **log >= LEAST);
        if !candidates.all(|(_, texture)| self.table.trials(texture, movement) >= least) {
            return None;
        }
        let mut models = self.novelty_models.iter();
        if least == 1 && models.all(|model| model.movement != movement) {
            let model = NoveltyModel::new(&self.table, movement);
            self.novelty_models.push(model).ok()?;
        }
        Some((made, Action { movement, ..action }))
    }
}
