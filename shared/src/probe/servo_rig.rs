//! The rig that a servo moves, a thousand times a second, as a probe sees it: one movement after the other, its samples
//! into the features.

use embedded_storage_async::nor_flash::NorFlash;
use heapless::Vec;

use super::calibrate;
use super::explore::Random;
use super::seams::{RigHandle, UnloadedRun};
use super::status::RigState;
use crate::features::{Block, Blocks, Movement, PropertySet, SamplePhase, Slide};
use crate::rig::calibration::RigCalibration;
use crate::rig::control::Control;
use crate::rig::over_link::RigOverLink;
use crate::rig::pins::Outputs;
use crate::rig::skin::SkinCare;
use crate::rig::timeout::{MovementTimeout, Wait};
use crate::rig::turning::{Turned, Turning};
use crate::rig::weigh::{LOOKS_HZ, Weighing};
use crate::rig::{Ended, Enough, Phase, Refused, Rig, RigError, most_mn};
use crate::store::Store;
use crate::wire::{Event, Failure, MemoryError, Prompt};

/// Interval of the looks at the samples, ms.
pub const LOOK_MS: u32 = 10;
const _: () = assert!(LOOK_MS * LOOKS_HZ == 1000);
/// While a finger is turned over so much may press on it, mN: a hand takes it off its mount, and its tip's weight
/// turns, too.
const TURNED_MN: u16 = 1000;
/// A weight is waited for as long, looks.
const PATIENCE: u32 = 60 * LOOKS_HZ;

/// A command to the servo.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum RigCommand {
    /// Lifts the finger to its limit switch, and leaves the stage alone.
    Lift,
    /// Ends a fault if there is one, then finds the limit switches.
    Home,
    /// The same without a person: see [`Control::recover`].
    Recover,
    /// A movement, and where on the sample it begins, 0 to 1.
    Start(Movement, f32),
    /// A run without load at this speed, um/s.
    StartUnloaded(u32),
    /// Uses this calibration.
    Calibrate(RigCalibration),
    /// True if movements may press with up to 2 N.
    AllowHighForce(bool),
    /// A person is asked to lay a weight of so many mN on the lifted finger; 0, none is expected any more.
    Weigh(u16),
    /// Another sample may lie under the finger.
    SampleChanged,
    /// Goes on from this wear of the skin.
    Skin(SkinCare),
}

impl RigCommand {
    /// Has the control do it.
    pub fn apply(self, control: &mut Control) -> Result<(), Refused> {
        match self {
            Self::Home => {
                control.reset()?;
                control.home()
            }
            Self::Recover => control.recover(),
            Self::Lift => {
                control.home()?;
                control.stop();
                Ok(())
            }
            Self::Start(movement, start) => control.start(movement, start),
            Self::StartUnloaded(speed_um_s) => control.start_unloaded(speed_um_s),
            Self::Calibrate(calibration) => control.calibrate(calibration),
            Self::AllowHighForce(allow) => {
                control.allow_high_force(allow);
                Ok(())
            }
            Self::Weigh(mn) => control.weigh(mn),
            Self::SampleChanged => {
                control.sample_changed();
                Ok(())
            }
            Self::Skin(skin) => {
                *control.skin() = skin;
                Ok(())
            }
        }
    }
}

impl RigCommand {
    /// Has a rig do it that an arm moves.
    pub fn apply_over_link(self, rig: &mut RigOverLink) -> Result<(), Refused> {
        match self {
            Self::Home | Self::Recover => {
                rig.reset()?;
                rig.home()
            }
            Self::Lift => rig.home(),
            Self::Start(movement, start) => rig.start(movement, start),
            Self::StartUnloaded(_) => rig.measure_air(),
            Self::Calibrate(calibration) => rig.calibrate(calibration),
            Self::AllowHighForce(allow) => {
                rig.allow_high_force(allow);
                Ok(())
            }
            Self::Weigh(mn) => rig.weigh(mn),
            Self::SampleChanged => Ok(()),
            Self::Skin(skin) => {
                *rig.skin() = skin;
                Ok(())
            }
        }
    }
}

/// A tick's samples, or some of them.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Samples {
    /// The phase that they belong to.
    pub sample_phase: SamplePhase,
    /// P_AC, counts about the still finger's.
    pub pac: Vec<i16, 8>,
    /// Shear, mN.
    pub shear_mn: Option<i16>,
}

impl Samples {
    /// Gives a tick's samples to `put`, in as many parts as they take; none outside a movement's sampling.
    pub fn of(outputs: &Outputs, mut put: impl FnMut(Self)) {
        if outputs.sample_phase == SamplePhase::Nothing {
            return;
        }
        let mut part = Self {
            sample_phase: outputs.sample_phase.clone(),
            pac: Vec::new(),
            shear_mn: outputs.shear_mn,
        };
        for &sample in &outputs.pac {
            if part.pac.push(sample).is_err() {
                let sample_phase = match part.sample_phase {
                    SamplePhase::Still => SamplePhase::Still,
                    _ => SamplePhase::Slide,
                };
                let next = Self {
                    sample_phase,
                    ..Self::default()
                };
                put(core::mem::replace(&mut part, next));
                let _ = part.pac.push(sample);
            }
        }
        put(part);
    }
}

/// The runner of [`Control`], which hands on its samples.
#[allow(async_fn_in_trait)] // no executor of this project moves tasks between threads
pub trait Servo {
    /// True if it has a stage of ours, whose motor's current is the shear; otherwise an arm moves the finger.
    fn has_stage(&self) -> bool {
        true
    }

    /// Gives a command and waits for the answer. Samples from before the command are dropped.
    async fn command(&mut self, command: RigCommand) -> Result<(), Refused>;

    /// Waits for the end of a slide, [`LOOK_MS`] at most.
    async fn wait(&mut self);

    /// True if the board's button is pressed; `None` on a board without one.
    fn pressed(&self) -> Option<bool> {
        None
    }

    /// The state after the last tick.
    fn state(&self) -> RigState;

    /// The oldest samples that nobody has taken.
    fn samples(&mut self) -> Option<Samples>;

    /// Gravity along the finger, counts of P_AC; `None` from a finger that does not feel it.
    fn gravity(&self) -> Option<f32> {
        None
    }

    /// Samples since boot that were dropped because a queue to the session was full.
    fn lost(&self) -> u32;

    /// Stops what is being done now: the stage stands, the finger is lifted.
    fn stop(&mut self);

    /// Ends the slide that is being made, if one is: see [`Control::end_slide`].
    fn end_slide(&mut self);

    /// True if the whole request is stopped: nothing further is to begin.
    fn is_stopped(&self) -> bool;

    /// True if raw samples are wanted.
    fn streams(&self) -> bool;

    /// Sends raw samples to the host.
    fn tell(&mut self, event: Event);
}

/// A task of a person at a lifted finger, and its result so far.
enum PersonTask {
    /// To lay a weight of so many mN on it: counts above the air. It is over when the weight was taken away again.
    Weight(u16, Weighing, Option<f32>),
    Turn(Turning, Option<Turned>),
}

impl PersonTask {
    fn prompt(&self) -> Prompt {
        match self {
            Self::Weight(mn, weighing, None) if weighing.wants_weight() => Prompt::Weigh(*mn),
            Self::Weight(..) => Prompt::Lift,
            Self::Turn(turning, _) if turning.wants_turn() => Prompt::TurnOver,
            Self::Turn(..) => Prompt::Still,
        }
    }

    fn look(&mut self, rig: &RigState, gravity: Option<f32>) -> bool {
        let counts = rig.force_mn / rig.calibration.pressure.force_mn_per_count;
        match self {
            Self::Weight(_, weighing, weighed @ None) => *weighed = weighing.take(counts),
            Self::Weight(_, weighing, Some(_)) => return weighing.is_air(counts),
            Self::Turn(turning, turned) => {
                *turned = gravity.and_then(|g| turning.take(g));
                return turned.is_some();
            }
        }
        false
    }
}

/// A rig moved by a servo.
#[derive(Clone, Debug)]
pub struct ServoRig<S> {
    /// The servo.
    pub servo: S,
    random: Random,
}

impl<S: Servo> ServoRig<S> {
    /// A rig that this servo moves.
    pub const fn new(servo: S) -> Self {
        Self {
            servo,
            random: Random::new(1),
        }
    }

    async fn rest(&mut self) -> Result<RigState, RigError> {
        self.until(|rig| rig.at_rest, |_| ()).await
    }

    /// Waits until the rig is as it is to be; `each` is called at least every [`LOOK_MS`], and once more at the end.
    async fn until(
        &mut self,
        over: impl Fn(&RigState) -> bool,
        mut each: impl FnMut(&mut S),
    ) -> Result<RigState, RigError> {
        let mut timeout = MovementTimeout::default();
        loop {
            self.servo.wait().await;
            // before the samples, so that none of a movement that is over is left behind
            let rig = self.servo.state();
            each(&mut self.servo);
            match (timeout.wait(LOOK_MS, over(&rig)), rig.phase) {
                (Wait::On, _) => {}
                (Wait::Stop, _) => self.servo.stop(),
                (Wait::Over | Wait::Hangs, Phase::Faulted(fault)) if rig.at_rest => {
                    return Err(RigError::Fault(fault));
                }
                (Wait::Over, _) => return Ok(rig),
                (Wait::Hangs, _) => return Err(RigError::Hangs),
            }
        }
    }

    /// Lifts the finger to its limit switch; the stage stays where it is.
    pub async fn lift(&mut self) -> Result<(), RigError> {
        self.command(RigCommand::Lift).await?;
        self.rest().await.map(|_| ())
    }

    /// Waits until somebody presses the board's button and lets it go before that: high forces are not allowed over the
    /// line alone, where the board has a button. Errors: nobody does, or the probe is told to stop.
    async fn confirmed(&mut self) -> Result<(), Failure> {
        let mut was_released = false;
        for look in 0..30 * LOOKS_HZ {
            match self.servo.pressed() {
                None => return Ok(()),
                Some(true) if was_released => return Ok(()),
                Some(pressed) => was_released |= !pressed,
            }
            if self.servo.is_stopped() {
                return Err(Failure::Rig(RigError::Stopped));
            }
            if look % LOOKS_HZ == 0 {
                self.servo.tell(Event::Prompt(Prompt::Button));
            }
            self.servo.wait().await;
        }
        Err(Failure::NotPressed)
    }

    /// Lifts the finger, on which a person may press with so many mN, and waits until what they are asked to do is
    /// done.
    async fn with_person(&mut self, mn: u16, asked: &mut PersonTask) -> Result<(), RigError> {
        if self.rest().await?.phase == Phase::Parked {
            self.home().await?;
        }
        self.command(RigCommand::Weigh(mn)).await?;
        let mut done = Err(RigError::NobodyThere);
        for look in 0..PATIENCE {
            if look.is_multiple_of(LOOKS_HZ) {
                self.servo.tell(Event::Prompt(asked.prompt()));
            }
            self.servo.wait().await;
            let rig = self.servo.state();
            if self.servo.is_stopped() {
                done = Err(RigError::Stopped);
                break;
            }
            if let Phase::Faulted(fault) = rig.phase {
                done = Err(RigError::Fault(fault));
                break;
            }
            if asked.look(&rig, self.servo.gravity()) {
                done = Ok(());
                break;
            }
        }
        // what still presses is a press now
        let _ = self.servo.command(RigCommand::Weigh(0)).await;
        done
    }

    /// Has something begun, unless all was stopped.
    async fn command(&mut self, command: RigCommand) -> Result<(), RigError> {
        if self.servo.is_stopped() {
            return Err(RigError::Stopped);
        }
        self.servo
            .command(command)
            .await
            .map_err(RigError::Refused)?;
        // it was stopped in the same millisecond, before it began
        if self.servo.is_stopped() {
            self.servo.stop();
        }
        Ok(())
    }
}

impl<S: Servo> RigHandle for ServoRig<S> {
    fn state(&self) -> RigState {
        self.servo.state()
    }

    async fn begin(&mut self, seed: u32) {
        self.random = Random::new(seed);
        // never refused
        let _ = self.servo.command(RigCommand::SampleChanged).await;
    }

    async fn home(&mut self) -> Result<(), RigError> {
        // the fault is what the user homes after
        let _ = self.rest().await;
        self.command(RigCommand::Home).await?;
        match self.rest().await?.phase {
            Phase::Ready => Ok(()),
            _ => Err(RigError::Stopped),
        }
    }

    async fn run_unloaded(&mut self, speed_um_s: u32) -> Result<UnloadedRun, RigError> {
        let from_mm = self.servo.state().stage_mm;
        self.command(RigCommand::StartUnloaded(speed_um_s)).await?;
        let rig = self.rest().await?;
        match rig.ended {
            Some(Ended::Whole) => Ok(UnloadedRun {
                from_mm,
                to_mm: rig.stage_mm,
                mean_current_a: rig.mean_current_a,
            }),
            _ => Err(RigError::Stopped),
        }
    }

    async fn calibrate(&mut self) -> Result<RigCalibration, Failure> {
        if self.servo.has_stage() {
            calibrate::by_motor(self).await
        } else {
            calibrate::in_air(self).await
        }
    }

    async fn set_calibration(&mut self, calibration: RigCalibration) -> Result<(), RigError> {
        let command = RigCommand::Calibrate(calibration);
        self.servo.command(command).await.map_err(RigError::Refused)
    }

    async fn weigh(&mut self, mn: u16) -> Result<f32, Failure> {
        let scale = self.servo.state().calibration.pressure.force_mn_per_count;
        let mut weight = PersonTask::Weight(mn, Weighing::new(mn, scale), None);
        let done = self.with_person(mn, &mut weight).await;
        done.map_err(Failure::Rig)?;
        match weight {
            PersonTask::Weight(_, _, Some(counts)) => Ok(counts),
            _ => Err(Failure::Rig(RigError::NobodyThere)),
        }
    }

    async fn turn_over(&mut self) -> Result<Turned, Failure> {
        if self.servo.gravity().is_none() {
            return Err(Failure::OtherProbe);
        }
        let mut turn = PersonTask::Turn(Turning::default(), None);
        let done = self.with_person(TURNED_MN, &mut turn).await;
        done.map_err(Failure::Rig)?;
        match turn {
            PersonTask::Turn(_, Some(turned)) => Ok(turned),
            _ => Err(Failure::Rig(RigError::NobodyThere)),
        }
    }

    async fn set_high_force<F: NorFlash>(
        &mut self,
        allow: bool,
        store: Result<&mut Store<F>, MemoryError>,
    ) -> Result<(), Failure> {
        let store = store?;
        if allow {
            self.confirmed().await?;
        }
        let kept = store.set_high_force(allow).await;
        let command = RigCommand::AllowHighForce(allow && kept.is_ok());
        let done = self.servo.command(command).await;
        done.map_err(|why| Failure::Rig(RigError::Refused(why)))?;
        kept.map_err(Failure::from)
    }

    async fn restore_high_force<F: NorFlash>(&mut self, store: &mut Store<F>) {
        let allow = store.high_force().await.unwrap_or(false);
        // never refused
        let _ = self.servo.command(RigCommand::AllowHighForce(allow)).await;
    }

    async fn set_skin(&mut self, skin: SkinCare) {
        // never refused
        let _ = self.servo.command(RigCommand::Skin(skin)).await;
    }
}

impl<S: Servo> Rig for ServoRig<S> {
    type Error = RigError;

    fn measures(&self) -> PropertySet {
        if self.servo.has_stage() {
            PropertySet::ALL
        } else {
            PropertySet::WITHOUT_SHEAR
        }
    }

    fn most_mn(&self) -> u16 {
        most_mn(self.servo.state().high_force)
    }

    async fn perform(&mut self, slide: &mut Slide<'_>) -> Result<(), RigError> {
        self.perform_until(slide, &mut |_| false).await
    }

    async fn perform_until(
        &mut self,
        slide: &mut Slide<'_>,
        enough: Enough<'_>,
    ) -> Result<(), RigError> {
        if self.servo.state().phase == Phase::Parked {
            self.home().await?;
        }
        while self.servo.samples().is_some() {}
        let lost_before = self.servo.lost();
        let start = self.random.next_f32();
        self.command(RigCommand::Start(slide.movement(), start))
            .await?;
        let streams = self.servo.streams();
        let mut over = false;
        let mut take = |servo: &mut S, block: Block, last: bool| {
            if over {
                slide.lose(block.lost);
            } else {
                slide.take(&block);
                over = !last && !block.still && enough(slide);
                if over {
                    servo.end_slide();
                }
            }
            if streams {
                servo.tell(Event::Block(block));
            }
        };
        let mut blocks = Blocks::default();
        let ended = self
            .until(
                |rig| rig.at_rest || rig.ended.is_some(),
                |servo| {
                    while let Some(samples) = servo.samples() {
                        let (phase, pac) = (&samples.sample_phase, &samples.pac);
                        if let Some(block) = blocks.put(phase, pac, samples.shear_mn) {
                            take(servo, block, false);
                        }
                    }
                },
            )
            .await
            .map(|rig| rig.ended);
        let gap = match ended {
            Ok(Some(Ended::Gap(samples))) => samples,
            _ => 0,
        };
        let gap = gap + self.servo.lost().wrapping_sub(lost_before);
        take(&mut self.servo, blocks.end(gap), true);
        match ended? {
            Some(Ended::Whole | Ended::Gap(_)) => Ok(()),
            Some(Ended::Stopped) | None => {
                self.rest().await?;
                Err(RigError::Stopped)
            }
        }
    }

    async fn lifted(&mut self) -> Result<(), RigError> {
        self.rest().await.map(|_| ())
    }

    async fn recover(&mut self, failed: &RigError) -> bool {
        failed.is_of_the_movement()
            && self.command(RigCommand::Recover).await.is_ok()
            && self.rest().await.is_ok()
    }
}

#[cfg(test)]
mod tests;
