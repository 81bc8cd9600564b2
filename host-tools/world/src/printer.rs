//! A 3D printer that holds the finger beside its nozzle: bytes of G-code come in, its words come out, and its axes
//! move. It knows nothing of the probe, and nothing of the program that speaks to it.
//!
//! Its figures are those of a bed slinger of the Ender 3 kind (Marlin's example configurations): 80 microsteps/mm along
//! the sample, 400 upwards, 500 and 100 mm/s^2, 500 and 5 mm/s. Its frame is its own: the sample begins at some place,
//! lies at some height, and is not level.

mod firmware;
mod planner;

use super::conditions::{TICK_S, TICKS_PER_S};
use super::finger::Held;
use super::maths::sin;
use super::mount::Weight;
use super::noise::Noise;
use super::surface::LENGTH_MM;
use firmware::Firmware;
use planner::Planner;
use std::f64::consts::TAU;

pub use firmware::Kind;

/// Stream of the seed that printers draw from.
const STREAM: u64 = 0x3d;
/// Microsteps of the three axes, mm.
const STEP_MM: [f64; 3] = [0.0125, 0.0125, 0.0025];
/// A full step, of which the motors shake, and a tooth of the belt, mm.
const FULL_STEP_MM: [f64; 3] = [0.2, 0.2, 0.04];
const TOOTH_MM: f64 = 2.0;
/// Acceleration of the finger by full steps and by teeth of the belt, g at 25 mm/s, and by fans (chosen).
const SHAKES_G: [f64; 2] = [0.012, 0.004];
const FAN_G: f64 = 0.01;
const FAN_HZ: f64 = 85.0;
/// Play of screw and belt, mm, and how far the gantry yields, mm/N (chosen).
const BACKLASH_MM: (f64, f64) = (0.02, 0.10);
const YIELDS_MM_N: (f64, f64) = (0.01, 0.06);
/// Height of the sample's top at its begin in the printer's own frame at power-up, mm: the finger hangs so far over it.
const OVER_MM: (f64, f64) = (2.0, 4.0);
/// The sample rises by so much over 60 mm (facts: printer).
const TILT_MM: f64 = 0.3;
/// Height of the sample over the bed, mm: beside it there is nothing to touch before.
const THICK_MM: f64 = 3.0;
/// Radius of the fingertip, mm: its side touches an edge before its middle is there.
const TIP_MM: f64 = 7.0;
/// What slips falls no faster than this, mm/s^2.
const FALLS_MM_S2: f64 = 9810.0;
/// The finger's carriage lies on its stop by its weight of 142 g, N, and rubs on its ball slide, N: less than the block
/// weighs, and what the balls' load adds (the book's page of the holder).
const WEIGHS_N: f64 = 1.39;
const RUBS_N: (f64, f64) = (0.05, 0.23);
/// Axes end there, mm: a screw stalls.
const ENDS_MM: (f64, f64) = (-30.0, 220.0);

/// Faults of a printer, and of the line to it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum PrinterFault {
    /// No byte passes any more, either way.
    LineLost,
    /// It starts anew, as after a dip of its supply: the motors lose their current.
    Resets,
    /// So many of the next lines are asked for again.
    Resends(u32),
    /// This share of the answers `ok` is lost.
    OkLost(f64),
    /// This share of them comes twice.
    OkTwice(f64),
    /// This share of the bytes to it is damaged.
    Damages(f64),
    /// `M410` is not looked for.
    IgnoresStop,
    /// All motion takes so many times as long, and nothing is said of it.
    Slower(f64),
    /// It stands in mid-motion for so many s and says that it is busy.
    Pauses(f64),
    /// It stops by itself, says an error, and takes no line any more.
    Halts,
    /// This axis goes the other way.
    Reversed(usize),
    /// This axis goes so many times as far.
    Scale(usize, f64),
    /// This axis stays behind by so many mm.
    Misses(usize, f64),
    /// The sample is so much higher from here on, mm.
    Rises(f64),
    /// The line's words take so many ms longer.
    Late(f64),
}

/// A printer.
#[derive(Clone, Debug)]
pub struct Printer {
    noise: Noise,
    firmware: Firmware,
    planner: Planner,
    ticks: u64,
    /// Place of each motor by its microsteps, mm, and of what hangs on it.
    motor_mm: [f64; 3],
    carriage_mm: [f64; 3],
    backlash_mm: [f64; 3],
    reversed: [bool; 3],
    scale: [f64; 3],
    missed_mm: [f64; 3],
    /// What is still to be missed, mm, and how fast it is, mm/s.
    slips_mm: [f64; 3],
    slips_mm_s: f64,
    yields_mm_n: f64,
    /// The finger's carriage; none where it is screwed to its stop.
    weight: Option<Weight>,
    /// Height of what carries it, mm.
    carrier_mm: f64,
    /// Where the sample begins along x, how high its top is there, and how much it rises for a mm.
    begins_mm: f64,
    top_mm: f64,
    slope: f64,
    /// It rises from this place on by so much.
    step_mm: Option<(f64, f64)>,
    bend_mm: f64,
    x_mm: f64,
    speed_mm_s: f64,
    held: Held,
}

impl Printer {
    /// A printer of this seed, with a sample that lies on it as `lies` says. Its finger hangs over the begin of the
    /// sample by 2 to 4 mm; its frame's zero is there.
    pub fn new(seed: u64, lies: u64, kind: Kind) -> Self {
        let (mut machine, mut noise) = (Noise::new(seed, STREAM), Noise::new(lies, STREAM));
        let top_mm = -noise.between(OVER_MM.0, OVER_MM.1);
        Self {
            top_mm,
            slope: noise.between(-TILT_MM, TILT_MM) / 60.0,
            // the person has put the finger a little inside of the sample
            begins_mm: -noise.between(0.2, 0.6),
            backlash_mm: [0; 3].map(|_: i32| machine.between(BACKLASH_MM.0, BACKLASH_MM.1)),
            yields_mm_n: machine.between(YIELDS_MM_N.0, YIELDS_MM_N.1),
            firmware: Firmware::new(kind),
            planner: Planner::default(),
            noise,
            ticks: 0,
            motor_mm: [0.0; 3],
            carriage_mm: [0.0; 3],
            reversed: [false; 3],
            scale: [1.0; 3],
            missed_mm: [0.0; 3],
            slips_mm: [0.0; 3],
            slips_mm_s: 0.0,
            weight: Some(Weight::new(WEIGHS_N, machine.between(RUBS_N.0, RUBS_N.1))),
            carrier_mm: 0.0,
            step_mm: None,
            bend_mm: 0.0,
            x_mm: 0.0,
            speed_mm_s: 0.0,
            held: Held::STILL,
        }
    }

    /// Takes bytes from its line.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.firmware.receive(bytes, self.ticks, &mut self.noise);
    }

    /// Returns the bytes that have come over its line.
    pub fn said(&mut self) -> Vec<u8> {
        self.firmware.said(self.ticks)
    }

    /// A person moves it by its own screen, mm.
    pub fn jog(&mut self, by_mm: [f64; 3]) {
        let end = self.planner.end();
        let to = [0, 1, 2].map(|axis| end[axis] + by_mm[axis]);
        self.planner.push(to, 30.0);
    }

    /// Breaks something, now.
    pub fn break_now(&mut self, fault: PrinterFault) {
        match fault {
            PrinterFault::Resets => {
                // its zero is where it stands
                self.missed_mm = self.motor_mm;
                self.planner = Planner::default();
                self.firmware.reset(self.ticks);
            }
            PrinterFault::Slower(times) => self.planner.slower = times,
            PrinterFault::Pauses(seconds) => {
                let until = self.ticks + (seconds * f64::from(TICKS_PER_S)) as u64;
                self.firmware.busy_until(until);
            }
            PrinterFault::Reversed(axis) => {
                // it goes on from where it is
                self.missed_mm[axis] =
                    self.motor_mm[axis] + self.planner.place()[axis] * self.scale[axis];
                self.reversed[axis] = true;
            }
            PrinterFault::Scale(axis, times) => {
                self.missed_mm[axis] += self.planner.place()[axis] * (self.scale[axis] - times);
                self.scale[axis] = times;
            }
            PrinterFault::Misses(axis, mm) => {
                (self.slips_mm[axis], self.slips_mm_s) = (mm, 0.0);
            }
            PrinterFault::Rises(mm) => self.step_mm = Some((self.x_mm + TIP_MM, mm)),
            fault => self.firmware.break_now(fault),
        }
    }

    /// The supply of its motors, which a relay on the line of permission may cut.
    pub fn power_motors(&mut self, on: bool) {
        self.planner.powered = on;
    }

    /// Screws the finger to its carriage's stop: nothing yields any more.
    pub fn hold_stiffly(&mut self) {
        self.weight = None;
    }

    /// Returns how often it was told to heat, to feed filament or to home by itself.
    pub fn misused(&self) -> u32 {
        self.firmware.misused
    }

    /// Place of the finger on the sample, mm from its edge.
    pub fn x_mm(&self) -> f64 {
        self.x_mm
    }

    /// Speed along the sample, mm/s.
    pub fn speed_mm_s(&self) -> f64 {
        self.speed_mm_s
    }

    /// Depth of the sample in the fingertip, mm; negative is a gap.
    pub fn indentation_mm(&self) -> f64 {
        let inside = self.x_mm.clamp(0.0, LENGTH_MM);
        let mut top = self.top_mm + self.slope * inside;
        if let Some((from, mm)) = self.step_mm {
            // the round tip rolls over its edge
            let before = (from - inside).max(0.0);
            let rolls = TIP_MM - (TIP_MM * TIP_MM - before * before).max(0.0).sqrt();
            top += (mm - rolls).max(0.0);
        }
        let beside = self.x_mm - inside;
        top -= (beside * beside / (2.0 * TIP_MM)).min(THICK_MM);
        top - self.carrier_mm - self.weight.map_or(0.0, |weight| weight.pushed_mm)
    }

    pub(super) fn held(&self) -> Held {
        self.held
    }

    pub(super) fn tick(&mut self, force_n: f64) {
        self.ticks += 1;
        self.firmware
            .tick(self.ticks, &mut self.planner, &mut self.noise);
        self.slips_mm_s += FALLS_MM_S2 * TICK_S;
        let most = self.slips_mm_s * TICK_S;
        let place = self.planner.place();
        for axis in 0..3 {
            let slips = self.slips_mm[axis].clamp(-most, most);
            self.slips_mm[axis] -= slips;
            self.missed_mm[axis] += slips;
            let sign = if self.reversed[axis] { -1.0 } else { 1.0 };
            let made = place[axis] + self.planner.lost_mm[axis];
            let wanted = sign * self.scale[axis] * made + self.missed_mm[axis];
            let step = STEP_MM[axis];
            self.motor_mm[axis] = ((wanted / step).round() * step).clamp(ENDS_MM.0, ENDS_MM.1);
            // play: the carriage is pushed from either side
            let (motor, play) = (self.motor_mm[axis], self.backlash_mm[axis] / 2.0);
            self.carriage_mm[axis] = self.carriage_mm[axis].clamp(motor - play, motor + play);
        }
        let follows = 0.02;
        self.bend_mm += follows * (self.yields_mm_n * force_n - self.bend_mm);
        // gantry and screw smooth the microsteps, too
        self.carrier_mm += follows * (self.carriage_mm[2] + self.bend_mm - self.carrier_mm);
        if let Some(weight) = &mut self.weight {
            weight.tick(force_n, self.carrier_mm);
        }
        let x_mm = self.carriage_mm[0] - self.begins_mm;
        // belt and bed smooth the microsteps
        let moved_mm = (x_mm - self.x_mm) * 0.05;
        self.x_mm += moved_mm;
        self.speed_mm_s += 0.01 * (moved_mm / TICK_S - self.speed_mm_s);
        self.shake();
    }

    /// Vibration of motors, belt and fans at the finger.
    fn shake(&mut self) {
        let speeds = self.planner.speeds();
        let mut g = 0.0;
        for axis in 0..3 {
            let share = (speeds[axis].abs() / 25.0).min(3.0);
            if share > 0.0 {
                let place = self.planner.place()[axis];
                g += SHAKES_G[0] * share * sin(TAU * place / FULL_STEP_MM[axis]);
                g += SHAKES_G[1] * share * sin(TAU * place / TOOTH_MM);
            }
        }
        if self.firmware.fan {
            g += FAN_G * sin(TAU * FAN_HZ * self.ticks as f64 * TICK_S);
        }
        self.held = Held {
            acceleration_g: g,
            ..Held::STILL
        };
    }
}
