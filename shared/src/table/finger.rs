//! The finger that a table was learned with: bands and pressures of two kinds of fingers cannot be compared.

use super::encode::{EncodeError, with_section};
use super::format::{TableError, array};
use super::name::valid_name;
use super::sections::FINGER;
use super::view::Table;
use crate::features::MovementError;
use crate::sensor::FingerCode;

/// Bytes that the section takes without a sensor's name.
pub const FINGER_LENGTH: usize = 4 + NAME;
const NAME: usize = 5;

impl Table<'_> {
    /// The finger that it was learned with.
    pub fn finger(&self) -> FingerCode {
        let section = self.section(FINGER).unwrap_or_default();
        section
            .first()
            .copied()
            .map_or_else(FingerCode::default, FingerCode)
    }

    /// Day on which that finger's force per count was measured: see [`crate::wire::Status::calibrated`].
    pub fn calibrated(&self) -> u32 {
        let date = self.section(FINGER).and_then(|section| array(section, 1));
        date.map_or(0, u32::from_le_bytes)
    }

    /// Name of the sensor that it was learned with, where that is [`FingerCode::OTHER`]; else empty.
    pub fn sensor(&self) -> &str {
        let section = self
            .section(FINGER)
            .filter(|_| self.finger() == FingerCode::OTHER);
        let name = section.and_then(|section| section.get(NAME..));
        name.and_then(|name| core::str::from_utf8(name).ok())
            .unwrap_or_default()
    }

    /// This table, if it was learned with this finger, and its movements are known: a rig is to make them.
    pub fn of_finger(self, probe: FingerCode) -> Result<Self, TableError> {
        let table = self.finger();
        if table != probe {
            return Err(TableError::Finger { table, probe });
        }
        let mut movements = self.movements().zip(0..);
        match movements.find(|(movement, _)| !movement.is_known()) {
            Some((_, index)) => Err(TableError::Movement(index, MovementError::Force(0))),
            None => Ok(self),
        }
    }
}

/// Returns whether a section says a finger and a day, and the name of the sensor exactly where it is another's.
pub(super) fn is_finger(section: &[u8]) -> bool {
    section.split_at_checked(NAME).is_some_and(|(head, name)| {
        let is_other = head.first() == Some(&FingerCode::OTHER.0);
        match core::str::from_utf8(name) {
            Ok(name) if is_other => valid_name(name).is_ok(),
            _ => !is_other && name.is_empty(),
        }
    })
}

/// Writes `old` into `out`, with this finger, the day of its calibration, and for [`FingerCode::OTHER`] the sensor's
/// name in place of what it says of that.
pub fn with_finger<'o>(
    out: &'o mut [u8],
    old: &Table<'_>,
    finger: FingerCode,
    calibrated: u32,
    sensor: &str,
) -> Result<Table<'o>, EncodeError> {
    let is_there = finger != FingerCode::BIOTAC || calibrated != 0;
    with_section(out, old, FINGER, is_there, |writer| {
        writer.put(&[finger.0]);
        writer.put(&calibrated.to_le_bytes());
        writer.put(sensor.as_bytes());
    })
}
