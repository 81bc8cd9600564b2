//! What people do to a rig, and with its finger.

use super::World;
use crate::sim::finger::Held;
use crate::sim::mount::Mount;
use crate::sim::person::Hand;

impl World {
    /// Inclines the stage with a weight on it, so that it is pulled towards lower positions with `pull_n` (paper, Traction:
    /// weights on the stage at 45 degrees).
    pub fn incline(&mut self, pull_n: f64) {
        self.pull_n = -pull_n;
    }

    /// Somebody turns the lever's screw by its knob, so far up, mm; whether it could be turned, which takes a motor without
    /// current.
    pub fn turn_knob(&mut self, up_mm: f64) -> bool {
        self.lever.turn_by_hand(up_mm, self.finger.force_n())
    }

    /// Fixes the finger to the lever by another mount; it is stiff unless this is called.
    pub fn mount(&mut self, mount: Mount) {
        self.mount = mount;
    }

    /// Something on the same table shakes the rig from now on, such as a printer: amplitude, g, and frequency, Hz. A BioTac's fluid
    /// hardly feels it.
    pub fn shake(&mut self, g: f64, hz: f64) {
        self.table = (g, hz);
        self.finger.hold(Held::STILL);
    }

    /// Has a hand hold the finger from now on, in place of lever and stage, which move without it.
    pub fn hold(&mut self, hand: Hand) {
        self.hand = Some(hand);
    }

    /// The finger is on the lever again, wherever that is.
    pub fn put_back(&mut self) {
        self.finger.hold(Held::STILL);
        self.hand = None;
    }

    /// The hand that holds the finger.
    pub fn hand(&mut self) -> Option<&mut Hand> {
        self.hand.as_mut()
    }
}
