//! The motor current without load, as part of a rig's calibration: runs at several speeds there and back.

use super::calibration::{LineFit, RigCalibration, RigCalibrationError};

/// Speeds of the runs, um/s, each there and back: from the slowest movement of the study to the fastest that most of
/// the grid needs.
pub const SPEEDS_UM_S: [u32; 4] = [10_000, 25_000, 40_000, 63_000];

/// The runs that are made and those that are still to be made.
///
/// The stage's place at first does not matter: of two runs at one speed one goes to the right, the way of every slide,
/// and only that one counts.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct UnloadedRuns {
    made: usize,
    fit: LineFit,
}

impl UnloadedRuns {
    /// Speed of the next run in um/s, for [`Control::start_unloaded`](super::control::Control::start_unloaded); `None`:
    /// all are made.
    pub fn next_speed(&self) -> Option<u32> {
        SPEEDS_UM_S.get(self.made / 2).copied()
    }

    /// Takes a run in: where the stage stood before and after it in mm, and its mean current in A; `None` if there was
    /// no time at constant speed.
    pub fn took(&mut self, from_mm: f32, to_mm: f32, mean_current_a: Option<f32>) {
        let Some(speed_um_s) = self.next_speed() else {
            return;
        };
        self.made += 1;
        if let Some(current_a) = mean_current_a.filter(|_| to_mm > from_mm) {
            self.fit.push(speed_um_s as f32 * 1e-3, current_a);
        }
    }

    /// `calibration` with the current that was measured. Errors: [`RigCalibrationError::Points`] also before all runs
    /// are made; [`RigCalibrationError::NoLine`], and the errors of [`RigCalibration::check`].
    #[inline]
    pub fn finish(
        &self,
        calibration: &RigCalibration,
    ) -> Result<RigCalibration, RigCalibrationError> {
        if self.next_speed().is_some() {
            return Err(RigCalibrationError::Points);
        }
        let measured = RigCalibration {
            unloaded_a: self.fit.line()?,
            ..*calibration
        };
        measured.check()?;
        Ok(measured)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::pressure::Calibration;
    use std::vec::Vec;

    const RIG: RigCalibration = RigCalibration {
        pressure: Calibration::PAPER,
        unloaded_a: (0.0, 0.0),
        newton_per_ampere: 8.0,
        date: 20_261_121,
        air_known: true,
        turned: 0,
        serial: [b'0'; 16],
    };

    /// The runs of a stage that stands at `at` of 100 mm and draws more current on its way back.
    fn made(mut at: f32, current: impl Fn(f32) -> f32) -> (UnloadedRuns, Vec<u32>) {
        let mut runs = UnloadedRuns::default();
        let mut speeds = Vec::new();
        while let Some(speed) = runs.next_speed() {
            assert_eq!(runs.finish(&RIG), Err(RigCalibrationError::Points));
            speeds.push(speed);
            let to = if at < 50.0 { 100.0 } else { 0.0 };
            let current_a = current(speed as f32 * 1e-3) * if to > at { 1.0 } else { -3.0 };
            runs.took(at, to, Some(current_a));
            at = to;
        }
        runs.took(0.0, 100.0, Some(9.0));
        (runs, speeds)
    }

    #[test]
    fn runs_to_the_right_count_wherever_the_stage_stands_at_first() {
        for at in [0.0, 100.0] {
            let (runs, speeds) = made(at, |mm_s| 0.1 + 0.002 * mm_s);
            let twice = |speed| [speed; 2];
            assert!(
                speeds
                    .into_iter()
                    .eq(SPEEDS_UM_S.into_iter().flat_map(twice))
            );
            let found = runs.finish(&RIG).unwrap();
            let (standstill, per_mm_s) = found.unloaded_a;
            assert!((standstill - 0.1).abs() < 1e-5 && (per_mm_s - 0.002).abs() < 1e-6);
            assert_eq!(
                RigCalibration {
                    unloaded_a: (0.0, 0.0),
                    ..found
                },
                RIG
            );
        }
    }

    #[test]
    fn what_is_no_line_or_no_current_is_refused() {
        let (runs, _) = made(0.0, |mm_s| if mm_s > 30.0 { 1.0 } else { mm_s });
        assert_eq!(runs.finish(&RIG), Err(RigCalibrationError::NoLine));
        let mut silent = UnloadedRuns::default();
        while silent.next_speed().is_some() {
            silent.took(0.0, 100.0, None);
        }
        assert_eq!(silent.finish(&RIG), Err(RigCalibrationError::Points));
    }
}
