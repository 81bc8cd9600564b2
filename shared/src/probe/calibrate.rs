//! The constants of this rig: measured, kept, and restored at boot.

use embedded_storage_async::nor_flash::NorFlash;

use super::seams::{RigHandle, UnloadedRun};
use crate::rig::calibration::RigCalibration;
use crate::rig::unloaded::UnloadedRuns;
use crate::rig::{Fault, Phase, RigError};
use crate::store::{Store, StoreError};
use crate::wire::Failure;

/// P_DC in the air may move so far while it is measured, counts: what a rig that waits allows in that time, 30 a
/// minute. One that has moved farther, and moves back, would be that of a finger that is pressed.
const DRIFT_COUNTS: f32 = 20.0;

/// Measures the motor's current without load and P_DC in the air, and uses them from now on.
pub(super) async fn by_motor<R: RigHandle>(rig: &mut R) -> Result<RigCalibration, Failure> {
    if rig.state().phase == Phase::Parked {
        rig.home().await.map_err(Failure::Rig)?;
    }
    let mut runs = UnloadedRuns::default();
    let mut first_air = None;
    while let Some(speed_um_s) = runs.next_speed() {
        let UnloadedRun {
            from_mm,
            to_mm,
            mean_current_a,
        } = rig.run_unloaded(speed_um_s).await.map_err(Failure::Rig)?;
        runs.took(from_mm, to_mm, mean_current_a);
        if let Some(air_counts) = rig.state().air_counts {
            let first = *first_air.get_or_insert(air_counts);
            if (air_counts - first).abs() > DRIFT_COUNTS {
                return Err(Failure::Rig(RigError::Fault(Fault::Unsteady)));
            }
        }
    }
    let state = rig.state();
    let mut calibration = runs.finish(&state.calibration)?;
    if let Some(air_counts) = state.air_counts {
        calibration = calibration.with_air(air_counts);
    }
    calibration.check()?;
    rig.set_calibration(calibration)
        .await
        .map_err(Failure::Rig)?;
    Ok(calibration)
}

/// Measures P_DC in the air, which is all that a rig can measure of itself that an arm moves.
pub(super) async fn in_air<R: RigHandle>(rig: &mut R) -> Result<RigCalibration, Failure> {
    rig.home().await.map_err(Failure::Rig)?;
    let mut measured = [0.0; 2];
    for counts in &mut measured {
        rig.run_unloaded(0).await.map_err(Failure::Rig)?;
        *counts = rig.state().air_counts.unwrap_or(f32::NAN);
    }
    let [first, counts] = measured;
    // not-a-number is not steady
    let is_steady = libm::fabsf(counts - first) <= DRIFT_COUNTS;
    if !is_steady {
        return Err(Failure::Rig(RigError::Fault(Fault::Unsteady)));
    }
    let calibration = rig.state().calibration.with_air(counts);
    calibration.check()?;
    rig.set_calibration(calibration)
        .await
        .map_err(Failure::Rig)?;
    Ok(calibration)
}

/// Keeps a calibration. Settings that cannot be read have lost theirs: they are begun anew.
pub(crate) async fn keep<F: NorFlash>(
    store: &mut Store<F>,
    calibration: &RigCalibration,
) -> Result<(), StoreError> {
    if store.settings().is_err() {
        store.erase_settings().await?;
    }
    store.set_calibration(calibration).await
}

/// Gives the rig its skin, its largest force and its calibration as they are stored; each whatever becomes of the
/// others. Errors: one of them cannot be read, or another record of the settings is damaged.
pub async fn restore<F: NorFlash, R: RigHandle>(
    store: &mut Store<F>,
    rig: &mut R,
) -> Result<(), StoreError> {
    let skin = store.skin().await;
    if let Ok(skin) = &skin {
        rig.set_skin(*skin).await;
    }
    rig.restore_high_force(store).await;
    if let Some(calibration) = store.calibration().await? {
        // one that was stored is not refused
        let _ = rig.set_calibration(calibration).await;
    }
    if let Some(why) = store.damaged_record() {
        return Err(why.into());
    }
    skin.map(|_| ())
}
