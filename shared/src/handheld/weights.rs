//! Calibration of a finger without a computer, prompted on the display: known weights on it set the force, and an
//! accelerometer is turned over.

use embedded_storage_async::nor_flash::NorFlash;

use super::by_hand::{ByHand, Hand};
use crate::probe::Memory;
use crate::probe::calibrate::keep;
use crate::probe::seams::{RigHandle, StoredBytes};
use crate::rig::RigError;
use crate::rig::calibration::RigCalibration;
use crate::rig::turning::Turned;
use crate::rig::weigh::ForceScale;
use crate::wire::Failure;

/// Weights as a kitchen scale shows them, 30, 60, 90, 120 and 150 g, as forces in mN.
pub const WEIGHTS_MN: [u16; 5] = [294, 588, 883, 1177, 1471];
const NOT_KEPT: &str = "Not kept. Restart it.";
const FALLS: &str = "P_DC falls. Swap the cell's wires.";

impl<H: Hand> ByHand<'_, H> {
    /// Asks for the finger in the air and for each of [`WEIGHTS_MN`] on it, keeps the result, and shows it.
    pub(super) async fn set_force<F: NorFlash, B: StoredBytes<F>>(
        &mut self,
        memory: &mut Memory<'_, F, B>,
    ) {
        let before = self.calibration();
        let done = self.weigh_all(memory).await;
        if done.is_err() {
            // it was good enough until now
            let _ = self.set_calibration(before).await;
        }
        self.handheld.calibrated(done);
    }

    async fn weigh_all<F: NorFlash, B: StoredBytes<F>>(
        &mut self,
        memory: &mut Memory<'_, F, B>,
    ) -> Result<ForceScale, Option<&'static str>> {
        let mut calibration = self.calibrate().await.map_err(|why| words(&why))?;
        let mut points = [(0.0, 0.0); WEIGHTS_MN.len()];
        for (point, mn) in points.iter_mut().zip(WEIGHTS_MN) {
            let counts = self.weigh(mn).await.map_err(|why| words(&why))?;
            *point = (counts, f32::from(mn));
            if counts < 0.0 {
                return Err(Some(FALLS));
            }
        }
        let agreed = ForceScale::of(&points);
        let scale = agreed.ok_or(Some("The weights do not agree. Weigh again."))?;
        calibration.pressure.force_mn_per_count = scale.mn_per_count;
        calibration.date = RigCalibration::UNDATED;
        let set = self.set_calibration(calibration).await;
        set.map_err(|_| Some("Wrong scale. Weigh again."))?;
        let kept = match memory.store() {
            Ok(store) => keep(store, &calibration).await.is_ok(),
            Err(_) => false,
        };
        kept.then_some(scale).ok_or(Some(NOT_KEPT))
    }

    /// Asks the person to turn the finger over, keeps the value of a count of acceleration, and shows it.
    pub(super) async fn set_gravity<F: NorFlash, B: StoredBytes<F>>(
        &mut self,
        memory: &mut Memory<'_, F, B>,
    ) {
        let before = self.calibration();
        let done = self.turn_and_keep(memory).await;
        if done.is_err() {
            let _ = self.set_calibration(before).await;
        }
        self.handheld.turned(done);
    }

    async fn turn_and_keep<F: NorFlash, B: StoredBytes<F>>(
        &mut self,
        memory: &mut Memory<'_, F, B>,
    ) -> Result<Turned, Option<&'static str>> {
        let turned = self.turn_over().await.map_err(|why| words(&why))?;
        let mg = turned.mg_per_count();
        let mg = mg.ok_or(Some("That is not 1 g. Hold it straight."))?;
        let mut calibration = self.calibration();
        calibration.pressure.pac_pa_per_count = mg;
        calibration.turned = RigCalibration::UNDATED;
        let set = self.set_calibration(calibration).await;
        set.map_err(|_| Some("Wrong. Turn it again."))?;
        let kept = match memory.store() {
            Ok(store) => keep(store, &calibration).await.is_ok(),
            Err(_) => false,
        };
        kept.then_some(turned).ok_or(Some(NOT_KEPT))
    }
}

/// Text of the display for a failure; `None` if the person gave up, or a fault is shown already.
fn words(why: &Failure) -> Option<&'static str> {
    match why {
        Failure::Rig(RigError::NobodyThere) => Some("Nothing was still."),
        _ => None,
    }
}
