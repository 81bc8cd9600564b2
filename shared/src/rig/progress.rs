//! Check of a press: P_DC has to rise with the lever's steps, and P_AC is the witness.
//!
//! P_AC is the same pressure as P_DC behind a high-pass of [`HIGH_PASS_S`]: where the pressure rises evenly, P_AC
//! stands that time's rise above its rest, and summed up it is the rise itself. Vibrations of the motor have no mean
//! and add nothing.
//!
//! The expected rise of P_DC is known, too. A finger is a ball on its plane: it gets the stiffer the harder it is
//! pressed (Hertz). A sample that gives way makes the rise slower, but evenly all the way; so the least compliance so
//! far predicts the rise of the next steps. A skin that leaks and a lever that slips fall behind that.

use super::fault::Fault;
use super::guard::Unguarded;
use crate::sensor::FingerModel;
use crate::sensor::pressure::{Calibration, RATE_HZ};

/// Time constant of P_AC's high-pass, s: 10 Hz (Methods, "BioTac").
const HIGH_PASS_S: f32 = 1.0 / (core::f32::consts::TAU * 10.0);
/// Age at which P_AC no longer counts for a contact, s: its rest is known to a tenth of a count only.
const MEMORY_S: f32 = 2.0;
/// The rest is a mean over the last 10 to 20 s.
const REST_SAMPLES: u32 = 20 * RATE_HZ;
/// Force of a count in this file, mN: that of a BioTac, whose figures these are. Counts of another finger are
/// converted.
const COUNT_MN: f32 = Calibration::PAPER.force_mn_per_count;
/// P_AC shows contact from this rise of the pressure on, in counts of P_DC: six times what a rest that was measured for
/// 0.7 s may be off by, with the noise of 4.8 counts that real devices have. The motor's hum adds 0.1.
const TOUCH_COUNTS: f32 = 1.0;
/// P_DC has to rise by [`SEEN_COUNTS`] within these steps after P_AC shows contact, and by a segment after its own: 0.5
/// mm.
const SEEN_STEPS: i32 = 800;
const SEEN_COUNTS: f32 = 3.0;
/// Progress is checked piece by piece, each of so many counts of P_DC: twenty times the noise of its mean.
const SEGMENT_COUNTS: f32 = 6.0;
/// A piece may take the steps that it should by the least compliance so far, divided by this: noise and a sample that
/// is not quite even.
const LEAST_SHARE: f32 = 0.75;
/// That compliance is seen from this P_DC on. Before, the finger touches less than 1.4 mm to either side, and a rough
/// sample's own heights make a difference: there the mean counts, and ...
const EVEN_COUNTS: f32 = 15.0;
/// ... the steps are divided by this.
const EARLY_SHARE: f32 = 0.4;
/// No later piece takes more: 0.38 mm for 69 mN, twice what the softest foam takes.
const LATER_STEPS: f32 = 600.0;
/// And so far it takes 1 mm at most: a sample of 4 mm/N.
const EARLY_STEPS: i32 = 1600;
/// By so many counts of P_DC the two signals differ before they contradict each other.
const AT_ODDS_COUNTS: f32 = 1.5;
/// Steps per count of P_DC of a finger on a hard sample, at one count; they fall with the cube root of the counts
/// (Hertz). Of a finger that gives way by 1.6 mm at 2 N.
const FINGER_STEPS: f32 = 54.0;

/// P_AC always has noise: the guard checks a value that has been the same for 10 ms; it counts for nothing here.
const FROZEN_SAMPLES: u32 = RATE_HZ / 100;

#[derive(Clone, Copy, Debug)]
struct Mark {
    steps: i32,
    counts: f32,
}

#[derive(Clone, Debug)]
pub(super) struct Progress {
    finger: &'static FingerModel,
    /// Counts of this finger in one count of this file.
    counts: f32,
    unguarded: Unguarded,
    /// Sum and number of P_AC samples since the finger was lifted.
    rest: (u32, u32),
    /// The last P_AC, and how many samples have been the same.
    last: u16,
    same: u32,
    /// Rise of the pressure by P_AC in counts of P_DC: over [`MEMORY_S`], and of this piece.
    lately: f32,
    of_piece: f32,
    /// Since when P_AC shows a contact that P_DC does not.
    touched: Option<Mark>,
    /// Steps at which P_DC showed contact, and the piece under way since then.
    contact: i32,
    piece: Option<Mark>,
    /// Steps of the pieces before [`EVEN_COUNTS`] beyond the finger's own, and their counts.
    early: (f32, f32),
    /// Least compliance of a later piece beyond the finger's own, steps per count.
    compliance: Option<f32>,
}

impl Progress {
    pub(super) fn new(finger: &'static FingerModel, unguarded: Unguarded) -> Self {
        Self {
            finger,
            counts: finger.counts(COUNT_MN),
            unguarded,
            rest: (0, 0),
            last: 0,
            same: 0,
            lately: 0.0,
            of_piece: 0.0,
            touched: None,
            contact: 0,
            piece: None,
            early: (0.0, 0.0),
            compliance: None,
        }
    }

    pub(super) fn lifted(&mut self) {
        *self = Self::new(self.finger, self.unguarded);
    }

    /// P_AC of the lifted finger while the lever stands, counts.
    pub(super) fn rest(&mut self, pac: u16) {
        let (sum, samples) = &mut self.rest;
        if *samples >= REST_SAMPLES {
            (*sum, *samples) = (*sum / 2, *samples / 2);
        }
        *sum += u32::from(pac);
        *samples += 1;
    }

    /// P_AC while the lever comes down, counts.
    #[inline]
    pub(super) fn hear(&mut self, pac: u16, calibration: &Calibration) {
        self.same = if pac == self.last {
            self.same.saturating_add(1)
        } else {
            0
        };
        self.last = pac;
        let (sum, samples) = self.rest;
        if samples == 0 || !self.finger.pac_shows_force {
            return;
        }
        let above = f32::from(pac) - sum as f32 / samples as f32;
        let ratio = calibration.pac_pa_per_count / calibration.pdc_pa_per_count;
        let rise = above * ratio / (HIGH_PASS_S * RATE_HZ as f32) / self.counts;
        self.lately += rise - self.lately / (MEMORY_S * RATE_HZ as f32);
        self.of_piece += rise;
    }

    pub(super) fn is_touched(&self) -> bool {
        self.touched.is_some()
    }

    /// Checks a millisecond of an approach: the steps made, P_DC above no contact, and whether it shows contact.
    /// Errors: [`Fault::PressureDead`] or [`Fault::LeverSlips`].
    #[inline]
    pub(super) fn judge(&mut self, steps: i32, counts: f32, contact: bool) -> Result<(), Fault> {
        if self.same >= FROZEN_SAMPLES {
            return Ok(());
        }
        let counts = counts / self.counts;
        let now = Mark { steps, counts };
        let fault = if contact {
            self.judge_piece(now)
        } else {
            self.judge_touch(now)
        };
        fault
            .filter(|fault| !self.unguarded.ignores(*fault))
            .map_or(Ok(()), Err)
    }

    #[inline]
    fn judge_touch(&mut self, now: Mark) -> Option<Fault> {
        if self.lately < TOUCH_COUNTS {
            self.touched = None;
            return None;
        }
        let Some(since) = self.touched else {
            self.touched = Some(now);
            self.of_piece = 0.0;
            return None;
        };
        let rise = now.counts - since.counts;
        (now.steps - since.steps >= SEEN_STEPS && rise < SEEN_COUNTS).then(|| self.stalled(rise))
    }

    #[inline]
    fn judge_piece(&mut self, now: Mark) -> Option<Fault> {
        let Some(since) = self.piece else {
            self.contact = now.steps;
            self.begin_piece(now);
            return None;
        };
        let (made, rise) = ((now.steps - since.steps) as f32, now.counts - since.counts);
        let middle = (since.counts + SEGMENT_COUNTS / 2.0).max(1.0);
        let finger = FINGER_STEPS / libm::cbrtf(middle);
        if rise >= SEGMENT_COUNTS {
            if since.counts < EVEN_COUNTS {
                self.early.0 += made - finger * rise;
                self.early.1 += rise;
            } else {
                let seen = (made / rise - finger).max(0.0);
                self.compliance = Some(self.compliance.map_or(seen, |least| least.min(seen)));
            }
            self.begin_piece(now);
            return None;
        }
        let steps = |compliance: f32, share: f32| (finger + compliance) * SEGMENT_COUNTS / share;
        let (early, counts) = self.early;
        let by_early = if since.counts < EVEN_COUNTS {
            SEEN_STEPS as f32
        } else if counts > 0.0 {
            steps((early / counts).max(0.0), EARLY_SHARE).min(LATER_STEPS)
        } else {
            LATER_STEPS
        };
        let by_least = self
            .compliance
            .map_or(f32::INFINITY, |least| steps(least, LEAST_SHARE));
        let most = by_early.min(by_least);
        let late = now.counts < EVEN_COUNTS && now.steps - self.contact > EARLY_STEPS;
        (made > most || late).then(|| self.stalled(rise))
    }

    /// The fault when P_DC has risen by no more than this: both signals look the same for a lever that slips and for a
    /// skin that leaks.
    fn stalled(&self, rise: f32) -> Fault {
        if self.of_piece > rise + AT_ODDS_COUNTS {
            Fault::PressureDead
        } else {
            Fault::LeverSlips
        }
    }

    fn begin_piece(&mut self, now: Mark) {
        self.piece = Some(now);
        self.of_piece = 0.0;
    }
}

#[cfg(test)]
mod tests;
