//! What the rig is doing, how a movement ended, and why one was not made.

use core::fmt;

use super::calibration::RigCalibrationError;
use super::fault::Fault;
use crate::features::{Movement, MovementError};

/// Forces over this are pressed only by a rig that was allowed to.
pub(super) const HIGH_FORCE_MN: u16 = Movement::FOR_TRACTION.force_mn();

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
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Refused {
    /// Something else is being done.
    Busy,
    /// The positions of lever and stage are unknown: home first.
    NotHomed,
    /// A fault has to be reset first.
    Fault(Fault),
    /// The force is over what this rig may press.
    Force(u16),
    /// No speed of this stage, um/s.
    Speed(u32),
    /// The slide does not fit on the sample.
    Length,
    /// The constants cannot be used.
    Calibration(RigCalibrationError),
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Busy => f.write_str("the rig is busy; stop it first"),
            Self::NotHomed => {
                f.write_str("lever and stage do not know where they are; home them first")
            }
            Self::Fault(fault) => write!(f, "{fault}: {}", fault.recovery()),
            Self::Force(mn) => write!(
                f,
                "{mn} mN is more than this rig may press; {HIGH_FORCE_MN} mN unless high forces are allowed"
            ),
            Self::Speed(um_s) => MovementError::Speed(*um_s).fmt(f),
            Self::Length => f.write_str("the slide does not fit on the sample"),
            Self::Calibration(why) => why.fmt(f),
        }
    }
}

impl core::error::Error for Refused {}

/// Why a rig with a stage and a lever did not make a movement.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum RigError {
    /// The movement was refused; nothing moved.
    Refused(Refused),
    /// A fault was seen: the stage stands and the finger is lifted, unless the fault is [`Fault::LeverNotHome`].
    Fault(Fault),
    /// It was stopped, and the finger is lifted.
    Stopped,
    /// It did not come to an end by itself, and was stopped: see [`super::timeout`].
    Hangs,
}

impl RigError {
    /// Whether this is about the one movement, and the rig may try it again or try another after it has homed: see
    /// [`Fault::is_of_the_movement`]. Of a refusal, too, that goes by force, speed or length.
    pub const fn is_of_the_movement(&self) -> bool {
        match self {
            Self::Fault(fault) => fault.is_of_the_movement(),
            Self::Refused(Refused::Force(_) | Refused::Speed(_) | Refused::Length) => true,
            Self::Refused(_) | Self::Stopped | Self::Hangs => false,
        }
    }
}

impl fmt::Display for RigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refused(why) => why.fmt(f),
            Self::Fault(fault) => write!(f, "{fault}: {}", fault.recovery()),
            Self::Stopped => f.write_str("stopped"),
            Self::Hangs => f.write_str("the rig does not come to an end: home it"),
        }
    }
}

impl core::error::Error for RigError {}

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
