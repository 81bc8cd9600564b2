//! Why a probe did not do what it was asked for. Its words are on the host: over the line goes what they are made of. The
//! order of each enum is that of the messages, so new reasons go to the end.

use core::fmt;

use serde::{Deserialize, Serialize};

use super::text::Text;
use crate::explorer::{ExplorerError, ObserveError};
use crate::features::{FeatureSet, Movement, Property, SlideError};
use crate::rig::calibration::RigCalibrationError;
use crate::rig::{Fault, RigError};
use crate::store::StoreError;
use crate::table::{EncodeError, MAX_TEXTURES, Name, TableError};

/// Fewest trials that a standard deviation can be had of. A fused table has those of all textures and needs one.
pub const LEAST_TRIALS: u8 = 2;

/// Why a texture is not learned.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub enum TrainingError {
    /// Its name is empty or longer than a [`Name`].
    Name(usize),
    /// Fewer trials are wanted than [`LEAST_TRIALS`].
    Trials(u8),
    /// The table has as many textures as it may have.
    Textures,
    /// The table would take this many bytes, and the buffer is smaller.
    NoSpace(usize),
    /// This rig does not measure a property that the table has, or none at all.
    Measures(Option<Property>),
    /// The slide has no value of this property; it does not count.
    Missing(Property),
    /// This rig, or the slide, does not have the features of the table.
    Features(FeatureSet),
    /// What was stored of this training is for another kind of table.
    Stats,
    /// A movement that is none of this training's.
    Movement(Movement),
    /// Trials are missing.
    Unfinished(Movement),
    /// A pilot's movements are not those of the table.
    Pilot,
    /// The table is another one than that this training was begun with.
    Table,
    /// The table cannot be written.
    Encode(EncodeError),
}

impl fmt::Display for TrainingError {
    #[inline]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Name(length) => write!(
                f,
                "a texture's name has 1 to {} bytes, not {length}",
                Name::new().capacity()
            ),
            Self::Trials(trials) => write!(
                f,
                "no standard deviation comes of so few trials, {trials}: {LEAST_TRIALS} or more, 1 or more for a fused table"
            ),
            Self::Textures => write!(f, "the table has {MAX_TEXTURES} textures: it is full"),
            Self::NoSpace(bytes) => write!(
                f,
                "the table is full: it would take {bytes} bytes, and there is less room"
            ),
            Self::Measures(Some(property)) => {
                write!(
                    f,
                    "the table has {property}, and this rig does not measure it"
                )
            }
            Self::Measures(None) => f.write_str("this rig measures no property"),
            Self::Missing(property) => write!(f, "the slide has no {property}: slide again"),
            Self::Features(set) => {
                write!(f, "the table was learned from {}, which are not measured here", set.name())
            }
            Self::Stats => f.write_str(
                "what is stored of this training is for another kind of table: forget it, and begin again",
            ),
            Self::Movement(movement) => write!(f, "{movement} is no part of this training"),
            Self::Unfinished(movement) => write!(f, "trials at {movement} are missing"),
            Self::Pilot => f.write_str("the movements of the pilot are not those of the table"),
            Self::Table => {
                f.write_str("the table was replaced during the training: begin it again")
            }
            Self::Encode(why) => why.fmt(f),
        }
    }
}

impl core::error::Error for TrainingError {}

/// Why nothing was learned, renamed, deleted or stored.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum MemoryError {
    /// The store could not be opened.
    #[error("the store is broken: {0}")]
    Broken(StoreError),
    /// There is no table to begin with: the firmware's own cannot be read.
    #[error("there is no table: {0}")]
    NoTable(TableError),
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
    Store(#[from] StoreError),
    /// The table that was stored cannot be read: the firmware's own is in force instead.
    #[error("the stored table cannot be read, and that of the firmware is in its place: {0}")]
    StoredTable(TableError),
    /// The newest table that was stored is damaged: the one before it is in force instead.
    #[error("the stored table cannot be read, and the one stored before it is in its place: {0}")]
    NewestTable(TableError),
}

/// Why a slide does not count; `E` is why a rig failed.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum Rejection<E = RigError> {
    /// The rig did not make it.
    #[error(transparent)]
    Rig(E),
    /// Its samples give no properties.
    #[error(transparent)]
    Slide(SlideError),
    /// Its properties say nothing to the explorer.
    #[error(transparent)]
    Observe(ObserveError),
    /// Its properties say nothing to the training.
    #[error(transparent)]
    Training(TrainingError),
}

/// Why a request was not done, or what went wrong meanwhile.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum Failure {
    /// Says in a sentence for what there is no other word: a sensor that does not start says so.
    #[error("{0}")]
    Said(Text),
    /// Something else is being done.
    #[error("busy: wait, or stop what is being done")]
    Busy,
    /// The rig failed.
    #[error(transparent)]
    Rig(RigError),
    /// The exploration makes no sense with this table.
    #[error(transparent)]
    Explorer(ExplorerError),
    /// The slide does not count.
    #[error(fmt = uncounted)]
    Slide(Rejection),
    /// [`MAX_REJECTED`](crate::rig::MAX_REJECTED) slides in a row came to nothing, or no movement is left, the last one for
    /// this reason.
    #[error("no movement gives a good slide: {0}")]
    NoGoodSlide(Rejection),
    /// The table has no such movement.
    #[error("the table has no movement {}", .0 + 1)]
    Movement(u8),
    /// The texture cannot be trained.
    #[error(transparent)]
    Training(#[from] TrainingError),
    /// [`MAX_REJECTED`](crate::rig::MAX_REJECTED) slides of a training in a row were no good.
    #[error("{}", Fault::Rejected)]
    Rejected,
    /// Nothing was learned, renamed, deleted or stored.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// The calibration cannot be used.
    #[error(transparent)]
    Calibration(#[from] RigCalibrationError),
    /// A calibration of another length.
    #[error("a calibration has 64 bytes")]
    CalibrationLength,
    /// The table ends before the byte that was asked for.
    #[error("the table has no such byte")]
    NoSuchByte,
    /// There is an answer, but the probe did not learn from it.
    #[error("not learned: {0}")]
    NotLearned(MemoryError),
    /// This kind of probe cannot do that.
    #[error("this kind of probe cannot do that")]
    OtherProbe,
    /// The table has no limits by which slides would be called different.
    #[error(
        "the table has no limits, by which slides would be called different: learn it again, with --method fused"
    )]
    NoLimits,
    /// A share of false alarms that is none, or that no limit can be for.
    #[error("the share of false alarms must be from 0.0005 to 0.2")]
    FalseAlarm,
}

/// What a rig gets over by itself asks nothing of a person.
fn uncounted(why: &Rejection, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    match why {
        Rejection::Rig(RigError::Fault(fault)) if fault.is_of_the_movement() => {
            f.write_str(fault.name())
        }
        why => write!(f, "{why}"),
    }
}

impl From<StoreError> for Failure {
    fn from(why: StoreError) -> Self {
        Self::Memory(why.into())
    }
}
