//! The space in which the slides of a texture scatter by 1 in every direction: from features to whitened features.
//!
//! The paper looks at one property per slide. Taking all features of a slide together needs their covariance; five
//! trials of one texture do not give it, but those of all textures together do: [`super::whiten`].

use heapless::Vec;

use crate::features::{FEATURE_STEPS, MAX_FEATURES, Vector, WHITE_STEPS};

/// From features to whitened ones, z = W (x - g): canonical variates. W' W is the inverse of the covariance of slides
/// within a texture, and the means of different textures are uncorrelated in z, those that scatter most first.
///
/// W is kept in whole numbers, row by row with a power of two of its own; means are learned through the same numbers,
/// so their rounding adds no error.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Whitening {
    pub(super) features: usize,
    /// As a table has them: g, as features are (i16); binary places of each row (u8); the rows of W (i16).
    pub(super) bytes: Vec<u8, { Self::bytes(MAX_FEATURES) }>,
}

impl Whitening {
    /// Bytes that it takes in a table.
    pub const fn bytes(features: usize) -> usize {
        3 * features + 2 * features * features
    }

    /// Of `features` features with these means, and rows of weights for each: what a step of theirs is in standard
    /// deviations, times [`crate::features::FEATURE_STEPS`].
    pub(super) fn new(
        features: usize,
        mean: &[f64],
        rows: impl Iterator<Item = impl Iterator<Item = f64> + Clone>,
    ) -> Self {
        let mean = mean.iter().take(features).map(|m| libm::round(*m) as i16);
        let mut bytes: Vec<u8, _> = mean.flat_map(i16::to_le_bytes).collect();
        let mut words: Vec<i16, { MAX_FEATURES * MAX_FEATURES }> = Vec::new();
        for row in rows {
            let weights = row.take(features);
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
        Self { features, bytes }
    }

    /// Reads it from a table; `None` if these are not the bytes of one of so many features.
    pub fn read(bytes: &[u8], features: usize) -> Option<Self> {
        View::new(bytes, features)?;
        let bytes = Vec::from_slice(bytes).ok()?;
        Some(Self { features, bytes })
    }

    /// Its bytes.
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Number of features.
    pub fn features(&self) -> usize {
        self.features
    }

    /// The whitened change that a change of the features by so many steps makes, to the nearest 1/256.
    pub fn change(&self, steps: &[f64; MAX_FEATURES]) -> Slope {
        let [_, places, rows] = self.view().parts();
        // steps of whitened features are coarser
        let coarser = f64::from(FEATURE_STEPS / WHITE_STEPS);
        let mut change = Slope::default();
        let rows = rows.chunks_exact((2 * self.features).max(1)).zip(places);
        for (change, (row, places)) in change.iter_mut().zip(rows) {
            let weights = row.as_chunks().0.iter().zip(steps);
            let sum = weights.map(|(w, x)| f64::from(i16::from_le_bytes(*w)) * x);
            let scale = coarser * f64::from(1u32 << (places & 31));
            // `as` saturates
            *change = libm::round(sum.sum::<f64>() / scale) as i16;
        }
        change
    }

    /// Whitens the features of a slide; those that are missing count as the mean, those beyond the table's not at all.
    pub fn apply(&self, features: &[i16]) -> Vector {
        self.view().apply(features)
    }

    fn view(&self) -> View<'_> {
        let Self {
            features,
            ref bytes,
        } = *self;
        View { features, bytes }
    }
}

/// Change of a whitened mean per unit of ln(speed), in steps of 1/256 standard deviation; 0 beyond the features.
pub type Slope = [i16; MAX_FEATURES];

/// A [`Whitening`] where its table lies: copying it takes as long as applying it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View<'b> {
    pub(super) features: usize,
    pub(super) bytes: &'b [u8],
}

impl<'b> View<'b> {
    /// `None` if these are not the bytes of one of so many features.
    pub(crate) fn new(bytes: &'b [u8], features: usize) -> Option<Self> {
        if bytes.len() != Whitening::bytes(features) || features > MAX_FEATURES {
            return None;
        }
        let view = Self { features, bytes };
        let [_, places, _] = view.parts();
        places.iter().all(|&p| p <= 30).then_some(view)
    }

    fn parts(&self) -> [&'b [u8]; 3] {
        let (mean, rest) = self
            .bytes
            .split_at_checked(2 * self.features)
            .unwrap_or_default();
        let (places, rows) = rest.split_at_checked(self.features).unwrap_or_default();
        [mean, places, rows]
    }

    #[inline(never)]
    pub(crate) fn apply(&self, features: &[i16]) -> Vector {
        let [mean, places, rows] = self.parts();
        // beyond 32 units all features are alike; those that the table does not have are 0
        let mut apart = [0; MAX_FEATURES];
        let known = features.iter().zip(mean.as_chunks().0);
        for (apart, (x, g)) in apart.iter_mut().zip(known) {
            *apart = x.saturating_sub(i16::from_le_bytes(*g));
        }
        let rows = rows.chunks_exact((2 * self.features).max(1)).zip(places);
        let white = rows.map(|(row, places)| rounded(product(row, &apart), *places));
        // no more rows than features
        white.collect()
    }
}

#[inline]
fn product(row: &[u8], others: &[i16; MAX_FEATURES]) -> i64 {
    let pairs = row.as_chunks().0.iter().zip(others);
    let products = pairs.map(|(w, x)| i32::from(i16::from_le_bytes(*w)) * i32::from(*x));
    products.map(i64::from).sum()
}

/// Products of features, in 1/1024 of a unit, and weights of so many binary places, 30 at most, to the nearest 1/256.
#[inline(always)]
fn rounded(sum: i64, places: u8) -> i16 {
    // twice that, by shifts of 32 bits: those of 64 take the chip several
    let twice = u32::from(places & 31) + 1;
    let (low, high) = (sum as u32, (sum >> 32) as i32);
    let low = (low >> twice | (high as u32) << (32 - twice)) as i32;
    let high = high >> twice;
    if high == low >> 31 {
        ((low >> 1) + (low & 1)).clamp(i16::MIN.into(), i16::MAX.into()) as i16
    } else if high < 0 {
        i16::MIN
    } else {
        i16::MAX
    }
}

/// Steps of a whitened feature as standard deviations.
pub fn white(steps: i16) -> f32 {
    f32::from(steps) / WHITE_STEPS
}

/// The whitened means of all textures at a movement.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Column<'t> {
    /// Means, the first at the beginning, numbers of 16 bits, little-endian; each begins `stride` bytes after the one
    /// before.
    pub(crate) means: &'t [u8],
    pub(crate) stride: usize,
    /// Slides that they were learned from, each `movements` after the one before.
    pub(crate) slides: &'t [u8],
    pub(crate) movements: usize,
}

impl<'t> Column<'t> {
    #[inline]
    pub(crate) fn mean(&self, texture: usize) -> &'t [u8] {
        self.means.get(texture * self.stride..).unwrap_or_default()
    }

    #[inline]
    pub(crate) fn slides(&self, texture: usize) -> u8 {
        self.slides
            .get(texture * self.movements)
            .copied()
            .unwrap_or(0)
    }
}
