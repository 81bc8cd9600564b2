//! What a probe and an arm that moves its finger say to each other. The probe gives one [`ArmOrder`] after the other; while one is
//! open, the arm says at least every [`ARM_SAYS_MS`] how far it has come: [`ArmReport`]. Both may be said twice and mean the same.

use serde::{Deserialize, Serialize};

/// An arm that works on an order says so at least this often, ms.
pub const ARM_SAYS_MS: u32 = 100;
/// Fastest that an arm comes down on a sample, um/s.
///
/// The guard sees the force within 10 ms, its word takes up to 50 ms to an arm that stands 50 ms later: it has come down 0.11 mm
/// farther then.
pub const APPROACH_UM_S: u32 = 1000;

/// What the arm is to do. A new order takes the place of the one before it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct ArmOrder {
    /// Comes back in every report about it. The same number again is the same order.
    pub number: u16,
    /// What.
    pub task: ArmTask,
}

/// What an arm can be asked for.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum ArmTask {
    /// To press the finger on the sample where the slide begins, and to hold it still. The movement's slide follows.
    Press(ArmMovement),
    /// To make the slide of that movement, and to stand again.
    Slide,
    /// To lift the finger off the sample, and to hold it still in the air.
    Lift,
    /// To stand at once, whatever it does, then to lift the finger straight off the sample.
    Stop,
}

/// A movement that an arm makes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct ArmMovement {
    /// Contact force, mN.
    pub force_mn: u16,
    /// Speed of the slide, um/s.
    pub speed_um_s: u32,
    /// Length of the slide at constant speed, um; the ramps come before and behind it.
    pub length_um: u32,
    /// Where the slide begins: thousandths of the room that the sample leaves it.
    pub start: u16,
    /// Fastest that the finger may come down on the sample, um/s.
    pub approach_um_s: u32,
}

/// How far an arm has come with an order.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct ArmReport {
    /// Of the order.
    pub number: u16,
    /// How far.
    pub state: ArmState,
}

/// How far an arm has come.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum ArmState {
    /// It is at it.
    Busy,
    /// The finger presses, and stands.
    Pressed,
    /// The slide has come to its constant speed.
    Steady,
    /// The slide is over, and the arm stands.
    Slid {
        /// How long it was at constant speed, um.
        length_um: u32,
        /// How fast it was there, um/s.
        speed_um_s: u32,
    },
    /// The finger is in the air, and the arm stands.
    Lifted,
    /// It cannot, or did not.
    Failed,
}

/// The order that is open, and when something was said about it.
#[derive(Clone, Debug)]
pub(super) struct Orders {
    order: ArmOrder,
    /// Since it was given last, ms; none that the arm need not be told again.
    said_ms: Option<u32>,
    heard_ms: u32,
}

impl Orders {
    /// Ms until an order that nobody has heard is said again.
    const AGAIN_MS: u32 = 100;

    /// An arm is told to stop: nobody knows what it does.
    pub(super) fn new(number: u16) -> Self {
        Self {
            order: ArmOrder {
                number,
                task: ArmTask::Stop,
            },
            said_ms: Some(Self::AGAIN_MS),
            heard_ms: 0,
        }
    }

    /// Gives the next order.
    pub(super) fn give(&mut self, task: ArmTask) {
        *self = Self {
            order: ArmOrder {
                number: self.order.number.wrapping_add(1),
                task,
            },
            said_ms: Some(Self::AGAIN_MS),
            heard_ms: 0,
        };
    }

    /// How far the arm is, if this is about the order that is open.
    pub(super) fn hear(&mut self, report: ArmReport) -> Option<ArmState> {
        if report.number != self.order.number {
            return None;
        }
        self.heard_ms = 0;
        // a stop is said until it is done
        if self.order.task != ArmTask::Stop || report.state == ArmState::Lifted {
            self.said_ms = None;
        }
        Some(report.state)
    }

    /// Nothing is to be said any more.
    pub(super) fn close(&mut self) {
        self.said_ms = None;
    }

    /// A millisecond: the order, if it is to be said now.
    pub(super) fn tick(&mut self) -> Option<ArmOrder> {
        self.heard_ms = self.heard_ms.saturating_add(1);
        let said_ms = self.said_ms.as_mut()?;
        *said_ms += 1;
        if *said_ms <= Self::AGAIN_MS {
            return None;
        }
        *said_ms = 0;
        Some(self.order)
    }

    /// For how many ms the arm has said nothing about it.
    pub(super) fn silent_ms(&self) -> u32 {
        self.heard_ms
    }
}
