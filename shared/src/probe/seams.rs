//! What a probe needs from the board, the emulated board or the PC that it runs on.

use embedded_storage_async::nor_flash::NorFlash;

use super::status::{RigState, TableInUse};
use crate::rig::arm::ArmReport;
use crate::rig::calibration::RigCalibration;
use crate::rig::skin::SkinCare;
use crate::rig::turning::Turned;
use crate::rig::{Rig, RigError};
use crate::sensor::FingerCode;
use crate::store::Store;
use crate::wire::{Counts, Event, Failure, MemoryError};

/// A run of the stage without load.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct UnloadedRun {
    /// Where the stage stood before it, mm.
    pub from_mm: f32,
    /// Where it stood after it, mm.
    pub to_mm: f32,
    /// Mean motor current at constant speed, A; `None` if there was no time at constant speed.
    pub mean_current_a: Option<f32>,
}

/// A [`Rig`] that a probe owns: besides its movements it homes, is calibrated, and shows its state.
#[allow(async_fn_in_trait)] // no executor of this project moves tasks between threads
pub trait RigHandle: Rig<Error = RigError> {
    /// The rig's state.
    fn state(&self) -> RigState;

    /// Something new begins: another sample may lie under the finger, and `seed` says where on it slides begin.
    async fn begin(&mut self, seed: u32);

    /// Ends a fault if there is one, then finds the limit switches, the lever's first.
    async fn home(&mut self) -> Result<(), RigError>;

    /// Moves the stage without load from one end to the other, at this speed in um/s.
    async fn run_unloaded(&mut self, speed_um_s: u32) -> Result<UnloadedRun, RigError>;

    /// Uses this calibration from now on.
    async fn set_calibration(&mut self, calibration: RigCalibration) -> Result<(), RigError>;

    /// Allows movements of up to 2 N, or forbids them. What the store cannot keep is not allowed.
    /// Errors: [`Failure::OtherProbe`]: a hand makes no such movement. The store failed.
    async fn set_high_force<F: NorFlash>(
        &mut self,
        _allow: bool,
        _store: Result<&mut Store<F>, MemoryError>,
    ) -> Result<(), Failure> {
        Err(Failure::OtherProbe)
    }

    /// Allows movements of up to 2 N if that is kept in the store.
    async fn restore_high_force<F: NorFlash>(&mut self, _store: &mut Store<F>) {}

    /// Goes on from this wear of the skin.
    async fn set_skin(&mut self, skin: SkinCare);

    /// Measures what a rig can measure of itself, and uses it from now on: with motors their current without load and
    /// P_DC in the air, in a hand P_DC in the air. Errors: it was not measured; the constants are those of before.
    async fn calibrate(&mut self) -> Result<RigCalibration, Failure>;

    /// Measures P_DC under a weight of so many mN that a person puts on the lifted finger, in counts above that in the
    /// air; below 0 where P_DC falls under it, as that of a load cell that is wired the wrong way round.
    async fn weigh(&mut self, mn: u16) -> Result<f32, Failure>;

    /// Measures gravity along the finger, which a person turns over.
    /// Errors: nobody turned it over. [`Failure::OtherProbe`]: it has no accelerometer.
    async fn turn_over(&mut self) -> Result<Turned, Failure> {
        Err(Failure::OtherProbe)
    }
}

/// Where the bytes of the stored table are read: mapped flash on the chip, a copy on a PC. They must stay readable
/// beside the store that they came from, for a new table is written while the old one is read.
pub trait StoredBytes<F: NorFlash> {
    /// The bytes of [`Store::table`]; `None` if no table is stored, or if it cannot be read.
    fn bytes(&mut self, store: &mut Store<F>) -> Option<&[u8]>;

    /// The finger of the probe: no table of another one comes into force.
    fn finger(&self) -> FingerCode;
}

/// Who hears what a probe does.
pub trait Events {
    /// Sends an event to the host.
    fn tell(&mut self, event: Event);

    /// This table is in force now.
    fn table(&mut self, table: TableInUse);

    /// So many sectors of the store were erased since boot.
    fn erased(&mut self, _sectors: u32) {}

    /// The go / no-go output: on from a verification that said "the same" until the next one begins.
    fn go(&mut self, _on: bool) {}
}

/// Answers at any time, whatever the probe is busy with.
pub trait Panel {
    /// The rig's state.
    fn rig(&self) -> RigState;

    /// The table in force, see [`Events::table`].
    fn table(&self) -> TableInUse;

    /// The counts of acquisition and link since boot.
    fn counts(&self) -> Counts;

    /// The finger of the probe.
    fn finger(&self) -> FingerCode;

    /// Stops what is being done now. `all`: also what would come after it, until the request is over.
    fn stop(&mut self, all: bool);

    /// Takes what the arm that moves the finger says; `false`: no arm moves it.
    fn arm(&mut self, _report: ArmReport) -> bool {
        false
    }

    /// True if raw samples are wanted from the next movement on.
    fn stream(&mut self, on: bool);

    /// Sends an event to the host.
    fn tell(&mut self, event: Event);
}
