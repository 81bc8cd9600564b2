//! The three properties of texture (traction, roughness, fineness), their values and sets of them.

use core::fmt;

use serde::{Deserialize, Serialize};

/// A property of texture, one of the paper's three.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
pub enum Property {
    /// Mean tangential force of the slide in N, from motor current or a force sensor (eq. 14).
    Traction,
    /// Natural logarithm of the band-passed P_AC power in counts^2 above the still finger's (eq. 16).
    Roughness,
    /// Natural logarithm of the spectral centroid in Hz (eq. 19).
    Fineness,
}

impl Property {
    /// All properties, in the order of every table.
    pub const ALL: [Self; 3] = [Self::Traction, Self::Roughness, Self::Fineness];

    /// Place in [`Property::ALL`].
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The paper's word for it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Traction => "traction",
            Self::Roughness => "roughness",
            Self::Fineness => "fineness",
        }
    }
}

impl fmt::Display for Property {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// The properties of one slide; `None` is a property that this rig cannot measure.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Properties([Option<f32>; 3]);

impl Properties {
    /// Properties in the order of [`Property::ALL`].
    pub const fn new(values: [Option<f32>; 3]) -> Self {
        Self(values)
    }

    /// The value of `property`.
    pub fn get(&self, property: Property) -> Option<f32> {
        let [traction, roughness, fineness] = self.0;
        match property {
            Property::Traction => traction,
            Property::Roughness => roughness,
            Property::Fineness => fineness,
        }
    }

    /// Which properties have a value.
    pub fn measured(&self) -> PropertySet {
        Property::ALL
            .into_iter()
            .filter(|&p| self.get(p).is_some())
            .collect()
    }
}

/// A set of properties: what a rig can measure, what a table knows.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct PropertySet(u8);

impl PropertySet {
    /// All three.
    pub const ALL: Self = Self(0b111);
    /// Those of P_AC, which a rig has whatever moves it: roughness and fineness.
    pub const WITHOUT_SHEAR: Self = Self(0b110);

    /// Returns whether `property` is in the set.
    pub const fn contains(self, property: Property) -> bool {
        self.0 & (1 << property.index()) != 0
    }

    /// The intersection of both sets.
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Returns whether the set is empty.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The properties of the set, in the order of [`Property::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Property> {
        Property::ALL.into_iter().filter(move |&p| self.contains(p))
    }

    /// One bit per property, lowest first.
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// The set with these bits; `None` if a bit stands for no property.
    pub const fn from_bits(bits: u8) -> Option<Self> {
        if bits & !Self::ALL.0 == 0 {
            Some(Self(bits))
        } else {
            None
        }
    }
}

impl FromIterator<Property> for PropertySet {
    fn from_iter<I: IntoIterator<Item = Property>>(properties: I) -> Self {
        Self(
            properties
                .into_iter()
                .fold(0, |bits, p| bits | 1 << p.index()),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    #[test]
    fn property_sets() {
        let set: PropertySet = [Property::Fineness, Property::Traction]
            .into_iter()
            .collect();
        assert!(set.contains(Property::Traction) && !set.contains(Property::Roughness));
        assert_eq!(
            set.iter().collect::<Vec<_>>(),
            [Property::Traction, Property::Fineness]
        );
        assert_eq!(PropertySet::from_bits(set.bits()), Some(set));
        assert_eq!(PropertySet::from_bits(8), None);
        assert_eq!(
            PropertySet::WITHOUT_SHEAR.iter().collect::<Vec<_>>(),
            [Property::Roughness, Property::Fineness]
        );
        assert!(set.and(PropertySet::from_bits(0b010).unwrap()).is_empty());
        assert_eq!(set.and(PropertySet::ALL), set);
    }
}
