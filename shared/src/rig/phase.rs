//! What the rig is doing, how a movement ended, and why one was not made.

use serde::{Deserialize, Serialize};

use super::calibration::RigCalibrationError;
use super::fault::Fault;
use crate::features::{Movement, MovementError};

/// Forces over this, 1.26 N, are pressed only by a rig that was allowed to.
pub const HIGH_FORCE_MN: u16 = Movement::FOR_TRACTION.force_mn();

/// Largest force of a movement, mN, of a rig that was allowed high forces, or was not.
pub const fn most_mn(high_force: bool) -> u16 {
    if high_force {
        *Movement::FORCE_MN.end()
    } else {
        HIGH_FORCE_MN
    }
}

/// What the rig is doing.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Phase {
    /// Nothing; the positions of lever and stage are unknown until it homes.
    Parked,
    /// The lever, then the stage look for their limit switches.
    Homing,
    /// Lifted and waiting.
    Ready,
    /// The stage goes to where the slide begins.
    Positioning,
    /// The lever comes down until the force is right.
    Pressing,
    /// The still finger is measured.
    Background,
    /// Sliding.
    Sliding,
    /// The finger is lifted; then the slide is over.
    Lifting,
    /// The stage goes without load, its current is measured.
    Unloaded,
    /// A fault was seen; the finger is being lifted, or is. Nothing moves until
    /// [`Control::reset`](super::control::Control::reset).
    Faulted(Fault),
}

/// How a movement ended.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Ended {
    /// All samples are there.
    Whole,
    /// So many words were damaged or missing between the beginning of the background and the end of the slide.
    Gap(u32),
    /// It was stopped.
    Stopped,
}

/// Why a command is refused.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum Refused {
    /// Something else is being done.
    #[error("the rig is busy; stop it first")]
    Busy,
    /// The positions of lever and stage are unknown: home first.
    #[error("lever and stage do not know where they are; home them first")]
    NotHomed,
    /// A fault has to be reset first.
    #[error("{}: {}", .0, .0.recovery())]
    Fault(Fault),
    /// The force is over what this rig may press.
    #[error(
        "{0} mN is more than this rig may press: {HIGH_FORCE_MN} mN, or {most} mN with tactus device settings --high-force on, and no more than its calibration can tell",
        most = most_mn(true)
    )]
    Force(u16),
    /// No speed of this stage, um/s.
    #[error("{}", MovementError::Speed(*.0))]
    Speed(u32),
    /// The slide does not fit on the sample.
    #[error("the slide does not fit on the sample")]
    Length,
    /// The constants cannot be used.
    #[error(transparent)]
    Calibration(RigCalibrationError),
}

/// Why a rig with a stage and a lever did not make a movement.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum RigError {
    /// The movement was refused; nothing moved.
    #[error(transparent)]
    Refused(Refused),
    /// A fault was seen: the stage stands and the finger is lifted, unless the fault is [`Fault::LeverNotHome`].
    #[error("{}: {}", .0, .0.recovery())]
    Fault(Fault),
    /// It was stopped, and the finger is lifted.
    #[error("stopped")]
    Stopped,
    /// It did not come to an end by itself, and was stopped: see [`super::timeout`].
    #[error("the rig does not come to an end: home it")]
    Hangs,
    /// Nobody made the movement by hand in time.
    #[error("nobody touched anything for a minute: ask again")]
    NobodyThere,
    /// A hand does not make this movement.
    #[error(
        "a hand makes one movement, 0.5 N and 25 mm/s, and the table has another: push one that was recorded by hand"
    )]
    NotByHand,
}

impl RigError {
    /// Whether this is about the one movement, and the rig may try it again or try another after it has homed: see
    /// [`Fault::is_of_the_movement`]. Of a refusal, too, that goes by force, speed or length.
    pub const fn is_of_the_movement(&self) -> bool {
        match self {
            Self::Fault(fault) => fault.is_of_the_movement(),
            Self::Refused(Refused::Force(_) | Refused::Speed(_) | Refused::Length) => true,
            Self::Refused(_)
            | Self::Stopped
            | Self::Hangs
            | Self::NobodyThere
            | Self::NotByHand => false,
        }
    }
}

impl From<Refused> for RigError {
    fn from(why: Refused) -> Self {
        Self::Refused(why)
    }
}

impl From<Fault> for RigError {
    fn from(fault: Fault) -> Self {
        Self::Fault(fault)
    }
}
