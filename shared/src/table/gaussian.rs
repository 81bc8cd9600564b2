//! Gaussians of the properties (eq. 4), and the fixed point in which a table keeps them.

use crate::features::Property;

/// One step of a stored standard deviation, in the unit of its property; the largest is 4.
pub const SD_STEP: f32 = 1.0 / 16384.0;
/// Smallest standard deviation in a table, the coarsest step of a mean: a few trials that agree by chance by more than
/// the table can show would otherwise outweigh all others.
pub const SD_LEAST: f32 = 1.0 / 2048.0;

/// One step of a stored mean of `property`, in its unit: traction reaches +-8 N, roughness +-16, fineness +-8.
pub const fn mean_step(property: Property) -> f32 {
    match property {
        Property::Traction | Property::Fineness => 1.0 / 4096.0,
        Property::Roughness => 1.0 / 2048.0,
    }
}

/// The expectation of one property of a texture (eq. 4).
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Gaussian {
    /// Mean, in the unit of the property.
    pub mean: f32,
    /// Standard deviation, in the unit of the property.
    pub sd: f32,
}

/// The expected distributions of one action, texture by texture.
#[derive(Clone, Copy, Debug)]
pub struct Gaussians<'t> {
    /// Each begins `stride` bytes after the one before.
    pub(super) cells: &'t [u8],
    pub(super) stride: usize,
    /// Each `movements` after the one before.
    pub(super) trials: &'t [u8],
    pub(super) movements: usize,
    pub(super) step: f32,
}

impl<'t> Gaussians<'t> {
    /// As [`super::Table::gaussian`].
    #[inline]
    pub fn get(&self, texture: usize) -> Option<Gaussian> {
        let trials = *self.trials.get(texture * self.movements)?;
        let cell = self.cells.get(texture * self.stride..)?;
        let &[m0, m1, s0, s1] = cell.first_chunk()?;
        (trials >= 2).then(|| Gaussian {
            mean: f32::from(i16::from_le_bytes([m0, m1])) * self.step,
            sd: f32::from(u16::from_le_bytes([s0, s1])) * SD_STEP,
        })
    }

    /// Mean (as i16) and standard deviation of each texture, in steps.
    pub(crate) fn cells(&self) -> impl Iterator<Item = [u16; 2]> + use<'t> {
        let cells = self.cells.chunks(self.stride.max(1));
        cells.map_while(|cell| {
            let &[m0, m1, s0, s1] = cell.first_chunk()?;
            Some([u16::from_le_bytes([m0, m1]), u16::from_le_bytes([s0, s1])])
        })
    }

    /// The factor from (steps of the means / steps of the standard deviation) to numbers whose square is half of that
    /// of standard deviations, in Q16.
    pub fn scale(&self) -> f32 {
        /// Square root of 2^16 / 2.
        const HALF_Q16: f32 = 181.019_34;
        self.step / SD_STEP * HALF_Q16
    }
}
