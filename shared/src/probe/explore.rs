//! An exploration: slide by slide, the explorer chooses, the rig moves, and the explorer takes in what was measured.

use core::fmt;

use crate::dsp::Plan;
use crate::explorer::{ExpectedOutcome, Explorer, Kernels, ObserveError, Verdict};
use crate::features::{Measurement, Observation, Slide, SlideError};
use crate::rig::{MAX_REJECTED, Rig};
use crate::table::Action;

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

    /// The next number from 0 to 1, without 1.
    pub fn next_f32(&mut self) -> f32 {
        (self.next_u32() >> 8) as f32 / (1 << 24) as f32
    }
}

/// What an exploration does, as it does it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum ExplorationStep<'a> {
    /// This action comes next; the slice has the expected outcomes of all actions.
    Chosen(Action, &'a [ExpectedOutcome]),
    /// The slide was made and taken in; the posterior of every texture.
    Measured(Action, &'a Measurement, &'a [f32]),
    /// The slide was made, but has no value of the property. It does not count: the choice is made again, and is the same
    /// unless it is random.
    Rejected(Action, Rejection),
    /// The answer, while the finger is still being lifted.
    Decided {
        /// The answer.
        verdict: &'a Verdict,
        /// Slides that counted.
        slides: u8,
        /// See [`Explorer::is_certain`].
        certain: bool,
    },
}

/// Why a slide does not count.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Rejection {
    /// Its samples give no properties.
    Slide(SlideError),
    /// Its properties say nothing to the explorer.
    Observe(ObserveError),
}

impl fmt::Display for Rejection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Slide(why) => why.fmt(f),
            Self::Observe(why) => why.fmt(f),
        }
    }
}

/// Why an exploration ended without an answer.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum ExploreError<E> {
    /// The rig failed.
    Rig(E),
    /// [`MAX_REJECTED`] slides in a row were no good, the last one for this reason.
    Rejected(Rejection),
    /// The table has no such movement.
    Movement(u8),
}

impl<E: fmt::Display> fmt::Display for ExploreError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rig(why) => why.fmt(f),
            Self::Rejected(why) => write!(f, "{MAX_REJECTED} slides in a row were no good: {why}"),
            Self::Movement(index) => write!(f, "the table has no movement {}", index + 1),
        }
    }
}

impl<E: fmt::Debug + fmt::Display> core::error::Error for ExploreError<E> {}

/// Explores from the beginning until there is an answer. `random` serves [`crate::explorer::Strategy::Random`]; `tell`
/// receives every step.
///
/// # Errors
/// See [`ExploreError`].
pub async fn explore<R: Rig, const N: usize, K: Kernels>(
    rig: &mut R,
    explorer: &mut Explorer<'_, N, K>,
    plan: &Plan,
    random: impl FnMut() -> u32,
    tell: impl FnMut(ExplorationStep<'_>),
) -> Result<Verdict, ExploreError<R::Error>> {
    let answer = slides(rig, explorer, plan, random, tell).await;
    if !matches!(answer, Err(ExploreError::Rig(_))) {
        rig.lifted().await.map_err(ExploreError::Rig)?;
    }
    answer
}

/// As [`explore`]; after the last slide the finger may still be on its way up.
async fn slides<R: Rig, const N: usize, K: Kernels>(
    rig: &mut R,
    explorer: &mut Explorer<'_, N, K>,
    plan: &Plan,
    mut random: impl FnMut() -> u32,
    mut tell: impl FnMut(ExplorationStep<'_>),
) -> Result<Verdict, ExploreError<R::Error>> {
    explorer.restart();
    let mut rejected = 0;
    loop {
        if let Some(verdict) = explorer.verdict() {
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
        let mut slide = Slide::<K>::new(plan);
        rig.lifted().await.map_err(ExploreError::Rig)?;
        rig.perform(movement, &mut slide)
            .await
            .map_err(ExploreError::Rig)?;
        let measured = slide
            .finish()
            .map_err(Rejection::Slide)
            .and_then(|measurement| {
                explorer
                    .observe(action, &Observation::from(&measurement))
                    .map_err(Rejection::Observe)?;
                Ok(measurement)
            });
        match measured {
            Ok(measurement) => {
                rejected = 0;
                tell(ExplorationStep::Measured(
                    action,
                    &measurement,
                    explorer.posterior(),
                ));
            }
            Err(why) => {
                rejected += 1;
                tell(ExplorationStep::Rejected(action, why));
                if rejected == MAX_REJECTED {
                    return Err(ExploreError::Rejected(why));
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
