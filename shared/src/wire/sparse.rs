//! Probabilities most of which are negligible: how many there are, and the others with their places, ascending.

use heapless::Vec;
use serde::de::Error as _;
use serde::ser::Error as _;
use serde::{Deserialize as _, Deserializer, Serialize as _, Serializer};

use crate::explorer::NEGLIGIBLE;
use crate::table::MAX_TEXTURES;
use crate::up_to;

const _: () = assert!(MAX_TEXTURES <= 1 << u8::BITS);

type OnLine = (u16, Vec<(u8, f32), MAX_TEXTURES>);

pub(super) fn serialize<S: Serializer>(
    numbers: &Vec<f32, MAX_TEXTURES>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let others = numbers.iter().zip(0..);
    let others = others.filter(|(number, _)| **number >= NEGLIGIBLE);
    let others = up_to(others.map(|(number, place)| (place, *number)));
    let count = u16::try_from(numbers.len()).map_err(S::Error::custom)?;
    OnLine::from((count, others)).serialize(serializer)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Vec<f32, MAX_TEXTURES>, D::Error> {
    let (count, others) = OnLine::deserialize(deserializer)?;
    let mut numbers = Vec::new();
    numbers
        .resize(count.into(), 0.0)
        .map_err(|_| D::Error::custom("too many textures"))?;
    let mut next = 0;
    for (place, number) in others {
        match numbers.get_mut(usize::from(place)) {
            Some(there) if place >= next => *there = number,
            _ => return Err(D::Error::custom("textures out of order")),
        }
        next = place.saturating_add(1);
    }
    Ok(numbers)
}
