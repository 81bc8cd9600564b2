//! What the force scale says, and what the rig's firmware said with the finger on its mount.

use tactus_core::features::Movement;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::unloaded::SPEEDS_UM_S;
use tactus_core::sensor::biotac;
use tactus_core::sensor::pressure::Calibration;
use tactus_core::wire::bringup::limits::SQUEEZED_MN;
use tactus_core::wire::{Counts, Live, SlideReport};

use super::{Finding, m};
use crate::bringup::weights;

/// Largest distance of P_DC from its value in the air, counts: 92 mN.
pub(crate) const AIR_COUNTS: f32 = 8.0;
/// Most that a weight may be off the line, as a share of it.
pub(crate) const OFF_LINE: f32 = 0.1;
/// Largest error of a mean speed, as a share.
pub const SPEED_SHARE: f64 = 0.02;
/// Largest distance of the stage from the place by its mean speed, mm: at the fastest a report may be 3 ms late.
pub(crate) const UNEVEN_MM: f64 = 0.3;
/// Reports of a run that are no steady speed, at each end: it takes 63 ms to its highest speed, and a report comes each
/// 50 ms.
const RAMP: usize = 3;
/// Slower than this it stands or turns round, um/s.
const STANDS_UM_S: i32 = 2_000;

/// The reports of a slide.
#[derive(Clone, Debug, Default)]
pub struct SlideSeen {
    /// The ordered movement.
    pub movement: Option<Movement>,
    /// Force by P_DC: ms since the first one, mN.
    pub force: Vec<[f64; 2]>,
    /// The measured features.
    pub observed: Option<SlideReport>,
    /// The reason why it failed, or was refused.
    pub failed: Option<String>,
    /// Counts since the firmware started.
    pub counts: Counts,
}

/// P_DC above that in the air, counts, under known weights, mN, how it changes under the last one, and after that was
/// taken away.
pub fn scale(points: &[[f64; 2]], held: f32, after: f32) -> Finding {
    let points: Vec<(f32, f32)> = points
        .iter()
        .map(|[counts, mn]| (*counts as f32, *mn as f32))
        .collect();
    let most = points.iter().map(|(counts, _)| *counts).fold(0.0, f32::max);
    let dead = most < biotac::PARTS.model.counts(SQUEEZED_MN);
    let leaks = !dead && (held < -AIR_COUNTS || after.abs() > AIR_COUNTS);
    let line = weights::line(&points);
    let (said, uneven, far) = match &line {
        Ok((mn_per_count, residuals)) => {
            let shares = points.iter().zip(residuals);
            let share = shares
                .map(|((_, mn), off)| (off / mn).abs())
                .fold(0.0, f32::max);
            let constants = RigCalibration {
                pressure: Calibration {
                    force_mn_per_count: *mn_per_count,
                    ..Calibration::PAPER
                },
                unloaded_a: (0.0, 0.0),
                newton_per_ampere: 1.0,
                date: 0,
                air_known: false,
                turned: 0,
                serial: [0; 16],
            };
            let percent = 100.0 * share;
            let said = format!("{mn_per_count:.2} mN a count, weights {percent:.1} % off the line");
            (said, share > OFF_LINE, constants.check().is_err())
        }
        Err(why) => (why.to_string(), true, false),
    };
    Finding::new(format!(
        "{said}; {held:+.1} counts while the last one stood, {after:+.1} without weight afterwards"
    ))
    .wrong(dead, &m::FINGER_DEAD, "")
    .wrong(leaks, &m::FINGER_LEAKS, "")
    .wrong(!dead && !leaks && uneven, &m::SCALE_LINE, "")
    .wrong(!dead && !leaks && !uneven && far, &m::SCALE_FAR, "")
}

/// The constants after each of two calibrations, and whether the firmware keeps the force scale, mN a count, that it
/// was given.
pub fn zero(
    first: &Result<RigCalibration, String>,
    second: &Result<RigCalibration, String>,
    kept: Option<&Result<(f32, bool), String>>,
) -> Finding {
    let (first, second) = match (first, second) {
        (Ok(first), Ok(second)) => (first, second),
        (Err(why), _) | (_, Err(why)) => return failed(why),
    };
    let [a, b] = [first, second].map(|constants| constants.pressure.pdc_no_contact);
    let (scale, lost) = match kept {
        None => ("no force scale was weighed".to_owned(), false),
        Some(Ok((mn, kept))) => (format!("force scale {mn:.2} mN a count"), !kept),
        Some(Err(why)) => (why.clone(), true),
    };
    let (standstill, per_mm_s) = second.unloaded_a;
    Finding::new(format!(
        "P_DC in the air {a:.1} and {b:.1} counts, {:.0} mA + {:.2} mA per mm/s without load; {scale}",
        standstill * 1e3,
        per_mm_s * 1e3
    ))
    .wrong((a - b).abs() >= AIR_COUNTS, &m::ZERO_DRIFTS, "")
    .wrong(lost, &m::STORE, "")
}

fn failed(why: &str) -> Finding {
    Finding::new(why.to_owned()).wrong(true, &m::FAULT, "")
}

/// A run of the stage: its mean speed, mm/s, and how far it was from where that has it, mm.
fn run(places: &[(u32, Live)]) -> Option<(f64, f64)> {
    let steady = places.get(RAMP..places.len().checked_sub(RAMP)?)?;
    let ((from_ms, from), (to_ms, to)) = (steady.first()?, steady.last()?);
    let seconds = |at_ms: u32| f64::from(at_ms.wrapping_sub(*from_ms)) * 1e-3;
    let way_mm = |live: &Live| f64::from(live.stage_um.wrapping_sub(from.stage_um)) * 1e-3;
    let mm_s = (*to_ms != *from_ms).then(|| way_mm(to) / seconds(*to_ms))?;
    let off = steady
        .iter()
        .map(|(at_ms, live)| (way_mm(live) - mm_s * seconds(*at_ms)).abs());
    Some((mm_s, off.fold(0.0, f64::max)))
}

/// Where the stage was while it made its runs without load, with the times, ms, or why that failed.
pub fn speed(why: Option<&str>, places: &[(u32, Live)]) -> Finding {
    if let Some(why) = why {
        return failed(why);
    }
    let way = |live: &Live| match live.speed_um_s {
        speed if speed.abs() < STANDS_UM_S => 0,
        speed => speed.signum(),
    };
    let runs = places.chunk_by(|(_, a), (_, b)| way(a) == way(b));
    let runs: Vec<(f64, f64)> = runs
        .filter(|run| run.iter().all(|(_, live)| way(live) != 0))
        .filter_map(run)
        .collect();
    let asked = SPEEDS_UM_S.map(|um_s| f64::from(um_s) * 1e-3);
    // each there and back
    let each = asked.iter().flat_map(|mm_s| [*mm_s, *mm_s]);
    let off = runs
        .iter()
        .zip(each)
        .map(|((mm_s, _), asked)| (mm_s.abs() / asked - 1.0).abs());
    let off = off.fold(0.0, f64::max);
    let uneven_mm = runs.iter().map(|(_, off)| *off).fold(0.0, f64::max);
    let missing = runs.len() != 2 * asked.len();
    Finding::new(format!(
        "runs without load: {}, speeds {:.1} % off at most, within {uneven_mm:.2} mm of an even movement",
        runs.len(),
        off * 100.0
    ))
    .wrong(missing, &m::STAGE_SPEED, "runs")
    .wrong(!missing && off > SPEED_SHARE, &m::STAGE_SPEED, "")
    .wrong(!missing && uneven_mm > UNEVEN_MM, &m::STAGE_SPEED, "uneven")
}

/// The first slide. A rig also measures its traction.
pub fn slide(seen: &SlideSeen, has_motors: bool) -> Finding {
    if let Some(why) = &seen.failed {
        return failed(why);
    }
    let Some(observed) = &seen.observed else {
        return failed("no slide was made");
    };
    let [traction, roughness, _] = observed.properties;
    let counts = &seen.counts;
    let bad = counts.late_slots + counts.parity_errors + counts.error_frames;
    let most = seen.force.iter().map(|[_, mn]| *mn).fold(0.0, f64::max);
    let movement = seen
        .movement
        .map(|movement| format!("{movement}, "))
        .unwrap_or_default();
    let said = |value: Option<f32>| value.map_or("none".to_owned(), |value| format!("{value:.2}"));
    Finding::new(format!(
        "{movement}up to {:.2} N: traction {}, roughness {}; {bad} bad words, {} lost samples",
        most * 1e-3,
        said(traction),
        said(roughness),
        counts.lost_samples
    ))
    .wrong(bad > 0, &m::WORDS, "")
    .wrong(counts.lost_samples > 0, &m::SAMPLES_LOST, "")
    .wrong(
        observed.roughness_is_bound || roughness.is_none(),
        &m::SLIDE_QUIET,
        "",
    )
    .wrong(
        has_motors && traction.is_none_or(|traction| traction <= 0.0),
        &m::SLIDE_TRACTION,
        "",
    )
}
