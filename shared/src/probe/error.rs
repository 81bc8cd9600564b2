//! Why a probe did not do what was asked for. The host reads it as text.

use super::explore::ExploreError;
use super::training::TrainingError;
use crate::explorer::ExplorerError;
use crate::rig::Fault;
use crate::rig::calibration::RigCalibrationError;
use crate::store::StoreError;
use crate::table::{EncodeError, Name, TableError};

/// Why nothing was learned, renamed, deleted or stored; `E` is the flash's error.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum MemoryError<E> {
    /// The store could not be opened.
    #[error("the store is broken: see the log")]
    Broken,
    /// There is no table to begin with: the firmware's own cannot be read.
    #[error("there is no table: see the log")]
    NoTable,
    /// The rig has moved since the exploration, or there was none.
    #[error("no slide was measured since the rig moved last: explore first")]
    NoEpisode,
    /// Another table is in force than the one that was explored with.
    #[error("the table has changed since the exploration: explore again")]
    TableChanged,
    /// The table is of a kind that learns from whole trainings.
    #[error("this kind of table learns by `train` only")]
    TrainOnly,
    /// The table has as many textures as it may have.
    #[error("the table is full: forget a texture first")]
    Full,
    /// The table has no texture of this name.
    #[error("there is no texture {0} in the table")]
    Unknown(Name),
    /// The table has a texture of this name.
    #[error("there is a texture {0} already")]
    Taken(Name),
    /// The texture is the table's only one.
    #[error("a table cannot be without any texture")]
    LastTexture,
    /// The table in force cannot be read.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The new table cannot be written.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// The store failed.
    #[error(transparent)]
    Store(#[from] StoreError<E>),
}

/// Why there is no answer to what lies under the finger; `R` is the rig's error.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum IdentifyError<R> {
    /// The request makes no sense with this table.
    #[error("{0}")]
    Explorer(ExplorerError),
    /// The exploration failed.
    #[error("{0}")]
    Explore(ExploreError<R>),
}

/// Why a request was not done; `R` is the rig's error, `E` the flash's.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum ProbeError<R, E> {
    /// The rig failed.
    #[error("{0}")]
    Rig(R),
    /// There is no answer.
    #[error("{0}")]
    Identify(IdentifyError<R>),
    /// The texture cannot be trained.
    #[error(transparent)]
    Training(#[from] TrainingError),
    /// [`MAX_REJECTED`](crate::rig::MAX_REJECTED) slides in a row were no good.
    #[error("{}", Fault::Rejected)]
    Rejected,
    /// Nothing was learned, renamed, deleted or stored.
    #[error(transparent)]
    Memory(#[from] MemoryError<E>),
    /// The calibration cannot be used.
    #[error(transparent)]
    Calibration(#[from] RigCalibrationError),
    /// A calibration of another length.
    #[error("a calibration has 60 bytes")]
    CalibrationLength,
    /// The table ends before the byte that was asked for.
    #[error("the table has no such byte")]
    NoSuchByte,
}

impl<R, E> From<StoreError<E>> for ProbeError<R, E> {
    fn from(why: StoreError<E>) -> Self {
        Self::Memory(why.into())
    }
}
