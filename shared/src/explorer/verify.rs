//! "The same as this one?": whether slides are of one texture, whatever else they may be of.
//!
//! The score is the one by which a texture is new, with that texture as the only candidate: how much likelier the
//! slides are of a texture that the table does not have. So it takes what is left of the other textures of the table:
//! how much slides of one texture differ, how fingers drift, and how textures differ.

use super::answer::{Answer, Verification};
use super::posterior::{Explorer, Verdict};
use crate::features::Vector;
use crate::table::Against;

/// Slides from which a reference is not one of few any more.
pub const ENOUGH_TRIALS: u8 = 3;

/// Score below which slides are of the only candidate, more probably than `threshold`: it is as likely as any other
/// texture before the first slide.
pub fn same_below(threshold: f32) -> f32 {
    let p = threshold.clamp(0.5, 0.999_999);
    -libm::logf(p / (1.0 - p))
}

impl<const N: usize> Explorer<'_, N> {
    /// As [`Explorer::verdict`]; where the question is whether it is the only candidate, once that is answered, or the
    /// last slide was made.
    pub fn end(&self) -> Option<Verdict> {
        if !self.config.verify {
            return self.verdict();
        }
        let now = self.verification().map(|now| now.answer);
        let over = !matches!(now, None | Some(Answer::Unsure));
        (over || self.slides >= self.config.max_slides).then(|| self.best())
    }

    /// What the slides made so far say of the only candidate. `None` before the first slide, where there are other
    /// candidates, and with a table that has no limits.
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
        let answer = if score > limit {
            Answer::Different
        } else if score < same_below(self.config.threshold) {
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
