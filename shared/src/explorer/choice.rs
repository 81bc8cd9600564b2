//! The next movement: the one that should leave the least confusion among the textures that are still likely (eq. 7,
//! 11-13).

use heapless::Vec;
use serde::{Deserialize, Serialize};

use super::config::{Method, NEGLIGIBLE, Strategy};
use super::gaussians::{
    self, LiveGaussian, LiveTexture, confused, exp_neg, uncertainty_of, uncertainty_of_one,
};
use super::likeness;
use super::posterior::Explorer;
use crate::features::Property;
use crate::table::{Action, Gaussian, MAX_ACTIONS};

/// Slides of a movement that come to nothing, one after the other, before it is left out for the rest of the
/// exploration.
const TRIES: u8 = 2;

/// The expected outcome of an action.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ExpectedOutcome {
    /// The action.
    pub action: Action,
    /// Uncertainty that is expected to remain after it (eq. 11), 0 to 1.
    pub uncertainty: f32,
    /// Its benefit (eq. 12), lower the more often it was made.
    pub benefit: f32,
}
/// Degree of confusion of two textures by one property (eq. 7): 1 for equal, 0 for disjoint distributions.
pub fn confusion(a: Gaussian, b: Gaussian) -> f32 {
    confused(a, b)
}

impl<const N: usize> Explorer<'_, N> {
    /// The slide that `action` asked for came to nothing: it was not made, or it gave no features. Its movement is
    /// tried once more, then left out for the rest of this exploration. Whether anything is left to choose from.
    pub fn reject(&mut self, action: Action) -> bool {
        if let Some(failed) = self.failed.get_mut(usize::from(action.movement)) {
            *failed = failed.saturating_add(1);
        }
        self.actions.iter().any(|action| !self.is_left_out(*action))
    }

    fn is_left_out(&self, action: Action) -> bool {
        let failed = self.failed.get(usize::from(action.movement));
        failed.is_some_and(|&failed| failed >= TRIES)
    }

    /// The next action, given the `outcomes` of [`Explorer::expected_outcomes`], of those that are not left out. While
    /// all are ([`Explorer::reject`]), it means nothing. [`Strategy::Random`] takes its choice from `random`; the
    /// other strategies ignore it.
    pub fn choose(&self, outcomes: &[ExpectedOutcome], random: u32) -> Action {
        let chosen = match self.config.strategy {
            Strategy::Bayesian => {
                let outcomes = outcomes.iter().filter(|o| !self.is_left_out(o.action));
                // the first of equals
                let best = outcomes.reduce(|best, next| {
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
                let actions = || self.actions.iter().filter(|a| !self.is_left_out(**a));
                let at = (u64::from(random) * actions().count() as u64) >> 32;
                actions().nth(at as usize).copied()
            }
        };
        // there is always an action: `among` refuses to begin without
        chosen.unwrap_or(Action {
            movement: 0,
            property: None,
        })
    }

    /// The expected outcome of every action after the slides so far, in the order of the actions.
    pub fn expected_outcomes(&self) -> Vec<ExpectedOutcome, MAX_ACTIONS> {
        let mut outcomes = Vec::new();
        self.evaluate_actions(&mut outcomes);
        outcomes
    }

    /// As [`Explorer::expected_outcomes`], for callers with a buffer for it: it is large, and not moved then.
    pub fn evaluate_actions(&self, outcomes: &mut Vec<ExpectedOutcome, MAX_ACTIONS>) {
        outcomes.clear();
        let actions = self.actions.iter().zip(&self.made).zip(&self.at_first);
        for ((&action, &made), &at_first) in actions {
            let uncertainty = match self.slides {
                0 => at_first,
                _ => self.uncertainty(self.config.method, action),
            };
            // `outcomes` holds MAX_ACTIONS, and there are no more actions
            let _ = outcomes.push(ExpectedOutcome {
                action,
                uncertainty,
                benefit: benefit(uncertainty, made),
            });
        }
    }

    /// What cycling goes through: the best action of each property when nothing is known, properties in their order;
    /// where all is looked at, every movement. What is left out is not among them.
    pub fn turns(&self) -> impl Iterator<Item = Action> {
        let all = self
            .actions
            .iter()
            .copied()
            .filter(|a| a.property.is_none() && !self.is_left_out(*a));
        let each = Property::ALL.into_iter().filter_map(|property| {
            let of_property = self
                .actions
                .iter()
                .zip(&self.at_first)
                .filter(|(a, _)| a.property == Some(property) && !self.is_left_out(**a));
            of_property
                .reduce(|best, next| if next.1 < best.1 { next } else { best })
                .map(|(&action, _)| action)
        });
        all.chain(each)
    }

    /// Expected uncertainty after `action` (eq. 11).
    ///
    /// Computed as eq. 10: 1 minus a sum that is close to 1 would lose the digits that decide late in an exploration.
    pub(super) fn uncertainty(&self, method: Method, action: Action) -> f32 {
        let movement = action.movement;
        if method == Method::Fused {
            return likeness::uncertainty::<N>(&self.table, movement, &self.posterior);
        }
        if let Some(property) = self.only_property(action) {
            let mut live: Vec<LiveGaussian, N> = Vec::new();
            let action = Action::of(movement, property);
            self.gather_one(method, action, &self.posterior, &mut live);
            return uncertainty_of_one(&mut live);
        }
        let mut live: Vec<LiveTexture, N> = Vec::new();
        self.gather(action, &self.posterior, &mut live);
        uncertainty_of(&mut live, self.measured.iter().count())
    }

    pub(super) fn only_property(&self, action: Action) -> Option<Property> {
        let mut measured = self.measured.iter();
        let (first, second) = (measured.next(), measured.next());
        action.property.or(first.filter(|_| second.is_none()))
    }

    /// The textures that are still likely, with what is expected of the property that `action` looks at.
    pub(super) fn gather_one(
        &self,
        method: Method,
        action: Action,
        posterior: &[f32],
        live: &mut Vec<LiveGaussian, N>,
    ) {
        if method == Method::Paper {
            return gaussians::gather_one(&self.table, action, posterior, live);
        }
        for (&probability, texture) in posterior.iter().zip(0..) {
            if probability >= NEGLIGIBLE {
                let expected = action
                    .property
                    .and_then(|property| self.expected(texture, action.movement, property));
                gaussians::push(live, probability, expected);
            }
        }
    }

    /// The textures that are still likely, with what is expected of all properties that are measured.
    pub(super) fn gather(&self, action: Action, posterior: &[f32], live: &mut Vec<LiveTexture, N>) {
        for (&probability, texture) in posterior.iter().zip(0..) {
            if probability >= NEGLIGIBLE {
                let mut candidate = LiveTexture::new(probability);
                for (slot, property) in candidate.expected.iter_mut().zip(self.measured.iter()) {
                    let expected = self.expected(texture, action.movement, property);
                    *slot = expected.unwrap_or(*slot);
                }
                // `live` has space: `posterior` is no longer than N
                let _ = live.push(candidate);
            }
        }
    }
}

/// Benefit of an action that leaves `uncertainty` and was made `made` times before (eq. 12).
///
/// Eq. 13 reads alpha = 1/n, which has no value for an action that was never made; taken as infinity, all untried
/// actions would tie. Here alpha = 1/(n+1).
pub fn benefit(uncertainty: f32, made: u8) -> f32 {
    if made == 0 {
        return 1.0 - uncertainty.clamp(0.0, 1.0);
    }
    // a power of `libm` would take 1.3 KB of flash
    let log = libm::logf(uncertainty.clamp(0.0, 1.0));
    1.0 - exp_neg(-log / (f32::from(made) + 1.0))
}
