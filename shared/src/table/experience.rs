//! What a few trials teach of a texture at one movement.

use serde::{Deserialize, Serialize};

use super::PROPERTIES;
use crate::features::{Properties, Property, PropertySet};

/// What was learned of one texture at one movement: number of trials, running mean and sum of squared deviations of each
/// property (Welford).
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Experience {
    pub(super) trials: u8,
    pub(super) mean: [f32; PROPERTIES],
    pub(super) squares: [f32; PROPERTIES],
}

impl Experience {
    /// Takes in one more trial. A property that was not measured, or that is not a finite number, leaves the whole
    /// experience as it was.
    ///
    /// After 255 trials the older ones are slowly forgotten: each new one has the weight of one in 255.
    ///
    /// # Errors
    /// The property of `measured` that the trial lacks.
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

/// What one property of a texture is expected to be (eq. 4). The order of the fields is fixed: [`crate::kernels`].
#[derive(Clone, Copy, PartialEq, Debug)]
#[repr(C)]
pub struct Gaussian {
    /// Mean, in the unit of the property.
    pub mean: f32,
    /// Standard deviation, in the unit of the property.
    pub sd: f32,
}
