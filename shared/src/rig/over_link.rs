//! A rig whose finger is moved by an external arm over the link: [`RigOverLink`] asks for press, slide and lift,
//! samples the finger meanwhile, and checks the arm's reports by P_DC and by its own clock. It is called once a
//! millisecond, as [`Control`](super::control::Control) is on a rig with motors, and has its phases.
//!
//! The guard is here, not at the arm: at any fault it orders the arm to stop and to lift the finger before anything is
//! reported.

use super::arm::{APPROACH_UM_S, ArmMovement, ArmOrder, ArmReport, ArmState, ArmTask, Orders};
use super::ascent::is_far;
use super::calibration::RigCalibration;
use super::fault::Fault;
use super::force::ForceMeter;
use super::guard::{Guard, GuardInputs, Unguarded, force_limit_mn, may_press};
use super::phase::{Ended, HIGH_FORCE_MN, Phase, Refused};
use super::pins::{Inputs, Outputs};
use super::skin::SkinCare;
use super::slide::{LINK_MS, Run};
use crate::features::{Movement, SamplePhase};
use crate::sensor::{FingerModel, pressure::Channel};

/// Time over which P_DC in the air is taken before each press, ms.
const ZERO_MS: u32 = 300;
/// Time that the finger stands pressed before its background is measured, ms: the vibration of the arm's last step dies
/// away.
const SETTLE_MS: u32 = 300;
/// Time over which the still finger is measured, ms.
const BACKGROUND_MS: u32 = 1000;
/// Time over which P_DC in the air is measured to calibrate it, ms.
const AIR_MS: u32 = 2000;
/// Largest P_DC above its zero that a lifted finger shows, mN.
const LIFTED_MN: f32 = 92.0;
/// Excess over a movement's force that is a fault: a share of it, and mN. With 1.26 N that is 1.66 N: an arm that comes
/// down at three times its speed limit stays below 2.2 N then, see `tests/core/arm.rs`.
const TOO_HARD: (f32, f32) = (1.2, 150.0);
/// Force that is a fault while the finger is lifted or on its way, mN.
const IN_AIR_MN: f32 = 500.0;
/// The pressed finger's force may be off the movement's by a share of it, and counts of P_DC.
const FORCE_OFF: (f32, f32) = (0.10, 2.0);
/// The mean force of a slide may differ from that of the still finger before it by mN and a share: friction, and a
/// sample that is not flat.
const SLIDE_OFF: (f32, f32) = (34.5, 0.25);
/// Tolerance of a slide's length and speed, as a share.
const SLIDE_SHARE: f32 = 0.05;
/// Longest silence of an arm about an open order, ms: five of its reports.
const SILENT_MS: u32 = 500;
/// Longest that an arm may take to press and to lift: across its table, and down the last centimetre by steps of a
/// printer that stands after each, ms.
const PRESSES_MS: u32 = 60_000;
const LIFTS_MS: u32 = 20_000;
/// Longest from the order of a slide to its constant speed, and from its end to its report, ms.
const RAMP_MS: u32 = 2000;
/// Time from the report that the finger is lifted until P_DC must show it, ms.
const RELEASE_MS: u32 = 500;
/// Time from a stop until the force must be under the limit, and as long again until the finger must be lifted, ms: an
/// arm is assumed to stand after 100 ms, and has as long to go up.
const STOPS_MS: u32 = 200;
const FREE_MS: u32 = 2000;
/// Time after which the probe gives up on an arm that does not lift the finger, ms.
const GAVE_UP_MS: u32 = 5000;

/// A rig that an arm moves.
#[derive(Clone, Debug)]
pub struct RigOverLink {
    finger: &'static FingerModel,
    calibration: RigCalibration,
    skin: SkinCare,
    guard: Guard,
    meter: ForceMeter,
    orders: Orders,
    phase: Phase,
    ms: u32,
    ended: Option<Ended>,
    run: Run,
    movement: Movement,
    length_mm: f32,
    start: u16,
    high_force: bool,
    /// Time for which the arm has reported that it presses, slides at constant speed or is lifted, ms.
    there_ms: Option<u32>,
    /// P_DC in the air was measured since the rig homed.
    zeroed: bool,
    air: Option<f32>,
    still: f32,
    expected_mn: f32,
}

impl RigOverLink {
    /// A rig with such a finger, with all guards but `unguarded`. It orders the arm to stop: the arm's state is
    /// unknown.
    pub fn new(
        finger: &'static FingerModel,
        calibration: RigCalibration,
        unguarded: Unguarded,
    ) -> Self {
        Self {
            finger,
            calibration,
            skin: SkinCare::default(),
            guard: Guard::new(unguarded),
            meter: ForceMeter::new(calibration.pressure.pdc_no_contact),
            orders: Orders::new(0),
            phase: Phase::Parked,
            ms: 0,
            ended: None,
            run: Run::NONE,
            movement: Movement::FOR_FINENESS,
            length_mm: 0.0,
            start: 0,
            high_force: false,
            there_ms: None,
            zeroed: false,
            air: None,
            still: 0.0,
            expected_mn: 0.0,
        }
    }

    /// The current phase.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Takes the end of the last movement; `None` the second time.
    pub fn take_ended(&mut self) -> Option<Ended> {
        self.ended.take()
    }

    /// Contact force in mN from P_DC, mean over 10 ms; 0 before P_DC in the air is known.
    pub fn force_mn(&self) -> f32 {
        if self.knows_air() {
            self.meter.force_mn(&self.calibration.pressure)
        } else {
            0.0
        }
    }

    /// P_DC in the air, mean over the last time that it was measured, counts.
    pub fn air_counts(&self) -> Option<f32> {
        self.air
    }

    /// The constants in use.
    pub fn calibration(&self) -> &RigCalibration {
        &self.calibration
    }

    /// Wear of the skin.
    pub fn skin(&mut self) -> &mut SkinCare {
        &mut self.skin
    }

    /// Returns true if forces up to 2 N are allowed.
    pub fn high_force(&self) -> bool {
        self.high_force
    }

    /// Allows forces up to 2 N, or forbids them.
    pub fn allow_high_force(&mut self, allow: bool) {
        self.high_force = allow;
    }

    /// Takes other constants, between movements.
    /// Errors: [`Refused::Busy`], or [`Refused::Calibration`] for constants that cannot be used.
    pub fn calibrate(&mut self, calibration: RigCalibration) -> Result<(), Refused> {
        if self.phase != Phase::Ready && !self.is_at_rest() {
            return Err(Refused::Busy);
        }
        calibration.check().map_err(Refused::Calibration)?;
        self.calibration = calibration;
        self.meter = ForceMeter::new(calibration.pressure.pdc_no_contact);
        self.zeroed = false;
        if self.phase == Phase::Ready {
            self.enter(Phase::Parked);
        }
        Ok(())
    }

    /// Orders the arm to lift the finger, and takes P_DC there as that of no contact.
    pub fn home(&mut self) -> Result<(), Refused> {
        match self.phase {
            Phase::Parked | Phase::Ready => {
                self.guard.reset();
                self.ask(Phase::Homing, ArmTask::Lift);
                Ok(())
            }
            Phase::Faulted(fault) => Err(Refused::Fault(fault)),
            _ => Err(Refused::Busy),
        }
    }

    /// Ends a fault.
    /// Errors: [`Refused::Busy`] while the finger is still being lifted.
    pub fn reset(&mut self) -> Result<(), Refused> {
        if let Phase::Faulted(_) = self.phase {
            if !self.is_at_rest() {
                return Err(Refused::Busy);
            }
            self.guard.reset();
            self.enter(Phase::Parked);
        }
        Ok(())
    }

    /// Makes one movement, beginning at `start`: 0 to 1 of the length that the sample leaves.
    pub fn start(&mut self, movement: Movement, start: f32) -> Result<(), Refused> {
        self.may_start()?;
        let force_mn = movement.force_mn();
        let pressure = &self.calibration.pressure;
        if !may_press(self.finger, pressure, force_mn, self.high_force) {
            return Err(Refused::Force(force_mn));
        }
        self.movement = movement;
        // not-a-number is no start
        self.start = (if start >= 0.0 { start.min(1.0) } else { 0.0 } * 1e3) as u16;
        (self.run, self.length_mm) = Run::over_link(movement);
        self.ended = None;
        self.meter.begin_long();
        self.enter(Phase::Positioning);
        Ok(())
    }

    pub(crate) fn measure_air(&mut self) -> Result<(), Refused> {
        self.may_start()?;
        self.ended = None;
        self.air = None;
        self.meter.begin_long();
        self.enter(Phase::Unloaded);
        Ok(())
    }

    /// Expects a person to lay a weight of so many mN on the lifted finger; 0 ends that.
    pub fn weigh(&mut self, mn: u16) -> Result<(), Refused> {
        self.may_start()?;
        self.expected_mn = f32::from(mn);
        Ok(())
    }

    fn may_start(&self) -> Result<(), Refused> {
        match self.phase {
            Phase::Ready => Ok(()),
            Phase::Parked => Err(Refused::NotHomed),
            Phase::Faulted(fault) => Err(Refused::Fault(fault)),
            _ => Err(Refused::Busy),
        }
    }

    /// Orders the arm to stop and to lift the finger.
    pub fn stop(&mut self) {
        match self.phase {
            Phase::Parked | Phase::Ready | Phase::Lifting | Phase::Faulted(_) => {}
            _ => {
                self.ended = Some(Ended::Stopped);
                self.ask(Phase::Lifting, ArmTask::Stop);
            }
        }
    }

    /// Returns true if nothing moves: ready, parked, or at the end of a fault. The finger is lifted then, unless the
    /// fault is [`Fault::ArmSilent`] or [`Fault::ArmRuns`].
    pub fn is_at_rest(&self) -> bool {
        match self.phase {
            Phase::Parked | Phase::Ready => true,
            Phase::Faulted(_) => self.is_free() || self.ms > GAVE_UP_MS,
            _ => false,
        }
    }

    /// Returns true if the arm reports the finger as lifted and P_DC agrees.
    fn is_free(&self) -> bool {
        self.there_ms.is_some() && !self.is_pressed()
    }

    fn knows_air(&self) -> bool {
        self.zeroed || self.calibration.air_known
    }

    fn is_pressed(&self) -> bool {
        self.knows_air() && self.meter.counts() > self.finger.counts(LIFTED_MN)
    }

    fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        self.ms = 0;
        self.there_ms = None;
    }

    fn ask(&mut self, phase: Phase, task: ArmTask) {
        self.expected_mn = 0.0;
        self.orders.give(task);
        self.enter(phase);
    }

    fn fail(&mut self, fault: Fault) {
        self.fails(fault, true);
    }

    /// Returns true if `is_it` and this fault is looked for: the arm is ordered to stop then.
    fn fails(&mut self, fault: Fault, is_it: bool) -> bool {
        let fails = is_it && self.guard.looks_for(fault);
        if fails {
            self.ended = None;
            self.ask(Phase::Faulted(fault), ArmTask::Stop);
        }
        fails
    }

    /// One millisecond, with the arm's report in it: sets the samples and their phase, the line of permission
    /// ([`Outputs::lever_enabled`], which an arm's protective stop may hang on), and the order to be sent now.
    pub fn tick(&mut self, inputs: &Inputs, reports: &[ArmReport]) -> (Outputs, Option<ArmOrder>) {
        self.ms = self.ms.saturating_add(1);
        self.there_ms = self.there_ms.map(|ms| ms.saturating_add(1));
        let pdc = inputs.words.iter().flatten();
        for word in pdc.filter(|word| word.channel == Channel::Pdc) {
            self.meter.push(word.counts);
        }
        let mut outputs = Outputs::default();
        match self.watch(inputs) {
            Some(fault) => self.fail(fault),
            None => {
                for report in reports {
                    if let Some(state) = self.orders.hear(*report) {
                        self.heard(state);
                    }
                }
                self.wait();
            }
        }
        self.advance(inputs, &mut outputs);
        outputs.lever_enabled = !matches!(
            self.phase,
            Phase::Faulted(Fault::ArmSilent | Fault::ArmRuns)
        );
        (outputs, self.orders.tick())
    }

    /// Force at which the arm is ordered to stop, mN.
    fn limit_mn(&self) -> f32 {
        let high = self.high_force && self.movement.force_mn() > HIGH_FORCE_MN;
        let most_mn = force_limit_mn(&self.calibration.pressure, high);
        let limit_mn = match self.phase {
            Phase::Parked | Phase::Ready | Phase::Positioning | Phase::Unloaded => {
                IN_AIR_MN + self.expected_mn
            }
            // the arm's task before is unknown
            Phase::Homing => most_mn,
            _ => {
                let (share, mn) = TOO_HARD;
                f32::from(self.movement.force_mn()) * share + mn
            }
        };
        limit_mn.min(most_mn)
    }

    /// The guard's fault, from sensor and force; all else belongs to the arm.
    fn watch(&mut self, inputs: &Inputs) -> Option<Fault> {
        let seen = GuardInputs {
            words: &inputs.words,
            e_stop: false,
            hung: inputs.hung,
            lever_top: false,
            lever_left: false,
            stage_limit: false,
            stage_wanted_mm_s: 0.0,
            stage_mm: 0.0,
            emf_mm_s: 0.0,
        };
        let (limit_mn, mn_per_count) = (
            self.limit_mn(),
            self.calibration.pressure.force_mn_per_count,
        );
        let fault = self
            .guard
            .tick(&seen, &self.meter, self.finger, mn_per_count, limit_mn)?;
        match (self.phase, fault) {
            // before P_DC in the air is known, its height is meaningless
            (_, Fault::ForceHigh) if !self.knows_air() => None,
            (Phase::Faulted(Fault::ArmRuns), _) => None,
            // a stop was ordered, and the arm does not obey
            (Phase::Faulted(_), Fault::ForceHigh) => (self.ms > STOPS_MS).then_some(Fault::ArmRuns),
            (Phase::Parked | Phase::Faulted(_), _) => None,
            (_, fault) => Some(fault),
        }
    }

    fn heard(&mut self, state: ArmState) {
        let there = match (self.phase, state) {
            (Phase::Faulted(_), ArmState::Lifted) => true,
            (Phase::Faulted(_) | Phase::Parked | Phase::Ready, _) => return,
            (_, ArmState::Failed) => return self.fail(Fault::ArmOff),
            (Phase::Pressing, ArmState::Pressed)
            | (Phase::Sliding, ArmState::Steady)
            | (Phase::Homing | Phase::Lifting, ArmState::Lifted) => true,
            (
                Phase::Sliding,
                ArmState::Slid {
                    length_um,
                    speed_um_s,
                },
            ) => return self.slid(length_um, speed_um_s),
            _ => false,
        };
        if there && self.there_ms.is_none() {
            self.there_ms = Some(0);
        }
    }

    fn wait(&mut self) {
        let (most_ms, waited_ms) = match self.phase {
            Phase::Homing | Phase::Lifting => (LIFTS_MS, self.ms),
            Phase::Pressing => (PRESSES_MS, self.ms),
            Phase::Background => (u32::MAX, 0),
            Phase::Sliding => match self.there_ms {
                None => (RAMP_MS, self.ms),
                Some(ms) => {
                    let slide_ms = self.run.slide_ms();
                    (
                        slide_ms + (slide_ms as f32 * SLIDE_SHARE) as u32 + RAMP_MS,
                        ms,
                    )
                }
            },
            Phase::Faulted(fault) => {
                let runs = self.ms > FREE_MS && self.is_pressed();
                if runs && !matches!(fault, Fault::ArmSilent | Fault::ArmRuns) {
                    self.fail(Fault::ArmRuns);
                }
                return;
            }
            _ => return,
        };
        if self.orders.silent_ms() > SILENT_MS {
            self.fail(Fault::ArmSilent);
        } else if waited_ms > most_ms {
            self.fail(Fault::ArmOff);
        }
    }

    /// Returns true if P_DC shows the movement's force.
    fn presses_right(&self, counts: f32) -> bool {
        let mn_per_count = self.calibration.pressure.force_mn_per_count;
        let wanted = f32::from(self.movement.force_mn()) / mn_per_count;
        let (share, more) = FORCE_OFF;
        libm::fabsf(counts - wanted) <= wanted * share + more
    }

    fn advance(&mut self, inputs: &Inputs, outputs: &mut Outputs) {
        let settled = self.there_ms.is_some_and(|ms| ms > 0);
        match self.phase {
            Phase::Homing if settled => self.take_zero_at_home(),
            Phase::Positioning if self.ms >= ZERO_MS => {
                let air = self.meter.no_contact();
                // the finger is on something, or was when its zero was taken
                let far = is_far(self.finger, self.meter.long_mean(), air);
                if self.fails(Fault::ArmOff, far) {
                    return;
                }
                self.meter.zero();
                let press = ArmTask::Press(ArmMovement {
                    force_mn: self.movement.force_mn(),
                    speed_um_s: self.movement.speed_um_s(),
                    length_um: (self.length_mm * 1e3) as u32,
                    start: self.start,
                    approach_um_s: APPROACH_UM_S,
                });
                self.ask(Phase::Pressing, press);
            }
            Phase::Pressing => {
                self.run.press(inputs, self.there_ms.is_none());
                if self.there_ms.is_some_and(|ms| ms >= SETTLE_MS) {
                    let right = self.presses_right(self.meter.counts());
                    if self.fails(Fault::ArmOff, !right) {
                        return;
                    }
                    self.run.hold();
                    self.meter.begin_long();
                    self.enter(Phase::Background);
                }
            }
            Phase::Background => {
                self.run.still(inputs, outputs);
                if self.ms >= BACKGROUND_MS {
                    self.still = self.meter.long_counts().unwrap_or_default();
                    let right = self.presses_right(self.still);
                    if self.fails(Fault::ArmOff, !right) {
                        return;
                    }
                    self.meter.begin_long();
                    self.ask(Phase::Sliding, ArmTask::Slide);
                }
            }
            Phase::Sliding => {
                if let Some(ms) = self.there_ms {
                    if ms == 0 {
                        self.there_ms = Some(1);
                        self.meter.begin_long();
                    }
                    self.run.slid(ms.max(1), 0.0, inputs, outputs);
                    // the arm's controller may know the shear, the probe does not
                    outputs.shear_mn = None;
                }
            }
            Phase::Unloaded if self.ms >= AIR_MS => {
                self.air = self.meter.long_mean();
                self.ended = Some(Ended::Whole);
                self.enter(Phase::Ready);
            }
            Phase::Lifting if settled => {
                if !self.is_pressed() {
                    self.orders.close();
                    self.enter(if self.zeroed {
                        Phase::Ready
                    } else {
                        Phase::Parked
                    });
                } else if self.there_ms.is_some_and(|ms| ms > RELEASE_MS) {
                    self.fail(Fault::ArmOff);
                }
            }
            Phase::Faulted(_) if self.is_free() => self.orders.close(),
            _ => {}
        }
        if outputs.sample_phase == SamplePhase::Nothing {
            outputs.pac.clear();
        }
    }

    /// The arm reports the finger as lifted: takes P_DC there as that of no contact, if it is plausible.
    fn take_zero_at_home(&mut self) {
        match self.there_ms {
            Some(1) => self.meter.begin_long(),
            Some(ZERO_MS..) => {
                let calibrated = self.calibration.pressure.pdc_no_contact;
                let mean = self.meter.long_mean();
                let far = is_far(self.finger, mean, calibrated) && self.calibration.air_known;
                if self.fails(Fault::ArmOff, far) {
                    return;
                }
                self.meter.zero();
                self.zeroed = true;
                self.orders.close();
                self.enter(Phase::Ready);
            }
            _ => {}
        }
    }

    /// The arm reports the end of the slide: compares its figures with the movement, with this clock, and with P_DC.
    fn slid(&mut self, length_um: u32, speed_um_s: u32) {
        let off = |made: u32, wanted: f32| libm::fabsf(made as f32 - wanted) > wanted * SLIDE_SHARE;
        let speed = self.movement.speed_um_s() as f32;
        let too_soon = self.run.slide_ms().saturating_sub(LINK_MS);
        let ms = self.there_ms.unwrap_or(0);
        let off = off(length_um, self.length_mm * 1e3) || off(speed_um_s, speed);
        if self.fails(Fault::ArmOff, off || ms < too_soon) {
            return;
        }
        let (mn, share) = SLIDE_OFF;
        let felt = self.meter.long_counts().unwrap_or_default();
        let most = self.finger.counts(mn) + share * self.still;
        if self.fails(Fault::Unsteady, libm::fabsf(felt - self.still) > most) {
            return;
        }
        self.ended = Some(self.run.ended(ms));
        self.ask(Phase::Lifting, ArmTask::Lift);
    }
}

#[cfg(test)]
mod tests;
