//! The texture of a table that is most like another: the share of slides that would be taken for the other's.

use serde::Serialize;
use tactus_core::features::Movement;
use tactus_core::table::{Action, Contents, Table, white};

/// Slides that an exploration makes at most by default, as the limit of the count.
const SLIDES: f64 = 10.0;
/// Quantile of the normal distribution at 99 %.
const SURE: f64 = 2.326;

/// Two textures of a table, side by side.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Alike {
    /// The other texture.
    pub texture: String,
    /// Share of slides of the one that would be taken for the other's, were these two the only ones, at the movement
    /// that tells them apart best. 0 where they never are, 0.5 where it is a guess; more where the other was learned
    /// from more slides.
    pub taken_for: f64,
    /// Contact force of that movement.
    pub force_n: f32,
    /// Its speed.
    pub speed_mm_s: f32,
    /// Slides of that movement that leave less than 1 % to chance; `None` where it is more than ten.
    pub slides: Option<u8>,
    /// True if ten slides of that movement would leave more than 1 % to chance.
    pub feels_the_same: bool,
}

/// The texture that slides of `texture` would be taken for most often; `None` where there is no other to compare with.
pub fn nearest(table: Table<'_>, texture: u16) -> Option<Alike> {
    let others = (0..table.textures()).filter(|&other| other != texture);
    let compared = others.filter_map(|other| alike(table, texture, other));
    compared.max_by(|a, b| a.taken_for.total_cmp(&b.taken_for))
}

/// The confusion of `texture` with another one; `None` where no movement was learned of both.
pub fn alike(table: Table<'_>, texture: u16, other: u16) -> Option<Alike> {
    let (movement, deviation) = compare(table, [texture, other])?;
    let movement: Movement = table.movement(movement)?;
    // the mean of n slides deviates by sqrt(n) less
    let slides = (SURE / deviation.min(0.0)).powi(2).ceil();
    let slides = (slides <= SLIDES).then_some(slides as u8);
    Some(Alike {
        texture: table.name(other)?.to_owned(),
        taken_for: normal_below(deviation),
        force_n: movement.written().0,
        speed_mm_s: movement.written().1,
        slides,
        feels_the_same: slides.is_none(),
    })
}

struct Apart {
    movement: u8,
    /// Squared distance of the means, in variances of a slide, over all features.
    square: f64,
    features: f64,
    /// Variance of the difference of the two means, which were learned from few slides: 1/n + 1/n.
    variance: f64,
    /// By how much the logarithm of the first one's likelihood is above that of the second at the same distance.
    preferred: f64,
}

/// The movement that tells two textures apart best, and the normal deviation below which slides would be taken for the
/// other's.
///
/// A slide goes to the nearer mean, so that the share is Phi(-d/2) where the means are d apart. Means of few slides are
/// further apart than the textures are, by chance: their difference over all movements and features is shrunk as James
/// and Stein (1961) do it, and what is left of its error widens the slide's. Of two means as near, the one of more
/// slides is preferred.
fn compare(table: Table<'_>, textures: [u16; 2]) -> Option<(u8, f64)> {
    let movements = (0..).zip(table.movements());
    let apart: Vec<Apart> = movements
        .filter_map(|(movement, _)| Apart::of(table, movement, textures))
        .collect();
    let features: f64 = apart.iter().map(|a| a.features).sum();
    let squares: f64 = apart.iter().map(|a| a.square / a.variance).sum();
    let by_chance = (features - 2.0).max(0.0) / squares.max(f64::MIN_POSITIVE);
    let kept = (1.0 - by_chance).max(0.0);
    apart
        .iter()
        .map(|a| {
            let off = kept * a.square + 2.0 * a.preferred;
            (a.movement, -off / (a.square * (4.0 + a.variance)).sqrt())
        })
        .min_by(|a, b| a.1.total_cmp(&b.1))
}

impl Apart {
    /// `None` where one of them was not learned at this movement.
    fn of(table: Table<'_>, movement: u8, textures: [u16; 2]) -> Option<Self> {
        let [n, m] = textures.map(|texture| f64::from(table.trials(texture, movement)));
        let variance = 1.0 / n + 1.0 / m;
        let differences: Vec<f64> = match table.contents() {
            Contents::Fused(..) if n > 0.0 && m > 0.0 => {
                let [a, b] = textures.map(|texture| table.white_mean(texture, movement));
                let apart = a
                    .zip(b)
                    .map(|(a, b)| f64::from(white(a)) - f64::from(white(b)));
                apart.collect()
            }
            Contents::Fused(..) => return None,
            Contents::Gaussians(measured) => {
                // Hedges (1981): a deviation from few trials is too small as often as not, and that counts more
                let few = 1.0 - 3.0 / (4.0 * (n + m - 2.0) - 1.0);
                let apart = measured.iter().filter_map(|property| {
                    let action = Action {
                        movement,
                        property: Some(property),
                    };
                    let [a, b] = textures.map(|texture| table.gaussian(texture, action));
                    let (a, b) = (a?, b?);
                    let variance = (f64::from(a.sd).powi(2) + f64::from(b.sd).powi(2)) / 2.0;
                    Some(few * (f64::from(a.mean) - f64::from(b.mean)) / variance.sqrt())
                });
                apart.collect()
            }
        };
        let square: f64 = differences.iter().map(|d| d * d).sum();
        let features = differences.len() as f64;
        (features > 0.0).then(|| Self {
            movement,
            // two that are equal to the last step are a step apart
            square: square.max(1e-6),
            features,
            variance,
            preferred: features / 2.0 * ((1.0 + 1.0 / m) / (1.0 + 1.0 / n)).ln(),
        })
    }
}

/// The normal distribution's share below x.
fn normal_below(x: f64) -> f64 {
    libm::erfc(-x / std::f64::consts::SQRT_2) / 2.0
}

#[cfg(test)]
mod tests;
