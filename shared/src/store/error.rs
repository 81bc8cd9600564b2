//! Why the store did not do what it was told.

use embedded_storage_async::nor_flash::{NorFlashError, NorFlashErrorKind};
use sequential_storage::Error;
use serde::{Deserialize, Serialize};

use super::layout::{SCHEMA, UNITS};
use crate::rig::calibration::RigCalibrationError;
use crate::table::TableError;

/// A failure of a flash.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum FlashFault {
    #[error("not at a whole unit of it")]
    Unaligned,
    #[error("beyond its end")]
    Bounds,
    #[error("it does not write or erase")]
    Work,
}

impl<E: NorFlashError> From<E> for FlashFault {
    fn from(why: E) -> Self {
        match why.kind() {
            NorFlashErrorKind::NotAligned => Self::Unaligned,
            NorFlashErrorKind::OutOfBounds => Self::Bounds,
            _ => Self::Work,
        }
    }
}

/// The reason why the store refused. Its order is that of the messages: new ones go to the end.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum StoreError {
    #[error("the flash failed: {0}")]
    Flash(FlashFault),
    #[error("{0} bytes of flash, and the store takes {UNITS} of its smallest sectors")]
    NoSpace(usize),
    #[error("the table takes {length} bytes, and there is room for {capacity}")]
    TooLong { length: usize, capacity: usize },
    #[error("no table is being written: begin one")]
    NoTable,
    #[error("a part of the table at {offset}, and {wanted} comes next: send the table anew")]
    Part { offset: usize, wanted: usize },
    #[error("{got} of the {wanted} bytes of the table have come")]
    Unfinished { got: usize, wanted: usize },
    #[error("reading the table back takes {0} bytes")]
    Buffer(usize),
    /// The written bytes do not read as a table.
    #[error(transparent)]
    Table(TableError),
    #[error("the flash does not keep what was written: its sector is worn out")]
    Worn,
    /// The settings cannot be used.
    #[error(transparent)]
    Settings(SettingsError),
    /// The calibration that is stored cannot be used.
    #[error(transparent)]
    Calibration(RigCalibrationError),
    #[error("the flash does not answer: switch the probe off and on")]
    Silent,
    #[error(
        "{0} sectors of the flash were erased since the start, which wears it: ask again in a second"
    )]
    TooSoon(u32),
}

impl StoreError {
    /// The flash failed in this way.
    pub(super) fn flash(why: impl Into<FlashFault>) -> Self {
        Self::Flash(why.into())
    }
}

impl<E: NorFlashError> From<Error<E>> for StoreError {
    fn from(why: Error<E>) -> Self {
        match why {
            Error::Storage { value, .. } => Self::flash(value),
            Error::FullStorage => SettingsError::Full.into(),
            _ => SettingsError::Corrupt.into(),
        }
    }
}

impl From<SettingsError> for StoreError {
    fn from(why: SettingsError) -> Self {
        Self::Settings(why)
    }
}

/// The reason why settings cannot be used.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum SettingsError {
    #[error("the settings are damaged: erase them, and calibrate again")]
    Corrupt,
    #[error(
        "the settings are of version {0}, and this program knows version {SCHEMA}: erase them, and calibrate again"
    )]
    Schema(u16),
    #[error("no room for more unfinished training: finish or forget a texture")]
    Full,
    #[error("a stored record is damaged, and the one before it is in its place: {0}")]
    Record(Setting),
}

/// The subject of a record. Its words say what to do without it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum Setting {
    #[error("the calibration; calibrate again")]
    Calibration,
    #[error("the wear of the skin")]
    Skin,
    #[error("what was set; set it again")]
    Limits,
    #[error("the training of a texture; train it again")]
    Training,
    #[error("what was learned by itself of a texture")]
    SelfLearned,
}
