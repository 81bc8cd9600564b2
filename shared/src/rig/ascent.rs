//! Whether a lever that is to go up does: P_DC may fall on the way, and not rise.

use super::fault::Fault;
use super::force::ForceMeter;
use super::phase::Phase;

/// P_DC of a finger in the air is no further than this from what its calibration says, counts: between the drift with the
/// finger's temperature and the 110 of a contact that is pressed (chosen). What it lets pass, 0.46 N, and 1.26 N on top
/// are below the guard's limit.
const AIR_COUNTS: f32 = 40.0;
/// A driver that steps on its own stops without current; only then the finger is lifted.
pub(super) const RELEASE_MS: u32 = 20;
/// P_DC that has risen by so many counts on the way up, 0.09 N, says that something presses: the lever, if it goes down.
const RISEN_COUNTS: f32 = 8.0;
/// The same of a finger that was pressed too hard, since its driver was off: there every tenth of a newton counts.
const WORSE_COUNTS: f32 = 4.0;

/// Whether P_DC at `counts` is none of a finger that says `air` in the air.
pub(super) fn is_far(counts: Option<f32>, air: f32) -> bool {
    counts.is_some_and(|counts| libm::fabsf(counts - air) > AIR_COUNTS)
}

/// P_DC on the way to the limit switch.
#[derive(Clone, Debug, Default)]
pub(super) struct Ascent {
    /// The least mean since the lever began to look for its switch, or without contact at the last press, counts.
    lowest: Option<f32>,
    /// That is kept: the finger was pressed too hard since lever and stage were home, and may be so still.
    pressed: bool,
    /// The finger cannot be lifted: the lever's driver stays off.
    pub(super) gave_up: bool,
    /// P_DC above no contact when the driver of a finger that was pressed too hard had been off for [`RELEASE_MS`].
    released: f32,
}

impl Ascent {
    /// Another finger, or another calibration: nothing is known of P_DC.
    pub(super) fn forget(&mut self) {
        (self.lowest, self.pressed) = (None, false);
    }

    /// The lever begins to look for its switch; whether what was known of P_DC without contact is to be found anew. After a
    /// press it is not: each try would begin where the last one ended.
    pub(super) fn begin(&mut self) -> bool {
        if self.pressed {
            return false;
        }
        self.forget();
        true
    }

    /// A millisecond of `phase`, its `ms`-th, with a stage that may have `lost` its place: the fault, if P_DC has risen on the
    /// way to the switch.
    #[inline(never)]
    pub(super) fn tick(
        &mut self,
        phase: Phase,
        lost: bool,
        ms: u32,
        meter: &ForceMeter,
    ) -> Option<Fault> {
        match phase {
            Phase::Homing => self.rises(meter.mean()),
            Phase::Lifting if lost => self.rises(meter.mean()),
            Phase::Faulted(Fault::ForceHigh) => {
                self.lift(ms, meter);
                None
            }
            Phase::Ready => {
                self.pressed = false;
                None
            }
            _ => None,
        }
    }

    /// P_DC on the way, mean of 10 ms: the fault, if it has risen. The first time somebody may lean on the finger, and it is
    /// lifted; then no further try makes a step before P_DC has fallen again.
    fn rises(&mut self, mean: Option<f32>) -> Option<Fault> {
        let mean = mean?;
        let lowest = self.lowest.map_or(mean, |lowest| lowest.min(mean));
        self.lowest = Some(lowest);
        if mean <= lowest + RISEN_COUNTS {
            return None;
        }
        let before = core::mem::replace(&mut self.pressed, true);
        Some(if before {
            Fault::LeverNotHome
        } else {
            Fault::ForceHigh
        })
    }

    /// So long after it was seen that the finger is pressed too hard: gives up if lifting makes it worse, by a driver or a wire
    /// that does not do what it is told.
    fn lift(&mut self, ms: u32, meter: &ForceMeter) {
        self.pressed = true;
        if ms <= RELEASE_MS {
            self.released = meter.counts();
        } else {
            self.gave_up |= meter.counts_now() > self.released + WORSE_COUNTS;
        }
    }

    /// P_DC without contact was measured, counts.
    pub(super) fn zero(&mut self, counts: f32) {
        self.lowest = Some(counts);
    }

    /// The least P_DC so far, counts.
    pub(super) fn lowest(&self) -> Option<f32> {
        self.lowest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_rose_once_must_fall_before_the_next_try() {
        let mut ascent = Ascent::default();
        assert!(ascent.begin());
        for mean in [None, Some(2700.0), Some(2650.0), Some(2658.0)] {
            assert_eq!(ascent.rises(mean), None);
        }
        assert_eq!(ascent.rises(Some(2659.0)), Some(Fault::ForceHigh));
        for _ in 0..3 {
            assert!(!ascent.begin(), "the zero is kept");
            assert_eq!(ascent.rises(Some(2659.0)), Some(Fault::LeverNotHome));
        }
        // somebody has freed it
        assert!(!ascent.begin());
        assert_eq!(ascent.rises(Some(2651.0)), None);
        ascent.pressed = false;
        assert!(ascent.begin());
        assert_eq!(ascent.lowest(), None);
        assert_eq!(ascent.rises(Some(2800.0)), None);
    }

    #[test]
    fn a_press_keeps_the_last_zero() {
        let mut ascent = Ascent::default();
        ascent.zero(2600.0);
        ascent.pressed = true;
        assert!(!ascent.begin());
        assert_eq!(ascent.rises(Some(2700.0)), Some(Fault::LeverNotHome));
    }
}
