//! What a slide says about every candidate: likelihoods (eq. 4) of one property, of all properties, or of all features.

use super::config::{Method, ObserveError};
use super::episode::{Episode, MovementSums, one_more};
use super::posterior::{Explorer, rebase};
use super::student::{ShrinkagePrior, Student};
use super::whitened;
use crate::dsp::fixed::ln_q16;
use crate::features::{Observation, Property};
use crate::table::{Action, Against, Contents, Gaussian, Gaussians, mean_step};

/// Most that the likelihood of a slide takes from a logarithm.
const MOST: i32 = 1 << 26;
/// Slides after which the greatest logarithm is made 0 again. Four times [`MOST`] below [`FLOOR`] is not [`LEAST`] yet.
const SLIDES: u8 = 4;

/// A property this many standard deviations off, squared and halved, counts as no farther: 1024 in Q16.
const MOST_OFF: i32 = (1 << 26) - 1;

impl<const N: usize> Explorer<'_, N> {
    /// Takes in a slide: what `action` looks at is compared with what every candidate would feel like (eq. 3, 4). The
    /// rest of the slide is not used.
    pub fn observe(&mut self, action: Action, slide: &Observation) -> Result<(), ObserveError> {
        let made = self
            .actions
            .iter()
            .position(|&a| a == action)
            .filter(|&at| at < self.made.len());
        let made = made.ok_or(ObserveError::Action(action))?;
        self.compare(action, slide)?;
        self.count(made, action);
        Ok(())
    }

    pub(super) fn compare(
        &mut self,
        action: Action,
        slide: &Observation,
    ) -> Result<(), ObserveError> {
        match action.property {
            None if self.config.method == Method::Fused => self.observe_features(action, slide),
            Some(property) => self.observe_property(action, property, slide),
            None => self.observe_properties(action, slide),
        }
    }

    pub(super) fn count(&mut self, made: usize, action: Action) {
        if let Some(made) = self.made.get_mut(made) {
            *made = made.saturating_add(1);
        }
        if let Some(failed) = self.failed.get_mut(usize::from(action.movement)) {
            *failed = 0;
        }
        self.slides = self.slides.saturating_add(1);
    }

    /// The value of a property of a slide, at most twice as far out as any mean that a table can hold: squares stay
    /// finite.
    fn value(slide: &Observation, property: Property) -> Result<f32, ObserveError> {
        let reach = mean_step(property) * 65536.0;
        let x = slide.properties.get(property).filter(|x| x.is_finite());
        x.map(|x| x.clamp(-reach, reach))
            .ok_or(ObserveError::Missing(property))
    }

    fn observe_property(
        &mut self,
        action: Action,
        property: Property,
        slide: &Observation,
    ) -> Result<(), ObserveError> {
        let x = Self::value(slide, property)?;
        if self.slides > 0 && (self.slides.is_multiple_of(SLIDES) || self.slides == u8::MAX) {
            rebase(&mut self.log);
        }
        if self.config.method == Method::Paper {
            let known = self.table.gaussians(action);
            add_gaussians(x / mean_step(property), &known, &mut self.log);
        } else {
            self.add_students(x, action.movement, property, 1);
        }
        self.normalize();
        Ok(())
    }

    fn add_students(&mut self, x: f32, movement: u8, property: Property, slides: u8) {
        let mut student: Option<Student> = None;
        for texture in 0..self.table.textures() {
            let Some((shrinkage, known, trials)) = self.shrinkage_of(texture, movement, property)
            else {
                continue;
            };
            let expected = shrinkage.expect(known, trials, slides);
            let freedom = shrinkage.freedom + (f32::from(trials) - 1.0);
            // mostly that of the texture before, which has as many trials
            let student = match student {
                Some(ref last) if last.freedom() == freedom => last,
                _ => student.insert(Student::new(freedom)),
            };
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
        if let Some(sums) = one_more(&mut self.episode, action.movement) {
            for (property, sum) in Property::ALL.into_iter().zip(&mut sums.properties) {
                *sum += Self::value(slide, property).unwrap_or(0.0);
            }
        }
        self.reset_to_prior();
        for at in 0..self.episode.len() {
            let Some(sums) = self.episode.get(at).copied() else {
                continue;
            };
            for property in self.measured.iter() {
                let Some(sum) = sums.properties.get(property.index()) else {
                    continue;
                };
                self.add_students(
                    sum / f32::from(sums.slides),
                    sums.movement,
                    property,
                    sums.slides,
                );
            }
            rebase(&mut self.log);
        }
        self.normalize();
        Ok(())
    }

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
        if let Some(sums) = one_more(&mut self.episode, action.movement) {
            for (sum, z) in sums.white.iter_mut().zip(&white) {
                *sum += i32::from(*z);
            }
            if let Some(pace) = slide.pace {
                sums.pace += i32::from(pace);
                sums.paces = sums.paces.saturating_add(1);
            }
        }
        self.agree(action.movement, &white, slide.pace);
        self.reset_to_prior();
        // the posterior is overwritten below
        let elsewhere = whitened::add_likelihoods(
            &self.table,
            &self.episode,
            &self.novelty_models,
            true,
            &mut self.log,
            &mut self.posterior,
        );
        let (top, sum) = self.normalize();
        self.log_odds = elsewhere.and_then(|(elsewhere, can_tell)| match &self.limits {
            Some(limits) => {
                let slides = self.slides.saturating_add(1);
                let share = self.config.false_alarm;
                let limit = self.limit(limits, Against::Drifted, slides, share);
                Some(elsewhere - top - limit)
            }
            None => can_tell.then(|| elsewhere - (top + self.mean_of(sum))),
        });
        Ok(())
    }

    /// Takes a slide into [`agreed`](Self::agreed).
    fn agree(&mut self, movement: u8, white: &[i16], pace: Option<i16>) {
        if !self.config.learn || self.slides > 0 && self.agreed.is_none() {
            return;
        }
        let mut alone = Episode::new();
        // one has room
        let _ = alone.push(MovementSums {
            pace: pace.map_or(0, i32::from),
            paces: u8::from(pace.is_some()),
            ..MovementSums::of(movement, 1, white)
        });
        self.reset_to_prior();
        // the posterior is overwritten later
        whitened::add_likelihoods(
            &self.table,
            &alone,
            &self.novelty_models,
            true,
            &mut self.log,
            &mut self.posterior,
        );
        let all = self.log.iter().zip(0..).max_by_key(|(log, _)| **log);
        let lead = all.map(|(_, texture)| texture);
        self.agreed = lead.filter(|lead| self.slides == 0 || self.agreed == Some(*lead));
    }

    pub(super) fn expected(
        &self,
        texture: u16,
        movement: u8,
        property: Property,
    ) -> Option<Gaussian> {
        if self.config.method == Method::Paper {
            return self.table.gaussian(texture, Action::of(movement, property));
        }
        let (shrinkage, known, trials) = self.shrinkage_of(texture, movement, property)?;
        Some(shrinkage.expect(known, trials, 1))
    }

    fn shrinkage_of(
        &self,
        texture: u16,
        movement: u8,
        property: Property,
    ) -> Option<(ShrinkagePrior, Gaussian, u8)> {
        let at = usize::from(movement) * Property::ALL.len() + property.index();
        let shrinkage = self.shrinkage.get(at)?;
        let known = self
            .table
            .gaussian(texture, Action::of(movement, property))?;
        Some((*shrinkage, known, self.table.trials(texture, movement)))
    }
}

/// Adds the likelihood (eq. 4; ln, Q16, up to a constant) of every texture when a property is `x`, in steps of the
/// means. Where nothing was learned, the standard deviation is 0, it adds nothing.
#[inline(never)]
fn add_gaussians(x: f32, known: &Gaussians<'_>, logs: &mut [i32]) {
    let scale = known.scale();
    for (log, [mean, sd]) in logs.iter_mut().zip(known.cells()) {
        let (mean, sd) = (mean as i16, sd);
        if sd > 0 {
            let z = (x - f32::from(mean)) / f32::from(sd) * scale;
            // to the nearest number that 32 bits hold
            let off = (z * z) as i32;
            *log -= off.min(MOST_OFF) + ln_q16(u64::from(sd) << 16);
        }
    }
}
