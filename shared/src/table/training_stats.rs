//! The statistics that a table keeps of a texture at one movement, from a few trials.

use serde::{Deserialize, Serialize};

use super::gaussian::Gaussian;
use crate::features::{MAX_FEATURES, Properties, Property, PropertySet};

/// The training statistics of one texture at one movement: number of trials, running mean and sum of squared deviations
/// of each property (Welford).
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Experience {
    pub(super) trials: u8,
    pub(super) mean: [f32; Property::ALL.len()],
    pub(super) squares: [f32; Property::ALL.len()],
}

impl Experience {
    /// Takes in one more trial. A property that was not measured, or that is not a finite number, leaves the whole
    /// experience as it was.
    ///
    /// After 255 trials the older ones are slowly forgotten: each new one has the weight of one in 255.
    /// Errors: the property of `measured` that the trial lacks.
    pub fn learn(&mut self, measured: PropertySet, trial: &Properties) -> Result<(), Property> {
        let mut next = *self;
        next.trials = self.trials.saturating_add(1);
        let n = f32::from(next.trials);
        // 1 up to 255 trials; beyond them the sum of squares stays that of 255
        let keep = f32::from(next.trials - 1) / f32::from(self.trials.max(1));
        for (property, (mean, squares)) in Property::ALL
            .into_iter()
            .zip(next.mean.iter_mut().zip(&mut next.squares))
        {
            if measured.contains(property) {
                let x = trial
                    .get(property)
                    .filter(|x| x.is_finite())
                    .ok_or(property)?;
                let before = x - *mean;
                *mean += before / n;
                *squares = *squares * keep + before * (x - *mean);
            }
        }
        *self = next;
        Ok(())
    }

    /// Number of trials, 255 for more.
    pub const fn trials(&self) -> u8 {
        self.trials
    }

    /// Mean and standard deviation (n - 1) of `property`; `None` before the second trial.
    pub fn gaussian(&self, property: Property) -> Option<Gaussian> {
        let (mean, squares) = (
            self.mean.get(property.index())?,
            self.squares.get(property.index())?,
        );
        (self.trials >= 2).then(|| Gaussian {
            mean: *mean,
            sd: libm::sqrtf(squares / f32::from(self.trials - 1)),
        })
    }
}

/// Features as they are stored: as many as there are, up to the last that is not 0.
mod without_zeros_behind {
    use heapless::Vec;
    use serde::{Deserialize as _, Deserializer, Serialize as _, Serializer};

    use crate::features::{MAX_FEATURES, Vector};

    pub(super) fn serialize<S: Serializer>(
        mean: &[i16; MAX_FEATURES],
        to: S,
    ) -> Result<S::Ok, S::Error> {
        let many = mean
            .iter()
            .rposition(|m| *m != 0)
            .map_or(0, |last| last + 1);
        let there: Vector =
            Vec::from_slice(mean.get(..many).unwrap_or_default()).unwrap_or_default();
        there.serialize(to)
    }

    pub(super) fn deserialize<'b, D: Deserializer<'b>>(
        from: D,
    ) -> Result<[i16; MAX_FEATURES], D::Error> {
        let mut mean = [0; MAX_FEATURES];
        let there = Vector::deserialize(from)?;
        mean.iter_mut().zip(there).for_each(|(to, m)| *to = m);
        Ok(mean)
    }
}

/// The data of a texture at one movement: the mean of its whitened slides, and their number.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Whitened {
    /// Slides, 255 for more.
    pub slides: u8,
    /// Their mean in steps of 1/256 standard deviation; 0 beyond the features of the table.
    #[serde(with = "without_zeros_behind")]
    pub mean: [i16; MAX_FEATURES],
}

impl Whitened {
    /// Slides that count at most when a texture is learned on the go: the mean follows what changes slowly. With the 8
    /// of the recipe it lags behind a real session's drift, until nothing passes the gate any more and the texture is
    /// lost; 3 was chosen on one half of the materials and holds on the other (tests/fused_recipe.rs).
    pub(crate) const MEMORY: u8 = 3;

    /// Takes in a whitened slide of a training: all have the same weight.
    pub fn teach(&mut self, slide: &[i16]) {
        self.follow(slide, self.slides);
        self.slides = self.slides.saturating_add(1);
    }

    /// Takes in a whitened slide on the go.
    pub fn adapt(&mut self, slide: &[i16]) {
        self.follow(slide, self.slides.min(Self::MEMORY));
        self.slides = self
            .slides
            .max(self.slides.saturating_add(1).min(Self::MEMORY));
    }

    fn follow(&mut self, slide: &[i16], before: u8) {
        for (mean, z) in self.mean.iter_mut().zip(slide) {
            let apart = f32::from(*z) - f32::from(*mean);
            let step = libm::roundf(apart / (f32::from(before) + 1.0));
            // between two numbers of the type
            *mean = (f32::from(*mean) + step) as i16;
        }
    }
}

/// The training statistics of a texture at one movement, in the form of its table.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub enum TrainingStats {
    /// For a table of Gaussians.
    Gaussians(Experience),
    /// For a fused table.
    Fused(Whitened),
}

impl TrainingStats {
    /// Trials so far.
    pub const fn trials(&self) -> u8 {
        match self {
            Self::Gaussians(experience) => experience.trials(),
            Self::Fused(whitened) => whitened.slides,
        }
    }
}
