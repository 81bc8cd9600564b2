//! Whitening: learned from the slides of many textures, and frozen in the table.

use core::fmt;

use heapless::Vec;
use serde::{Deserialize, Serialize};

use super::{FEATURE_STEPS, MAX_FEATURES, Vector, WHITE_STEPS};
use crate::table::MAX_MOVEMENTS;

/// Elements of a lower triangle.
const TRIANGLE: usize = MAX_FEATURES * (MAX_FEATURES + 1) / 2;
/// Weight of the average over all movements, in trials: with few trials of its own a movement's covariance is mostly that.
const SHARED_TRIALS: f64 = 15.0;
/// Variance of what rounding to whole steps adds, in steps^2: no feature is more certain than that.
const ROUNDING: f64 = 1.0 / 12.0;
/// Least part of a feature's variance that the features before it may leave unexplained.
const LEAST_PIVOT: f64 = 1e-6;

/// From features to whitened ones, z = W (x - g): W is the inverse of the covariance's Cholesky factor.
///
/// W is kept in whole numbers, row by row with a power of two of its own; means are learned through the same numbers, so
/// their rounding adds no error.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Whitening {
    /// g, as features are.
    mean: Vector,
    /// Binary places of each row.
    places: Vec<u8, MAX_FEATURES>,
    /// The rows of W up to their diagonal, one after the other.
    rows: Vec<i16, TRIANGLE>,
}

impl Whitening {
    /// Bytes that it takes in a table.
    pub const fn bytes(features: usize) -> usize {
        3 * features + features * (features + 1)
    }

    /// Reads it from a table; `None` if these are not the bytes of one of so many features.
    pub fn read(bytes: &[u8], features: usize) -> Option<Self> {
        if bytes.len() != Self::bytes(features) || features > MAX_FEATURES {
            return None;
        }
        let (mean, rest) = bytes.split_at_checked(2 * features)?;
        let (places, rows) = rest.split_at_checked(features)?;
        let words = |bytes: &[u8]| {
            let words = bytes.chunks_exact(2);
            words
                .map(|pair| i16::from_le_bytes([pair[0], pair[1]]))
                .collect::<Vec<i16, TRIANGLE>>()
        };
        Some(Self {
            mean: Vector::from_slice(&words(mean)).ok()?,
            places: Vec::from_slice(places).ok()?,
            rows: words(rows),
        })
        .filter(|w| w.places.iter().all(|&p| p <= 30))
    }

    /// Its bytes, in order.
    pub fn write(&self, mut put: impl FnMut(&[u8])) {
        self.mean.iter().for_each(|g| put(&g.to_le_bytes()));
        put(&self.places);
        self.rows.iter().for_each(|w| put(&w.to_le_bytes()));
    }

    /// Number of features.
    pub fn features(&self) -> usize {
        self.mean.len()
    }

    /// Whitens the features of a slide, as many as there are in the table; the fewer they are, the fewer come out.
    pub fn apply(&self, features: &[i16]) -> Vector {
        let mut rows = self.rows.as_slice();
        let mut white = Vector::new();
        for (row, (_, &places)) in (1..).zip(features.iter().zip(&self.places)) {
            let Some((weights, rest)) = rows.split_at_checked(row) else {
                break;
            };
            rows = rest;
            let apart = features
                .iter()
                .zip(&self.mean)
                .map(|(x, g)| i64::from(*x) - i64::from(*g));
            let sum: i64 = weights
                .iter()
                .zip(apart)
                .map(|(w, x)| i64::from(*w) * x)
                .sum();
            // from 1/1024 of a unit, and the row's places, to 1/256
            let places = u32::from(places) + 2;
            let z = (sum + (1 << (places - 1))) >> places;
            // there is room: both are as long as the features
            let _ = white.push(z.clamp(i16::MIN.into(), i16::MAX.into()) as i16);
        }
        white
    }
}

/// Why a whitening cannot be learned.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum WhitenError {
    /// No texture has two slides of this movement.
    Trials(u8),
    /// Slides have different numbers of features, or none.
    Features,
    /// No movement, or more than a table holds.
    Movements,
}

impl fmt::Display for WhitenError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Trials(movement) => write!(
                f,
                "movement {}: no texture has two slides, and how slides of one texture differ takes two",
                movement + 1
            ),
            Self::Features => f.write_str("the slides do not have the same features"),
            Self::Movements => write!(f, "a table has 1 to {MAX_MOVEMENTS} movements"),
        }
    }
}

impl core::error::Error for WhitenError {}

type Square = [[f64; MAX_FEATURES]; MAX_FEATURES];

/// How the slides of each texture differ at one movement, all textures taken together.
#[derive(Clone, Debug)]
pub struct Scatter {
    features: usize,
    /// Sum of all slides, and their number.
    sum: [f64; MAX_FEATURES],
    slides: u32,
    /// Sum of products of deviations from the mean of the own texture, and its degrees of freedom.
    products: Square,
    freedom: u32,
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
        self.slides += slides.len() as u32;
        self.freedom += (slides.len() as u32).saturating_sub(1);
        Ok(())
    }

    /// Pooled covariance, in steps^2.
    fn covariance(&self) -> Square {
        self.products
            .map(|row| row.map(|p| p / f64::from(self.freedom.max(1))))
    }
}

/// The whitening of every movement, from how slides scatter there: pooled covariance, blended with the average over all
/// movements, its correlations shrunk towards none (OAS, Chen et al. 2010).
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
        let mean = scatter.sum.iter().take(features);
        let mean = mean.map(|sum| libm::round(sum / f64::from(scatter.slides.max(1))) as i16);
        let mut whitening = Whitening {
            mean: mean.collect(),
            places: Vec::new(),
            rows: Vec::new(),
        };
        for (row, length) in inverse.iter().zip(1..=features) {
            // per unit of the feature, not per step
            let weights = row.iter().zip(&deviations).take(length);
            let weights = weights.map(|(w, sd)| w / sd * f64::from(FEATURE_STEPS));
            let largest = weights.clone().fold(0.0, |most: f64, w| most.max(w.abs()));
            let places = (0..=30u8)
                .rev()
                .find(|&p| largest * f64::from(1u32 << p) < f64::from(i16::MAX))
                .unwrap_or(0);
            let scale = f64::from(1u32 << places);
            // there is room: a triangle of so many features at most
            let _ = whitening.places.push(places);
            whitening
                .rows
                .extend(weights.map(|w| libm::round(w * scale) as i16));
        }
        whitenings
            .push(whitening)
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

/// Draws correlations towards 0 by as much as so few degrees of freedom deserve.
fn shrink(correlation: &mut Square, features: usize, freedom: f64) {
    let d = features as f64;
    let squares = correlation
        .iter()
        .take(features)
        .flat_map(|row| row.iter().take(features));
    let t: f64 = squares.map(|c| c * c).sum();
    let above = (1.0 - 2.0 / d) * t + d * d;
    let below = (freedom + 1.0 - 2.0 / d) * (t - d);
    let lambda = if above < below { above / below } else { 1.0 };
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

/// What a table knows of a texture at one movement: the mean of its whitened slides, and how many they were.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Whitened {
    /// Slides, 255 for more.
    pub slides: u8,
    /// Their mean in steps of 1/256 standard deviation; 0 beyond the features of the table.
    pub mean: [i16; MAX_FEATURES],
}

impl Whitened {
    /// Slides that count at most when a texture is learned on the go: the mean follows what changes slowly.
    pub const MEMORY: u8 = 8;

    /// Takes in a whitened slide in teaching: all have the same weight.
    pub fn teach(&mut self, slide: &[i16]) {
        self.follow(slide, self.slides);
        self.slides = self.slides.saturating_add(1);
    }

    /// Takes in a whitened slide on the go (facts of the recipe, step 8).
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

/// Steps of a whitened feature as standard deviations.
pub fn white(steps: i16) -> f32 {
    f32::from(steps) / WHITE_STEPS
}
