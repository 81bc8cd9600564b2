//! Why a probe did not do what it was asked for. Its words are on the host: over the line goes what they are made of.
//! The order of each enum is that of the messages, so new reasons go to the end.

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

/// The reasons why a texture is not learned.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum TrainingError {
    #[error("a texture's name has 1 to {} bytes, not {}", Name::new().capacity(), .0)]
    Name(usize),
    #[error(
        "no standard deviation comes of so few trials, {0}: {LEAST_TRIALS} or more, 1 or more for a fused table"
    )]
    Trials(u8),
    #[error("the table has {MAX_TEXTURES} textures: it is full")]
    Textures,
    #[error("the table is full: it would take {0} bytes, and there is less room")]
    NoSpace(usize),
    /// This rig does not measure a property that the table has, or none at all.
    #[error(fmt = unmeasured)]
    Measures(Option<Property>),
    #[error("the slide has no {0}: slide again")]
    Missing(Property),
    #[error("the table was learned from {}, which are not measured here", .0.name())]
    Features(FeatureSet),
    #[error(
        "what is stored of this training is for another kind of table: forget it, and begin again"
    )]
    Stats,
    #[error("{0} is no part of this training")]
    Movement(Movement),
    #[error("trials at {0} are missing")]
    Unfinished(Movement),
    #[error("the movements of the pilot are not those of the table")]
    Pilot,
    #[error("the table was replaced during the training: begin it again")]
    Table,
    /// The table cannot be written.
    #[error(transparent)]
    Encode(EncodeError),
}

fn unmeasured(property: &Option<Property>, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    match property {
        Some(property) => {
            write!(
                f,
                "the table has {property}, and this rig does not measure it"
            )
        }
        None => f.write_str("this rig measures no property"),
    }
}

/// Why nothing was learned, renamed, deleted or stored.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum MemoryError {
    #[error("the store is broken: {0}")]
    Broken(StoreError),
    #[error("there is no table: {0}")]
    NoTable(TableError),
    #[error("no slide was measured since the rig moved last: explore first")]
    NoEpisode,
    #[error("the table has changed since the exploration: explore again")]
    TableChanged,
    #[error("this kind of table learns by `train` only")]
    TrainOnly,
    #[error("the table is full: forget a texture first")]
    Full,
    #[error("there is no texture {0} in the table")]
    Unknown(Name),
    #[error("there is a texture {0} already")]
    Taken(Name),
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
    #[error("the stored table cannot be read, and that of the firmware is in its place: {0}")]
    StoredTable(TableError),
    #[error("the stored table cannot be read, and the one stored before it is in its place: {0}")]
    NewestTable(TableError),
    #[error(
        "the probe was reset while it read its stored table, and that of the firmware is in its place: push a table, \
         or go back to the firmware's"
    )]
    Unread,
    #[error(
        "{0} has moved as far from what was taught as it may by itself: if it is {0}, say so with \
         `tactus device teach`, or undo with `tactus device forget --self-learned`"
    )]
    TooFar(Name),
    #[error(
        "all textures that it learned by itself have moved the same way, so finger, rig or drive has changed: nothing \
         is learned until `tactus device refresh`"
    )]
    CommonShift,
    #[error(
        "by its own figures this table would give too many new textures a name, and learn them under it: nothing is \
         learned by itself. `tactus device table show` has the figures; more slides of each texture may help"
    )]
    NamesNew,
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
#[allow(missing_docs)] // their texts say it
pub enum Failure {
    #[error("{0}")]
    Said(Text),
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
    #[error("no movement gives a good slide: {0}")]
    NoGoodSlide(Rejection),
    #[error("the table has no movement {}", .0 + 1)]
    Movement(u8),
    /// The texture cannot be trained.
    #[error(transparent)]
    Training(#[from] TrainingError),
    #[error("{}", Fault::Rejected)]
    Rejected,
    /// Nothing was learned, renamed, deleted or stored.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// The calibration cannot be used.
    #[error(transparent)]
    Calibration(#[from] RigCalibrationError),
    #[error("a calibration has 64 bytes")]
    CalibrationLength,
    #[error("the table has no such byte")]
    NoSuchByte,
    #[error("not learned: {0}")]
    NotLearned(MemoryError),
    #[error("this kind of probe cannot do that")]
    OtherProbe,
    #[error(
        "the table has no limits, by which slides would be called different: learn it again, with --method fused"
    )]
    NoLimits,
    #[error("the share of false alarms must be from 0.0005 to 0.2")]
    FalseAlarm,
    #[error(
        "nobody pressed the blue button on the board within 30 s: allow high forces again, and press it"
    )]
    NotPressed,
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
