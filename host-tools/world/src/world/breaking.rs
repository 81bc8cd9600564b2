//! Faults in the world, their times, and their repair.

use super::World;
use crate::faults::{Fault, Faults};
use crate::parts::PartFault;

impl World {
    /// Breaks something now, or presses the stop. Faults add up.
    pub fn inject(&mut self, fault: Fault) {
        let position_mm = self.stage.position_at_mm(self.fraction());
        self.inject_at(fault, self.now_ns, position_mm);
    }

    /// Breaks something of the finger's parts; a BioTac has none.
    pub fn break_part(&mut self, fault: PartFault) {
        self.peers.break_part(self.now_ns, fault, &mut self.finger);
    }

    /// Lets something break at a time, to the tick: up to 76 us late.
    pub fn schedule(&mut self, at_ns: u64, fault: Fault) {
        self.scheduled.push((at_ns, fault));
        self.scheduled
            .sort_by_key(|(at_ns, _)| std::cmp::Reverse(*at_ns));
    }

    /// Repairs everything, and drops the scheduled faults; a sensor that is plugged in again starts up. The effects of
    /// a fault stay: lost steps, lost counts, a lever that ran down.
    pub fn clear(&mut self) {
        self.faults = Faults::default();
        self.scheduled.clear();
        self.peers.mend(self.now_ns);
        self.finger.mend();
        self.stage.jammed = false;
        self.stage.decays_fast = false;
        self.stage.vibration_um = 0.0;
        let position_mm = self.stage.position_at_mm(self.fraction());
        self.encoder.set_cut(None, position_mm, self.now_ns);
        self.encoder.swap(false, position_mm, self.now_ns);
        self.lever.lost_share = 0.0;
        self.lever.run_away_down(false);
        self.lever.inverted = false;
        self.supply_motors();
    }
}
