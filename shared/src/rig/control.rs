//! One movement from beginning to end: position the stage, press, measure the still finger, slide, lift. [`Control`]
//! joins lever, stage and guard, and is called once a millisecond.
//!
//! It has no input or output of its own: [`Control::tick`] takes the state of the inputs and returns that of the
//! outputs, so that board and simulator run the same code.

use super::ascent::{Ascent, RELEASE_MS, is_far};
use super::calibration::RigCalibration;
use super::fault::Fault;
use super::force::ForceMeter;
use super::guard::{Guard, GuardInputs, Switch, Unguarded, force_limit_mn, may_press};
use super::lever::{Lever, LeverState};
use super::phase::{Ended, HIGH_FORCE_MN, Phase, Refused};
use super::pins::{Inputs, Outputs};
use super::skin::SkinCare;
use super::slide::Run;
use super::stage::{MARGIN_MM, Stage, StageConstants, StageState};
use crate::features::Movement;
use crate::sensor::{FingerModel, pressure::Channel};

/// Time over which the still finger is measured, ms.
pub(crate) const BACKGROUND_MS: u32 = 1000;
/// Speed of the stage while the finger is lifted.
const RETURN_MM_S: f32 = 50.0;
/// The hard stop is nearer than this to where the limit switch opens, mm: it is 4 mm before it.
const BEYOND_MM: f32 = 7.0;
/// Slower than this the stage stands, mm/s.
const STANDS_MM_S: f32 = 0.5;
/// Largest P_DC above its zero that a lifted finger shows, mN.
const LIFTED_MN: f32 = 92.0;
/// Largest difference between the mean force of a slide and that of the still finger before it: mN, and a share.
const SLIDE_OFF: (f32, f32) = (34.5, 0.25);

/// The whole rig.
#[derive(Clone, Debug)]
pub struct Control {
    finger: &'static FingerModel,
    lever: Lever,
    stage: Stage,
    guard: Guard,
    meter: ForceMeter,
    calibration: RigCalibration,
    skin: SkinCare,
    phase: Phase,
    ms: u32,
    ended: Option<Ended>,
    run: Run,
    high_force: bool,
    /// True once P_DC without contact was measured: before that only its rise tells anything about an uncalibrated
    /// finger.
    zeroed: bool,
    /// True once the first zero since homing was compared with the calibration's.
    compared: bool,
    /// P_DC without contact before the fault that the rig recovers from by itself: it must be found again.
    recovered: Option<f32>,
    air: Option<f32>,
    ascent: Ascent,
    /// P_DC above no contact of the still finger, mean of the background.
    still: f32,
    lever_top: Switch,
    stage_left: Switch,
    duty: f32,
}

impl Control {
    /// A rig with such a finger whose position is unknown, with all guards but `unguarded`.
    pub fn new(
        finger: &'static FingerModel,
        constants: StageConstants,
        calibration: RigCalibration,
        unguarded: Unguarded,
    ) -> Self {
        Self {
            finger,
            lever: Lever::new(finger, unguarded),
            stage: Stage::new(constants),
            guard: Guard::new(unguarded),
            meter: ForceMeter::new(calibration.pressure.pdc_no_contact),
            calibration,
            skin: SkinCare::default(),
            phase: Phase::Parked,
            ms: 0,
            ended: None,
            run: Run::NONE,
            high_force: false,
            zeroed: false,
            compared: false,
            recovered: None,
            air: None,
            ascent: Ascent::new(finger),
            still: 0.0,
            lever_top: Switch::default(),
            stage_left: Switch::default(),
            duty: 0.0,
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

    /// Contact force in mN from P_DC, mean over 10 ms.
    pub fn force_mn(&self) -> f32 {
        self.meter.force_mn(&self.calibration.pressure)
    }

    /// Place of the stage by its encoder, mm from its left limit switch.
    pub fn stage_mm(&self) -> f32 {
        self.stage.position_mm()
    }

    pub(crate) fn stage_velocity_mm_s(&self) -> f32 {
        self.stage.velocity_mm_s()
    }

    /// Wear of the skin.
    pub fn skin(&mut self) -> &mut SkinCare {
        &mut self.skin
    }

    /// The constants in use.
    pub fn calibration(&self) -> &RigCalibration {
        &self.calibration
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
        self.ascent.forget();
        self.forget_default();
        Ok(())
    }

    /// Allows forces up to 2 N, the last two rows of the grid of eq. 21, or forbids them. Where P_DC reads too low the
    /// lever presses on: for a rig whose finger yields before 2.2 N, or whose lever is stopped.
    pub fn allow_high_force(&mut self, allow: bool) {
        self.high_force = allow;
    }

    /// Returns true if forces up to 2 N are allowed.
    pub fn high_force(&self) -> bool {
        self.high_force
    }

    /// Another sample lies under the finger and may be thicker: the place of the last contact is forgotten.
    pub fn sample_changed(&mut self) {
        self.lever.forget_contact();
    }

    /// Looks for the limit switches, the lever's first.
    #[inline]
    pub fn home(&mut self) -> Result<(), Refused> {
        match self.phase {
            Phase::Parked | Phase::Ready => {
                self.guard.reset();
                self.lever.home();
                self.stage.forget();
                self.compared = false;
                self.recovered = None;
                let pressure = &self.calibration.pressure;
                let air = self
                    .calibration
                    .air_known
                    .then_some(pressure.pdc_no_contact);
                if self.ascent.begin(self.meter.mean(), air) {
                    self.forget_default();
                }
                self.enter(Phase::Homing);
                Ok(())
            }
            Phase::Faulted(fault) => Err(Refused::Fault(fault)),
            _ => Err(Refused::Busy),
        }
    }

    /// Ends a fault and homes without a person. P_DC in the air must be within 40 counts of its value before: a finger
    /// that has drifted further, and would drift on, is [`Fault::LeverNotHome`].
    #[inline]
    pub fn recover(&mut self) -> Result<(), Refused> {
        let before = self.zeroed.then(|| self.meter.no_contact());
        self.reset()?;
        self.home()?;
        self.recovered = before;
        Ok(())
    }

    /// Returns true if this finger's P_DC without contact was never measured: the default says nothing about it.
    fn knows_only_default(&self) -> bool {
        !self.zeroed && !self.calibration.air_known
    }

    fn forget_default(&mut self) {
        if self.knows_only_default() {
            self.meter.forget_zero();
        }
    }

    /// Returns true if P_DC at `counts` is implausible for this finger in the air.
    #[inline(never)]
    fn is_pressed(&self, counts: Option<f32>) -> bool {
        let calibrated = self.calibration.pressure.pdc_no_contact;
        let calibrated = self.calibration.air_known.then_some(calibrated);
        // for a finger without calibration, its reading on the way up
        let known = [calibrated.or(self.ascent.lowest()), self.recovered];
        let mut known = known.into_iter().flatten();
        known.any(|air| is_far(self.finger, counts, air))
    }

    /// Makes one movement, beginning at `start`: 0 to 1 of the length that the sample leaves.
    #[inline]
    pub fn start(&mut self, movement: Movement, start: f32) -> Result<(), Refused> {
        self.may_start()?;
        let force_mn = movement.force_mn();
        let pressure = &self.calibration.pressure;
        if !may_press(self.finger, pressure, force_mn, self.high_force) {
            return Err(Refused::Force(force_mn));
        }
        self.run = Run::slide(movement, start, self.stage.constants()).ok_or(Refused::Length)?;
        self.ended = None;
        let (from, _) = self.run.path_mm();
        self.stage.go(from, RETURN_MM_S);
        self.ascent.set_out(self.meter.mean());
        self.enter(Phase::Positioning);
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

    /// Stops the stage and lifts the finger.
    #[inline]
    pub fn stop(&mut self) {
        match self.phase {
            Phase::Positioning
            | Phase::Pressing
            | Phase::Background
            | Phase::Sliding
            | Phase::Unloaded => {
                self.stage.stop();
                self.lever.home();
                self.ended = Some(Ended::Stopped);
                self.enter(Phase::Lifting);
            }
            // the lever continues to its limit switch: that lifts the finger
            Phase::Homing => {
                self.stage.forget();
                self.ended = Some(Ended::Stopped);
                self.enter(Phase::Lifting);
            }
            _ => {}
        }
    }

    /// Ends the current slide, if there is one: the stage brakes as at its end, and the rest is the same. All guards
    /// stay on.
    #[inline]
    pub fn end_slide(&mut self) {
        if self.phase == Phase::Sliding {
            self.stage.brake();
            self.run.cut(self.ms);
        }
    }

    /// Ends a fault. Lever and stage have to be homed again.
    /// Errors: [`Refused::Busy`] while the finger is still being lifted.
    #[inline]
    pub fn reset(&mut self) -> Result<(), Refused> {
        if let Phase::Faulted(fault) = self.phase {
            if !self.is_at_rest() {
                return Err(Refused::Busy);
            }
            self.guard.reset();
            self.stage.stop();
            if fault == Fault::LeverNotHome {
                // its place differs from its steps, and it may be moved by hand now
                self.lever.lose();
            } else {
                self.lever.reset();
            }
            self.ascent.gave_up = false;
            self.enter(Phase::Parked);
        }
        Ok(())
    }

    /// Returns true if nothing moves: ready, parked, or at the end of a fault; a finger that hangs goes up to its
    /// switch later. It is lifted then, unless the fault is [`Fault::LeverNotHome`], or [`Fault::EStop`] and the motors
    /// had no supply.
    pub fn is_at_rest(&self) -> bool {
        match self.phase {
            Phase::Parked => true,
            Phase::Ready => !self.lever.is_parking(),
            Phase::Faulted(_) => self.lever.is_lifted() || self.ascent.gave_up,
            _ => false,
        }
    }

    fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        self.ms = 0;
    }

    #[inline]
    fn fail(&mut self, fault: Fault) {
        self.stage.stop();
        self.lever.home();
        self.ended = None;
        self.enter(Phase::Faulted(fault));
    }

    /// One millisecond.
    #[inline]
    pub fn tick(&mut self, inputs: &Inputs) -> Outputs {
        self.ms = self.ms.saturating_add(1);
        for word in &inputs.words {
            let Some(word) = word else { continue };
            match word.channel {
                Channel::Pac => self.lever.hear(word.counts, &self.calibration.pressure),
                Channel::Pdc => self.meter.push(word.counts),
            }
        }
        if self.phase != Phase::Parked && self.knows_only_default() {
            self.meter.sink();
        }
        let at_top = self.lever_top.tick(inputs.lever_top);
        let at_left = self.stage_left.tick(inputs.stage_limits.0);
        let seeks = self.lever.is_parking() || self.stage.state() == StageState::Unknown;
        // where the lever rests at its switch, a rise of P_DC is a sensor that was mended or a hand, and no lever
        let rests = matches!(self.phase, Phase::Faulted(_)) && self.lever.rests();
        let rise = (!rests).then(|| self.ascent.tick(self.phase, seeks, self.ms, &self.meter));
        let rise = rise.flatten();
        let goes_up = matches!(self.phase, Phase::Homing | Phase::Lifting);
        if let Some(fault) = rise.filter(|_| !(goes_up && self.lever.is_lifted())) {
            self.check(fault);
        }
        match self.watch(inputs) {
            Some(Fault::ForceHigh) if self.phase == Phase::Faulted(Fault::ForceHigh) => {}
            Some(fault @ Fault::LeverNotHome) => self.check(fault),
            Some(fault) => self.fail(fault),
            None => {}
        }
        let mut outputs = Outputs {
            lever_enabled: true,
            stage_enabled: true,
            ..Outputs::default()
        };
        match self.stage.tick(inputs.encoder, at_left) {
            Ok(duty) => outputs.stage_duty = duty,
            Err(fault) => self.check(fault),
        }
        match self.lever.tick(&mut self.meter, inputs.steps, at_top) {
            Ok(rate) => outputs.lever_steps_s = rate,
            Err(fault) => self.check(fault),
        }
        self.advance(inputs, &mut outputs);
        match self.phase {
            Phase::Faulted(fault) => {
                // with its bridge on and no duty the motor is shorted, and brakes
                outputs.stage_duty = 0.0;
                // a driver that steps on its own must lose its current. Once the finger is lifted, nothing more may
                // happen.
                let released = fault != Fault::ForceHigh || self.ms > RELEASE_MS;
                outputs.lever_enabled = released && !self.is_at_rest();
                if !outputs.lever_enabled {
                    outputs.lever_steps_s = 0;
                }
            }
            Phase::Parked => outputs = Outputs::default(),
            _ => {}
        }
        self.duty = outputs.stage_duty;
        outputs
    }

    /// A fault that lever or stage have found themselves. A finger that cannot be lifted is worse than the fault that
    /// it was to be lifted for.
    #[inline]
    fn check(&mut self, fault: Fault) {
        if !self.guard.looks_for(fault) {
            return;
        }
        if fault == Fault::LeverNotHome {
            self.ascent.gave_up = true;
            // the emergency stop itself has taken the lever's supply
            if self.phase != Phase::Faulted(Fault::EStop) {
                self.fail(fault);
            }
        } else if !matches!(self.phase, Phase::Faulted(_)) {
            self.fail(fault);
        }
    }

    #[inline]
    fn watch(&mut self, inputs: &Inputs) -> Option<Fault> {
        let moving = match self.stage.state() {
            StageState::Moving(profile) => profile.velocity_mm_s(),
            _ => 0.0,
        };
        let seen = GuardInputs {
            words: &inputs.words,
            e_stop: inputs.e_stop,
            hung: inputs.hung,
            lever_top: inputs.lever_top && self.lever.is_down(inputs.steps),
            lever_left: !inputs.lever_top && self.lever.is_at_switch(),
            // off a switch it may always go
            stage_limit: (moving < 0.0 && inputs.stage_limits.0)
                || (moving > 0.0 && inputs.stage_limits.1),
            stage_wanted_mm_s: moving,
            stage_mm: self.stage.position_mm(),
            emf_mm_s: self
                .stage
                .constants()
                .emf_speed_mm_s(self.duty, inputs.current_a),
        };
        let pressure = &self.calibration.pressure;
        let high = self.high_force && self.run.movement().force_mn() > HIGH_FORCE_MN;
        let limit_mn = force_limit_mn(pressure, high);
        let mn_per_count = pressure.force_mn_per_count;
        let fault = self
            .guard
            .tick(&seen, &self.meter, self.finger, mn_per_count, limit_mn)?;
        // a sensor that is switched off is no fault of an idle rig; too much force always is
        let idle = matches!(self.phase, Phase::Parked | Phase::Faulted(_));
        (!idle || (fault == Fault::ForceHigh && self.phase != Phase::Parked)).then_some(fault)
    }

    #[inline]
    fn advance(&mut self, inputs: &Inputs, outputs: &mut Outputs) {
        let moves = outputs.lever_steps_s != 0 || self.phase != Phase::Pressing;
        self.run.press(inputs, moves);
        match self.phase {
            Phase::Parked | Phase::Faulted(_) => {}
            Phase::Ready if self.lever.wait() => self.ascent.set_out(self.meter.mean()),
            Phase::Ready => {}
            Phase::Homing if self.lever.is_lifted() => self.home_stage(inputs),
            Phase::Homing => {}
            Phase::Positioning => {
                if self.stage.state() == StageState::Standing && !self.lever.is_parking() {
                    let target = f32::from(self.run.movement().force_mn())
                        / self.calibration.pressure.force_mn_per_count;
                    if self.lever.press(target) {
                        self.enter(Phase::Pressing);
                    } else {
                        // the finger is not lifted after all steps of the lever: now it will be
                        self.fail(Fault::LeverSlips);
                    }
                }
            }
            Phase::Pressing => {
                if let zero @ Some(_) = self.lever.zero()
                    && self.lever.state() != LeverState::Zeroing
                {
                    self.zeroed = true;
                    let first = !core::mem::replace(&mut self.compared, true);
                    if first && self.is_pressed(zero) {
                        self.check(Fault::LeverNotHome);
                    }
                    self.ascent.zero(self.meter.no_contact());
                }
                if self.phase == Phase::Pressing && self.lever.state() == LeverState::Holding {
                    self.run.hold();
                    self.meter.begin_long();
                    self.enter(Phase::Background);
                }
            }
            Phase::Background => {
                self.run.still(inputs, outputs);
                if self.ms >= BACKGROUND_MS {
                    let (_, to) = self.run.path_mm();
                    self.stage.go(to, self.run.movement().speed_mm_s());
                    self.still = self.meter.long_counts().unwrap_or_default();
                    self.meter.begin_long();
                    self.enter(Phase::Sliding);
                }
            }
            Phase::Sliding => self.advance_slide(inputs, outputs),
            Phase::Unloaded => {
                self.run.weigh_current(self.ms, inputs);
                if self.stage.state() == StageState::Standing {
                    self.ended = Some(Ended::Whole);
                    self.air = self.meter.long_mean();
                    self.enter(Phase::Ready);
                }
            }
            Phase::Lifting => {
                if self.lever.is_lifted() && libm::fabsf(self.stage.velocity_mm_s()) < STANDS_MM_S {
                    // steps that were commanded and not made leave the finger down
                    if self.meter.counts() > self.finger.counts(LIFTED_MN) {
                        self.check(Fault::LeverSlips);
                    } else if self.stage.state() == StageState::Unknown {
                        self.lever.reset();
                        self.enter(Phase::Parked);
                    } else {
                        self.enter(Phase::Ready);
                    }
                }
            }
        }
    }

    /// The way of the stage to its switch and off it, once the finger is lifted.
    #[inline]
    fn home_stage(&mut self, inputs: &Inputs) {
        match self.stage.state() {
            // a switch with a broken wire is closed everywhere: do not drag the finger along
            StageState::Unknown => {
                let mean = self.meter.mean();
                if self.is_pressed(mean) {
                    self.check(Fault::LeverNotHome);
                }
                // before there are 10 ms of P_DC nothing is known; the guard sees to it that they come
                let known = mean.is_some() || !self.calibration.air_known;
                if known && self.phase == Phase::Homing {
                    self.stage.home();
                }
            }
            StageState::Standing if self.stage.position_mm() < MARGIN_MM / 2.0 => {
                self.stage.go(MARGIN_MM, RETURN_MM_S);
            }
            // it stood beyond the switch, towards its hard stop: the origin is where the switch opens
            StageState::Standing if self.stage.is_searched() && inputs.stage_limits.0 => {
                let to = self.stage.position_mm() + MARGIN_MM;
                if to > BEYOND_MM {
                    self.check(Fault::StageNotHome);
                }
                self.stage.go(to, RETURN_MM_S);
            }
            StageState::Standing if self.stage.is_searched() => self.stage.home(),
            StageState::Standing => self.enter(Phase::Ready),
            _ => {}
        }
    }

    #[inline]
    fn advance_slide(&mut self, inputs: &Inputs, outputs: &mut Outputs) {
        let speed_mm_s = self.run.movement().speed_mm_s();
        let shear_n = self.calibration.shear_n(inputs.current_a, speed_mm_s);
        self.run.slid(self.ms, shear_n, inputs, outputs);
        self.skin
            .slid(shear_n, self.force_mn() * 1e-3, self.stage.velocity_mm_s());
        if self.stage.state() == StageState::Standing {
            let felt = self.meter.long_counts().unwrap_or_default();
            let (mn, share) = SLIDE_OFF;
            let most = self.finger.counts(mn) + share * self.still;
            if libm::fabsf(felt - self.still) > most {
                self.check(Fault::Unsteady);
            }
        }
        if self.phase == Phase::Sliding && self.stage.state() == StageState::Standing {
            let ended = self.run.ended(self.ms);
            self.ended = Some(if self.guard.looks_for(Fault::SlideGap) {
                ended
            } else {
                Ended::Whole
            });
            self.lever.lift(inputs.steps);
            self.enter(Phase::Lifting);
        }
    }
}

mod lifted;
#[cfg(test)]
mod tests;
