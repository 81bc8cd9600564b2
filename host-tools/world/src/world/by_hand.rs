//! People's operations on a rig, and with its finger.

use super::holder::Holder;
use super::{NotLifted, World, sample};
use crate::arm::Arm;
use crate::finger::Held;
use crate::mount::Mount;
use crate::person::Hand;
use crate::played::{PlayCounts, Played};
use crate::printer::Printer;

impl World {
    /// Inclines the stage with a weight on it, so that it is pulled towards lower positions with `pull_n` (paper,
    /// Traction: weights on the stage at 45 degrees).
    pub fn incline(&mut self, pull_n: f64) {
        self.pull_n = -pull_n;
    }

    /// Turns the lever's screw by its knob, so far up, mm; returns true if it could be turned, which takes a motor
    /// without current.
    pub fn turn_knob(&mut self, up_mm: f64) -> bool {
        self.lever.turn_by_hand(up_mm, self.finger.force_n())
    }

    /// Fixes the finger to the lever by another mount; it is stiff unless this is called.
    pub fn mount(&mut self, mount: Mount) {
        self.mount = mount;
    }

    /// Something on the same table shakes the rig from now on, such as a printer: amplitude, g, and frequency, Hz. A
    /// BioTac's fluid hardly feels it.
    pub fn shake(&mut self, g: f64, hz: f64) {
        self.table = (g, hz);
        self.finger.held = Held::STILL;
    }

    /// Has a hand hold the finger from now on, in place of lever and stage, which move without it.
    pub fn hold(&mut self, hand: Hand) {
        self.holder = Some(Holder::Hand(Box::new(hand)));
    }

    /// The hand that holds the finger.
    pub fn hand(&mut self) -> Option<&mut Hand> {
        match &mut self.holder {
            Some(Holder::Hand(hand)) => Some(hand),
            _ => None,
        }
    }

    /// Has an arm hold the finger from now on, in place of lever and stage, which move without it.
    pub fn mount_on(&mut self, arm: Arm) {
        self.holder = Some(Holder::Arm(Box::new(arm)));
    }

    /// The arm that holds the finger.
    pub fn arm(&mut self) -> Option<&mut Arm> {
        match &mut self.holder {
            Some(Holder::Arm(arm)) => Some(arm),
            _ => None,
        }
    }

    /// Has a printer hold the finger from now on, in place of lever and stage, which move without it.
    pub fn mount_on_printer(&mut self, printer: Printer) {
        self.holder = Some(Holder::Printer(Box::new(printer)));
    }

    /// The printer that holds the finger.
    pub fn printer(&mut self) -> Option<&mut Printer> {
        match &mut self.holder {
            Some(Holder::Printer(printer)) => Some(printer),
            _ => None,
        }
    }

    /// Mounts another sample. Errors: the finger touches the one that is there or would touch the other, which may be
    /// thicker by millimetres.
    pub fn place(&mut self, texture: u8) -> Result<(), NotLifted> {
        let surface = sample(texture, self.setup.world_seed, self.variation);
        self.must_be_over(&self.surface)?;
        self.must_be_over(&surface)?;
        self.setup.texture = texture;
        self.surface = surface;
        Ok(())
    }

    /// Has the finger feel recorded slides instead of the mounted sample: each press-and-slide is the next one of an
    /// order that `seed` gives, over and over. Without any, it feels the sample again.
    ///
    /// From where the pressed finger begins to move, P_AC is the recorded one about the simulated finger's rest, and
    /// shear the recorded force once the skin has stretched that far. The sample still carries the press, and makes
    /// P_DC; a still finger has the simulated sensor's noise. Samples beyond 12 bits are cut, and a recording that is
    /// over is that noise: see [`World::played`].
    pub fn play(&mut self, slides: Vec<Played>, seed: u64) {
        self.finger.play(slides, seed);
    }

    /// Counts of the slides and samples played, and of the samples that were cut.
    pub fn played(&self) -> PlayCounts {
        self.finger.played()
    }

    /// Gives the finger a skin that is worn: 0 is new, at 1 its ridges are gone. Errors: the finger touches the sample.
    pub fn put_on_skin(&mut self, wear: f64) -> Result<(), NotLifted> {
        self.must_be_over(&self.surface)?;
        self.finger.put_on_skin(wear);
        Ok(())
    }
}
