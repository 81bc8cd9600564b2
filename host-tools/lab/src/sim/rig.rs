//! The simulated rig: the world of [`tactus_world`] at one end of the pins, the core's [`Control`] at the other, and
//! the work of the board's timers in between, in virtual time.

use std::time::Duration;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::features::{Blocks, Movement, PropertySet, SamplePhase, Slide};
use tactus_core::probe::RigState;
use tactus_core::rig::calibration::{RigCalibration, RigCalibrationError};
use tactus_core::rig::control::Control;
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::pins::{Inputs, Outputs};
use tactus_core::rig::stage::StageConstants;
use tactus_core::rig::timeout::{MovementTimeout, Wait};
use tactus_core::rig::{Ended, Enough, Fault, MAX_REJECTED, Phase, Refused, Rig, RigError};
use tactus_core::sensor::biotac;
use tactus_core::sensor::pressure::{Channel, Pressure, RATE_HZ, SLOTS_HZ};
use tactus_core::sensor::slot::Unexpected;

use crate::data::recording::Recording;
use tactus_world::conditions::Conditions;
use tactus_world::slot::Reader;
use tactus_world::world::{Setup, World};

/// Largest force that the finger ever bears, N.
pub const FORCE_LIMIT_N: f64 = 2.2;
const TICK_NS: u64 = 1_000_000;
const PULSE_NS: u64 = 5_000;
const DIR_NS: u64 = 2_000;

/// Motor current amplifier of the reference board: 1 V/A about half of 3.3 V, 12 bits.
fn amperes(adc: u16) -> f32 {
    (f32::from(adc) - 2048.0) * (3.3 / 4096.0)
}

/// Reasons why the simulated rig did not make a movement.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SimError {
    /// It was refused.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// A fault was seen.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// It was stopped.
    #[error("stopped")]
    Stopped,
    /// It did not end in two minutes of virtual time.
    #[error("the rig hangs in {0:?}")]
    Hangs(Phase),
    /// A calibration failed.
    #[error(transparent)]
    Calibration(#[from] RigCalibrationError),
    /// The sensor does not identify itself.
    #[error(transparent)]
    Sensor(#[from] biotac::PropertyError),
    /// A part of the finger does not start.
    #[error(transparent)]
    Part(#[from] Unexpected),
}

/// The board's timers between control and world: sensor slots, step pulses, the 1 kHz tick.
pub struct SimRig {
    world: World,
    reader: Reader,
    started: bool,
    control: Control,
    random: ChaCha8Rng,
    now_ns: u64,
    slot: u64,
    words: Vec<Option<Pressure>>,
    steps: i32,
    rate: i32,
    down: bool,
    next_step_ns: u64,
    outputs: Outputs,
    current_a: f32,
    pdc: Vec<u16>,
    performed: Vec<Performed>,
}

/// The ground truth of a slide, which the control does not know.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Performed {
    /// Contact force when the slide began, N.
    pub force_n: f64,
    /// Largest contact force since the lever came down, N.
    pub force_max_n: f64,
    /// Mean speed of the steady part, mm/s.
    pub speed_mm_s: f64,
    /// Duration of that, s.
    pub steady_s: f64,
    /// Largest relative deviation of the mean speed of any 100 ms of the steady part.
    pub speed_error: f64,
}

impl SimRig {
    /// A rig at power-up, its guards all on, with the reference constants in place of measured ones.
    pub fn new(setup: Setup) -> Self {
        Self::unguarded(setup, Unguarded::default())
    }

    /// As [`SimRig::new`], with a guard switched off: for tests.
    pub fn unguarded(setup: Setup, unguarded: Unguarded) -> Self {
        Self::of(World::new(setup), setup, unguarded)
    }

    /// As [`SimRig::unguarded`], in a world under these conditions.
    pub fn under(setup: Setup, conditions: Conditions, unguarded: Unguarded) -> Self {
        Self::of(World::under(setup, conditions), setup, unguarded)
    }

    fn of(world: World, setup: Setup, unguarded: Unguarded) -> Self {
        let reader = Reader::new(setup.finger);
        let model = reader.model();
        let calibration = RigCalibration::unmeasured(model);
        Self {
            world,
            started: reader.start().is_empty(),
            reader,
            control: Control::new(model, StageConstants::REFERENCE, calibration, unguarded),
            random: ChaCha8Rng::seed_from_u64(setup.trial_seed),
            now_ns: 0,
            slot: 0,
            words: Vec::new(),
            steps: 0,
            rate: 0,
            down: true,
            next_step_ns: 0,
            outputs: Outputs::default(),
            current_a: 0.0,
            pdc: Vec::new(),
            performed: Vec::new(),
        }
    }

    /// The ground truth of every slide so far.
    pub fn performed(&self) -> &[Performed] {
        &self.performed
    }

    /// Sensor slots since power-up.
    pub fn slots(&self) -> u64 {
        self.slot
    }

    /// The world behind the pins: its truth, its faults.
    pub fn world(&mut self) -> &mut World {
        &mut self.world
    }

    /// Gravity along the finger by its decoder, counts of P_AC: see [`tactus_core::sensor::AnyFinger::gravity`].
    pub fn gravity(&self) -> Option<f32> {
        self.reader.gravity()
    }

    /// The control at the other end.
    pub fn control(&mut self) -> &mut Control {
        &mut self.control
    }

    /// State of the rig, as a probe shows it; the caller remembers the end of the last movement.
    pub fn state(&mut self, ended: Option<Ended>) -> RigState {
        RigState::of(&mut self.control, self.steps, self.current_a, ended)
    }

    /// Virtual time since power-up.
    pub fn now(&self) -> Duration {
        Duration::from_nanos(self.now_ns)
    }

    /// P_DC words of the last tick.
    pub fn pdc(&self) -> &[u16] {
        &self.pdc
    }

    /// The last outputs of the control.
    pub fn outputs(&self) -> &Outputs {
        &self.outputs
    }

    /// Puts another texture under the lifted finger.
    /// Errors: [`Refused::Busy`] while the finger is down.
    pub fn place(&mut self, texture: u8) -> Result<(), SimError> {
        self.world.place(texture).map_err(|_| Refused::Busy)?;
        self.control.sample_changed();
        Ok(())
    }

    /// One millisecond: the slots and steps in it, then the control.
    pub fn tick(&mut self) -> &Outputs {
        let end = self.now_ns + TICK_NS;
        let mut slot_ns = self.slot_ns();
        loop {
            let step_ns = if self.rate == 0 {
                u64::MAX
            } else {
                self.next_step_ns
            };
            if slot_ns.min(step_ns) >= end {
                break;
            }
            if slot_ns <= step_ns {
                self.sample(slot_ns);
                slot_ns = self.slot_ns();
            } else {
                self.step(step_ns);
            }
        }
        self.world.advance_to(end);
        self.now_ns = end;
        let pdc = self
            .words
            .iter()
            .flatten()
            .filter(|w| w.channel == Channel::Pdc);
        self.pdc = pdc.map(|w| w.counts.get()).collect();
        let stage_limits = self.world.stage_limits();
        let inputs = Inputs {
            words: self.words.drain(..).collect(),
            steps: self.steps,
            encoder: self.world.encoder(),
            current_a: amperes(self.world.motor_adc()),
            lever_top: self.world.lever_top(),
            stage_limits,
            e_stop: self.world.e_stop(),
            hung: false,
        };
        self.current_a = inputs.current_a;
        self.outputs = self.control.tick(&inputs);
        self.world.lever_enable(end, self.outputs.lever_enabled);
        self.world.stage_enable(end, self.outputs.stage_enabled);
        self.world.stage_pwm(end, self.outputs.stage_duty.into());
        self.set_rate(self.outputs.lever_steps_s);
        &self.outputs
    }

    /// Time of the next slot, from a timer of 4400 Hz: no drift, and no overflow.
    fn slot_ns(&self) -> u64 {
        let hz = u64::from(SLOTS_HZ);
        let (seconds, slot) = (self.slot / hz, self.slot % hz);
        seconds * 1_000_000_000 + slot * 1_000_000_000 / hz
    }

    fn sample(&mut self, at_ns: u64) {
        let slot = self.slot;
        self.slot += 1;
        if !self.started {
            self.words.push(None);
            return;
        }
        let mut reader = self.reader.clone();
        let word = reader.word_of_slot(slot, at_ns, |transfer, mosi, miso| {
            // steps that fall due in the gap are made in it
            while self.rate != 0 && self.next_step_ns < transfer.begins_ns {
                self.step(self.next_step_ns);
            }
            self.world.transfer(transfer, mosi, miso);
        });
        self.reader = reader;
        self.words.push(word);
    }

    fn step(&mut self, at_ns: u64) {
        let down = self.rate > 0;
        if down != self.down {
            self.down = down;
            self.world.lever_dir(at_ns.saturating_sub(DIR_NS), down);
        }
        self.world.lever_step(at_ns, true);
        self.world.lever_step(at_ns + PULSE_NS, false);
        self.steps += if down { 1 } else { -1 };
        self.next_step_ns = at_ns + 1_000_000_000 / u64::from(self.rate.unsigned_abs());
    }

    fn set_rate(&mut self, rate: i32) {
        if rate != self.rate {
            self.rate = rate;
            if rate != 0 {
                self.next_step_ns = self.now_ns + 1_000_000_000 / u64::from(rate.unsigned_abs());
            }
        }
    }

    /// Runs the rig until it is at rest: ready, parked or faulted with the finger off the sample.
    /// Errors: the fault that it came to, or that it never came to rest.
    pub fn rest(&mut self, mut each: impl FnMut(&Outputs)) -> Result<(), SimError> {
        let mut timeout = MovementTimeout::default();
        let mut hung = Phase::Parked;
        loop {
            each(self.tick());
            let phase = self.control.phase();
            match (timeout.wait(1, self.control.is_at_rest()), phase) {
                (Wait::On, _) => {}
                (Wait::Stop, _) => {
                    hung = phase;
                    self.control.stop();
                }
                (Wait::Over | Wait::Hangs, Phase::Faulted(fault)) if self.control.is_at_rest() => {
                    return Err(fault.into());
                }
                (Wait::Over, _) => return Ok(()),
                (Wait::Hangs, _) => return Err(SimError::Hangs(hung)),
            }
        }
    }

    /// Powers up: waits for the sensor, finds the limit switches.
    pub fn home(&mut self) -> Result<(), SimError> {
        for _ in 0..=self.reader.power_up_ms() {
            self.tick();
        }
        self.start_finger()?;
        self.control.home()?;
        self.rest(|_| ())
    }

    /// Does the finger's start-up list, if it has not been done.
    /// Errors: A part does not answer as it must; it may be tried again.
    pub(crate) fn start_finger(&mut self) -> Result<(), SimError> {
        if self.started {
            return Ok(());
        }
        let world = &mut self.world;
        let ended_ns = self.reader.start_up(self.now_ns, |transfer, mosi, miso| {
            world.transfer(transfer, mosi, miso);
        })?;
        self.started = true;
        while self.now_ns < ended_ns {
            self.tick();
        }
        // until each channel has been heard
        for _ in 0..10 {
            self.tick();
        }
        Ok(())
    }

    /// Makes one movement, beginning at `start` (0 to 1 of the length that the sample leaves); `each` gets the outputs
    /// of every tick.
    /// Errors: see [`SimError`]. The stage stands then, and the finger is lifted.
    pub fn slide(
        &mut self,
        movement: Movement,
        start: f32,
        mut each: impl FnMut(&Outputs, &[u16]),
    ) -> Result<Ended, SimError> {
        self.slide_until(movement, start, |outputs, pdc| {
            each(outputs, pdc);
            false
        })
    }

    /// As [`SimRig::slide`]; the slide ends early when `each` returns so.
    fn slide_until(
        &mut self,
        movement: Movement,
        start: f32,
        mut each: impl FnMut(&Outputs, &[u16]) -> bool,
    ) -> Result<Ended, SimError> {
        self.control.start(movement, start)?;
        self.world.reset_extremes();
        let mut timeout = MovementTimeout::default();
        let mut truth = Performed::default();
        let mut speeds = Vec::new();
        loop {
            self.tick();
            if each(&self.outputs, &self.pdc) {
                self.control.end_slide();
            }
            let now = self.world.truth();
            truth.force_max_n = now.force_max_n;
            match &self.outputs.sample_phase {
                SamplePhase::Still => truth.force_n = now.force_n,
                SamplePhase::Begin(_) | SamplePhase::Slide if self.outputs.shear_mn.is_some() => {
                    speeds.push(now.speed_mm_s)
                }
                _ => {}
            }
            match self.control.phase() {
                Phase::Ready => break,
                Phase::Faulted(_) => self.rest(|_| ())?,
                phase => {
                    if timeout.wait(1, false) == Wait::Stop {
                        self.control.stop();
                        self.rest(|_| ())?;
                        return Err(SimError::Hangs(phase));
                    }
                }
            }
        }
        if !speeds.is_empty() {
            let mean = |speeds: &[f64]| speeds.iter().sum::<f64>() / speeds.len() as f64;
            let wanted = f64::from(movement.speed_um_s()) * 1e-3;
            truth.speed_mm_s = mean(&speeds);
            truth.steady_s = speeds.len() as f64 * 1e-3;
            let off = speeds
                .windows(100.min(speeds.len()))
                .map(|w| (mean(w) / wanted - 1.0).abs());
            truth.speed_error = off.fold(0.0, f64::max);
        }
        self.performed.push(truth);
        match self.control.take_ended() {
            Some(Ended::Stopped) | None => Err(SimError::Stopped),
            Some(ended) => Ok(ended),
        }
    }

    /// Makes one movement and records it; repeats a slide with a gap, and one that failed with an error that the rig
    /// recovers from by itself. Texture and number are left at 0.
    pub fn record(&mut self, movement: Movement) -> Result<Recording, SimError> {
        let mut failed = SimError::from(Fault::Rejected);
        for _ in 0..MAX_REJECTED {
            let (mut blocks, mut taken, mut pdc) = (Blocks::default(), Vec::new(), Vec::new());
            // the first tick of a slide is its first millisecond
            let mut ms = 1;
            let start = self.random.random();
            let no_contact = self.control.calibration().pressure.pdc_no_contact as i16;
            let ended = self.slide(movement, start, |outputs, words| {
                let (phase, pac) = (&outputs.sample_phase, &outputs.pac);
                taken.extend(blocks.put(phase, pac, outputs.shear_mn));
                if let SamplePhase::Begin(_) | SamplePhase::Slide = phase {
                    pdc.extend(words.iter().map(|&counts| counts as i16 - no_contact));
                    ms += 1;
                }
            });
            taken.push(blocks.end(0));
            match ended {
                Ok(Ended::Whole) => {
                    let slide = Recording::from_blocks(movement, taken, pdc, RATE_HZ.into(), ms);
                    return slide.ok_or(failed);
                }
                Ok(_) => {}
                Err(why) if self.go_on(&why) => failed = why,
                Err(why) => return Err(why),
            }
        }
        Err(failed)
    }

    /// Returns true if the rig can continue after this failure; it has homed then, if it had to.
    fn go_on(&mut self, failed: &SimError) -> bool {
        match *failed {
            SimError::Refused(why) => RigError::from(why).is_of_the_movement(),
            SimError::Fault(fault) if fault.is_of_the_movement() => {
                self.control.recover().is_ok() && self.rest(|_| ()).is_ok()
            }
            _ => false,
        }
    }
}

impl Rig for SimRig {
    type Error = SimError;

    fn measures(&self) -> PropertySet {
        PropertySet::ALL
    }

    async fn perform(&mut self, slide: &mut Slide<'_>) -> Result<(), SimError> {
        self.perform_until(slide, &mut |_| false).await
    }

    async fn perform_until(
        &mut self,
        slide: &mut Slide<'_>,
        enough: Enough<'_>,
    ) -> Result<(), SimError> {
        if self.control.phase() == Phase::Parked {
            self.home()?;
        }
        let start = self.random.random();
        let mut blocks = Blocks::default();
        let mut over = false;
        let ended = self.slide_until(slide.movement(), start, |outputs, _| {
            let (phase, pac) = (&outputs.sample_phase, &outputs.pac);
            let Some(block) = blocks.put(phase, pac, outputs.shear_mn) else {
                return false;
            };
            if over {
                return false;
            }
            slide.take(&block);
            over = !block.still && enough(slide);
            over
        })?;
        let lost = match ended {
            Ended::Gap(samples) => samples,
            _ => 0,
        };
        if over {
            slide.lose(lost);
        } else {
            slide.take(&blocks.end(lost));
        }
        Ok(())
    }

    async fn recover(&mut self, failed: &SimError) -> bool {
        self.go_on(failed)
    }
}

mod measuring;
#[cfg(test)]
mod tests;
