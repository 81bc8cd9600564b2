//! The slopes of the whitened means: each texture has a straight line over ln(speed) of the slide.
//!
//! A rig holds its speed, a hand does not. Where the speed was measured while a table was learned, its means are those
//! at the movement's speed, and slides scatter about the line; so a slide of unknown speed lies somewhere on it.

use super::encode::{EncodeError, Writer};
use super::format::{SLOPES, array};
use super::view::Table;
use super::whitening::{Column, Slope};
use crate::features::{FEATURE_STEPS, Observation, Vector};

/// Largest variance of ln(speed) that a table may expect.
const MOST_VARIANCE: f32 = 4.0;
const EXPECTED: usize = 6;

/// The speeds of a movement, as ln of them in parts of the movement's.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Pace {
    /// Mean of slides whose speed is not known, in steps of 1/1024.
    pub mean: i16,
    /// Their variance.
    pub variance: f32,
    /// Slope of all textures together: that of one whose own is not known.
    pub pooled: Slope,
}

/// The speeds and slopes of a table.
#[derive(Clone, Copy, Debug)]
pub struct Slopes<'a> {
    /// Of every movement.
    pub paces: &'a [Pace],
    /// Of every texture, movement by movement.
    pub slopes: &'a [Slope],
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct SlopesView<'t> {
    pub(crate) mean: i16,
    pub(crate) variance: f32,
    /// Slopes in the place of means.
    pub(crate) column: Column<'t>,
}

const fn of_pace(features: usize) -> usize {
    EXPECTED + 2 * features
}

pub(super) const fn length(features: usize, textures: usize, movements: usize) -> usize {
    movements * (of_pace(features) + textures * 2 * features)
}

impl Slopes<'_> {
    pub(super) fn write(&self, features: usize, writer: &mut Writer<'_>) {
        for pace in self.paces {
            writer.put(&pace.mean.to_le_bytes());
            writer.put(&pace.variance.to_le_bytes());
            writer.put_numbers(pace.pooled.iter().take(features));
        }
        for slope in self.slopes {
            writer.put_numbers(slope.iter().take(features));
        }
    }
}

pub(super) fn are_slopes(bytes: &[u8], features: usize, textures: usize, movements: usize) -> bool {
    let possible = |movement: usize| {
        let at = movement * of_pace(features) + 2;
        let variance = array(bytes, at).map(f32::from_le_bytes);
        variance.is_some_and(|v| (0.0..=MOST_VARIANCE).contains(&v))
    };
    bytes.len() == length(features, textures, movements) && (0..movements).all(possible)
}

impl<'a> Table<'a> {
    /// Returns whether its means depend on the speed.
    pub fn is_paced(&self) -> bool {
        !self.slopes.is_empty()
    }

    /// Puts the section with the slopes of these textures, those of all for `None`; nothing if it knows no speeds.
    pub(super) fn put_slopes(
        &self,
        textures: impl Iterator<Item = Option<u16>>,
        writer: &mut Writer<'_>,
    ) -> Result<(), EncodeError> {
        if !self.is_paced() {
            return Ok(());
        }
        let paces = usize::from(self.movements) * of_pace(self.features());
        writer.section(SLOPES, |writer| {
            writer.put(self.slopes.get(..paces).unwrap_or_default());
            for texture in textures {
                for movement in 0..self.movements {
                    writer.put(self.slope_bytes(texture, movement));
                }
            }
        })
    }

    /// The slope of a texture at a movement; that of all where there is no such texture.
    fn slope_bytes(&self, texture: Option<u16>, movement: u8) -> &'a [u8] {
        let (features, movements) = (self.features(), usize::from(self.movements));
        let at = match texture.filter(|&texture| texture < self.textures) {
            Some(texture) => {
                let before = usize::from(texture) * movements + usize::from(movement);
                movements * of_pace(features) + before * 2 * features
            }
            None => usize::from(movement) * of_pace(features) + EXPECTED,
        };
        let bytes = self.slopes.get(at..).unwrap_or_default();
        bytes.get(..2 * features).unwrap_or_default()
    }

    fn numbers(&self, texture: Option<u16>, movement: u8) -> impl Iterator<Item = i16> + use<'a> {
        let bytes = self.slope_bytes(texture, movement);
        bytes
            .as_chunks()
            .0
            .iter()
            .map(|two| i16::from_le_bytes(*two))
    }

    /// The slope of a texture at a movement, or of all of them together; 0 in a table that knows no speeds.
    pub fn slope(&self, texture: Option<u16>, movement: u8) -> Slope {
        let mut slope = Slope::default();
        for (to, from) in slope.iter_mut().zip(self.numbers(texture, movement)) {
            *to = from;
        }
        slope
    }

    /// The speeds and slopes at a movement; `None` in a table without speeds.
    pub(crate) fn slopes_at(&self, movement: u8) -> Option<SlopesView<'a>> {
        if !self.is_paced() || movement >= self.movements {
            return None;
        }
        let features = self.features();
        let at = usize::from(movement) * of_pace(features);
        let own =
            usize::from(self.movements) * of_pace(features) + usize::from(movement) * 2 * features;
        Some(SlopesView {
            mean: i16::from_le_bytes(array(self.slopes, at)?),
            variance: f32::from_le_bytes(array(self.slopes, at + 2)?),
            column: Column {
                means: self.slopes.get(own..)?,
                ..self.column(movement)
            },
        })
    }

    /// ln(speed) of a slide of a movement, 1/1024: the usual one where it is not known, and 0 in a table that knows no
    /// speeds.
    pub fn pace_of(&self, movement: u8, slide: &Observation) -> i16 {
        let usual = self.slopes_at(movement);
        usual.map_or(0, |slopes| slide.pace.unwrap_or(slopes.mean))
    }

    /// Moves the mean of whitened slides, whose mean of ln(speed) is `pace` (1/1024), to the movement's speed, if they
    /// are of this texture.
    pub fn at_movement_speed(
        &self,
        texture: Option<u16>,
        movement: u8,
        mean: &[i16],
        pace: i16,
    ) -> Vector {
        let mut slowed = crate::up_to(mean.iter().copied());
        if self.is_paced() {
            for (z, slope) in slowed.iter_mut().zip(self.numbers(texture, movement)) {
                *z = z.saturating_sub(moved(slope, pace));
            }
        }
        slowed
    }
}

/// By how much this slope moves a whitened mean at such a speed (1/1024), to the nearest step.
#[inline]
pub(crate) fn moved(slope: i16, pace: i16) -> i16 {
    const HALF: i32 = FEATURE_STEPS as i32 / 2;
    let by = (i32::from(slope) * i32::from(pace) + HALF) >> 10;
    by.clamp(i16::MIN.into(), i16::MAX.into()) as i16
}
