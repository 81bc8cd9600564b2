//! How slides and textures scatter, and the whitening that follows from it.

use heapless::Vec;

use super::format::MAX_MOVEMENTS;
use super::whitening::Whitening;
use crate::features::{FEATURE_STEPS, MAX_FEATURES, Vector};

/// Weight of the average over all movements, in trials: with few trials of its own a movement's covariance is mostly that.
const SHARED_TRIALS: f64 = 15.0;
/// Variance of what rounding to whole steps adds, in steps^2: no feature is more certain than that.
const ROUNDING: f64 = 1.0 / 12.0;
/// Rounds of rotations for the axes along which textures differ.
const SWEEPS: usize = 12;
/// Least part of a feature's variance that the features before it may leave unexplained.
const LEAST_PIVOT: f64 = 1e-6;

/// Why a whitening cannot be learned.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum WhitenError {
    /// No texture has two slides of this movement.
    #[error("movement {}: no texture has two slides, and how slides of one texture differ takes two", .0 + 1)]
    Trials(u8),
    /// Slides have different numbers of features, or none.
    #[error("the slides do not have the same features")]
    Features,
    /// No movement, or more than a table holds.
    #[error("a table has 1 to {MAX_MOVEMENTS} movements")]
    Movements,
}

type Square = [[f64; MAX_FEATURES]; MAX_FEATURES];

/// How the slides of each texture differ at one movement, all textures taken together, and how textures differ.
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
    ///
    /// # Errors
    /// [`WhitenError::Features`].
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
/// movements, its correlations shrunk towards none (OAS), and turned so that means of textures are uncorrelated.
///
/// # Errors
/// See [`WhitenError`].
pub fn whiten(scatters: &[Scatter]) -> Result<Vec<Whitening, MAX_MOVEMENTS>, WhitenError> {
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
        let mut between = scatter.between();
        for (row, sd_row) in between.iter_mut().zip(&deviations) {
            row.iter_mut()
                .zip(&deviations)
                .for_each(|(c, sd)| *c /= sd_row * sd);
        }
        let axes = principal_axes(
            &product(&product(&inverse, &between), &transposed(&inverse)),
            features,
        );
        let canonical = product(&axes, &inverse);
        let mean = scatter.sum.iter().take(features);
        let mean = mean.map(|sum| libm::round(sum / f64::from(scatter.slides.max(1))) as i16);
        let mut bytes: Vec<u8, _> = mean.flat_map(i16::to_le_bytes).collect();
        let mut words: Vec<i16, { MAX_FEATURES * MAX_FEATURES }> = Vec::new();
        for row in canonical.iter().take(features) {
            // per unit of the feature, not per step
            let weights = row.iter().zip(&deviations).take(features);
            let weights = weights.map(|(w, sd)| w / sd * f64::from(FEATURE_STEPS));
            let largest = weights.clone().fold(0.0, |most: f64, w| most.max(w.abs()));
            let places = (0..=30u8)
                .rev()
                .find(|&p| largest * f64::from(1u32 << p) < f64::from(i16::MAX))
                .unwrap_or(0);
            let scale = f64::from(1u32 << places);
            // both have space: for the rows of a square matrix of the most features
            bytes.extend([places]);
            words.extend(weights.map(|w| libm::round(w * scale) as i16));
        }
        bytes.extend(words.into_iter().flat_map(i16::to_le_bytes));
        whitenings
            .push(Whitening { features, bytes })
            .map_err(|_| WhitenError::Movements)?;
    }
    Ok(whitenings)
}

fn add(sum: &mut Square, more: &Square, weight: f64) {
    for (row, more) in sum.iter_mut().zip(more) {
        for (sum, more) in row.iter_mut().zip(more) {
            *sum += weight * more;
        }
    }
}

/// Weight of a sphere beside a covariance of `d` features from `n` degrees of freedom, by its trace and that of its square
/// (OAS, Chen et al. 2010, eq. 23).
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

/// Inverse of the lower Cholesky factor of a correlation matrix.
fn inverse_cholesky(matrix: &Square, features: usize) -> Square {
    let mut lower = [[0.0; MAX_FEATURES]; MAX_FEATURES];
    let mut inverse = [[0.0; MAX_FEATURES]; MAX_FEATURES];
    // indices, as in every book; all are below `features`, which is at most the matrices' size
    #[allow(clippy::indexing_slicing, clippy::needless_range_loop)]
    for i in 0..features.min(MAX_FEATURES) {
        for j in 0..=i {
            let dot: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
            let rest = matrix[i][j] - dot;
            lower[i][j] = if i == j {
                libm::sqrt(rest.max(LEAST_PIVOT))
            } else {
                rest / lower[j][j]
            };
        }
        for j in 0..i {
            let dot: f64 = (j..i).map(|k| lower[i][k] * inverse[k][j]).sum();
            inverse[i][j] = -dot / lower[i][i];
        }
        inverse[i][i] = 1.0 / lower[i][i];
    }
    inverse
}

fn transposed(matrix: &Square) -> Square {
    let mut other = [[0.0; MAX_FEATURES]; MAX_FEATURES];
    for (row, at) in matrix.iter().zip(0..) {
        for (c, other) in row.iter().zip(&mut other) {
            if let Some(other) = other.get_mut::<usize>(at) {
                *other = *c;
            }
        }
    }
    other
}

fn product(left: &Square, right: &Square) -> Square {
    left.map(|row| {
        let mut sum = [0.0; MAX_FEATURES];
        for (weight, other) in row.iter().zip(right) {
            sum.iter_mut()
                .zip(other)
                .for_each(|(sum, c)| *sum += weight * c);
        }
        sum
    })
}

/// The eigenvectors of a symmetric matrix as rows, that of the largest eigenvalue first (Jacobi's rotations; Golub and Van
/// Loan, Matrix Computations, 8.5). Of the two directions of each, that in which its largest element is positive.
fn principal_axes(matrix: &Square, features: usize) -> Square {
    let features = features.min(MAX_FEATURES);
    let mut rest = *matrix;
    let mut axes = [[0.0; MAX_FEATURES]; MAX_FEATURES];
    // indices, as in every book; all are below `features`, which is at most the matrices' size
    #[allow(clippy::indexing_slicing, clippy::needless_range_loop)]
    {
        for i in 0..features {
            axes[i][i] = 1.0;
        }
        // each sweep squares what is left beside the diagonal: a few do
        for _ in 0..SWEEPS {
            for p in 0..features {
                for q in p + 1..features {
                    if rest[p][q] == 0.0 {
                        continue;
                    }
                    let tau = (rest[q][q] - rest[p][p]) / (2.0 * rest[p][q]);
                    let t = 1.0 / (libm::fabs(tau) + libm::sqrt(1.0 + tau * tau));
                    let t = if tau < 0.0 { -t } else { t };
                    let c = 1.0 / libm::sqrt(1.0 + t * t);
                    let s = t * c;
                    for k in 0..features {
                        let (a, b) = (rest[k][p], rest[k][q]);
                        (rest[k][p], rest[k][q]) = (c * a - s * b, s * a + c * b);
                    }
                    for k in 0..features {
                        let (a, b) = (rest[p][k], rest[q][k]);
                        (rest[p][k], rest[q][k]) = (c * a - s * b, s * a + c * b);
                        let (a, b) = (axes[p][k], axes[q][k]);
                        (axes[p][k], axes[q][k]) = (c * a - s * b, s * a + c * b);
                    }
                }
            }
        }
        // the rows beyond the features stay last, and 0
        let mut order: [usize; MAX_FEATURES] = core::array::from_fn(|i| i);
        order[..features]
            .sort_unstable_by(|&i, &j| rest[j][j].total_cmp(&rest[i][i]).then(i.cmp(&j)));
        order.map(|i| {
            let axis = axes[i];
            let largest = axis.iter().fold(0.0, |most: f64, &c| {
                if libm::fabs(c) > libm::fabs(most) {
                    c
                } else {
                    most
                }
            });
            if largest < 0.0 {
                axis.map(|c| -c)
            } else {
                axis
            }
        })
    }
}
