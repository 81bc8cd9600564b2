//! The lever that presses the fingertip on the sample: a stepper with a lead screw behind a STEP/DIR/EN driver.
//!
//! Reference lever of the project: 200 steps x 1/16, lead 2 mm, so 0.625 um per microstep and 800 steps/s at the
//! paper's 0.5 mm/s. Figures marked "chosen" are of a common NEMA 14 motor on 12 V; the paper names only its motor
//! (L4118, Nanotec) and that it hums differently from trial to trial, even when it stands.
//!
//! The driver's currents point to a microstep, the *field*; the rotor follows it to the nearest place where they agree,
//! which repeats every 64 microsteps. Lost steps follow from that: a rotor that is left behind by more than half of
//! that snaps into another period, always a whole number of them away.
//!
//! The screw locks itself: its thread (Tr8x2) rises by 5.2 degrees, and steel on brass holds up to 8.5. Without current
//! the lever stays where it is under any force; only its knob moves it.

use std::f64::consts::TAU;

use super::conditions::TICK_S;
use super::maths::{cos, sin};
use super::noise::Noise;

/// Movement of the tip per microstep: 2 mm / (200 x 16).
pub(crate) const STEP_UM: f64 = 0.625;
/// Microsteps in which the driver's currents repeat: four full steps.
const PERIOD: i64 = 64;
/// STEP must stay at each level this long (chosen: it suits every common driver). A shorter pulse is no step.
pub(crate) const STEP_LEVEL_NS: u64 = 4_000;
/// DIR must be stable this long before STEP rises. Else the step is lost.
pub(crate) const DIR_SETUP_NS: u64 = 1_000;
/// Fastest rate at which the motor starts and stops without a ramp, microsteps/s; 4 mm/s (chosen).
pub(crate) const START_STOP_PER_S: f64 = 6_400.0;
/// Rate at which back-EMF leaves no torque, microsteps/s; 15 mm/s (chosen).
pub(crate) const TOP_PER_S: f64 = 24_000.0;
/// Steepest ramp above the start/stop rate, microsteps/s^2; 200 mm/s^2 (chosen).
pub(crate) const RAMP_PER_S2: f64 = 320_000.0;
/// Tolerance of a single interval above the ramp: STEP from software jitters (chosen).
const RATE_SLACK: f64 = 1.02;
/// Load that the standing motor holds, N (chosen); falls linearly to nothing at [`TOP_PER_S`].
pub(crate) const HOLD_N: f64 = 12.0;
/// Play between screw and nut, um (chosen). A pressed finger keeps it closed: it shows only with the finger in the air.
pub(crate) const BACKLASH_UM: f64 = 15.0;
/// Finger force that overcomes the lever's own friction and closes the play, N (chosen).
const CLOSES_PLAY_N: f64 = 0.05;
/// Largest error of a microstep's place, um: 5 % of a full step, not accumulating (usual for such motors), once per
/// full step and once per period.
const STEP_ERROR_UM: [f64; 2] = [0.25, 0.25];
/// Height of the fingertip over the steel plate with the lever at the upper hard stop, mm (chosen: over every sample;
/// foams and furs have 6 to 15 mm, so that some touch the finger before it has homed).
pub(crate) const TOP_MM: f64 = 16.0;
/// Way from the upper to the lower hard stop, mm (chosen).
pub(crate) const TRAVEL_MM: f64 = 17.5;
/// The limit switch closes this far below the upper hard stop, mm, and opens [`LIMIT_HYSTERESIS_MM`] lower (chosen).
pub(crate) const LIMIT_MM: f64 = 0.5;
/// Way between closing and opening of the limit switch, mm (chosen: a micro switch).
pub(crate) const LIMIT_HYSTERESIS_MM: f64 = 0.05;
/// Speed with which a runaway driver steps down, microsteps/s: the approach's own (chosen).
pub(crate) const RUNAWAY_PER_S: f64 = 800.0;
/// Stream of the seeds that the lever draws from.
const STREAM: u64 = 0x1e7e;
/// Without a step for this long the motor stands, and hums in a new way.
const STANDS_NS: u64 = 20_000_000;
/// A motor that was faster than the start/stop rate and gets no step for this long has run past its stop.
const OVERRUN_NS: u64 = 2_000_000;

#[derive(Clone, Debug, Default)]
pub(crate) struct Lever {
    step: Pin,
    dir: Pin,
    enabled: bool,
    /// DIR's wire comes in inverted (fault)
    pub(super) inverted: bool,
    /// a coil has no current: the rotor does not turn
    pub(super) coil_open: bool,
    pub(super) per_pulse: i64,
    /// whether the last rising edge was a step: a short pulse takes it back
    last_edge_stepped: bool,
    last_step_ns: Option<u64>,
    /// microsteps/s and sign of the last step
    rate: f64,
    direction: i64,
    stalled: bool,
    standing: bool,
    /// microsteps down from the upper hard stop, unwrapped
    field: i64,
    /// the same for the rotor; between microsteps only after its knob was turned
    rotor: f64,
    /// way of the nut at this place of the rotor: its sines take longer than the rest of a step
    screw: (f64, f64),
    /// how much of the play is above the tip, um
    play_um: f64,
    /// height of the fingertip's undeformed surface over the steel plate, mm
    pub(super) height_mm: f64,
    error_phase: [f64; 2],
    at_top: bool,
    /// a person holds its switch actuated
    pub(super) held: bool,
    vibration: Hum,
    noise: Noise,
    began_at: f64,
    asked: i64,
    /// pulses that broke [`STEP_LEVEL_NS`] or [`DIR_SETUP_NS`]
    pub(super) bad_pulses: u64,
    /// share of steps that the motor misses (fault)
    pub(super) lost_share: f64,
    runaway: Option<Runaway>,
}

#[derive(Clone, Copy, Default, Debug)]
struct Pin {
    high: bool,
    since_ns: Option<u64>,
}

impl Pin {
    fn held_for(self, at_ns: u64, ns: u64) -> bool {
        self.since_ns
            .is_none_or(|since| at_ns.saturating_sub(since) >= ns)
    }
}

/// A driver that steps down on its own.
#[derive(Clone, Copy, Default, Debug)]
struct Runaway {
    due: f64,
    /// its own steps down, and the steps up that were commanded since it began
    down: u64,
    up: u64,
}

impl Lever {
    /// A lever without current, its tip `height_mm` over the plate. The motor's microstep errors are drawn from
    /// `world_seed`, its hum from `trial_seed`.
    pub(crate) fn new(height_mm: f64, world_seed: u64, trial_seed: u64) -> Self {
        let mut motor = Noise::new(world_seed, STREAM);
        let rotor = ((TOP_MM - height_mm) * 1e3 / STEP_UM).round();
        let mut lever = Self {
            per_pulse: 1,
            direction: 1,
            standing: true,
            field: rotor as i64,
            rotor,
            screw: (f64::NAN, 0.0),
            play_um: BACKLASH_UM,
            height_mm,
            error_phase: [motor.between(0.0, TAU), motor.between(0.0, TAU)],
            noise: Noise::new(trial_seed, STREAM),
            began_at: rotor,
            ..Self::default()
        };
        lever.place_tip();
        lever
    }

    /// The level of STEP. A rising edge is a step, with or without current; `load_n` is the finger's force.
    pub(crate) fn step(&mut self, at_ns: u64, high: bool, load_n: f64) {
        if high == self.step.high {
            return;
        }
        let long_enough = self.step.held_for(at_ns, STEP_LEVEL_NS);
        self.step = Pin {
            high,
            since_ns: Some(at_ns),
        };
        if high {
            let sign = if self.dir.high != self.inverted {
                1
            } else {
                -1
            };
            self.asked += sign;
            if sign < 0
                && let Some(runaway) = &mut self.runaway
            {
                runaway.up += 1;
            }
            let heard = long_enough && self.dir.held_for(at_ns, DIR_SETUP_NS);
            self.bad_pulses += u64::from(!heard);
            self.last_edge_stepped = heard && !self.misses_this_step();
            if self.last_edge_stepped {
                self.take_step(at_ns, sign, load_n);
            }
        } else if !long_enough {
            // the driver never saw this pulse: its step of 4 us ago is undone
            self.bad_pulses += 1;
            if self.last_edge_stepped {
                self.last_edge_stepped = false;
                self.field -= self.direction * self.per_pulse;
                self.follow(load_n);
            }
        }
    }

    /// The level of DIR: high is down.
    pub(crate) fn dir(&mut self, at_ns: u64, high: bool) {
        if high != self.dir.high {
            self.dir = Pin {
                high,
                since_ns: Some(at_ns),
            };
        }
    }

    /// The level of EN: high gives current. Without it the driver still counts steps, as an A4988 does, but the rotor
    /// stays where it is, and snaps to the nearest fitting place when the current returns.
    pub(crate) fn enable(&mut self, high: bool, load_n: f64) {
        if high == self.enabled {
            return;
        }
        self.enabled = high;
        self.rate = 0.0;
        self.stalled = false;
        if high {
            self.vibration = Hum::draw(&mut self.noise);
            self.follow(load_n);
        } else {
            self.runaway = None;
            self.vibration = Hum::default();
        }
    }

    /// Lets one tick pass that ends at `now_ns`, with the finger pushing up with `load_n`.
    pub(crate) fn tick(&mut self, now_ns: u64, load_n: f64) {
        if !self.enabled {
            return;
        }
        self.run_away(load_n);
        let idle_ns = now_ns.saturating_sub(self.last_step_ns.unwrap_or(0));
        if self.rate > START_STOP_PER_S && idle_ns > OVERRUN_NS {
            self.rate = 0.0;
            self.slip(self.direction, load_n);
        }
        if !self.standing && idle_ns > STANDS_NS {
            self.standing = true;
            self.rate = 0.0;
            self.vibration = Hum::draw(&mut self.noise);
        }
        if load_n > pull_out_n(self.rate) {
            self.slip(-1, load_n);
        }
        self.vibration.tick();
    }

    /// Pressure in the finger's fluid by the motor's vibration, Pa; 0 without current.
    pub(crate) fn vibration_pa(&self) -> f64 {
        self.vibration.value()
    }

    pub(crate) fn at_top(&self) -> bool {
        self.at_top || self.held
    }

    /// Steps down that STEP edges commanded and the rotor did not make, less those up.
    pub(crate) fn missing_steps(&self) -> f64 {
        self.asked as f64 - (self.rotor - self.began_at)
    }

    /// Turns the screw by its knob while there is no current: so far up, mm. Whether it could be turned.
    pub(crate) fn turn_by_hand(&mut self, up_mm: f64, load_n: f64) -> bool {
        if !self.enabled {
            self.turn(-up_mm * 1e3 / STEP_UM, load_n);
        }
        !self.enabled
    }

    /// From now on the driver steps down by itself, [`RUNAWAY_PER_S`], until the current is off or more steps up were
    /// commanded than it made; `false` ends it.
    pub(crate) fn run_away_down(&mut self, on: bool) {
        self.runaway = on.then(Runaway::default);
    }

    fn misses_this_step(&mut self) -> bool {
        self.lost_share > 0.0 && self.noise.uniform() < self.lost_share
    }

    fn take_step(&mut self, at_ns: u64, sign: i64, load_n: f64) {
        let rate = self.last_step_ns.map_or(0.0, |last_ns| {
            1e9 / at_ns.saturating_sub(last_ns).max(1) as f64
        });
        let ran_at = if sign == self.direction {
            self.rate.max(START_STOP_PER_S)
        } else {
            START_STOP_PER_S
        };
        let can_run_at = (ran_at * ran_at + 2.0 * RAMP_PER_S2).sqrt().min(TOP_PER_S);
        self.field += sign * self.per_pulse;
        self.direction = sign;
        self.last_step_ns = Some(at_ns);
        if rate <= START_STOP_PER_S || (!self.stalled && rate <= can_run_at * RATE_SLACK) {
            self.stalled = false;
            self.standing = false;
            self.rate = rate.min(can_run_at);
            self.follow(load_n);
        } else {
            self.stalled = true;
            self.rate = 0.0;
        }
    }

    /// Turns the rotor to the nearest place where it agrees with the field, or against the hard stop.
    fn follow(&mut self, load_n: f64) {
        if self.enabled && !self.coil_open {
            let half = PERIOD as f64 / 2.0;
            let lag = (self.field as f64 - self.rotor + half).rem_euclid(PERIOD as f64) - half;
            self.turn(lag, load_n);
        }
    }

    /// Loses hold: the rotor moves to the next place of the same currents.
    fn slip(&mut self, direction: i64, load_n: f64) {
        self.turn((PERIOD * direction) as f64, load_n);
    }

    fn turn(&mut self, microsteps: f64, load_n: f64) {
        let (_, before_um) = self.screw;
        self.rotor = (self.rotor + microsteps).clamp(0.0, TRAVEL_MM * 1e3 / STEP_UM);
        self.turn_screw();
        let down_um = self.screw.1 - before_um;
        self.play_um = if load_n > CLOSES_PLAY_N {
            BACKLASH_UM
        } else {
            (self.play_um + down_um).clamp(0.0, BACKLASH_UM)
        };
        self.place_tip();
    }

    /// Brings the nut to where the rotor has it: um below its place at the upper hard stop.
    fn turn_screw(&mut self) {
        if self.screw.0 == self.rotor {
            return;
        }
        let angle = self.rotor * TAU / PERIOD as f64;
        let way_um = self.rotor * STEP_UM
            + STEP_ERROR_UM[0] * sin(angle + self.error_phase[0])
            + STEP_ERROR_UM[1] * sin(4.0 * angle + self.error_phase[1]);
        self.screw = (self.rotor, way_um);
    }

    fn place_tip(&mut self) {
        self.turn_screw();
        let down_mm = (self.screw.1 - self.play_um) * 1e-3;
        self.height_mm = TOP_MM - down_mm;
        let opens_at_mm = LIMIT_MM
            + if self.at_top {
                LIMIT_HYSTERESIS_MM
            } else {
                0.0
            };
        self.at_top = down_mm < opens_at_mm;
    }

    fn run_away(&mut self, load_n: f64) {
        let Some(runaway) = &mut self.runaway else {
            return;
        };
        if runaway.up > runaway.down {
            self.runaway = None;
            return;
        }
        runaway.due += RUNAWAY_PER_S * TICK_S;
        if runaway.due >= 1.0 {
            runaway.due -= 1.0;
            runaway.down += 1;
            self.field += 1;
            self.follow(load_n);
        }
    }
}

/// Load at which the motor loses hold at a rate of steps.
fn pull_out_n(rate: f64) -> f64 {
    HOLD_N * (1.0 - rate / TOP_PER_S).max(0.0)
}

/// The effect of an energised motor on a finger: a few tones, drawn anew at every stop, since the motor stands at
/// another balance of its two phase currents each time.
#[derive(Clone, Debug)]
struct Hum([Tone; HUM_TONES]);

const HUM_TONES: usize = 3;
/// Frequencies of the tones, Hz (chosen: within the band of the dynamic pressure).
const HUM_HZ: (f64, f64) = (60.0, 600.0);
/// Median amplitude of a tone in the fluid, Pa, and its log-normal deviation (chosen: about the sensor's own noise of
/// 0.52 Pa; one in six is over twice the median).
const HUM_PA: f64 = 0.3;
const HUM_SPREAD: f64 = 0.7;

/// A sine as a pointer that turns by a fixed angle per tick.
#[derive(Clone, Copy, Debug)]
struct Tone {
    at: [f64; 2],
    turn: [f64; 2],
}

impl Default for Hum {
    /// Silent.
    fn default() -> Self {
        let (at, turn) = ([0.0, 0.0], [1.0, 0.0]);
        Self([Tone { at, turn }; HUM_TONES])
    }
}

impl Hum {
    fn draw(noise: &mut Noise) -> Self {
        Self(std::array::from_fn(|_| {
            let per_tick = TAU * noise.between(HUM_HZ.0, HUM_HZ.1) * TICK_S;
            let phase = noise.between(0.0, TAU);
            let pa = noise.about(HUM_PA, HUM_SPREAD);
            Tone {
                at: [pa * cos(phase), pa * sin(phase)],
                turn: [cos(per_tick), sin(per_tick)],
            }
        }))
    }

    fn tick(&mut self) {
        for Tone {
            at: [re, im],
            turn: [cos, sin],
        } in &mut self.0
        {
            (*re, *im) = (*re * *cos - *im * *sin, *re * *sin + *im * *cos);
        }
    }

    fn value(&self) -> f64 {
        self.0.iter().map(|tone| tone.at[1]).sum()
    }
}

#[cfg(test)]
mod tests;
