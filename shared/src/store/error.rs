//! Why the store did not do what it was told.

use core::fmt;

use sequential_storage::Error;

use super::layout::{SCHEMA, SECTORS};
use crate::rig::calibration::RigCalibrationError;
use crate::table::TableError;

/// Why the store did not do what it was told.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum StoreError<E> {
    /// The flash itself failed.
    Flash(E),
    /// The flash has fewer than four sectors.
    NoSpace(usize),
    /// The table does not fit into its sector.
    TooLong {
        /// Bytes of the table.
        length: usize,
        /// Bytes there are for it.
        capacity: usize,
    },
    /// No table is being written.
    NoTable,
    /// A part that does not follow on the one before, or that reaches beyond the length that was announced.
    Part {
        /// Where it was to go.
        offset: usize,
        /// Where the next one goes.
        wanted: usize,
    },
    /// The table was to be committed before all of it was there.
    Unfinished {
        /// Bytes written.
        got: usize,
        /// Bytes announced.
        wanted: usize,
    },
    /// The buffer for reading the table back is smaller than the table.
    Buffer(usize),
    /// What was written does not read as a table.
    Table(TableError),
    /// The flash does not hold what was written to it: it is worn out.
    Worn,
    /// The settings cannot be used.
    Settings(SettingsError),
    /// The calibration that is stored cannot be used.
    Calibration(RigCalibrationError),
}

impl<E: fmt::Debug> fmt::Display for StoreError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flash(why) => write!(f, "the flash failed: {why:?}"),
            Self::NoSpace(bytes) => write!(
                f,
                "{bytes} bytes of flash, and the store takes {SECTORS} sectors"
            ),
            Self::TooLong { length, capacity } => {
                write!(
                    f,
                    "the table takes {length} bytes, and there is room for {capacity}"
                )
            }
            Self::NoTable => f.write_str("no table is being written: begin one"),
            Self::Part { offset, wanted } => write!(
                f,
                "a part of the table at {offset}, and {wanted} comes next: send the table anew"
            ),
            Self::Unfinished { got, wanted } => {
                write!(f, "{got} of the {wanted} bytes of the table have come")
            }
            Self::Buffer(wanted) => write!(f, "reading the table back takes {wanted} bytes"),
            Self::Table(why) => why.fmt(f),
            Self::Worn => {
                f.write_str("the flash does not keep what was written: its sector is worn out")
            }
            Self::Settings(why) => why.fmt(f),
            Self::Calibration(why) => why.fmt(f),
        }
    }
}

impl<E: fmt::Debug> core::error::Error for StoreError<E> {}

impl<E> From<Error<E>> for StoreError<E> {
    fn from(why: Error<E>) -> Self {
        match why {
            Error::Storage { value, .. } => Self::Flash(value),
            Error::FullStorage => SettingsError::Full.into(),
            _ => SettingsError::Corrupt.into(),
        }
    }
}

impl<E> From<SettingsError> for StoreError<E> {
    fn from(why: SettingsError) -> Self {
        Self::Settings(why)
    }
}

/// Why settings cannot be used.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum SettingsError {
    /// They cannot be read: erase them.
    Corrupt,
    /// They were written by another version: erase them.
    Schema(u16),
    /// No space for more progress of training: delete a texture.
    Full,
}

impl fmt::Display for SettingsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Corrupt => {
                f.write_str("the settings are damaged: erase them, and calibrate again")
            }
            Self::Schema(found) => write!(
                f,
                "the settings are of version {found}, and this program knows {SCHEMA}: erase them, and calibrate again"
            ),
            Self::Full => {
                f.write_str("no room for more unfinished training: finish or forget a texture")
            }
        }
    }
}

impl core::error::Error for SettingsError {}
