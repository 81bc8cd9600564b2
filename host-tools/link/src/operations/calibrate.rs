//! What differs from rig to rig is measured, and kept by the probe.

use std::io::Write as _;

use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::weigh::ForceScale;
use tactus_core::sensor::mems;
use tactus_core::sensor::{FingerCode, FingerName};
use tactus_core::wire::Command;

use super::Result;
use crate::request::Request;
use crate::say;
use crate::{OperationError, Probe};

/// A calibration: what is measured by the probe, and what was measured otherwise.
#[derive(Clone, Default, Debug)]
pub struct Calibrating {
    /// Discard P_DC in the air, which has drifted further than the probe allows.
    pub drifted: bool,
    /// Shear per motor current, N/A.
    pub newton_per_ampere: Option<f32>,
    /// Contact force per count of P_DC, mN.
    pub force_mn_per_count: Option<f32>,
    /// Weights, mN, that the probe asks for one after the other.
    pub weights: Vec<u16>,
    /// The day, as 20261121.
    pub day: u32,
}

/// Shows the constants in use.
pub async fn show_calibration(probe: &Probe) -> Result<RigCalibration> {
    let calibration = probe.get(Request::read_calibration()).await?;
    say::show_rows(&say::calibration_rows(&calibration), &mut probe.words())?;
    Ok(calibration)
}

/// Measures P_DC in the air and, of a rig, the motor's current without load, takes over what was measured otherwise,
/// and shows what the
/// probe keeps.
pub async fn calibrate(probe: &Probe, how: &Calibrating) -> Result<RigCalibration> {
    if how.drifted {
        let mut drifted = probe.get(Request::read_calibration()).await?;
        drifted.air_known = false;
        probe.get(Request::write_calibration(&drifted)?).await?;
        probe.perform(Request::command(Command::Home)).await?;
    }
    writeln!(
        probe.words(),
        "Measuring P_DC in the air and, of a rig, the motor's current without load ..."
    )?;
    let mut calibration = probe.perform(Request::calibrate()).await?;
    if let Some(newton_per_ampere) = how.newton_per_ampere {
        calibration.newton_per_ampere = newton_per_ampere;
    }
    let mut scale = how.force_mn_per_count;
    if !how.weights.is_empty() {
        scale = Some(weigh(probe, &how.weights).await?);
    }
    if let Some(scale) = scale {
        calibration.pressure.force_mn_per_count = scale;
        calibration.date = how.day;
    }
    keep_calibration(probe, &calibration).await?;
    show_calibration(probe).await
}

/// Has the probe keep these constants, and compares what it keeps.
pub async fn keep_calibration(probe: &Probe, calibration: &RigCalibration) -> Result<()> {
    probe.get(Request::write_calibration(calibration)?).await?;
    let kept = probe.get(Request::read_calibration()).await?;
    match kept == *calibration {
        true => Ok(()),
        false => Err(OperationError::said(
            "the probe keeps other constants than it was given: calibrate again",
        )),
    }
}

/// Measures acceleration per count of a finger that a person turns over as asked, on this day.
pub async fn turn_over(probe: &Probe, day: u32) -> Result<RigCalibration> {
    let mut calibration = probe.get(Request::read_calibration()).await?;
    let finger = probe.get(Request::status()).await?.finger;
    if finger != FingerCode::MEMS {
        return Err(OperationError::said(format!(
            "this probe's finger has no accelerometer: only {} is turned over",
            FingerName::Mems
        )));
    }
    let turned = probe.perform(Request::turn_over()).await?;
    let nominal = mems::PARTS.model.calibration.pac_pa_per_count;
    let mg = 1e3 / turned.g_counts;
    writeln!(
        probe.words(),
        "1 g is {:.1} counts: a count is {mg:.4} mg ({:+.1} % of the data sheet's); at 0 g it says {:+.0} mg",
        turned.g_counts,
        100.0 * (mg / nominal - 1.0),
        turned.offset_counts * mg
    )?;
    calibration.pressure.pac_pa_per_count = turned.mg_per_count().ok_or_else(|| {
        OperationError::said(
            "no sound accelerometer is like that. Point the finger straight down, then straight up, against something \
             upright, and keep it still. If it says the same again, check its supply",
        )
    })?;
    calibration.turned = day;
    keep_calibration(probe, &calibration).await?;
    show_calibration(probe).await
}

/// Contact force per count, mN, from known weights, which are asked for.
async fn weigh(probe: &Probe, weights: &[u16]) -> Result<f32> {
    let (mut points, mut words) = (Vec::new(), probe.words());
    for &mn in weights {
        let counts = probe.perform(Request::weigh(mn)).await?;
        writeln!(words, "{mn} mN: {counts:.1} counts")?;
        if counts <= 0.0 {
            return Err(OperationError::said(
                "P_DC falls under a weight: the load cell is wired the wrong way round. Swap its two signal wires",
            ));
        }
        points.push((counts, f32::from(mn)));
    }
    let scale = ForceScale::of(&points).ok_or_else(|| {
        OperationError::said("the weights do not lie on a line through 0: weigh again")
    })?;
    for (counts, mn) in points {
        let off = mn - scale.mn_per_count * counts;
        let share = 100.0 * off / mn;
        writeln!(
            words,
            "{mn:.0} mN: {off:+.0} mN off the line ({share:+.1} %)"
        )?;
    }
    Ok(scale.mn_per_count)
}
