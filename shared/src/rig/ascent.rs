//! Check that a lever on its way up rises, and that a lifted finger stays up: P_DC may fall meanwhile, and not rise.

use super::fault::Fault;
use super::force::ForceMeter;
use super::phase::Phase;
use crate::sensor::FingerModel;

/// P_DC of a finger in the air is no further than this from its calibrated value, mN: 40 counts of a BioTac, between
/// its drift with temperature and the 110 of a contact that is pressed (chosen). A contact that passes this check and
/// 1.26 N on top of it stay below the guard's limit.
const AIR_MN: f32 = 460.0;
/// A driver that steps on its own stops without current; only then the finger is lifted.
pub(super) const RELEASE_MS: u32 = 20;
/// Rise of P_DC on the way up, mN, that shows that something presses: the lever, if it goes down.
const RISEN_MN: f32 = 92.0;
/// The same of a pressed finger that is lifted, whose stage may still be braking, mN: 20 counts of a BioTac, and 1.26 N
/// with them are far below the guard's limit, which a lever that goes down at the speed of lifting overshoots by up to
/// 0.15 N.
const LIFTED_RISEN_MN: f32 = 230.0;
/// P_DC of a finger that waits in the air may drift by so many mN a millisecond as it warms up: 30 counts of a BioTac a
/// minute (chosen). A person may touch it, too: only [`AIR_MN`] more show that the lever has come down.
const WARMING_MN: f32 = 0.00575;
/// The same of a finger that was pressed too hard and whose driver is off: there every tenth of a newton counts.
const WORSE_MN: f32 = 46.0;

/// Returns true if P_DC at `counts` is implausible for this finger in the air, where it reads `air`.
pub(super) fn is_far(finger: &FingerModel, counts: Option<f32>, air: f32) -> bool {
    counts.is_some_and(|counts| libm::fabsf(counts - air) > finger.counts(AIR_MN))
}

#[derive(Clone, Debug)]
pub(super) struct Ascent {
    finger: &'static FingerModel,
    /// The least mean since the lever began to look for its switch, or without contact at the last press, counts.
    lowest: Option<f32>,
    /// The finger was pressed too hard since lever and stage were home, and may be so still.
    pressed: bool,
    /// A weight of so many mN may come to lie on the finger while it waits.
    weight_mn: f32,
    /// True if the finger cannot be lifted: the lever's driver stays off.
    pub(super) gave_up: bool,
    /// P_DC above no contact when the driver of a finger that was pressed too hard had been off for [`RELEASE_MS`].
    released: f32,
}

impl Ascent {
    pub(super) fn new(finger: &'static FingerModel) -> Self {
        Self {
            finger,
            lowest: None,
            pressed: false,
            weight_mn: 0.0,
            gave_up: false,
            released: 0.0,
        }
    }

    pub(super) fn forget(&mut self) {
        (self.lowest, self.pressed) = (None, false);
    }

    /// The lever begins to look for its switch, at P_DC of `mean`. Returns true if P_DC without contact must be found
    /// again. After a press it is not: each try would begin where the last one ended. But where P_DC is the value that
    /// the calibration measured in the `air`, nothing presses: the rise was noise, or a person has freed the finger.
    pub(super) fn begin(&mut self, mean: Option<f32>, air: Option<f32>) -> bool {
        let is_free = mean
            .zip(air)
            .is_some_and(|(mean, air)| libm::fabsf(mean - air) < self.finger.counts(RISEN_MN));
        if self.pressed && !is_free {
            return false;
        }
        self.lowest = None;
        true
    }

    /// A lifted finger sets out with the stage, at P_DC of `mean`.
    pub(super) fn set_out(&mut self, mean: Option<f32>) {
        self.lowest = mean.or(self.lowest);
    }

    /// A weight of so many mN may be laid on the finger while it waits.
    pub(super) fn expect(&mut self, mn: u16) {
        self.weight_mn = f32::from(mn);
    }

    /// A millisecond of `phase`, its `ms`-th, with a lever that `seeks` its switch or a stage that does not know its
    /// place. Returns the fault if P_DC has risen on the way to the switch, or while the finger is to stay lifted.
    #[inline(never)]
    pub(super) fn tick(
        &mut self,
        phase: Phase,
        seeks: bool,
        ms: u32,
        meter: &ForceMeter,
    ) -> Option<Fault> {
        if phase != Phase::Ready {
            self.weight_mn = 0.0;
        }
        match phase {
            Phase::Homing | Phase::Positioning | Phase::Unloaded => {
                self.rises(meter.mean(), RISEN_MN)
            }
            Phase::Lifting if seeks => self.rises(meter.mean(), RISEN_MN),
            Phase::Lifting => {
                // it was lifted when it was pressed last
                if ms <= 1 {
                    self.set_out(meter.mean());
                }
                self.rises(meter.mean(), LIFTED_RISEN_MN)
            }
            Phase::Faulted(Fault::ForceHigh) => {
                self.lift(ms, meter);
                None
            }
            // a switch that was closed on the way does not show that the finger is up; nor do steps, nor a missing
            // contact where the sample should be: P_DC shows when it is not
            Phase::Faulted(Fault::LeverLimit | Fault::NoContact | Fault::PressureDead) => {
                if ms <= 1 && !self.pressed {
                    self.set_out(meter.mean());
                }
                self.rises(meter.mean(), RISEN_MN)
                    .map(|_| Fault::LeverNotHome)
            }
            Phase::Ready => {
                self.pressed = false;
                self.lowest = self
                    .lowest
                    .map(|lowest| lowest + self.finger.counts(WARMING_MN));
                let most_mn = if seeks {
                    RISEN_MN
                } else {
                    AIR_MN + self.weight_mn
                };
                self.rises(meter.mean(), most_mn)
            }
            _ => None,
        }
    }

    /// P_DC on the way, mean of 10 ms. Returns the fault if it has risen by more than `mn`. The first time a person may
    /// be leaning on the finger, and it is lifted; then no further try makes a step before P_DC has fallen again.
    #[inline(never)]
    fn rises(&mut self, mean: Option<f32>, mn: f32) -> Option<Fault> {
        let mean = mean?;
        let lowest = self.lowest.map_or(mean, |lowest| lowest.min(mean));
        self.lowest = Some(lowest);
        if mean <= lowest + self.finger.counts(mn) {
            return None;
        }
        let before = core::mem::replace(&mut self.pressed, true);
        Some(if before {
            Fault::LeverNotHome
        } else {
            Fault::ForceHigh
        })
    }

    /// So long after the finger was seen to be pressed too hard: gives up if lifting makes it worse, as with a driver
    /// or a wire that does not obey.
    fn lift(&mut self, ms: u32, meter: &ForceMeter) {
        self.pressed = true;
        if ms <= RELEASE_MS {
            self.released = meter.counts();
        } else {
            self.gave_up |= meter.counts_now() > self.released + self.finger.counts(WORSE_MN);
        }
    }

    pub(super) fn zero(&mut self, counts: f32) {
        self.lowest = Some(counts);
    }

    pub(super) fn lowest(&self) -> Option<f32> {
        self.lowest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::biotac;
    use crate::sensor::pressure::Counts;

    #[test]
    fn what_rose_once_must_fall_before_the_next_try() {
        let mut ascent = Ascent::new(&biotac::PARTS.model);
        assert!(ascent.begin(None, None));
        for mean in [None, Some(2700.0), Some(2650.0), Some(2658.0)] {
            assert_eq!(ascent.rises(mean, RISEN_MN), None);
        }
        assert_eq!(ascent.rises(Some(2659.0), RISEN_MN), Some(Fault::ForceHigh));
        for _ in 0..3 {
            assert!(
                !ascent.begin(Some(2659.0), Some(2640.0)),
                "the zero is kept"
            );
            assert_eq!(
                ascent.rises(Some(2659.0), RISEN_MN),
                Some(Fault::LeverNotHome)
            );
        }
        // a person has freed it
        assert!(!ascent.begin(None, None));
        assert_eq!(ascent.rises(Some(2651.0), RISEN_MN), None);
        ascent.pressed = false;
        assert!(ascent.begin(None, None));
        assert_eq!(ascent.lowest(), None);
        assert_eq!(ascent.rises(Some(2800.0), RISEN_MN), None);
    }

    #[test]
    fn noise_that_seemed_a_press_is_forgotten_where_p_dc_is_as_it_was_in_the_air() {
        let mut ascent = Ascent::new(&biotac::PARTS.model);
        assert!(ascent.begin(None, Some(2600.0)));
        // words of noise make it seem lower than it is
        assert_eq!(ascent.rises(Some(2570.0), AIR_MN), None);
        assert_eq!(ascent.rises(Some(2611.0), AIR_MN), Some(Fault::ForceHigh));
        assert!(!ascent.begin(Some(2608.5), Some(2600.0)));
        assert!(!ascent.begin(Some(2600.0), None), "nobody has measured it");
        assert!(!ascent.begin(None, Some(2600.0)), "the sensor is silent");
        assert!(ascent.begin(Some(2607.5), Some(2600.0)));
        assert_eq!(ascent.rises(Some(2607.5), RISEN_MN), None);
        // a lever that goes down after all is seen within those counts
        assert_eq!(
            ascent.rises(Some(2616.0), RISEN_MN),
            Some(Fault::LeverNotHome)
        );
        assert!(!ascent.begin(Some(2616.0), Some(2600.0)));
    }

    #[test]
    fn a_press_keeps_the_last_zero() {
        let mut ascent = Ascent::new(&biotac::PARTS.model);
        ascent.zero(2600.0);
        ascent.pressed = true;
        assert!(!ascent.begin(None, None));
        assert_eq!(
            ascent.rises(Some(2700.0), RISEN_MN),
            Some(Fault::LeverNotHome)
        );
    }

    #[test]
    fn a_lever_that_felt_nothing_is_watched_on_its_way_up() {
        for (fault, seen) in [
            (Fault::LeverLimit, Some(Fault::LeverNotHome)),
            (Fault::NoContact, Some(Fault::LeverNotHome)),
            (Fault::PressureDead, Some(Fault::LeverNotHome)),
            // the lever knows that it was pressed
            (Fault::Unsteady, None),
        ] {
            let mut meter = ForceMeter::new(2600.0);
            let mut ascent = Ascent::new(&biotac::PARTS.model);
            let mut found = None;
            for ms in 1..100 {
                for _ in 0..2 {
                    meter.push(Counts::new(2600 + ms as u16).unwrap());
                }
                found = found.or(ascent.tick(Phase::Faulted(fault), true, ms, &meter));
            }
            assert_eq!(found, seen, "{fault:?}");
        }
    }

    #[test]
    fn a_finger_that_waits_may_warm_up_but_not_be_pressed() {
        let mut meter = ForceMeter::new(2600.0);
        let mut ascent = Ascent::new(&biotac::PARTS.model);
        let mut wait = |ascent: &mut Ascent, ms: u32, counts_per_ms: f32, from: f32| {
            let mut seen = None;
            for ms in 0..ms {
                let counts = Counts::new((from + counts_per_ms * ms as f32) as u16);
                meter.push(counts.unwrap());
                seen = seen.or(ascent.tick(Phase::Ready, false, ms, &meter));
            }
            seen
        };
        // 24 counts a minute, for ten minutes; then a person touches it
        assert_eq!(wait(&mut ascent, 600_000, 0.0004, 2600.0), None);
        assert_eq!(wait(&mut ascent, 1_000, 0.0, 2860.0), None);
        // a lever comes down: 45 counts a second
        let fault = wait(&mut ascent, 2_000, 0.045, 2840.0);
        assert_eq!(fault, Some(Fault::ForceHigh));
    }
}
