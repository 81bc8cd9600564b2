//! The lever's motor: it lowers the finger until the force is right, holds, and lifts it again.
//!
//! A state machine that is called once a millisecond. It returns a step rate; the caller makes the steps, counts them
//! and passes the count to the next call.

use super::fault::Fault;
use super::force::ForceMeter;
use super::guard::Unguarded;
use super::progress::Progress;
use crate::sensor::FingerModel;
use crate::sensor::pressure::{Calibration, Counts};

/// Travel of the reference lever per step, um: lead 2 mm, 200 steps, 1/16.
pub(crate) const STEP_UM: f32 = 0.625;
/// Steps per second while approaching: 0.5 mm/s (Methods, "Force Control with Stepper Motor").
pub(crate) const APPROACH_STEPS_S: i32 = 800;
/// Steps per second through the air, down to the first contact in P_AC or P_DC: 2 mm/s, at which a stepper stops on a
/// step. Until the mean of P_DC shows it and the motor stands, 11 ms, it makes 22 um: 50 mN on a hard sample, half of
/// the lightest press.
pub(crate) const DESCENT_STEPS_S: i32 = 3200;
/// After that the lever stands until the whole mean of P_DC, 10 ms, and the one before are of the standing finger.
const REST_MS: u32 = 20;
/// It goes slowly from this far above the last contact on, 0.15 mm: that was seen some hundredths of a millimetre below
/// the surface.
const NEAR_STEPS: i32 = 240;
/// The mean of P_DC is of 10 ms, and the skin comes back within 100 (chosen).
const RESTS_MS: u32 = 100;
/// Steps per second while lifting, upwards: 2 mm/s, still within what a stepper starts and stops at without a ramp.
pub const RETRACT_STEPS_S: i32 = -3200;
/// Steps per second while the force is trimmed: slow enough to stop on a step.
const TRIM_STEPS_S: i32 = 200;
/// Between trials the finger hangs this far above the last contact: 1 mm. It is pressed on no further below that than
/// this while P_DC shows no contact: that is 1 N on a hard sample.
const CLEARANCE_STEPS: i32 = 1600;
/// The lever goes at most this far below the limit switch: 16 mm, just above its lower end. Without contact by then,
/// there is no sample.
pub const MAX_STEPS: i32 = 25_600;
/// A finger that presses on something thin continues to the lower end itself: 17 mm below the limit switch.
const END_STEPS: i32 = 27_200;
/// Contact is seen when the mean of P_DC has risen by this, mN: 3 counts of a BioTac, thirty times its noise.
const CONTACT_MN: f32 = 34.5;
/// The zero was taken in the air if P_DC does not rise by a third of that in the first 0.1 mm of the way down, 200 ms:
/// the softest sample would show 18 mN.
const CLEAR_MS: u32 = 200;
/// Nearer to the top than this the limit switch may be closed, further down it must be open: 1 mm, the switch's
/// own way and the half millimetre from it to the hard stop.
const NEAR_TOP_STEPS: i32 = 1600;
/// The switch closes at the same place each time, this exactly: one sixteenth of a millimetre.
const SWITCH_STEPS: i32 = 100;
/// A lever that hangs over the sample for this long goes up to its switch, which sees it come down. One that came down
/// by itself at the speed of an approach would touch after [`CLEARANCE_STEPS`], 2 s; a choice among movements takes 1 s
/// at most.
const HANGS_MS: u32 = 1500;
/// A trim makes no more steps than this: 0.75 mm.
const TRIM_STEPS: f32 = 1200.0;
/// The skin creeps after it was pressed, and P_DC with it.
const SETTLE_MS: u32 = 250;
/// Mean of P_DC from which the force is trimmed: 100 ms, 220 samples.
const WEIGH_MS: u32 = 100;
/// The approach stops short by this, mN, so that trimming mostly presses on and never meets the backlash.
const SHORT_MN: f32 = 6.9;
/// The force is good when it is this near, mN, or ...
const GOOD_MN: f32 = 2.875;
/// ... this near, as a share of the target.
const GOOD_SHARE: f32 = 0.01;
/// After this many trims the force has to be within tolerance.
const MAX_TRIMS: u8 = 6;
/// All trims together press on by no more than this share of the target and this force, mN: the skin creeps by less,
/// and a P_DC that drifts must not be followed until the finger is crushed.
const MAX_CREEP_SHARE: f32 = 0.15;
const MAX_CREEP_MN: f32 = 34.5;
/// A whole count of a BioTac below 2.05 N, where the force guard acts as a rule, mN: trims never press on beyond.
const LIMIT_MN: f32 = 2047.0;
/// A whole count of a BioTac above the guard's highest limit, 2.1 N, mN: it must be below full scale.
const GUARD_MN: f32 = 2104.5;
/// The zero of one press and of the next differ by less, mN: drift, and nothing that presses.
const ZERO_MN: f32 = 92.0;
/// 1 N/mm, the softest that a finger is, mN per step.
const SOFTEST_MN: f32 = STEP_UM;
/// Longest times of a trim, of lifting and of an approach, ms: a motor that makes no steps must not go unnoticed.
const TRIM_MS: u32 = 20_000;
const LIFT_MS: u32 = 10_000;
const APPROACH_MS: u32 = 60_000;
/// A press beyond this, mN, stands still twice on its way, at these shares of its target: a skin that leaks over
/// seconds looks like a sample that gives way for as long as the lever steps. Lighter presses are over before it
/// matters.
const STANDS_FROM_MN: f32 = 1380.0;
const STANDS_AT: [f32; 2] = [0.5, 0.75];
/// While it stands P_DC is weighed twice: from 50 to 150 ms and from [`SETTLE_MS`] on, 200 ms later.
const FIRST_WEIGH_MS: u32 = 50;
const BETWEEN_WEIGHINGS_S: f32 = 0.2;
/// Largest leak until the target is reached, mN, if it continues as while the lever stands: the finger bears so much
/// more than P_DC shows (chosen: with the guard's limit and the trims, less than 2.2 N).
const LEAK_MN: f32 = 92.0;
/// Tolerance of a pressed finger: this, mN (a BioTac's count), or 5 %, whichever is more.
const TOLERANCE_MN: f32 = 11.5;
const TOLERANCE_SHARE: f32 = 0.05;
/// The value of no contact is a mean over this time.
const ZERO_MS: u32 = 200;
/// Vibration of the motor dies down before the zero is taken.
const QUIET_MS: u32 = 100;

#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(crate) enum LeverState {
    /// Its position is not known, the motor stands.
    #[default]
    Unknown,
    /// Up, to the limit switch.
    Homing,
    /// The same of a lifted finger that waits: the place of the sample stays known.
    Parking,
    Lifted,
    /// Lifted, and P_DC without contact is measured.
    Zeroing,
    /// Down; the count of steps where contact was seen.
    Approaching(Option<i32>),
    /// Pressed, and waiting for the skin; then the force is weighed.
    Settling,
    /// Pressed; the last correction is being stepped, to this count.
    Trimming(i32),
    /// Pressed with the target force. The motor stands, at any change of the force.
    Holding,
    /// Up, to this count of steps.
    Retracting(i32),
}

#[derive(Clone, Debug)]
pub(crate) struct Lever {
    finger: &'static FingerModel,
    state: LeverState,
    /// Target force, in counts above no contact.
    target: f32,
    trims: u8,
    /// Number of stops on the way, the first mean of P_DC there, and P_DC summed up since contact, counts times s.
    stood: usize,
    first: f32,
    pressed: f32,
    crept: f32,
    /// Counts of P_DC per step near the target, learned during the approach.
    counts_per_step: f32,
    /// Count of steps and P_DC some way before the target.
    before: Option<(i32, f32)>,
    /// P_DC without contact at the last press, since homing.
    zero: Option<f32>,
    /// Count of steps at the limit switch, which is 0 of the travel, once it was found.
    top: i32,
    known: bool,
    /// Lifted, its limit switch was closed.
    at_switch: bool,
    contact: Option<i32>,
    /// True if the lever comes down through the air; then the time that it stands where it touched, ms.
    descends: bool,
    rest_ms: u32,
    progress: Progress,
    ms: u32,
}

impl Lever {
    /// A lever whose place is unknown, for such a finger, with all guards but `unguarded`.
    pub(crate) fn new(finger: &'static FingerModel, unguarded: Unguarded) -> Self {
        Self::with(finger, Progress::new(finger, unguarded))
    }

    fn with(finger: &'static FingerModel, progress: Progress) -> Self {
        Self {
            finger,
            state: LeverState::Unknown,
            target: 0.0,
            trims: 0,
            stood: 0,
            first: 0.0,
            pressed: 0.0,
            crept: 0.0,
            counts_per_step: 0.0,
            before: None,
            zero: None,
            top: 0,
            known: false,
            at_switch: false,
            contact: None,
            descends: false,
            rest_ms: 0,
            progress,
            ms: 0,
        }
    }

    /// Forgets its place: it may be moved by hand now.
    pub(crate) fn lose(&mut self) {
        *self = Self::with(self.finger, self.progress.clone());
    }

    pub(crate) fn hear(&mut self, pac: Counts, calibration: &Calibration) {
        match self.state {
            LeverState::Lifted | LeverState::Zeroing => self.progress.rest(pac.get()),
            LeverState::Approaching(_) => self.progress.hear(pac.get(), calibration),
            _ => {}
        }
    }

    pub(crate) fn state(&self) -> LeverState {
        self.state
    }

    /// Returns true if the finger is certainly off the sample and the motor stands.
    pub(crate) fn is_lifted(&self) -> bool {
        self.state == LeverState::Lifted
    }

    /// Returns true if it is lifted and has stood so long that P_DC no longer shows its way.
    pub(crate) fn rests(&self) -> bool {
        self.is_lifted() && self.ms > RESTS_MS
    }

    pub(crate) fn is_parking(&self) -> bool {
        self.state == LeverState::Parking
    }

    /// Returns true if it stands at the limit switch, so that the switch must be closed.
    pub(crate) fn is_at_switch(&self) -> bool {
        self.at_switch && matches!(self.state, LeverState::Lifted | LeverState::Zeroing)
    }

    /// Returns true if it is so far below the limit switch that the switch must be open.
    pub(crate) fn is_down(&self, steps: i32) -> bool {
        let known = !matches!(self.state, LeverState::Unknown | LeverState::Homing);
        known && steps - self.top > NEAR_TOP_STEPS
    }

    /// P_DC without contact as it was measured for the last press since homing.
    pub(crate) fn zero(&self) -> Option<f32> {
        self.zero
    }

    /// Goes up to the limit switch. This also lifts the finger after any fault: a lever that knows its place trusts the
    /// switch only at the top, for a switch that sticks must not leave the finger down.
    pub(crate) fn home(&mut self) {
        self.enter(LeverState::Homing);
    }

    /// Brings a finger that hangs over the sample up to the limit switch, which shows whether it stays lifted,
    /// independent of the sensor. Returns true if the way begins.
    pub(crate) fn park(&mut self) -> bool {
        let hangs = self.is_lifted() && !self.at_switch;
        if hangs {
            self.enter(LeverState::Parking);
        }
        hangs
    }

    /// Counts another millisecond of waiting: parks the lifted finger if it has waited for too long. Returns true if
    /// the way begins.
    pub(crate) fn wait(&mut self) -> bool {
        self.ms >= HANGS_MS && self.park()
    }

    /// Requires another homing. The top stays known.
    pub(crate) fn reset(&mut self) {
        self.enter(LeverState::Unknown);
    }

    /// Measures P_DC without contact, then presses until P_DC has risen by `target` counts. Only a lifted lever does.
    pub(crate) fn press(&mut self, target: f32) -> bool {
        let lifted = self.is_lifted();
        if lifted {
            self.target = target;
            self.enter(LeverState::Zeroing);
        }
        lifted
    }

    pub(crate) fn lift(&mut self, steps: i32) {
        match self.contact {
            Some(contact) if self.state != LeverState::Unknown => {
                self.enter(LeverState::Retracting(
                    (contact - CLEARANCE_STEPS).max(self.top).min(steps),
                ));
            }
            _ => self.home(),
        }
    }

    pub(crate) fn forget_contact(&mut self) {
        self.contact = None;
    }

    fn enter(&mut self, state: LeverState) {
        if state == LeverState::Lifted && !self.is_parking() {
            self.progress.lifted();
        }
        self.state = state;
        self.ms = 0;
    }

    #[inline]
    fn go_up(&mut self, steps: i32, at_top: bool) -> Result<i32, Fault> {
        // Lower than it was, the lever continues: if the switch is stuck, that is right; if steps were lost, it
        // stands at its hard stop until the count is right again. Higher, and steps up were lost: there the top
        // is now.
        if at_top && (!self.known || steps - self.top <= SWITCH_STEPS) {
            self.top = if self.known {
                self.top.min(steps)
            } else {
                steps
            };
            self.known = true;
            self.at_switch = true;
            if !self.is_parking() {
                self.contact = None;
                self.zero = None;
            }
            self.enter(LeverState::Lifted);
            return Ok(0);
        }
        // the whole travel and a quarter, at the speed of lifting
        let longest_ms = MAX_STEPS as u32 * 1250 / RETRACT_STEPS_S.unsigned_abs();
        if self.ms > longest_ms {
            Err(Fault::LeverNotHome)
        } else {
            Ok(RETRACT_STEPS_S)
        }
    }

    /// One millisecond: `steps` made so far (downwards positive), and whether the limit switch is pressed. Returns the
    /// steps per second to make now, downwards positive.
    /// Errors: the motor is to stand; the guard then lifts the finger.
    #[inline]
    pub(crate) fn tick(
        &mut self,
        meter: &mut ForceMeter,
        steps: i32,
        at_top: bool,
    ) -> Result<i32, Fault> {
        self.ms = self.ms.saturating_add(1);
        match self.state {
            LeverState::Unknown | LeverState::Lifted | LeverState::Holding => Ok(0),
            LeverState::Homing | LeverState::Parking => self.go_up(steps, at_top),
            LeverState::Zeroing => {
                if self.ms == QUIET_MS {
                    meter.begin_long();
                } else if self.ms >= QUIET_MS + ZERO_MS {
                    meter.zero();
                    let zero = meter.no_contact();
                    // something presses already, or full scale comes before the guard's limit
                    let moved = self
                        .zero
                        .is_some_and(|last| libm::fabsf(zero - last) > self.finger.counts(ZERO_MN));
                    if moved || zero + self.finger.counts(GUARD_MN) > f32::from(Counts::MAX.get()) {
                        return Err(Fault::Unsteady);
                    }
                    self.zero = Some(zero);
                    self.counts_per_step = self.finger.counts(SOFTEST_MN);
                    self.before = None;
                    self.trims = 0;
                    self.stood = 0;
                    self.pressed = 0.0;
                    self.crept = 0.0;
                    (self.descends, self.rest_ms) = (false, 0);
                    self.enter(LeverState::Approaching(None));
                    return Ok(APPROACH_STEPS_S);
                }
                Ok(0)
            }
            LeverState::Approaching(contact) => self.approach(meter, steps, contact),
            LeverState::Settling => {
                self.pressed += meter.counts() * 1e-3;
                if self.ms == FIRST_WEIGH_MS {
                    meter.begin_long();
                } else if self.ms == FIRST_WEIGH_MS + WEIGH_MS {
                    self.first = meter.long_counts().unwrap_or_default();
                } else if self.ms == SETTLE_MS {
                    meter.begin_long();
                } else if self.ms >= SETTLE_MS + WEIGH_MS {
                    return self.weigh(meter, steps);
                }
                Ok(0)
            }
            LeverState::Trimming(to) => {
                if self.ms > TRIM_MS {
                    return Err(Fault::LeverSlips);
                }
                if steps == to {
                    self.enter(LeverState::Settling);
                    Ok(0)
                } else {
                    Ok(TRIM_STEPS_S * (to - steps).signum())
                }
            }
            LeverState::Retracting(to) => {
                if self.ms > LIFT_MS {
                    return Err(Fault::LeverNotHome);
                }
                let at_switch = at_top && steps - self.top <= NEAR_TOP_STEPS;
                if steps <= to || at_switch {
                    self.at_switch = at_switch;
                    self.enter(LeverState::Lifted);
                    Ok(0)
                } else {
                    Ok(RETRACT_STEPS_S)
                }
            }
        }
    }

    #[inline]
    fn approach(
        &mut self,
        meter: &ForceMeter,
        steps: i32,
        contact: Option<i32>,
    ) -> Result<i32, Fault> {
        if self.rest_ms > 0 {
            self.rest_ms -= 1;
            return Ok(0);
        }
        let (counts, mean) = (meter.counts_now(), meter.counts());
        let contact_counts = self.finger.counts(CONTACT_MN);
        let contact = contact.or_else(|| (mean > contact_counts).then_some(steps));
        self.state = LeverState::Approaching(contact);
        if contact.is_some() && core::mem::take(&mut self.descends) {
            self.rest_ms = REST_MS;
            return Ok(0);
        }
        self.progress.judge(steps, mean, contact.is_some())?;
        let lowest = contact.map_or(MAX_STEPS, |_| END_STEPS);
        let at_end = self.ms > APPROACH_MS || steps - self.top >= lowest;
        match contact {
            // less than no contact: the zero has drifted, and with it the force that would be pressed. A larger
            // difference: something pressed when it was taken
            None if mean < -contact_counts
                || (self.ms < CLEAR_MS && mean > contact_counts / 3.0) =>
            {
                return Err(Fault::Unsteady);
            }
            // the sample is the same, and a finger whose skin is torn shows nothing in either signal
            None if self.contact.is_some_and(|at| steps - at > CLEARANCE_STEPS) => {
                return Err(Fault::PressureDead);
            }
            None if at_end => return Err(Fault::NoContact),
            None => {
                // slowly while the zero is still to be believed, and where the sample is or may be
                let near = self.contact.is_some_and(|at| at - steps < NEAR_STEPS);
                self.descends = self.ms >= CLEAR_MS && !near && !self.progress.is_touched();
                return Ok(if self.descends {
                    DESCENT_STEPS_S
                } else {
                    APPROACH_STEPS_S
                });
            }
            Some(_) if at_end => return Err(Fault::LeverSlips),
            Some(at) => self.contact = Some(at),
        }
        // stiffness over the last part of the way, for the trims
        if self.before.is_none() && counts > self.target * 0.6 {
            self.before = Some((steps, counts));
        }
        self.pressed += mean * 1e-3;
        if counts < self.next_stand() - self.finger.counts(SHORT_MN) {
            return Ok(APPROACH_STEPS_S);
        }
        if let Some((from, before)) = self.before {
            let made = (steps - from) as f32;
            let rise = (counts - before) / made;
            // a light target is reached before the mean has filled: 1 N/mm then, the softest that a finger is
            let softest = self.finger.counts(SOFTEST_MN);
            self.counts_per_step = if made > 0.0 && rise > softest {
                rise
            } else {
                softest
            };
        }
        self.enter(LeverState::Settling);
        Ok(0)
    }

    /// P_DC at which the lever stands next, counts: on its way, or at its target.
    fn next_stand(&self) -> f32 {
        let share = STANDS_AT.get(self.stood);
        let share = share.filter(|_| self.target > self.finger.counts(STANDS_FROM_MN));
        share.copied().unwrap_or(1.0) * self.target
    }

    /// Looks for a skin that leaks: P_DC falls while the lever stands on its way.
    fn look_for_leak(&mut self, counts: f32) -> Result<i32, Fault> {
        let share_per_s = (self.first - counts) / counts / BETWEEN_WEIGHINGS_S;
        // the pressure until now is to the whole as the square of the force, or less
        let still = self.target / counts;
        if share_per_s * self.pressed * still * still > self.finger.counts(LEAK_MN) {
            return Err(Fault::PressureDead);
        }
        self.stood += 1;
        self.before = None;
        self.enter(LeverState::Approaching(self.contact));
        Ok(APPROACH_STEPS_S)
    }

    /// The skin has settled: finds whether the force is right, or how many steps it is off.
    #[inline]
    fn weigh(&mut self, meter: &ForceMeter, steps: i32) -> Result<i32, Fault> {
        let Some(counts) = meter.long_counts() else {
            return Err(Fault::Unsteady);
        };
        if self.next_stand() < self.target {
            return self.look_for_leak(counts);
        }
        let off = self.target - counts;
        let near = |mn: f32, share: f32| {
            libm::fabsf(off) <= self.finger.counts(mn).max(share * self.target)
        };
        if near(GOOD_MN, GOOD_SHARE)
            || (self.trims >= MAX_TRIMS && near(TOLERANCE_MN, TOLERANCE_SHARE))
        {
            self.enter(LeverState::Holding);
            return Ok(0);
        }
        if self.trims >= MAX_TRIMS {
            return Err(Fault::Unsteady);
        }
        self.trims += 1;
        self.crept += off;
        let [creep, limit] = [MAX_CREEP_MN, LIMIT_MN].map(|mn| self.finger.counts(mn));
        let most = (creep + MAX_CREEP_SHARE * self.target).min(limit - self.target);
        if self.crept > most.max(0.0) {
            return Err(Fault::Unsteady);
        }
        let correction =
            libm::roundf(off / self.counts_per_step).clamp(-TRIM_STEPS, TRIM_STEPS) as i32;
        let correction = if correction == 0 {
            if off > 0.0 { 1 } else { -1 }
        } else {
            correction
        };
        self.enter(LeverState::Trimming(steps + correction));
        Ok(TRIM_STEPS_S * correction.signum())
    }
}

#[cfg(test)]
mod tests;
