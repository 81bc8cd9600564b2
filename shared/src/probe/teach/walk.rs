//! How far means have walked from what a person taught while the probe learned by itself.
//!
//! Slow wear moves a texture a little; a texture that was mistaken for another moves far, and a finger, rig or drive
//! that was changed moves all the same way. Distances are in standard deviations of one slide.

use crate::features::MAX_FEATURES;
use crate::store::SelfLearnedRecord;
use crate::table::{Contents, Table, Whitened};

/// What the mean of the last slides scatters by, however many there are: each new one counts a share a of
/// 1/([`Whitened::MEMORY`] + 1), which leaves the variance a/(2 - a).
const LAST: f32 = 1.0 / (2.0 * Whitened::MEMORY as f32 + 1.0);
/// Textures that must have walked before they can be said to walk together.
const MANY: u8 = 4;
/// So many standard deviations beyond the mean of a chi-square are no chance.
const NO_CHANCE: f32 = 4.0;

/// True if a sum of so many squares, each of mean 1, is too large to be chance.
fn is_no_chance(squares: f32, many: usize) -> bool {
    let many = many as f32;
    squares > many + NO_CHANCE * libm::sqrtf(2.0 * many)
}

/// The way of a mean along each axis, from what was taught, and its variance, without and with the expected drift.
fn way(base: &Table<'_>, texture: u16, movement: u8, now: &Whitened) -> [(f32, f32); MAX_FEATURES] {
    let taught = base.whitened(texture, movement);
    let scatter = LAST + 1.0 / f32::from(taught.slides.max(1));
    let mut way = [(0.0, scatter); MAX_FEATURES];
    for ((way, now), taught) in way.iter_mut().zip(now.mean).zip(taught.mean) {
        way.0 = (f32::from(now) - f32::from(taught)) / 256.0;
    }
    let drifts = base.drifts(movement).into_iter().flatten();
    for (pair, drift) in way.chunks_mut(2).zip(drifts) {
        for (_, variance) in pair {
            *variance += drift;
        }
    }
    way
}

fn features(base: &Table<'_>) -> usize {
    match base.contents() {
        Contents::Fused(_, features) => usize::from(features),
        Contents::Gaussians(_) => 0,
    }
}

/// True if a texture is farther at one of its movements from what was taught than the expected drift explains.
pub(super) fn is_too_far(base: &Table<'_>, texture: u16, record: &SelfLearnedRecord) -> bool {
    let features = features(base);
    record.movements.iter().any(|(movement, _, now)| {
        let way = way(base, texture, *movement, now);
        let squares = way
            .iter()
            .take(features)
            .map(|(off, variance)| off * off / variance);
        is_no_chance(squares.sum(), features)
    })
}

/// The ways of textures, each at the movement where it learned most.
pub(super) struct Together {
    textures: u8,
    features: usize,
    /// Sum of the ways along each axis, and of their variances.
    sums: [(f32, f32); MAX_FEATURES],
}

impl Default for Together {
    fn default() -> Self {
        Self {
            textures: 0,
            features: 0,
            sums: [(0.0, 0.0); MAX_FEATURES],
        }
    }
}

impl Together {
    /// Takes a texture; one that the table does not have is left out.
    pub(super) fn take(&mut self, base: &Table<'_>, record: &SelfLearnedRecord) {
        let Some(texture) = base.numbered(record.number) else {
            return;
        };
        let most = record.movements.iter().max_by_key(|(_, slides, _)| *slides);
        let Some((movement, _, now)) = most else {
            return;
        };
        self.textures = self.textures.saturating_add(1);
        self.features = features(base);
        for (sum, way) in self.sums.iter_mut().zip(way(base, texture, *movement, now)) {
            sum.0 += way.0;
            sum.1 += way.1;
        }
    }

    /// True if they walk the same way, which textures that drift each for itself do not.
    pub(super) fn is_so(&self) -> bool {
        let sums = self.sums.iter().take(self.features);
        let squares = sums.map(|(way, variance)| way * way / variance);
        self.textures >= MANY && is_no_chance(squares.sum(), self.features)
    }
}
