//! Punctuality of the firmware: the ends of the sensor's commands in their slots, and the servo's updates of the stage.

use rigless::emulator::{Access, AccessKind};

/// TIM2's count, which begins anew with each slot, 84 to the us.
pub(super) const SLOT_COUNT: u64 = 0x4000_0024;
const SLOT_COUNTS_PER_US: f64 = 84.0;
/// TIM3's first compare register: the servo writes the stage's duty there in each of its periods.
const DUTY: u64 = 0x4000_0434;

#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(crate) struct Timing {
    /// Commands that ended.
    pub commands: u64,
    /// The latest end of one after its slot began, us.
    pub(crate) command_us: f64,
    pub(crate) servo_periods: u64,
    /// The longest time between two of them, us.
    pub(crate) servo_gap_us: f64,
    servo_ns: Option<u64>,
}

impl Timing {
    /// A command has ended, so many counts after its slot began.
    pub(super) fn command(&mut self, count: u64) {
        self.commands += 1;
        self.command_us = self.command_us.max(count as f64 / SLOT_COUNTS_PER_US);
    }

    pub(super) fn access(&mut self, access: &Access) {
        if access.kind != AccessKind::Write || access.address != DUTY {
            return;
        }
        let now_ns = access.virtual_time.0;
        if let Some(last_ns) = self.servo_ns.replace(now_ns) {
            let gap_us = (now_ns - last_ns) as f64 * 1e-3;
            self.servo_gap_us = self.servo_gap_us.max(gap_us);
        }
        self.servo_periods += 1;
    }
}
