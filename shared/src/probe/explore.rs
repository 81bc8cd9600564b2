//! An exploration: slide by slide, the explorer chooses, the rig moves, and the explorer takes in what was measured.

use crate::dsp::Plan;
use crate::explorer::{ExpectedOutcome, Explorer, Verdict, Verification};
use crate::features::{Measurement, Slide};
use crate::rig::{MAX_REJECTED, Rig, RigError};
use crate::table::Action;
use crate::wire::Failure;
pub use crate::wire::Rejection;

/// Random numbers for choices and for where slides begin (xorshift, Marsaglia 2003); not for secrets.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Random(u32);

impl Random {
    /// A row of numbers.
    pub const fn new(seed: u32) -> Self {
        // 0 would stay 0
        Self(if seed == 0 { 0x9E37_79B9 } else { seed })
    }

    /// The next number.
    pub fn next_u32(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }

    pub(crate) fn next_f32(&mut self) -> f32 {
        (self.next_u32() >> 8) as f32 / (1 << 24) as f32
    }
}

/// A step of an exploration; `E` is the rig's error.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum ExplorationStep<'a, E> {
    /// This action comes next; the slice has the expected outcomes of all actions.
    Chosen(Action, &'a [ExpectedOutcome]),
    /// The slide that was made ended early, after so many ms at constant speed: the verdict is certain.
    Early(u16),
    /// The slide was made and taken in; the posterior of every texture.
    Measured(Action, &'a Measurement, &'a [f32]),
    /// Where that was asked: whether it is the only candidate, after so many slides that counted.
    Verified(Verification, u8),
    /// The slide came to nothing and does not count. The choice is made again: see [`Explorer::reject`].
    Rejected(Action, &'a Rejection<E>),
    /// The answer, while the finger is still being lifted.
    Decided {
        /// The answer.
        verdict: &'a Verdict,
        /// Slides that counted.
        slides: u8,
        /// See [`Explorer::is_certain`].
        certain: bool,
    },
    /// The exploration cannot go on: what is known so far, of so many slides. The error follows.
    CutShort(&'a Verdict, u8),
}

/// The reason why an exploration ended without an answer.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
pub enum ExploreError<E> {
    /// The rig failed, and a person is needed.
    #[error(transparent)]
    Rig(E),
    /// [`MAX_REJECTED`] slides in a row came to nothing, or no movement is left, the last one for this reason.
    #[error("no movement gives a good slide: {0}")]
    Rejected(Rejection<E>),
    /// The table has no such movement.
    #[error("the table has no movement {}", .0 + 1)]
    Movement(u8),
}

impl From<ExploreError<RigError>> for Failure {
    fn from(why: ExploreError<RigError>) -> Self {
        match why {
            ExploreError::Rig(why) => Self::Rig(why),
            ExploreError::Rejected(why) => Self::NoGoodSlide(why),
            ExploreError::Movement(movement) => Self::Movement(movement),
        }
    }
}

/// Explores from the beginning until there is an answer. A slide that comes to nothing is made again, then another
/// movement is chosen; only a rig that cannot go on ends it, with what is known so far. `random` serves
/// [`crate::explorer::Strategy::Random`]; `tell` receives every step.
pub async fn explore<R: Rig, const N: usize>(
    rig: &mut R,
    explorer: &mut Explorer<'_, N>,
    plan: &Plan,
    random: impl FnMut() -> u32,
    mut tell: impl FnMut(ExplorationStep<'_, R::Error>),
) -> Result<Verdict, ExploreError<R::Error>> {
    match slides(rig, explorer, plan, random, &mut tell).await {
        Ok(verdict) => rig
            .lifted()
            .await
            .map_err(ExploreError::Rig)
            .map(|()| verdict),
        Err(why) => {
            if explorer.slides() > 0 {
                tell(ExplorationStep::CutShort(
                    &explorer.best(),
                    explorer.slides(),
                ));
            }
            if !matches!(why, ExploreError::Rig(_)) {
                rig.lifted().await.map_err(ExploreError::Rig)?;
            }
            Err(why)
        }
    }
}

/// As [`explore`]; after the last slide the finger may still be on its way up.
async fn slides<R: Rig, const N: usize>(
    rig: &mut R,
    explorer: &mut Explorer<'_, N>,
    plan: &Plan,
    mut random: impl FnMut() -> u32,
    tell: &mut impl FnMut(ExplorationStep<'_, R::Error>),
) -> Result<Verdict, ExploreError<R::Error>> {
    explorer.restart();
    let mut rejected = 0;
    loop {
        if let Some(verdict) = explorer.end() {
            tell(ExplorationStep::Decided {
                verdict: &verdict,
                slides: explorer.slides(),
                certain: explorer.is_certain(),
            });
            return Ok(verdict);
        }
        let mut expected = heapless::Vec::new();
        explorer.evaluate_actions(&mut expected);
        let action = explorer.choose(&expected, random());
        tell(ExplorationStep::Chosen(action, &expected));
        let movement = explorer
            .table()
            .movement(action.movement)
            .ok_or(ExploreError::Movement(action.movement))?;
        let mut slide = Slide::new(plan, movement);
        let made = match rig.lifted().await {
            Ok(()) => early::perform(rig, explorer, action, &mut slide).await,
            Err(failed) => Err(failed),
        };
        let why = match made {
            Err(why) if !rig.recover(&why).await => return Err(ExploreError::Rig(why)),
            Err(why) => Rejection::Rig(why),
            Ok(length) => match early::measure(&mut slide, length) {
                Err(why) => Rejection::Slide(why),
                Ok(measurement) => match early::observe(explorer, action, length, &measurement) {
                    Err(why) => Rejection::Observe(why),
                    Ok(()) => {
                        rejected = 0;
                        if let Some(length) = length {
                            tell(ExplorationStep::Early(length.ms));
                        }
                        let posterior = explorer.posterior();
                        tell(ExplorationStep::Measured(action, &measurement, posterior));
                        if explorer.config().verify
                            && let Some(now) = explorer.verification()
                        {
                            tell(ExplorationStep::Verified(now, explorer.slides()));
                        }
                        continue;
                    }
                },
            },
        };
        rejected += 1;
        tell(ExplorationStep::Rejected(action, &why));
        if !explorer.reject(action) || rejected == MAX_REJECTED {
            return Err(ExploreError::Rejected(why));
        }
    }
}

mod early;
#[cfg(test)]
mod tests;
