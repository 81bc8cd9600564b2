//! The phases of the rig, the ends of a movement, and the reasons for not making one.

use serde::{Deserialize, Serialize};

use super::calibration::RigCalibrationError;
use super::fault::Fault;
use crate::features::{Movement, MovementError};

/// Largest force without permission for high forces, mN.
pub const HIGH_FORCE_MN: u16 = Movement::FOR_TRACTION.force_mn();

/// Largest force of a movement, mN, with or without permission for high forces.
pub const fn most_mn(high_force: bool) -> u16 {
    if high_force {
        *Movement::FORCE_MN.end()
    } else {
        HIGH_FORCE_MN
    }
}

/// The phases of the rig.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Phase {
    /// The rig does nothing; the positions of lever and stage are unknown until it homes.
    #[default]
    Parked,
    /// The lever, then the stage look for their limit switches.
    Homing,
    /// The finger is lifted and waits.
    Ready,
    /// The stage goes to where the slide begins.
    Positioning,
    /// The lever comes down until the force is right.
    Pressing,
    /// The still finger is measured.
    Background,
    /// The finger slides.
    Sliding,
    /// The finger is lifted; then the slide is over.
    Lifting,
    /// The stage goes without load, its current is measured.
    Unloaded,
    /// A fault was seen; the finger is being lifted, or is. Nothing moves until
    /// [`Control::reset`](super::control::Control::reset).
    Faulted(Fault),
}

/// The end of a movement.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Ended {
    /// All samples are there.
    Whole,
    /// So many words were damaged or missing between the beginning of the background and the end of the slide.
    Gap(u32),
    /// It was stopped.
    Stopped,
}

/// Reasons for refusing a command.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum Refused {
    /// The rig is busy.
    #[error("the rig is busy; stop it first")]
    Busy,
    /// The positions of lever and stage are unknown: home first.
    #[error("the positions of lever and stage are unknown; home them first")]
    NotHomed,
    /// A fault has to be reset first.
    #[error("{}: {}", .0, .0.recovery())]
    Fault(Fault),
    /// The force is over this rig's limit.
    #[error(
        "{0} mN is more than this rig may press: {HIGH_FORCE_MN} mN, or {most} mN with tactus device settings \
         --high-force on, and no more than its calibration covers",
        most = most_mn(true)
    )]
    Force(u16),
    /// The stage does not have this speed, um/s.
    #[error("{}", MovementError::Speed(*.0))]
    Speed(u32),
    /// The slide does not fit on the sample.
    #[error("the slide does not fit on the sample")]
    Length,
    /// The constants cannot be used.
    #[error(transparent)]
    Calibration(RigCalibrationError),
}

/// Reasons why a rig with a stage and a lever did not make a movement.
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
    /// The movement did not end by itself, and was stopped: see [`super::timeout`].
    #[error("the movement does not end: home the rig")]
    Hangs,
    /// The movement was not made by hand in time.
    #[error("no touch for a minute: ask again")]
    NobodyThere,
    /// A hand does not make this movement.
    #[error(
        "a hand makes one movement, 0.5 N and 25 mm/s, and the table has another: push one that was recorded by hand"
    )]
    NotByHand,
}

impl RigError {
    /// Returns true if the error is about the one movement, so that the rig may try it again or try another after it
    /// has homed: see [`Fault::is_of_the_movement`]. That includes a refusal because of force, speed or length.
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
