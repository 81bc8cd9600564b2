//! The drift of a finger and its samples from one session to the next.
//!
//! Features drift more than the scatter of a session's slides explains. In the raw features it is plain how:
//! neighbouring bands go together, and whatever is no band goes by itself. The whitened axes are turned so that this
//! covariance is diagonal there: a table holds its variances, which come on top of those of means everywhere.
//!
//! The two numbers were chosen on twenty materials of one rig.

use serde::{Deserialize, Serialize};

use super::matrix::Square;
use crate::features::{COARSE_BANDS, FEATURE_STEPS, FeatureSet, LOW_BANDS, MAX_FEATURES};

/// Variances of the drift along the axes of a whitening, of each two their mean: those next to each other are much
/// alike, for axes are in the order of their variances. 0 beyond the features.
pub type Drifts = [f32; PAIRS];
/// Pairs of axes; the last has one where the features are an odd number.
pub const PAIRS: usize = MAX_FEATURES / 2;

/// The drift of a band below 17 Hz, each of which drifts by itself, in parts of that of the others.
const LOW: f64 = 0.6;
/// The drift of the logarithm of P_DC's scatter in parts of that of a band.
const SCATTER: f64 = 0.5;

/// The amount of drift that is expected.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Drift {
    /// Standard deviation of the logarithm of a band's power.
    pub bands: f32,
    /// Standard deviation of traction, and of whatever is no band, as a share of its mean.
    pub traction: f32,
}

impl Default for Drift {
    /// The drift between the begin and the end of a recorded session: 0.4 dB, and 4 %.
    fn default() -> Self {
        Self {
            bands: 0.12,
            traction: 0.04,
        }
    }
}

impl Drift {
    /// One session, and a sample that stays where it is.
    pub const NONE: Self = Self {
        bands: 0.0,
        traction: 0.0,
    };

    /// A table made by hand: how a hand's slides scatter is in its whitening, and the drift of a rig's session on top
    /// of that would hide what tells textures apart.
    pub const BY_HAND: Self = Self {
        bands: 0.05,
        traction: 0.02,
    };

    /// Returns whether no drift is expected.
    pub fn is_none(self) -> bool {
        self == Self::NONE
    }

    /// Returns whether these values are a possible drift: not negative, and small enough to learn with.
    pub fn is_possible(self) -> bool {
        let possible = |sd: f32| (0.0..=10.0).contains(&sd);
        possible(self.bands) && possible(self.traction)
    }

    /// Covariance of the features of `set`, which have these means, in steps^2.
    pub(super) fn covariance(
        self,
        set: FeatureSet,
        features: usize,
        mean: &[f64; MAX_FEATURES],
    ) -> Square {
        let others = set.others();
        // neighbours differ by a band's width: of the coarse ones that is twice as much
        let apart = if features > others + COARSE_BANDS {
            0.25
        } else {
            0.5
        };
        let mut covariance = [[0.0; MAX_FEATURES]; MAX_FEATURES];
        for (i, (row, mean)) in covariance.iter_mut().zip(mean).enumerate().take(features) {
            for (j, c) in row.iter_mut().enumerate().take(features) {
                let band = f64::from(self.bands * FEATURE_STEPS);
                let sd = if i >= others {
                    LOW * band
                } else if set == FeatureSet::Pressure && i == 1 {
                    SCATTER * band
                } else {
                    f64::from(self.traction) * mean
                };
                *c = if i.min(j) >= others + LOW_BANDS {
                    band * band * libm::exp(-apart * i.abs_diff(j) as f64)
                } else if i == j {
                    sd * sd
                } else {
                    0.0
                };
            }
        }
        covariance
    }
}
