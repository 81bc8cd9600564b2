//! Why the store did not do what it was told.

use embedded_storage_async::nor_flash::{NorFlashError, NorFlashErrorKind};
use sequential_storage::Error;
use serde::{Deserialize, Serialize};

use super::layout::{SCHEMA, UNITS};
use crate::rig::calibration::RigCalibrationError;
use crate::table::TableError;

/// What a flash did not do.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum FlashFault {
    /// It read, wrote or erased at a place that is no whole number of its units.
    #[error("not at a whole unit of it")]
    Unaligned,
    /// It was to read, write or erase where it is not.
    #[error("beyond its end")]
    Bounds,
    /// It did not take a word, or did not erase a sector.
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

/// Why the store did not do what it was told. Its order is that of the messages: new ones go to the end.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum StoreError {
    /// The flash itself failed.
    #[error("the flash failed: {0}")]
    Flash(FlashFault),
    /// The flash has fewer sectors than the store takes.
    #[error("{0} bytes of flash, and the store takes {UNITS} of its smallest sectors")]
    NoSpace(usize),
    /// The table does not fit into the largest sector for one.
    #[error("the table takes {length} bytes, and there is room for {capacity}")]
    TooLong {
        /// Bytes of the table.
        length: usize,
        /// Bytes there are for it.
        capacity: usize,
    },
    /// No table is being written.
    #[error("no table is being written: begin one")]
    NoTable,
    /// A part that does not follow on the one before, or that reaches beyond the length that was announced.
    #[error("a part of the table at {offset}, and {wanted} comes next: send the table anew")]
    Part {
        /// Where it was to go.
        offset: usize,
        /// Where the next one goes.
        wanted: usize,
    },
    /// The table was to be committed before all of it was there.
    #[error("{got} of the {wanted} bytes of the table have come")]
    Unfinished {
        /// Bytes written.
        got: usize,
        /// Bytes announced.
        wanted: usize,
    },
    /// The buffer for reading the table back is smaller than the table.
    #[error("reading the table back takes {0} bytes")]
    Buffer(usize),
    /// What was written does not read as a table.
    #[error(transparent)]
    Table(TableError),
    /// The flash does not hold what was written to it: it is worn out.
    #[error("the flash does not keep what was written: its sector is worn out")]
    Worn,
    /// The settings cannot be used.
    #[error(transparent)]
    Settings(SettingsError),
    /// The calibration that is stored cannot be used.
    #[error(transparent)]
    Calibration(RigCalibrationError),
    /// The flash did not come to an end with opening the store.
    #[error("the flash does not answer: switch the probe off and on")]
    Silent,
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

/// Why settings cannot be used.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum SettingsError {
    /// They cannot be read: erase them.
    #[error("the settings are damaged: erase them, and calibrate again")]
    Corrupt,
    /// They were written by another version: erase them.
    #[error(
        "the settings are of version {0}, and this program knows version {SCHEMA}: erase them, and calibrate again"
    )]
    Schema(u16),
    /// No space for more progress of training: delete a texture.
    #[error("no room for more unfinished training: finish or forget a texture")]
    Full,
    /// A record of this kind is damaged, the one before it is in force.
    #[error("a stored record is damaged, and the one before it is in its place: {0}")]
    Record(Setting),
}

/// What a record is about. Its words say what to do without it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum Setting {
    /// The calibration.
    #[error("the calibration; calibrate again")]
    Calibration,
    /// The wear of the skin.
    #[error("the wear of the skin")]
    Skin,
    /// What was set by `tactus device settings`.
    #[error("what was set; set it again")]
    Limits,
    /// An unfinished training.
    #[error("the training of a texture; train it again")]
    Training,
    /// What the probe learned by itself.
    #[error("what was learned by itself of a texture")]
    SelfLearned,
}
