//! The messages between the probe and an arm that moves its finger. The probe gives one [`ArmOrder`] after the other;
//! while one is open, the arm sends its progress, an [`ArmReport`], at least every [`ARM_SAYS_MS`]. Either message may
//! be repeated without effect.

use serde::{Deserialize, Serialize};

/// Longest interval between two reports of an arm that works on an order, ms.
pub const ARM_SAYS_MS: u32 = 100;
/// Fastest that an arm comes down on a sample, um/s.
///
/// The guard sees the force within 10 ms, its order takes up to 50 ms to the arm, which stands 50 ms later: by then it
/// has come down 0.11 mm farther.
pub(crate) const APPROACH_UM_S: u32 = 1000;

/// One task for the arm. A new order replaces the one before it.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct ArmOrder {
    /// Number of the order; every report about it carries the same. A repeated number is the same order.
    pub number: u16,
    /// The task.
    pub task: ArmTask,
}

/// The tasks of an arm.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum ArmTask {
    /// Presses the finger on the sample where the slide begins, and holds it still. The movement's slide follows.
    Press(ArmMovement),
    /// Makes the slide of that movement, and stands again.
    Slide,
    /// Lifts the finger off the sample, and holds it still in the air.
    Lift,
    /// Stands at once, then lifts the finger straight off the sample.
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
    /// Place where the slide begins: thousandths of the length that the sample leaves it.
    pub start: u16,
    /// Fastest that the finger may come down on the sample, um/s.
    pub approach_um_s: u32,
}

/// Progress of an arm with an order.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct ArmReport {
    /// Number of the order.
    pub number: u16,
    /// The progress.
    pub state: ArmState,
}

/// Progress of an arm with an order.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum ArmState {
    /// The arm works on it.
    Busy,
    /// The finger presses, and stands.
    Pressed,
    /// The slide has come to its constant speed.
    Steady,
    /// The slide is over, and the arm stands.
    Slid {
        /// Length at constant speed, um.
        length_um: u32,
        /// Speed there, um/s.
        speed_um_s: u32,
    },
    /// The finger is in the air, and the arm stands.
    Lifted,
    /// The arm cannot carry it out, or did not.
    Failed,
}

#[derive(Clone, Debug)]
pub(super) struct Orders {
    order: ArmOrder,
    /// Time since it was last sent, ms; `None` if it need not be repeated.
    said_ms: Option<u32>,
    heard_ms: u32,
}

impl Orders {
    /// Time after which an order without a report is repeated, ms.
    const AGAIN_MS: u32 = 100;

    /// Orders an arm to stop: its state is unknown.
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

    /// Returns the arm's progress if the report is about the open order.
    pub(super) fn hear(&mut self, report: ArmReport) -> Option<ArmState> {
        if report.number != self.order.number {
            return None;
        }
        self.heard_ms = 0;
        // a stop is repeated until it is done
        if self.order.task != ArmTask::Stop || report.state == ArmState::Lifted {
            self.said_ms = None;
        }
        Some(report.state)
    }

    pub(super) fn close(&mut self) {
        self.said_ms = None;
    }

    /// A millisecond passes: returns the order if it is due to be sent.
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

    /// Time since the arm's last report about it, ms.
    pub(super) fn silent_ms(&self) -> u32 {
        self.heard_ms
    }
}
