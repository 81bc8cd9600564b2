//! The simulated rig behind the board's pins, and its notes of them.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tactus_core::sensor::FingerName;
use tactus_world::parts::ClockMode;
use tactus_world::world::{Setup, World};

use super::display::Display;
use super::motion::MotionPeer;
use super::options::Options;
use super::record::{Recorder, Slide, Touch};
use super::taps::Coupled;
use super::wave::Wave;

/// Shortest byte of the fastest clock of a finger's parts, ns: 10 MHz of BioTac and IIS3DWB, 0.9 MHz of the MCP3202 at
/// 2.7 V (DS21034), 150 ns a clock of the ADS1220 (SBAS501, 6.6).
const fn fastest_byte_ns(finger: FingerName) -> &'static [u64] {
    match finger {
        FingerName::Biotac => &[800],
        FingerName::Analog => &[8888],
        FingerName::Mems => &[800, 1200],
    }
}
/// The byte that reads Z from the accelerometer, in each slot.
const READ_Z: u8 = 0xAC;
/// CR1 of an SPI (RM0090 28.5.1): clock phase, clock polarity.
const CR1_MODE: u64 = 0b11;
const CR1_LSB_FIRST: u64 = 1 << 7;

/// The rig, which the emulator's thread and its owner look at in turn.
pub(crate) type SharedRig = Arc<Mutex<Rig>>;

/// The lock is never contended: the emulator stands while its owner acts.
pub(crate) fn lock(rig: &SharedRig) -> MutexGuard<'_, Rig> {
    rig.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A change at an output of the firmware.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Output {
    /// Level of the lever's STEP.
    LeverStep(bool),
    /// Level of the lever's DIR: high is down.
    LeverDown(bool),
    /// Level of the lever's EN.
    LeverEnable(bool),
    /// Duty of the stage, -1 to 1, positive towards higher positions.
    StageDuty(f64),
    /// Level of the stage's EN.
    StageEnable(bool),
    /// Tone of the handheld's buzzer, Hz.
    Buzzer(Option<u32>),
}

/// The rig and the wires between it and the chip.
pub struct Rig {
    world: World,
    finger: FingerName,
    /// STEP by the timer, and by the port if that has the pin
    step_timer: bool,
    step_port: Option<bool>,
    step: bool,
    duty_timer: f64,
    duty_port: Option<bool>,
    wave: Option<Wave>,
    stage_up: bool,
    lever_down: bool,
    lever_enabled: bool,
    stage_enabled: bool,
    duty: f64,
    /// Which part of the finger is selected.
    selected: Option<u8>,
    pub(super) selected_ns: u64,
    /// bytes of this select so far, and the time of the last one
    bytes: u32,
    pub(super) byte_ns: u64,
    /// last bit of MISO, for a wrong clock phase
    bit: u8,
    sensor_wired: bool,
    encoder_wired: bool,
    spi_control: u64,
    motion: MotionPeer,
    encoder_lines: (bool, bool),
    coupled_ns: Option<u64>,
    trace_ns: u64,
    trace: VecDeque<(u64, Output)>,
    recorder: Recorder,
    commands: u64,
    display: Display,
    tone: Option<u32>,
    /// From the firmware, with the time at which each byte was over.
    pub(crate) heard: Vec<(u64, u8)>,
    /// To the firmware.
    pub(crate) to_say: VecDeque<u8>,
}

impl std::fmt::Debug for Rig {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Rig")
            .field("truth", &self.world.truth())
            .finish_non_exhaustive()
    }
}

impl Rig {
    pub(crate) fn new(setup: Setup, options: &Options) -> Self {
        Self {
            finger: setup.finger,
            world: World::new(Setup {
                keep_edges: true,
                // virtual time is the PC's
                shimmed: true,
                ..setup
            }),
            step_timer: false,
            step_port: Some(false),
            step: false,
            duty_timer: 0.0,
            duty_port: Some(false),
            wave: None,
            stage_up: false,
            lever_down: false,
            lever_enabled: false,
            stage_enabled: false,
            duty: 0.0,
            selected: None,
            selected_ns: 0,
            bytes: 0,
            byte_ns: 0,
            bit: 1,
            sensor_wired: false,
            encoder_wired: false,
            spi_control: 0,
            motion: MotionPeer::new(setup.trial_seed, options.motion),
            encoder_lines: (false, false),
            coupled_ns: None,
            trace_ns: options.trace_s * 1_000_000_000,
            trace: VecDeque::new(),
            recorder: Recorder::default(),
            commands: 0,
            display: Display::default(),
            tone: None,
            heard: Vec::new(),
            to_say: VecDeque::new(),
        }
    }

    /// The world: its truth, its faults. Leave its pins to the firmware.
    pub fn world(&mut self) -> &mut World {
        &mut self.world
    }

    /// Changes at the firmware's outputs with their times, ns, oldest first: those of the last seconds
    /// ([`Options::trace_s`](super::Options::trace_s)).
    pub fn trace(&self) -> impl Iterator<Item = &(u64, Output)> {
        self.trace.iter()
    }

    /// The handheld's display.
    pub fn display(&self) -> &Display {
        &self.display
    }

    /// The same, to pull its plug.
    pub fn display_mut(&mut self) -> &mut Display {
        &mut self.display
    }

    pub(crate) fn buzzer(&mut self, now_ns: u64, tone: Option<u32>) {
        if tone != self.tone {
            self.tone = tone;
            self.note(now_ns, Output::Buzzer(tone));
        }
    }

    /// The ground truth of every slide so far.
    pub fn slides(&self) -> &[Slide] {
        &self.recorder.slides
    }

    /// Every contact so far.
    pub fn touches(&self) -> &[Touch] {
        &self.recorder.touches
    }

    /// Sample commands that the sensor got since power-up, one in each slot.
    pub fn sensor_commands(&self) -> u64 {
        self.commands
    }

    /// Tells the truth recorder the speed that the next slides are to have, mm/s. Without it, their median speed
    /// counts.
    pub(crate) fn expect_speed(&mut self, mm_s: f64) {
        self.recorder.expect_speed(mm_s);
    }

    pub(crate) fn advance_to(&mut self, now_ns: u64) {
        self.world.advance_to(now_ns);
    }

    /// Lets time pass and records the truth.
    pub(crate) fn tick(&mut self, now_ns: u64) {
        self.world.advance_to(now_ns);
        self.recorder.tick(now_ns, &self.world.truth());
        let oldest = now_ns.saturating_sub(self.trace_ns);
        while self.trace.pop_front_if(|(at, _)| *at < oldest).is_some() {}
    }

    fn note(&mut self, now_ns: u64, output: Output) {
        self.trace.push_back((now_ns, output));
    }

    pub(crate) fn step_timer(&mut self, now_ns: u64, high: bool) {
        self.step_timer = high;
        self.update_step(now_ns);
    }

    /// STEP as an output of its port; `None` leaves it to the timer.
    pub(crate) fn step_port(&mut self, now_ns: u64, level: Option<bool>) {
        self.step_port = level;
        self.update_step(now_ns);
    }

    fn update_step(&mut self, now_ns: u64) {
        let high = self.step_port.unwrap_or(self.step_timer);
        if high != self.step {
            self.step = high;
            self.world.lever_step(now_ns, high);
            self.note(now_ns, Output::LeverStep(high));
        }
    }

    pub(crate) fn lever_dir(&mut self, now_ns: u64, high: bool) {
        if high != self.lever_down {
            self.lever_down = high;
            self.world.lever_dir(now_ns, high);
            self.note(now_ns, Output::LeverDown(high));
        }
    }

    pub(crate) fn lever_enable(&mut self, now_ns: u64, high: bool) {
        if high != self.lever_enabled {
            self.lever_enabled = high;
            self.world.lever_enable(now_ns, high);
            self.note(now_ns, Output::LeverEnable(high));
        }
    }

    /// Duty of the timer, 0 to 1.
    pub(crate) fn stage_duty(&mut self, now_ns: u64, duty: f64) {
        self.duty_timer = duty;
        self.update_duty(now_ns);
    }

    /// Sets the timer's PWM and its place in its period, if it makes one.
    pub(super) fn stage_wave(&mut self, wave: Option<Wave>) {
        self.wave = wave;
    }

    /// Reading of the converter for the motor's current.
    pub(super) fn motor_adc(&mut self, now_ns: u64) -> u16 {
        self.advance_to(now_ns);
        // a port's level does not swing
        let by_timer = self.wave.filter(|_| self.duty_port.is_none());
        match by_timer.and_then(|wave| wave.phase(now_ns)) {
            Some(phase) => self.world.motor_adc_within(phase),
            None => self.world.motor_adc(),
        }
    }

    /// PWM as an output of its port; `None` leaves it to the timer.
    pub(crate) fn stage_port(&mut self, now_ns: u64, level: Option<bool>) {
        self.duty_port = level;
        self.update_duty(now_ns);
    }

    pub(crate) fn stage_dir(&mut self, now_ns: u64, high: bool) {
        self.stage_up = high;
        self.update_duty(now_ns);
    }

    fn update_duty(&mut self, now_ns: u64) {
        let magnitude = self
            .duty_port
            .map_or(self.duty_timer, |level| f64::from(u8::from(level)));
        let duty = self.world.bridge_duty(magnitude, self.stage_up);
        if duty != self.duty {
            self.duty = duty;
            self.world.stage_pwm(now_ns, duty);
            self.note(now_ns, Output::StageDuty(duty));
        }
    }

    pub(crate) fn stage_enable(&mut self, now_ns: u64, high: bool) {
        if high != self.stage_enabled {
            self.stage_enabled = high;
            self.world.stage_enable(now_ns, high);
            self.note(now_ns, Output::StageEnable(high));
        }
    }

    /// Chip select of a part falls, or rises.
    pub(crate) fn select_part(&mut self, now_ns: u64, part: u8, selected: bool) {
        let is_there = usize::from(part) < fastest_byte_ns(self.finger).len();
        if !is_there || selected == (self.selected == Some(part)) {
            return;
        }
        self.selected = selected.then_some(part);
        if selected {
            self.selected_ns = now_ns;
            self.bytes = 0;
            let mode = ClockMode::of((self.spi_control & CR1_MODE) as u8);
            self.world.spi_select_part(now_ns, part, mode);
        } else {
            self.world.spi_deselect(now_ns);
        }
    }

    /// Connects the pins to SPI1, and to TIM4, or not.
    pub(crate) fn wire(&mut self, sensor: bool, encoder: bool) {
        self.sensor_wired = sensor;
        self.encoder_wired = encoder;
    }

    /// Levels at MISO, MOSI, and lines A and B of the encoder, as far as the chip only reads these pins; `None` if
    /// nothing drives them.
    pub(super) fn read_pins(&mut self) -> [Option<bool>; 4] {
        let [miso, mosi] = match self.selected {
            Some(_) => self.world.data_lines(),
            None => [None; 2],
        };
        let [a, b] = self.world.encoder_levels(self.encoder_lines);
        [miso, mosi, a, b]
    }

    pub(crate) fn spi_control(&mut self, cr1: u64) {
        self.spi_control = cr1;
    }

    /// A byte over the sensor's bus, at its end.
    pub(super) fn spi_byte(&mut self, now_ns: u64, mosi: u8) -> u8 {
        let Some(part) = self.selected.filter(|_| self.sensor_wired) else {
            return 0xFF;
        };
        let first = self.bytes == 0;
        let too_fast = now_ns.saturating_sub(if first {
            self.selected_ns
        } else {
            self.byte_ns
        }) < fastest_byte_ns(self.finger)[usize::from(part)];
        self.bytes += 1;
        self.byte_ns = now_ns;
        let samples = match self.finger {
            FingerName::Biotac => mosi & 0x80 != 0,
            FingerName::Analog => true,
            FingerName::Mems => part == 0 && mosi == READ_Z,
        };
        if first && samples {
            self.commands += 1;
            self.recorder.command(self.selected_ns);
        }
        if too_fast || self.spi_control & CR1_LSB_FIRST != 0 {
            self.world.spi_byte(mosi.reverse_bits());
            return self.world.idle_miso();
        }
        let miso = self.world.spi_byte(mosi);
        // other fingers' parts know the mode since they were selected
        if self.spi_control & CR1_MODE == 0 || self.finger != FingerName::Biotac {
            return miso;
        }
        // read a bit late; the sensor itself is taken to understand (chosen): three of four words fail parity
        let late = self.bit << 7 | miso >> 1;
        self.bit = miso & 1;
        late
    }

    /// The handheld's sensor of motion.
    pub fn motion(&mut self) -> &mut MotionPeer {
        &mut self.motion
    }

    /// A byte over its bus, at its end.
    pub(super) fn motion_byte(&mut self, now_ns: u64, mosi: u8, bits: u8) -> u8 {
        self.advance_to(now_ns);
        let x_mm = self.world.hand().map(|hand| hand.x_mm());
        self.motion.byte(now_ns, x_mm.unwrap_or(0.0), mosi, bits)
    }

    /// The encoder's lines after its next edge up to the time reached.
    pub(crate) fn next_encoder_lines(&mut self) -> Option<(u64, (bool, bool))> {
        let edge = self.world.next_encoder_edge()?;
        self.encoder_lines = (edge.a, edge.b);
        Some((edge.at_ns, self.encoder_lines()))
    }

    /// From now on the stage's bridge couples spikes of so many ns into the encoder's lines.
    pub fn couple_bridge(&mut self, ns: u64) {
        self.coupled_ns = Some(ns);
    }

    pub(super) fn coupled(&self) -> Option<Coupled> {
        self.coupled_ns.filter(|_| self.stage_enabled).map(Coupled)
    }

    /// The encoder's lines as the timer sees them.
    pub(crate) fn encoder_lines(&self) -> (bool, bool) {
        if self.encoder_wired {
            self.encoder_lines
        } else {
            (false, false)
        }
    }
}
