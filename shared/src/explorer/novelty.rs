//! What a texture that the table does not have is like: as its table says, or where that does not say, by its means.

use super::spread::DEGREES_OF_FREEDOM;
use crate::features::{MAX_FEATURES, Vector};
use crate::table::{Contents, Table, oas, white};

const POPULATION: usize = 3;
/// Variance of textures' means where there are too few to say, standard deviations within a texture squared.
const WIDE: f32 = 400.0;

/// Where it is known from what textures are like.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Source {
    /// There are too few of them to tell.
    Nowhere,
    Means,
    /// The table says it: mean and variances of a [`NoveltyModel`] are not used.
    Table,
}

/// So many variances are multiplied before a logarithm is taken: each is 2^-8 to 2^18, and such products are finite.
const AT_ONCE: usize = 7;

/// A squared distance from all textures that is so many of its standard deviations above its mean counts as no greater:
/// what is unlike everything must not become known by being unlike other new textures, too.
const FARTHEST: f32 = 2.0;

/// The likelihood of a texture that the table does not have: means of textures scatter as those of the table do.
#[derive(Clone, Copy, Debug)]
pub(super) struct NoveltyModel {
    pub(super) movement: u8,
    mean: [f32; MAX_FEATURES],
    variance: [f32; MAX_FEATURES],
    pub(super) source: Source,
    farthest: f32,
    norm: f32,
}

impl NoveltyModel {
    pub(super) fn is_calibrated(&self) -> bool {
        self.source == Source::Table
    }

    pub(super) fn new(table: &Table<'_>, movement: u8) -> Self {
        if let (Contents::Fused(_, features), Some(_)) = (table.contents(), table.limits()) {
            return Self {
                movement,
                mean: [0.0; MAX_FEATURES],
                variance: [0.0; MAX_FEATURES],
                source: Source::Table,
                farthest: farthest(features),
                norm: student_norm(features.into()),
            };
        }
        let mut count = 0;
        let mut sum = [0i64; MAX_FEATURES];
        let mut squares = [0i64; MAX_FEATURES];
        for texture in (0..table.textures()).filter(|&t| table.trials(t, movement) > 0) {
            count += 1;
            let mean = table.white_mean(texture, movement);
            for ((sum, square), m) in sum.iter_mut().zip(&mut squares).zip(mean) {
                *sum += i64::from(m);
                *square += i64::from(m) * i64::from(m);
            }
        }
        let n = count.max(1) as f32;
        let known = count >= POPULATION;
        let step = white(1);
        let mut model = Self {
            movement,
            mean: sum.map(|sum| sum as f32 / n * step),
            variance: [WIDE; MAX_FEATURES],
            source: if known {
                Source::Means
            } else {
                Source::Nowhere
            },
            farthest: f32::INFINITY,
            norm: 0.0,
        };
        if known {
            for ((variance, sum), squares) in model.variance.iter_mut().zip(sum).zip(squares) {
                // exact in i64: 117 means of 16 bits
                let above = squares * count as i64 - sum * sum;
                *variance = above as f32 / (n * n) * step * step;
            }
            let Contents::Fused(_, features) = table.contents() else {
                return model;
            };
            let variances = model.variance.get_mut(..features.into());
            shrink(variances.unwrap_or_default(), n);
        }
        model
    }

    /// As [`Spread::likelihood`], of the mean of `k` slides.
    pub(super) fn likelihood(&self, table: &Table<'_>, mean: &Vector, k: u8) -> f32 {
        if self.source == Source::Table {
            return self.population_likelihood(table, mean, k) - self.norm;
        }
        let v = 1.0 / f32::from(k);
        let (mut norm, mut distance) = (0.0, 0.0);
        let known = self.mean.chunks(AT_ONCE).zip(self.variance.chunks(AT_ONCE));
        for (means, (known, variances)) in mean.chunks(AT_ONCE).zip(known) {
            let mut product = 1.0;
            for ((z, m), variance) in means.iter().zip(known).zip(variances) {
                let total = variance + v;
                let apart = white(*z) - m;
                product *= total;
                distance += apart * apart / total;
            }
            norm += libm::logf(product);
        }
        let freedom = f32::from(DEGREES_OF_FREEDOM);
        let tail = (freedom + mean.len() as f32) / 2.0;
        -0.5 * norm - tail * libm::log1pf(distance / freedom)
    }

    /// ln of the likelihood of a texture that the table does not have, whose `k` slides have this mean: means of
    /// textures are a Gaussian's, as a calibrated table says. 0 in another one.
    pub(super) fn population_likelihood(&self, table: &Table<'_>, mean: &Vector, k: u8) -> f32 {
        let Some(population) = table.population(self.movement) else {
            return 0.0;
        };
        let v = 1.0 / f32::from(k);
        let (mut norm, mut distance) = (0.0, 0.0);
        let along = population.axes.apply(mean);
        let mut known = along.iter().zip(population.variances);
        loop {
            let mut part = known.by_ref().take(AT_ONCE).peekable();
            if part.peek().is_none() {
                break;
            }
            let mut product = 1.0;
            for (z, variance) in part {
                let total = variance + v;
                let apart = white(*z);
                distance += apart * apart / total;
                product *= total;
            }
            norm += libm::logf(product);
        }
        let distance = if distance < self.farthest {
            distance
        } else {
            self.farthest
        };
        -0.5 * (norm + distance)
    }
}

/// The squared distance of a slide of any texture has about as many degrees of freedom as it has features.
fn farthest(features: u8) -> f32 {
    let d = f32::from(features);
    d + FARTHEST * libm::sqrtf(2.0 * d)
}

/// ln of the constant of Student's t in so many dimensions in parts of that of a Gaussian: ln G((8+P)/2) - ln G(4)
/// - P/2 ln 4 (Stirling's series, to 1e-5 from P = 1 on).
pub(super) fn student_norm(dimensions: usize) -> f32 {
    if dimensions == 0 {
        return 0.0;
    }
    let half = dimensions as f32 / 2.0;
    let x = f32::from(DEGREES_OF_FREEDOM) / 2.0 + half;
    let ln_gamma =
        (x - 0.5) * libm::logf(x) - x + 0.918_938_5 + (1.0 - 1.0 / (30.0 * x * x)) / (12.0 * x);
    // ln G(4) = ln 6
    ln_gamma - 1.791_759_5 - half * 1.386_294_4
}

/// Draws the variances along the axes of a covariance of `n` towards their mean, by as much as so few deserve
/// ([`oas`]): textures differ in more directions than a few of them show.
fn shrink(variances: &mut [f32], n: f32) {
    let d = variances.len() as f32;
    let sum: f32 = variances.iter().sum();
    let squares: f32 = variances.iter().map(|v| v * v).sum();
    let weight = oas(sum.into(), squares.into(), d.into(), n.into()) as f32;
    for variance in variances {
        *variance += weight * (sum / d - *variance);
    }
}
