//! The holder of the finger in place of lever and stage: a hand, or an arm.

use crate::arm::Arm;
use crate::finger::Held;
use crate::person::Hand;

pub(super) enum Holder {
    Hand(Box<Hand>),
    Arm(Box<Arm>),
}

impl Holder {
    /// A tick against this force on the finger, N.
    pub(super) fn tick(&mut self, force_n: f64) {
        match self {
            Self::Hand(hand) => hand.tick(force_n),
            Self::Arm(arm) => arm.tick(),
        }
    }

    pub(super) fn held(&self) -> Held {
        match self {
            Self::Hand(hand) => hand.held(),
            Self::Arm(_) => Held::STILL,
        }
    }

    /// Depth of the sample in the fingertip, mm, negative for a gap; place of the finger on the sample, mm from its
    /// edge; its speed along the sample, mm/s.
    pub(super) fn place(&self) -> [f64; 3] {
        match self {
            Self::Hand(hand) => [hand.indentation_mm, hand.x_mm(), hand.speed_mm_s],
            Self::Arm(arm) => [arm.indentation_mm(), arm.x_mm(), arm.speed_mm_s()],
        }
    }
}
