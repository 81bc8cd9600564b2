//! All that a slide says at once: the features of the fused way of deciding, in fixed point.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use super::property::{Properties, Property, PropertySet};
use super::slide::Measurement;
use crate::dsp::FUSED_BANDS;
use crate::up_to;

/// Most features of a slide.
pub const MAX_FEATURES: usize = 28;
/// Bands below 17 Hz.
pub(crate) const LOW_BANDS: usize = 2;
/// Number of bands where each two of [`FUSED_EDGES`](crate::dsp::FUSED_EDGES) from 17 Hz on are one: few slides tell
/// more about few features.
pub const COARSE_BANDS: usize = LOW_BANDS + (FUSED_BANDS - LOW_BANDS) / 2;
/// Parts of a feature's unit that one step of a [`Vector`] of features is.
pub const FEATURE_STEPS: f32 = 1024.0;
/// Parts of a within-texture standard deviation that one step of a whitened [`Vector`] is.
pub const WHITE_STEPS: f32 = 256.0;
/// Counts of P_DC that are the unit of its features.
pub const PDC_UNIT: f32 = 100.0;

/// Features of a slide in steps of 1/1024 of their units, or whitened ones in steps of 1/256 standard deviation.
pub type Vector = Vec<i16, MAX_FEATURES>;

/// Which features a table was learned from.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
pub enum FeatureSet {
    /// Traction in N, and logarithms of band powers.
    Force,
    /// Mean of P_DC during the slide in units of 100 counts, the logarithm of its scatter, and logarithms of band
    /// powers: for a rig without force sensing.
    Pressure,
    /// Logarithms of band powers only.
    Bands,
    /// The three properties of the paper.
    Properties,
}

impl FeatureSet {
    /// All sets, in the order of their codes in a table.
    pub const ALL: [Self; 4] = [Self::Force, Self::Pressure, Self::Bands, Self::Properties];

    /// Features that are no band powers.
    pub const fn others(self) -> usize {
        match self {
            Self::Force => 1,
            Self::Pressure => 2,
            Self::Bands => 0,
            Self::Properties => 3,
        }
    }

    /// Returns whether a table may have this set with `features` features in all.
    pub(crate) const fn allows(self, features: usize) -> bool {
        match self {
            Self::Properties => features == 3,
            _ => features > self.others() && features <= self.others() + FUSED_BANDS,
        }
    }

    /// Returns whether a rig that measures `measured` can have these features. Every rig has P_AC and P_DC.
    pub(crate) const fn measured_by(self, measured: PropertySet) -> bool {
        match self {
            Self::Force => measured.contains(Property::Traction),
            Self::Pressure | Self::Bands => true,
            Self::Properties => measured.bits() == PropertySet::ALL.bits(),
        }
    }

    /// In words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Force => "traction and band powers",
            Self::Pressure => "P_DC and band powers",
            Self::Bands => "band powers",
            Self::Properties => "the three properties",
        }
    }
}

/// The features of one slide, in the form that is compared with a table.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Observation {
    /// The paper's three properties.
    pub properties: Properties,
    /// Mean natural logarithms of the band powers, in steps of 1/1024: of [`FUSED_EDGES`](crate::dsp::FUSED_EDGES), or
    /// the coarse ones where no more than [`COARSE_BANDS`] of these were measured.
    pub bands: Vec<i16, FUSED_BANDS>,
    /// Mean of P_DC in steps of 1/1024 of 100 counts, and natural logarithm of its standard deviation about a parabola
    /// and half a count, in steps of 1/1024.
    pub pressure: Option<[i16; 2]>,
    /// Natural logarithm of the mean speed in parts of the movement's, in steps of 1/1024; `None` where it was not
    /// measured.
    pub pace: Option<i16>,
}

impl Observation {
    /// The features of `set`, `length` in all; `None` where one of them is missing.
    pub fn vector(&self, set: FeatureSet, length: usize) -> Option<Vector> {
        let mut vector = Vector::new();
        match set {
            FeatureSet::Force => {
                let traction = fixed(self.properties.get(Property::Traction)?)?;
                vector.push(traction).ok()?;
            }
            FeatureSet::Pressure => vector.extend_from_slice(&self.pressure?).ok()?,
            FeatureSet::Bands => {}
            FeatureSet::Properties => {
                for property in Property::ALL {
                    let value = fixed(self.properties.get(property)?)?;
                    vector.push(value).ok()?;
                }
            }
        }
        if set != FeatureSet::Properties {
            if vector.len() + self.bands.len() == length {
                vector.extend_from_slice(&self.bands).ok()?;
            } else if self.bands.len() > COARSE_BANDS {
                vector.extend(coarse(&self.bands).take(COARSE_BANDS));
            }
        }
        (vector.len() == length).then_some(vector)
    }

    /// The same with coarse bands, made of all of [`FUSED_EDGES`](crate::dsp::FUSED_EDGES) that it has.
    pub fn with_coarse_bands(mut self) -> Self {
        if self.bands.len() > COARSE_BANDS {
            self.bands = up_to(coarse(&self.bands));
        }
        self
    }

    /// Numbers of bands that it can be compared by, the most first.
    pub fn numbers_of_bands(&self) -> [usize; 2] {
        let bands = self.bands.len();
        [
            bands,
            if bands > COARSE_BANDS {
                coarse(&self.bands).count()
            } else {
                bands
            },
        ]
    }
}

impl From<Properties> for Observation {
    fn from(properties: Properties) -> Self {
        Self {
            properties,
            ..Self::default()
        }
    }
}

impl From<&Measurement> for Observation {
    fn from(slide: &Measurement) -> Self {
        let pressure = slide
            .pdc
            .and_then(|(mean, sd)| Some([fixed(mean / PDC_UNIT)?, fixed(libm::logf(sd + 0.5))?]));
        let bands = slide.spectrum.fused_bands().iter().take(slide.bands);
        let bands: Vec<i16, FUSED_BANDS> = up_to(bands.filter_map(|band| fixed(*band)));
        Self {
            properties: slide.properties,
            bands: match bands.len() {
                ..=COARSE_BANDS => up_to(coarse(&bands)),
                _ => bands,
            },
            pressure,
            pace: slide.pace,
        }
    }
}

/// The low bands, and the mean of each two of the others.
fn coarse(bands: &[i16]) -> impl Iterator<Item = i16> {
    let (low, others) = bands.split_at_checked(LOW_BANDS).unwrap_or_default();
    let (pairs, _) = others.as_chunks();
    let means = pairs
        .iter()
        .map(|&[a, b]| ((i32::from(a) + i32::from(b)) >> 1) as i16);
    low.iter().copied().chain(means)
}

/// A feature in fixed point; one that is beyond it is at its end, and `None` is no number.
pub fn fixed(feature: f32) -> Option<i16> {
    // `as` saturates
    feature
        .is_finite()
        .then(|| libm::roundf(feature * FEATURE_STEPS) as i16)
}

#[cfg(test)]
mod tests;
