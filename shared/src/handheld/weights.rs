//! The force is set without a computer: three known weights on the finger, asked for on the display.

use embedded_storage_async::nor_flash::NorFlash;

use super::by_hand::{ByHand, Hand};
use crate::explorer::Kernels;
use crate::probe::Memory;
use crate::probe::seams::{RigHandle, StoredBytes};
use crate::rig::RigError;
use crate::rig::calibration::RigCalibration;
use crate::wire::Failure;

/// Weights that people have, 50, 100 and 150 g, as forces in mN.
pub const WEIGHTS_MN: [u16; 3] = [490, 981, 1471];
/// Share by which a weight may be off the line through 0 and all of them.
const OFF: f32 = 0.08;

impl<H: Hand, K: Kernels> ByHand<'_, H, K> {
    /// Asks for the finger in the air and for each of [`WEIGHTS_MN`] on it, keeps what comes of it, and shows that.
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
    ) -> Result<f32, Option<&'static str>> {
        let mut calibration = self.calibrate().await.map_err(|why| words(&why))?;
        let mut points = [(0.0, 0.0); WEIGHTS_MN.len()];
        for (point, mn) in points.iter_mut().zip(WEIGHTS_MN) {
            let counts = self.weigh(mn).await.map_err(|why| words(&why))?;
            *point = (counts, f32::from(mn));
        }
        let scale = line(&points).ok_or(Some("The weights do not agree. Weigh again."))?;
        calibration.pressure.force_mn_per_count = scale;
        calibration.date = RigCalibration::UNDATED;
        let set = self.set_calibration(calibration).await;
        set.map_err(|_| Some("No finger is like that. Weigh again."))?;
        let kept = match memory.store() {
            Ok(store) => store.set_calibration(&calibration).await.is_ok(),
            Err(_) => false,
        };
        if kept {
            Ok(scale)
        } else {
            Err(Some("The memory does not keep it. Switch off and on."))
        }
    }
}

/// mN a count by the line through 0 that is nearest to these points, if it is near to all.
fn line(points: &[(f32, f32)]) -> Option<f32> {
    let sum = |of: fn(&(f32, f32)) -> f32| points.iter().map(of).sum::<f32>();
    let scale = sum(|(x, y)| x * y) / sum(|(x, _)| x * x);
    let near = |(x, y): &(f32, f32)| (scale * x - y).abs() <= OFF * y;
    points.iter().all(near).then_some(scale)
}

/// What the display says of it; nothing where the person gave up, or a fault is shown already.
fn words(why: &Failure) -> Option<&'static str> {
    match why {
        Failure::Rig(RigError::NobodyThere) => Some("No weight lay still for a minute."),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::line;

    #[test]
    fn a_line_through_weights_is_found_and_one_weight_that_is_another_refused() {
        let at =
            |counts: [f32; 3]| line(&[(counts[0], 490.0), (counts[1], 981.0), (counts[2], 1471.0)]);
        let scale = at([49.0, 98.1, 147.1]).unwrap();
        assert!((scale - 10.0).abs() < 1e-4, "{scale}");
        assert!(at([50.0, 96.5, 148.0]).is_some());
        // the second was laid on twice
        assert_eq!(at([49.0, 98.1, 98.1]), None);
        assert_eq!(at([0.0; 3]), None);
        assert_eq!(at([f32::NAN, 98.1, 147.1]), None);
    }
}
