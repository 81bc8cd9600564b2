//! "The same as this one?": whether slides are of one texture, whatever else they may be of.
//!
//! The score is the one by which a texture is new, with that texture as the only candidate: how much likelier the slides are of
//! a texture that the table does not have. So it takes what is left of the other textures of the table: how much slides of one
//! texture differ, how fingers drift, and how textures differ.

use super::kernels::Kernels;
use super::posterior::Explorer;
use crate::features::Vector;
use crate::table::Against;

/// Slides from which a reference is not one of few any more.
pub const ENOUGH_TRIALS: u8 = 3;

/// What an exploration says of its only candidate.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Verification {
    /// ln of how much likelier the slides are of another texture, whichever, than of this one.
    pub score: f32,
    /// Score above which it is another one: as many of the slides of this one are above it as
    /// [`Config::false_alarm`](super::Config::false_alarm) says.
    pub limit: f32,
    /// What to tell.
    pub answer: Answer,
}

/// Whether it is the same.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Answer {
    /// It is.
    Same,
    /// It is another one, or this one changed beyond what the table expects.
    Different,
    /// More slides would tell.
    Unsure,
}

impl<const N: usize, K: Kernels> Explorer<'_, N, K> {
    /// What the slides made so far say of the only candidate. `None` before the first slide, where there are other candidates,
    /// and with a table that has no limits.
    pub fn verification(&self) -> Option<Verification> {
        if self.slides == 0 {
            return None;
        }
        self.answer(self.score(&self.episode, Against::Drifted)?, self.slides)
    }

    /// The same of other visits: movements made, their slides, and the whitened mean of these.
    pub fn verify(&self, visits: &[(u8, u8, Vector)]) -> Option<Verification> {
        let slides = visits.iter().map(|visit| u32::from(visit.1)).sum::<u32>();
        let score = self.score_of(visits, Against::Drifted)?;
        self.answer(score, slides.min(255) as u8)
    }

    fn answer(&self, score: f32, slides: u8) -> Option<Verification> {
        let limits = self.limits?;
        if self.candidates != 1 {
            return None;
        }
        let limit = limits.limit(Against::Drifted, slides, self.config.false_alarm);
        // as likely to be this one as any other before the first slide
        let p = self.config.threshold.clamp(0.5, 0.999_999);
        let same = score < -libm::logf(p / (1.0 - p));
        let answer = if score > limit {
            Answer::Different
        } else if same {
            Answer::Same
        } else {
            Answer::Unsure
        };
        Some(Verification {
            score,
            limit,
            answer,
        })
    }
}
