//! The simulated rig: the world of [`crate::sim`] at one end of the pins, the core's [`Control`] at the other, and what the
//! board's timers do in between, in virtual time.

use std::convert::Infallible;
use std::time::Duration;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::dsp::Kernels;
use tactus_core::features::{Blocks, Movement, PropertySet, SamplePhase, Slide};
use tactus_core::probe::{RigState, Watch};
use tactus_core::rig::calibration::{LineFit, RigCalibration, RigCalibrationError};
use tactus_core::rig::control::Control;
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::pins::{Inputs, Outputs};
use tactus_core::rig::stage::StageConstants;
use tactus_core::rig::timeout::{MovementTimeout, Wait};
use tactus_core::rig::unloaded::UnloadedRuns;
use tactus_core::rig::{Ended, Fault, MAX_REJECTED, Phase, Refused, Rig, RigError};
use tactus_core::sensor::pressure::{Calibration, Channel, Pressure, RATE_HZ, SLOTS_HZ};
use tactus_core::sensor::{PressureSensor as _, biotac, slot};
use tactus_core::wire::Event;

use crate::data::recording::Recording;
use crate::sim::conditions::Conditions;
use crate::sim::slot::{TRANSFER_NS, word_of_slot};
use crate::sim::world::{Setup, World};

const TICK_NS: u64 = 1_000_000;
/// STEP stays high this long.
const PULSE_NS: u64 = 5_000;
/// DIR is set this long before STEP rises.
const DIR_NS: u64 = 2_000;

/// Motor current amplifier of the reference board: 1 V/A about half of 3.3 V, 12 bits.
fn amperes(adc: u16) -> f32 {
    (f32::from(adc) - 2048.0) * (3.3 / 4096.0)
}

/// Why the simulated rig did not make a movement.
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
    /// Nothing came of it in two minutes of virtual time.
    #[error("the rig hangs in {0:?}")]
    Hangs(Phase),
    /// A calibration came to nothing.
    #[error(transparent)]
    Calibration(#[from] RigCalibrationError),
    /// The sensor does not say what it is.
    #[error(transparent)]
    Sensor(#[from] biotac::PropertyError),
}

/// The board's timers between control and world: sensor slots, step pulses, the 1 kHz tick.
pub struct SimRig {
    world: World,
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
    /// Motor current of the last tick, A.
    current_a: f32,
    /// P_DC words of the last tick.
    pdc: Vec<u16>,
    performed: Vec<Performed>,
    listener: Option<(Watch, Listener)>,
}

/// Hears what a probe with this rig would report of a slide, with the time in ms.
pub type Listener = Box<dyn FnMut(u32, Event) + Send>;

/// How a slide was really made: the world's truth, which the control does not know.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Performed {
    /// Contact force when the slide began, N.
    pub force_n: f64,
    /// Largest contact force since the lever came down, N.
    pub force_max_n: f64,
    /// Mean speed of the steady part, mm/s.
    pub speed_mm_s: f64,
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
        Self::of(World::new(setup), setup.trial_seed, unguarded)
    }

    /// As [`SimRig::unguarded`], in a world under these conditions.
    pub fn under(setup: Setup, conditions: Conditions, unguarded: Unguarded) -> Self {
        Self::of(World::under(setup, conditions), setup.trial_seed, unguarded)
    }

    fn of(world: World, seed: u64, unguarded: Unguarded) -> Self {
        let calibration = RigCalibration {
            pressure: biotac::BioTac::MODEL.calibration,
            unloaded_a: (0.037, 0.0),
            newton_per_ampere: 16.4,
            date: 0,
            air_known: false,
            serial: [0; 16],
        };
        Self {
            world,
            control: Control::new(
                &biotac::BioTac::MODEL,
                StageConstants::REFERENCE,
                calibration,
                unguarded,
            ),
            random: ChaCha8Rng::seed_from_u64(seed),
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
            listener: None,
        }
    }

    /// From now on `listener` hears of every slide: its phases, where the rig is, and the samples.
    pub fn listen(&mut self, listener: Listener) {
        self.listener = Some((Watch::default(), listener));
    }

    /// How every slide so far was really made.
    pub fn performed(&self) -> &[Performed] {
        &self.performed
    }

    /// How every slide was really made since this was asked for last.
    pub fn take_performed(&mut self) -> Vec<Performed> {
        std::mem::take(&mut self.performed)
    }

    /// Sensor slots since power-up.
    pub fn slots(&self) -> u64 {
        self.slot
    }

    /// The world behind the pins: its truth, its faults.
    pub fn world(&mut self) -> &mut World {
        &mut self.world
    }

    /// The control at the other end.
    pub fn control(&mut self) -> &mut Control {
        &mut self.control
    }

    /// What the rig is doing, as a probe shows it; how the last movement ended is for the caller to remember.
    pub fn state(&mut self, ended: Option<Ended>) -> RigState {
        RigState::of(&mut self.control, self.steps, self.current_a, ended)
    }

    /// Virtual time since power-up.
    pub fn now(&self) -> Duration {
        Duration::from_nanos(self.now_ns)
    }

    /// What the control last set the pins to.
    pub fn outputs(&self) -> &Outputs {
        &self.outputs
    }

    /// Puts another texture under the lifted finger.
    ///
    /// # Errors
    /// [`Refused::Busy`] while the finger is down.
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

    /// When the next slot is due, from a timer of 4400 Hz: no drift, and no overflow.
    fn slot_ns(&self) -> u64 {
        let hz = u64::from(SLOTS_HZ);
        let (seconds, slot) = (self.slot / hz, self.slot % hz);
        seconds * 1_000_000_000 + slot * 1_000_000_000 / hz
    }

    /// A slot.
    fn sample(&mut self, at_ns: u64) {
        let slot = self.slot;
        self.slot += 1;
        let word = word_of_slot(slot, at_ns, |begins_ns, mosi, miso| {
            // steps that fall due in the gap are made in it
            while self.rate != 0 && self.next_step_ns < begins_ns {
                self.step(self.next_step_ns);
            }
            self.world.spi(begins_ns, TRANSFER_NS, mosi, miso);
        });
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

    /// Lets the rig go on until it is at rest: ready, parked or faulted with the finger off the sample.
    ///
    /// # Errors
    /// The fault that it came to, or that it never came to rest.
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
    ///
    /// # Errors
    /// See [`SimError`].
    pub fn home(&mut self) -> Result<(), SimError> {
        for _ in 0..=biotac::BioTac::POWER_UP_MS {
            self.tick();
        }
        self.control.home()?;
        self.rest(|_| ())
    }

    /// Measures this rig's motor current without load, and takes it into the calibration.
    ///
    /// # Errors
    /// See [`SimError`].
    pub fn calibrate_current(&mut self) -> Result<RigCalibration, SimError> {
        let mut runs = UnloadedRuns::default();
        while let Some(speed_um_s) = runs.next_speed() {
            let (from, to, current_a) = self.run_unloaded(speed_um_s)?;
            runs.took(from, to, current_a);
        }
        let calibration = runs.finish(self.control.calibration())?;
        self.control.calibrate(calibration)?;
        Ok(calibration)
    }

    /// Where the stage stood before a run over the sample and after it, and its mean motor current.
    fn run_unloaded(&mut self, speed_um_s: u32) -> Result<(f32, f32, Option<f32>), SimError> {
        let from = self.control.stage_mm();
        self.control.start_unloaded(speed_um_s)?;
        self.rest(|_| ())?;
        Ok((from, self.control.stage_mm(), self.control.mean_current_a()))
    }

    /// The sensor's serial number, asked for between two slots.
    ///
    /// # Errors
    /// It is not that of a BioTac.
    pub fn serial(&mut self) -> Result<[u8; 16], SimError> {
        let mut bytes = biotac::IdentityBytes::default();
        for (transactions, place) in bytes.reads() {
            let Ok(answer) = slot::perform(&transactions, |transaction, miso| {
                let duration_ns = TRANSFER_NS / 2 * miso.len() as u64;
                self.world
                    .spi(self.now_ns, duration_ns, transaction.out, miso);
                // the timer of the slots stands meanwhile
                self.now_ns += TICK_NS / 4;
                Ok::<(), Infallible>(())
            });
            biotac::keep(place, &answer);
        }
        let identity = bytes.decode()?;
        let mut serial = [0; 16];
        for (byte, character) in serial.iter_mut().zip(identity.serial.as_str().bytes()) {
            *byte = character;
        }
        Ok(serial)
    }

    /// Measures everything that differs from rig to rig: the motor current without load, newtons per ampere on the
    /// inclined stage, P_DC in the air, and its counts per newton on a force plate. `date` as 20261121.
    ///
    /// # Errors
    /// See [`SimError`].
    pub fn calibrate(&mut self, date: u32) -> Result<RigCalibration, SimError> {
        let serial = self.serial()?;
        let unloaded = self.calibrate_current()?;
        let mut incline = LineFit::default();
        for pull_n in [0.0f32, 1.0, 2.0, 3.0] {
            self.world.incline(pull_n.into());
            for _ in 0..2 {
                // to the right: the way of every slide
                if let (from, to, Some(current_a)) = self.run_unloaded(25_000)?
                    && to > from
                {
                    incline.push(pull_n, current_a);
                }
            }
        }
        self.world.incline(0.0);
        let (_, ampere_per_newton) = incline.line()?;
        // the plate is what lies under the finger, and reads what really presses on it
        let mut plate = LineFit::default();
        for force_mn in [300, 600, 900, 1200] {
            let Ok(movement) = Movement::new(force_mn, 10_000) else {
                continue;
            };
            let mn_per_count = unloaded.pressure.force_mn_per_count;
            self.control.start(movement, 0.0)?;
            while self.control.phase() != Phase::Sliding {
                self.tick();
                if let Phase::Faulted(fault) = self.control.phase() {
                    return Err(fault.into());
                }
            }
            plate.push(
                self.control.force_mn() / mn_per_count,
                (self.world.truth().force_n * 1e3) as f32,
            );
            self.control.stop();
            self.rest(|_| ())?;
        }
        let (_, force_mn_per_count) = plate.line()?;
        let calibration = RigCalibration {
            pressure: Calibration {
                force_mn_per_count,
                ..unloaded.pressure
            },
            newton_per_ampere: 1.0 / ampere_per_newton,
            date,
            serial,
            ..unloaded
        };
        let air = self.control.air_counts();
        let calibration = air.map_or(calibration, |counts| calibration.with_air(counts));
        self.control.calibrate(calibration)?;
        Ok(calibration)
    }

    /// Makes one movement, beginning at `start` (0 to 1 of the room that the sample leaves); `each` sees what every tick
    /// set the pins to.
    ///
    /// # Errors
    /// See [`SimError`]. The stage stands then, and the finger is lifted.
    pub fn slide(
        &mut self,
        movement: Movement,
        start: f32,
        mut each: impl FnMut(&Outputs, &[u16]),
    ) -> Result<Ended, SimError> {
        self.control.start(movement, start)?;
        self.world.reset_extremes();
        let mut timeout = MovementTimeout::default();
        let mut truth = Performed::default();
        let mut speeds = Vec::new();
        loop {
            self.tick();
            each(&self.outputs, &self.pdc);
            let now_ms = self.now_ns / TICK_NS;
            if now_ms.is_multiple_of(Watch::EVERY_MS) && self.listener.is_some() {
                let state = self.state(None);
                if let Some((watch, listener)) = &mut self.listener {
                    watch.look(&state, |event| listener(now_ms as u32, event));
                }
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

    /// Makes one movement and records it; a slide with a gap is repeated, and one that failed in a way that the rig gets over
    /// by itself. Texture and number are left at 0.
    ///
    /// # Errors
    /// See [`SimError`].
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
                    let slide = Recording::from_blocks(movement, taken, pdc, RATE_HZ, ms);
                    return slide.ok_or(failed);
                }
                Ok(_) => {}
                Err(why) if self.go_on(&why) => failed = why,
                Err(why) => return Err(why),
            }
        }
        Err(failed)
    }

    /// Whether the rig can go on after this failure; it has homed then, if it had to.
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

    async fn perform<K: Kernels>(&mut self, slide: &mut Slide<'_, K>) -> Result<(), SimError> {
        if self.control.phase() == Phase::Parked {
            self.home()?;
        }
        let start = self.random.random();
        let (mut blocks, mut taken) = (Blocks::default(), Vec::new());
        let listens = self.listener.is_some();
        let ended = self.slide(slide.movement(), start, |outputs, _| {
            let (phase, pac) = (&outputs.sample_phase, &outputs.pac);
            if let Some(block) = blocks.put(phase, pac, outputs.shear_mn) {
                slide.take(&block);
                taken.extend(listens.then_some(block));
            }
        })?;
        if let Some((_, listener)) = &mut self.listener {
            let now_ms = (self.now_ns / TICK_NS) as u32;
            for block in taken {
                listener(now_ms, Event::Block(block));
            }
        }
        let lost = match ended {
            Ended::Gap(samples) => samples,
            _ => 0,
        };
        slide.take(&blocks.end(lost));
        Ok(())
    }

    async fn recover(&mut self, failed: &SimError) -> bool {
        self.go_on(failed)
    }
}
