//! Shifts of means from what a person taught, while the probe learned by itself.
//!
//! Slow wear moves a texture a little; a texture that was mistaken for another moves far, and a finger, rig or drive
//! that was changed moves all the same way. Distances are in standard deviations of one slide.

use crate::features::MAX_FEATURES;
use crate::store::SelfLearnedRecord;
use crate::table::{Contents, Table, Whitened};

/// What the mean of the last slides scatters by, however many there are: each new one counts a share a of
/// 1/([`Whitened::MEMORY`] + 1), which leaves the variance a/(2 - a).
const LAST: f32 = 1.0 / (2.0 * Whitened::MEMORY as f32 + 1.0);
/// Textures that must have shifted before a common shift can be told.
const MANY: u8 = 4;
/// So many standard deviations beyond the mean of a chi-square are no chance.
const NO_CHANCE: f32 = 4.0;

/// True if a sum of so many squares, each of mean 1, is too large to be chance.
fn is_no_chance(squares: f32, many: usize) -> bool {
    let many = many as f32;
    squares > many + NO_CHANCE * libm::sqrtf(2.0 * many)
}

/// The shift of a mean along each axis from what was taught, and its variance with the expected drift.
fn shift(
    base: &Table<'_>,
    texture: u16,
    movement: u8,
    now: &Whitened,
) -> [(f32, f32); MAX_FEATURES] {
    let taught = base.whitened(texture, movement);
    let scatter = LAST + 1.0 / f32::from(taught.slides.max(1));
    let mut shift = [(0.0, scatter); MAX_FEATURES];
    for ((shift, now), taught) in shift.iter_mut().zip(now.mean).zip(taught.mean) {
        shift.0 = (f32::from(now) - f32::from(taught)) / 256.0;
    }
    let drifts = base.drifts(movement).into_iter().flatten();
    for (pair, drift) in shift.chunks_mut(2).zip(drifts) {
        for (_, variance) in pair {
            *variance += drift;
        }
    }
    shift
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
        let shift = shift(base, texture, *movement, now);
        let squares = shift
            .iter()
            .take(features)
            .map(|(off, variance)| off * off / variance);
        is_no_chance(squares.sum(), features)
    })
}

/// The mean shift of textures at one movement: axes of different movements are not the same.
pub(super) struct CommonShift {
    movement: u8,
    textures: u8,
    features: usize,
    /// Sum of the shifts along each axis, and of their variances.
    sums: [(f32, f32); MAX_FEATURES],
}

impl CommonShift {
    /// At this movement, of no texture yet.
    pub(super) fn at(movement: u8) -> Self {
        Self {
            movement,
            textures: 0,
            features: 0,
            sums: [(0.0, 0.0); MAX_FEATURES],
        }
    }

    /// Takes a texture; one that the table does not have, or that learned nothing at the movement, is left out.
    pub(super) fn take(&mut self, base: &Table<'_>, record: &SelfLearnedRecord) {
        let learned = record.movements.iter().find(|of| of.0 == self.movement);
        let Some((texture, (movement, _, now))) = base.numbered(record.number).zip(learned) else {
            return;
        };
        self.textures = self.textures.saturating_add(1);
        self.features = features(base);
        let shift = shift(base, texture, *movement, now);
        for (sum, shift) in self.sums.iter_mut().zip(shift) {
            sum.0 += shift.0;
            sum.1 += shift.1;
        }
    }

    /// True if they shift the same way, which textures that drift each for itself do not.
    pub(super) fn is_no_chance(&self) -> bool {
        let sums = self.sums.iter().take(self.features);
        let squares = sums.map(|(shift, variance)| shift * shift / variance);
        self.textures >= MANY && is_no_chance(squares.sum(), self.features)
    }
}
