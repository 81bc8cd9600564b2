//! Operations on a lifted finger: runs without load, and weights that a person lays on it.

use super::Control;
use crate::features::Movement;
use crate::rig::phase::{Phase, Refused};
use crate::rig::slide::Run;

impl Control {
    /// Moves the stage over the whole sample at `speed_um_s` um/s with the finger lifted, and measures the motor
    /// current at constant speed: see [`Control::mean_current_a`].
    #[inline]
    pub fn start_unloaded(&mut self, speed_um_s: u32) -> Result<(), Refused> {
        self.may_start()?;
        if !Movement::SPEED_UM_S.contains(&speed_um_s) {
            return Err(Refused::Speed(speed_um_s));
        }
        let speed_mm_s = speed_um_s as f32 * 1e-3;
        let far = self.stage.constants().travel_mm;
        let to = if self.stage.position_mm() < far / 2.0 {
            far
        } else {
            0.0
        };
        let profile = self.stage.go(to, speed_mm_s).ok_or(Refused::Busy)?;
        self.run = Run::unloaded(speed_mm_s, profile.duration_s(), self.stage.constants());
        self.ended = None;
        self.air = None;
        self.meter.begin_long();
        self.lever.park();
        self.ascent.set_out(self.meter.mean());
        self.enter(Phase::Unloaded);
        Ok(())
    }

    /// Mean motor current at constant speed of the last slide or unloaded run, A; positive drives to the right.
    pub fn mean_current_a(&self) -> Option<f32> {
        self.run.mean_current_a()
    }

    /// P_DC in the air, mean over the last whole run without load, counts.
    pub fn air_counts(&self) -> Option<f32> {
        self.air
    }

    /// Expects a person to lay a weight of so many mN on the lifted finger; 0 ends that. Until then, or until something
    /// else begins, P_DC may rise by that much more than otherwise while the finger waits. The guard's limit of force
    /// and the lever's switch, to which the lever goes first, protect the finger as ever.
    #[inline]
    pub fn weigh(&mut self, mn: u16) -> Result<(), Refused> {
        self.may_start()?;
        if self.lever.park() {
            self.ascent.set_out(self.meter.mean());
        }
        self.ascent.expect(mn);
        Ok(())
    }
}
