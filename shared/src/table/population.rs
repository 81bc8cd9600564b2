//! The population of textures at a movement, known or not: the covariance of the means that a table has.

use super::limits::MOST_VARIANCE;
use super::matrix::{Square, principal_axes, variances};
use super::scatter::oas;
use super::whitening::Whitening;
use crate::features::{FEATURE_STEPS, MAX_FEATURES, WHITE_STEPS};

/// Fewest textures whose means say what textures are like.
pub const POPULATION: usize = 3;
/// Least variance of the population along an axis.
pub(super) const LEAST: f32 = 0.02;

/// All textures, those of a table taken for a sample of them.
#[derive(Clone, Debug)]
pub struct Population {
    /// From whitened features to the axes of the population, its mean at 0; steps are the same.
    pub(super) axes: Whitening,
    /// Variance along each axis, in standard deviations within a texture squared; 0 beyond the features.
    pub(super) variances: [f32; MAX_FEATURES],
}

impl Population {
    /// From the whitened means of textures, of so many features, and the number of slides of each; `None` where they
    /// are fewer than [`POPULATION`].
    pub fn new<'m>(
        features: usize,
        means: impl Iterator<Item = (u8, &'m [i16])> + Clone,
    ) -> Option<Self> {
        let features = features.min(MAX_FEATURES);
        let means = means.filter(|(slides, _)| *slides > 0);
        let count = means.clone().count();
        if count < POPULATION {
            return None;
        }
        let number = count as f64;
        let mut centre = [0.0; MAX_FEATURES];
        let mut of_slides = 0.0;
        for (slides, mean) in means.clone() {
            of_slides += 1.0 / f64::from(slides) / number;
            for (centre, m) in centre.iter_mut().zip(mean).take(features) {
                *centre += f64::from(*m) / number;
            }
        }
        let mut covariance: Square = [[0.0; MAX_FEATURES]; MAX_FEATURES];
        let steps = f64::from(WHITE_STEPS * WHITE_STEPS) * (number - 1.0);
        for (_, mean) in means {
            let apart = || {
                let each = mean.iter().zip(&centre).take(features);
                each.map(|(m, c)| f64::from(*m) - c)
            };
            for (row, x) in covariance.iter_mut().zip(apart()) {
                for (c, y) in row.iter_mut().zip(apart()) {
                    *c += x * y / steps;
                }
            }
        }
        let axes = principal_axes(&covariance, features);
        let along = variances(&axes, &covariance);
        let d = features as f64;
        let trace: f64 = along.iter().sum();
        let squares: f64 = along.iter().map(|v| v * v).sum();
        let rho = oas(trace, squares, d, number - 1.0);
        let shrunk = |v: f64| (1.0 - rho) * v + rho * trace / d;
        let mut of_textures = [0.0; MAX_FEATURES];
        for (variance, v) in of_textures.iter_mut().zip(along).take(features) {
            *variance = ((shrunk(v) - of_slides) as f32).clamp(LEAST, MOST_VARIANCE);
        }
        // a whitening takes steps of features, which are smaller
        let finer = f64::from(FEATURE_STEPS / WHITE_STEPS);
        let rows = axes.iter().take(features);
        let rows = rows.map(|axis| axis.iter().map(move |a| a * finer));
        Some(Self {
            axes: Whitening::new(features, &centre, rows),
            variances: of_textures,
        })
    }
}
