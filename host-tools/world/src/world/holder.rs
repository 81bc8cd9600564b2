//! The holder of the finger in place of lever and stage: a hand, an arm, or a printer.

use crate::arm::Arm;
use crate::finger::Held;
use crate::person::Hand;
use crate::printer::Printer;

pub(super) enum Holder {
    Hand(Box<Hand>),
    Arm(Box<Arm>),
    Printer(Box<Printer>),
}

impl Holder {
    /// A tick against this force on the finger, N.
    pub(super) fn tick(&mut self, force_n: f64) {
        match self {
            Self::Hand(hand) => hand.tick(force_n),
            Self::Arm(arm) => arm.tick(),
            Self::Printer(printer) => printer.tick(force_n),
        }
    }

    pub(super) fn held(&self) -> Held {
        match self {
            Self::Hand(hand) => hand.held(),
            Self::Arm(_) => Held::STILL,
            Self::Printer(printer) => printer.held(),
        }
    }

    /// Depth of the sample in the fingertip, mm, negative for a gap; place of the finger on the sample, mm from its
    /// edge; its speed along the sample, mm/s.
    pub(super) fn place(&self) -> [f64; 3] {
        match self {
            Self::Hand(hand) => [hand.indentation_mm, hand.x_mm(), hand.speed_mm_s],
            Self::Arm(arm) => [arm.indentation_mm(), arm.x_mm(), arm.speed_mm_s()],
            Self::Printer(printer) => [
                printer.indentation_mm(),
                printer.x_mm(),
                printer.speed_mm_s(),
            ],
        }
    }
}
