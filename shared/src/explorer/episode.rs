//! The slides of one exploration, movement by movement, and what the probe can learn from it when it is over.

use heapless::Vec;

use crate::features::{MAX_FEATURES, Vector};
use crate::table::MAX_MOVEMENTS;
use crate::up_to;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MovementSums {
    pub(super) movement: u8,
    pub(super) slides: u8,
    /// Sum of the whitened slides, 1/256.
    pub(super) white: [i32; MAX_FEATURES],
    /// Sum of ln(speed) of the slides of which it is known, 1/1024, and how many these are.
    pub(super) pace: i32,
    pub(super) paces: u8,
    pub(super) properties: [f32; 3],
}

pub(super) type Episode = Vec<MovementSums, MAX_MOVEMENTS>;

/// The slides of `movement`, one more than before; `None` beyond 255, where nothing new is learned.
pub(super) fn one_more(episode: &mut Episode, movement: u8) -> Option<&mut MovementSums> {
    let at = match episode.iter().position(|v| v.movement == movement) {
        Some(at) => at,
        None => {
            let new = MovementSums {
                movement,
                ..MovementSums::default()
            };
            episode.push(new).ok()?;
            episode.len() - 1
        }
    };
    let sums = episode.get_mut(at)?;
    sums.slides = sums.slides.checked_add(1)?;
    Some(sums)
}

impl MovementSums {
    /// So many slides of this whitened mean, at the movement's speed.
    pub(super) fn of(movement: u8, slides: u8, mean: &[i16]) -> Self {
        let mut sums = Self {
            movement,
            slides,
            paces: slides,
            ..Self::default()
        };
        for (sum, z) in sums.white.iter_mut().zip(mean) {
            *sum = i32::from(*z) * i32::from(slides);
        }
        sums
    }

    /// Mean of so many whitened features, to the nearest step.
    pub(super) fn mean(&self, features: usize) -> Vector {
        if self.slides == 1 {
            // without divisions
            let slide = self.white.iter().take(features);
            return up_to(slide.map(|&z| z as i16));
        }
        let n = i32::from(self.slides.max(1));
        let rounded = |sum: i32| sum.saturating_mul(2).saturating_add(n).div_euclid(2 * n);
        // a mean of i16
        let means = self.white.iter().take(features);
        up_to(means.map(|&sum| rounded(sum) as i16))
    }
}

/// The result of an exploration, from which the probe can learn until the next one begins.
#[derive(Clone, Debug)]
pub struct EpisodeSummary {
    /// Checksum of the table that was explored with.
    pub table: u32,
    /// The most probable texture.
    pub texture: u16,
    /// True if the probe may learn from it by itself.
    pub certain: bool,
    /// The movements made, with the number of slides and their whitened mean; none with a table of Gaussians.
    pub observed: Vec<(u8, u8, Vector), MAX_MOVEMENTS>,
    /// At each of these the mean of ln(speed) in parts of the movement's, 1/1024; where it is not known that of a usual
    /// one. 0 with a table that knows no speeds.
    pub paces: Vec<i16, MAX_MOVEMENTS>,
}
