//! All that a slide says at once: the features of the fused way of deciding, in fixed point.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use super::property::{Properties, Property, PropertySet};
use super::slide::Measurement;
use crate::dsp::FUSED_BANDS;
use crate::up_to;

/// Most features of a slide.
pub const MAX_FEATURES: usize = 16;
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
    /// Mean of P_DC during the slide in units of 100 counts, the logarithm of its scatter, and logarithms of band powers:
    /// for a rig without force sensing.
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
    /// Natural logarithms of the band powers, in steps of 1/1024.
    pub bands: Vec<i16, FUSED_BANDS>,
    /// Mean of P_DC in steps of 1/1024 of 100 counts, and natural logarithm of its standard deviation about a parabola and
    /// half a count, in steps of 1/1024.
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
            for band in &self.bands {
                vector.push(*band).ok()?;
            }
        }
        (vector.len() == length).then_some(vector)
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
        let pressure = slide.pdc.and_then(|(mean, sd)| {
            Some([fixed(mean / PDC_UNIT)?, fixed(libm::logf(sd + 0.5))?])
        });
        Self {
            properties: slide.properties,
            bands: up_to(
                slide
                    .spectrum
                    .fused_bands()
                    .iter()
                    .take(slide.bands)
                    .filter_map(|band| fixed(*band)),
            ),
            pressure,
            pace: slide.pace,
        }
    }
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
