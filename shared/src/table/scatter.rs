//! The scatter of slides and textures, and the whitening that follows from it.

use heapless::Vec;

use super::drift::{Drift, Drifts};
use super::format::MAX_MOVEMENTS;
use super::limits::MOST_VARIANCE;
use super::matrix::{
    Square, add, inverse_cholesky, principal_axes, product, transposed, variances,
};
use super::whitening::Whitening;
use crate::features::{FEATURE_STEPS, FeatureSet, MAX_FEATURES, Vector};

/// Weight of the average over all movements, in trials: with few trials of its own a movement's covariance is mostly
/// that.
const SHARED_TRIALS: f64 = 15.0;
/// Variance of what rounding to whole steps adds, in steps^2: no feature is more certain than that.
const ROUNDING: f64 = 1.0 / 12.0;

/// The reasons why a whitening cannot be learned.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum WhitenError {
    #[error("movement {}: no texture has two slides, and how slides of one texture differ takes two", .0 + 1)]
    Trials(u8),
    #[error("the slides do not have the same features")]
    Features,
    #[error("a table has 1 to {MAX_MOVEMENTS} movements")]
    Movements,
}

/// The scatter of slides within textures at one movement, all textures taken together, and the scatter of textures.
#[derive(Clone, Debug)]
pub struct Scatter {
    features: usize,
    /// Sum of all slides, and their number.
    sum: [f64; MAX_FEATURES],
    slides: u32,
    /// Sum of products of deviations from the mean of the own texture, and its degrees of freedom.
    products: Square,
    freedom: u32,
    /// Sum of the means of all textures and of their products, and the number of textures.
    means: [f64; MAX_FEATURES],
    mean_products: Square,
    textures: u32,
}

impl Scatter {
    /// Of slides of so many features.
    pub const fn new(features: usize) -> Self {
        Self {
            features,
            sum: [0.0; MAX_FEATURES],
            slides: 0,
            products: [[0.0; MAX_FEATURES]; MAX_FEATURES],
            freedom: 0,
            means: [0.0; MAX_FEATURES],
            mean_products: [[0.0; MAX_FEATURES]; MAX_FEATURES],
            textures: 0,
        }
    }

    /// Takes in all slides of one texture at this movement.
    pub fn push(&mut self, slides: &[Vector]) -> Result<(), WhitenError> {
        if slides.iter().any(|slide| slide.len() != self.features) {
            return Err(WhitenError::Features);
        }
        let mut mean = [0.0; MAX_FEATURES];
        for slide in slides {
            for (mean, x) in mean.iter_mut().zip(slide) {
                *mean += f64::from(*x);
            }
        }
        for (sum, mean) in self.sum.iter_mut().zip(&mut mean) {
            *sum += *mean;
            *mean /= slides.len().max(1) as f64;
        }
        for slide in slides {
            for ((row, x), mean_row) in self.products.iter_mut().zip(slide).zip(&mean) {
                for ((product, y), mean) in row.iter_mut().zip(slide).zip(&mean) {
                    *product += (f64::from(*x) - mean_row) * (f64::from(*y) - mean);
                }
            }
        }
        if !slides.is_empty() {
            for ((sum, row), x) in self
                .means
                .iter_mut()
                .zip(&mut self.mean_products)
                .zip(&mean)
            {
                *sum += x;
                row.iter_mut()
                    .zip(&mean)
                    .for_each(|(product, y)| *product += x * y);
            }
            self.textures += 1;
        }
        self.slides += slides.len() as u32;
        self.freedom += (slides.len() as u32).saturating_sub(1);
        Ok(())
    }

    /// Pooled covariance, in steps^2.
    fn covariance(&self) -> Square {
        self.products
            .map(|row| row.map(|p| p / f64::from(self.freedom.max(1))))
    }

    /// Covariance of the means of textures, in steps^2.
    fn between(&self) -> Square {
        let textures = f64::from(self.textures.max(1));
        let mut between = self.mean_products;
        for (row, x) in between.iter_mut().zip(&self.means) {
            for (product, y) in row.iter_mut().zip(&self.means) {
                *product = (*product - x * y / textures) / textures;
            }
        }
        between
    }
}

/// The whitening of every movement, from how slides scatter there: pooled covariance, blended with the average over all
/// movements, its correlations shrunk towards none (OAS), and turned so that means of textures are uncorrelated; for
/// features that drift, into the axes along which the drift has no covariances, and its variances along these.
pub fn whiten_drifting(
    scatters: &[Scatter],
    set: FeatureSet,
    drift: Drift,
) -> Result<Vec<(Whitening, Drifts), MAX_MOVEMENTS>, WhitenError> {
    let features = scatters.first().ok_or(WhitenError::Movements)?.features;
    if features == 0 || features > MAX_FEATURES || scatters.iter().any(|s| s.features != features) {
        return Err(WhitenError::Features);
    }
    if let Some(movement) = scatters.iter().position(|s| s.freedom == 0) {
        return Err(WhitenError::Trials(movement as u8));
    }
    let mut average = [[0.0; MAX_FEATURES]; MAX_FEATURES];
    for scatter in scatters {
        add(
            &mut average,
            &scatter.covariance(),
            1.0 / scatters.len() as f64,
        );
    }
    let mut whitenings = Vec::new();
    for scatter in scatters {
        let freedom = f64::from(scatter.freedom);
        let shared = SHARED_TRIALS / (SHARED_TRIALS + freedom);
        let mut covariance = [[0.0; MAX_FEATURES]; MAX_FEATURES];
        add(&mut covariance, &scatter.covariance(), 1.0 - shared);
        add(&mut covariance, &average, shared);
        let mut deviations = [0.0; MAX_FEATURES];
        for (at, (deviation, row)) in deviations.iter_mut().zip(&covariance).enumerate() {
            *deviation = libm::sqrt(row.get(at).copied().unwrap_or_default().max(ROUNDING));
        }
        let mut correlation = covariance;
        for (row, sd_row) in correlation.iter_mut().zip(&deviations) {
            for (c, sd) in row.iter_mut().zip(&deviations) {
                *c /= sd_row * sd;
            }
        }
        shrink(&mut correlation, features, freedom);
        let inverse = inverse_cholesky(&correlation, features);
        let in_deviations = |mut covariance: Square| {
            for (row, sd_row) in covariance.iter_mut().zip(&deviations) {
                row.iter_mut()
                    .zip(&deviations)
                    .for_each(|(c, sd)| *c /= sd_row * sd);
            }
            product(&product(&inverse, &covariance), &transposed(&inverse))
        };
        let mean = scatter
            .sum
            .map(|sum| sum / f64::from(scatter.slides.max(1)));
        let drifted = in_deviations(drift.covariance(set, features, &mean));
        let apart = if drift.is_none() {
            in_deviations(scatter.between())
        } else {
            drifted
        };
        let axes = principal_axes(&apart, features);
        let along = variances(&axes, &drifted);
        let mut drifts = Drifts::default();
        let pairs = along.get(..features).unwrap_or_default().chunks(2);
        for (drift, pair) in drifts.iter_mut().zip(pairs) {
            let mean = pair.iter().sum::<f64>() / pair.len() as f64;
            *drift = (mean as f32).clamp(0.0, MOST_VARIANCE);
        }
        let canonical = product(&axes, &inverse);
        // per unit of the feature, not per step
        let rows = canonical.iter().take(features).map(|row| {
            let weights = row.iter().zip(&deviations);
            weights.map(|(w, sd)| w / sd * f64::from(FEATURE_STEPS))
        });
        let whitening = Whitening::new(features, &mean, rows);
        whitenings
            .push((whitening, drifts))
            .map_err(|_| WhitenError::Movements)?;
    }
    Ok(whitenings)
}

/// Weight of a sphere beside a covariance of `d` features from `n` degrees of freedom, by its trace and that of its
/// square (OAS, Chen et al. 2010, eq. 23).
pub(crate) fn oas(trace: f64, of_square: f64, d: f64, n: f64) -> f64 {
    let above = (1.0 - 2.0 / d) * of_square + trace * trace;
    let below = (n + 1.0 - 2.0 / d) * (of_square - trace * trace / d);
    if above < below { above / below } else { 1.0 }
}

/// Draws correlations towards 0 by as much as so few degrees of freedom deserve.
fn shrink(correlation: &mut Square, features: usize, freedom: f64) {
    let d = features as f64;
    let squares = correlation
        .iter()
        .take(features)
        .flat_map(|row| row.iter().take(features));
    let lambda = oas(d, squares.map(|c| c * c).sum(), d, freedom);
    for (at, row) in correlation.iter_mut().enumerate() {
        for (other, c) in row.iter_mut().enumerate() {
            *c = if at == other {
                1.0
            } else {
                (1.0 - lambda) * *c
            };
        }
    }
}
