//! The program of an arm: it carries out a probe's orders that come over its link, and reports. It has the probe's
//! force, late, and the arm's encoders. It may also be a bad one: [`Misbehaves`].

use std::collections::VecDeque;

use tactus_core::rig::arm::{ARM_SAYS_MS, ArmMovement, ArmOrder, ArmReport, ArmState, ArmTask};

use super::arm::Arm;
use super::noise::Noise;
use super::surface::LENGTH_MM;

/// Stream of the seed that the line draws from.
const STREAM: u64 = 0xa4;
/// Delay of a message, ms, either way: half of it to one and a half (chosen: USB, an interpreter, a bus to the arm).
const ON_ITS_WAY_MS: f64 = 15.0;
/// Time from a received stop until the axes have their command, ms (chosen: a cycle of a slow controller).
const STOPS_MS: u64 = 20;
/// Height of a lifted finger, and how fast it is lifted and moved in the air, mm and mm/s.
const SAFE_MM: f64 = 8.0;
const LIFTS_MM_S: f64 = 30.0;
const MOVES_MM_S: f64 = 60.0;
/// Left free at both ends of the sample, mm.
const MARGIN_MM: f64 = 2.0;
/// Height below which there is no sample, mm.
const LOWEST_MM: f64 = -4.0;
/// Force that is contact, N, and speed for a newton that is missing, mm/s.
const CONTACT_N: f64 = 0.03;
const GAIN_MM_S_N: f64 = 1.5;
/// The force is right: within this share, and N, for so long, ms.
const RIGHT: (f64, f64) = (0.02, 0.006);
const RIGHT_MS: u32 = 100;
/// A constant speed is within this share.
const STEADY: f64 = 0.01;

/// Faults of an arm.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Misbehaves {
    /// It presses with so many times the force.
    Presses(f64),
    /// It comes down so fast, and does not look at the force: only a stop ends that, so many ms after it was heard.
    ComesDown {
        /// Its speed, mm/s.
        mm_s: f64,
        /// Its delay after a stop, ms.
        stops_ms: u64,
    },
    /// It presses too hard, and does not stop at all.
    NeverStops,
    /// It sends no reports any more, and does nothing new, so many ms after a slide has come to its speed.
    Silent(u64),
    /// It sends no reports, and continues the slide to its end.
    SilentAndGoesOn(u64),
    /// It reports that it presses, and does not touch anything.
    SaysPressed,
    /// It slides at this share of the speed, in the time of the whole length, and reports the full speed and length.
    SaysSpeed(f64),
    /// It reports that it has lifted the finger, and stays where it is.
    SaysLifted,
    /// It slides only this share of the length, and reports it.
    Shorter(f64),
    /// It reports that it cannot carry out the order.
    Fails,
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Doing {
    Nothing,
    GoesOver(ArmMovement),
    ComesDown(ArmMovement),
    Trims(ArmMovement, u32),
    Ramps(ArmMovement),
    Slides(ArmMovement, f64, u64),
    Brakes(u32, u32),
    /// It obeys a stop after so many ms.
    Stops(u64),
    Lifts,
}

/// The program.
#[derive(Debug)]
pub struct ArmProgram {
    noise: Noise,
    now_ms: u64,
    to_it: VecDeque<(u64, ArmOrder)>,
    forces: VecDeque<(u64, f64)>,
    from_it: VecDeque<(u64, ArmReport)>,
    force_n: f64,
    order: Option<ArmOrder>,
    doing: Doing,
    state: ArmState,
    movement: Option<ArmMovement>,
    said_ms: u64,
    steady_ms: Option<u64>,
    misbehaves: Option<Misbehaves>,
}

impl ArmProgram {
    /// A program that waits for orders.
    pub fn new(seed: u64) -> Self {
        Self {
            noise: Noise::new(seed, STREAM),
            now_ms: 0,
            to_it: VecDeque::new(),
            forces: VecDeque::new(),
            from_it: VecDeque::new(),
            force_n: 0.0,
            order: None,
            doing: Doing::Nothing,
            state: ArmState::Busy,
            movement: None,
            said_ms: 0,
            steady_ms: None,
            misbehaves: None,
        }
    }

    /// Sets or clears its fault.
    pub fn misbehave(&mut self, how: Option<Misbehaves>) {
        self.misbehaves = how;
    }

    fn later(&mut self) -> u64 {
        self.now_ms + (self.noise.between(0.5, 1.5) * ON_ITS_WAY_MS + 0.5) as u64
    }

    /// Takes an order of the probe.
    pub fn ask(&mut self, order: ArmOrder) {
        let at = self.later();
        self.to_it.push_back((at, order));
    }

    /// Takes the probe's force, N.
    pub fn force(&mut self, newton: f64) {
        let at = self.later();
        self.forces.push_back((at, newton));
    }

    fn stops_after_ms(&self) -> u64 {
        match self.misbehaves {
            Some(Misbehaves::ComesDown { stops_ms, .. }) => stops_ms,
            Some(Misbehaves::NeverStops) => u64::MAX / 2,
            _ => STOPS_MS,
        }
    }

    fn take(&mut self, order: ArmOrder) {
        if self.order == Some(order) {
            return;
        }
        self.order = Some(order);
        self.state = ArmState::Busy;
        self.said_ms = 0;
        self.steady_ms = None;
        if self.misbehaves == Some(Misbehaves::Fails) && order.task != ArmTask::Stop {
            self.state = ArmState::Failed;
            return;
        }
        self.doing = match (order.task, self.movement) {
            (ArmTask::Press(movement), _) => {
                self.movement = Some(movement);
                Doing::GoesOver(movement)
            }
            (ArmTask::Slide, Some(movement)) => Doing::Ramps(movement),
            (ArmTask::Slide, None) => {
                self.state = ArmState::Failed;
                Doing::Nothing
            }
            (ArmTask::Lift, _) => Doing::Lifts,
            (ArmTask::Stop, _) => Doing::Stops(self.now_ms + self.stops_after_ms()),
        };
    }

    /// A millisecond: commands the arm, and returns the report that reaches the probe now.
    pub fn tick(&mut self, arm: &mut Arm) -> Vec<ArmReport> {
        self.now_ms += 1;
        let now = self.now_ms;
        while let Some((_, order)) = self.to_it.pop_front_if(|(at, _)| *at <= now) {
            self.take(order);
        }
        while let Some((_, force)) = self.forces.pop_front_if(|(at, _)| *at <= now) {
            self.force_n = force;
        }
        let silent = match (self.misbehaves, self.steady_ms) {
            (Some(Misbehaves::Silent(ms) | Misbehaves::SilentAndGoesOn(ms)), Some(since)) => {
                now > since + ms
            }
            _ => false,
        };
        if !silent || matches!(self.misbehaves, Some(Misbehaves::SilentAndGoesOn(_))) {
            self.go_on(arm);
        }
        if let Some(order) = self.order
            && !silent
            && now >= self.said_ms + u64::from(ARM_SAYS_MS) / 2
        {
            self.said_ms = now;
            let at = self.later();
            let (number, state) = (order.number, self.state);
            self.from_it.push_back((at, ArmReport { number, state }));
        }
        let mut heard = Vec::new();
        while let Some((_, report)) = self.from_it.pop_front_if(|(at, _)| *at <= now) {
            heard.push(report);
        }
        heard
    }

    /// Reports its progress at once.
    fn reach(&mut self, state: ArmState, doing: Doing) {
        self.state = state;
        self.doing = doing;
        self.said_ms = 0;
    }

    fn share(&self) -> f64 {
        match self.misbehaves {
            Some(Misbehaves::SaysSpeed(share)) => share,
            _ => 1.0,
        }
    }

    fn go_on(&mut self, arm: &mut Arm) {
        let now = self.now_ms;
        match self.doing {
            Doing::Nothing => arm.go(0.0, 0.0),
            Doing::GoesOver(movement) => {
                let away = begins_mm(&movement) - arm.x_mm();
                let up = if arm.height_mm() < SAFE_MM {
                    LIFTS_MM_S
                } else {
                    0.0
                };
                arm.go((away * 10.0).clamp(-MOVES_MM_S, MOVES_MM_S), up);
                if away.abs() < 0.1 && up == 0.0 {
                    self.doing = match self.misbehaves {
                        Some(Misbehaves::SaysPressed) => {
                            self.state = ArmState::Pressed;
                            Doing::Nothing
                        }
                        _ => Doing::ComesDown(movement),
                    };
                }
            }
            Doing::ComesDown(movement) => {
                let fastest = match self.misbehaves {
                    Some(Misbehaves::ComesDown { mm_s, .. }) => mm_s,
                    _ => f64::from(movement.approach_um_s) * 1e-3,
                };
                let blind = matches!(
                    self.misbehaves,
                    Some(Misbehaves::ComesDown { .. } | Misbehaves::NeverStops)
                );
                arm.go(0.0, -fastest);
                if !blind && self.force_n > CONTACT_N {
                    self.doing = Doing::Trims(movement, 0);
                } else if arm.height_mm() < LOWEST_MM && !blind {
                    self.reach(ArmState::Failed, Doing::Nothing);
                }
            }
            Doing::Trims(movement, right_ms) => {
                let wanted_n = f64::from(movement.force_mn)
                    * 1e-3
                    * match self.misbehaves {
                        Some(Misbehaves::Presses(times)) => times,
                        _ => 1.0,
                    };
                let missing_n = wanted_n - self.force_n;
                let fastest = f64::from(movement.approach_um_s) * 1e-3;
                let right = missing_n.abs() <= RIGHT.0 * wanted_n + RIGHT.1;
                let down = if right { 0.0 } else { missing_n * GAIN_MM_S_N };
                arm.go(0.0, -down.clamp(-fastest, fastest));
                self.doing = Doing::Trims(movement, if right { right_ms + 1 } else { 0 });
                if right_ms >= RIGHT_MS {
                    self.reach(ArmState::Pressed, Doing::Nothing);
                }
            }
            Doing::Ramps(movement) => {
                let speed = f64::from(movement.speed_um_s) * 1e-3 * self.share();
                arm.go(speed, 0.0);
                if (arm.speed_mm_s() - speed).abs() < STEADY * speed {
                    self.steady_ms = Some(now);
                    self.reach(ArmState::Steady, Doing::Slides(movement, arm.x_mm(), now));
                }
            }
            Doing::Slides(movement, from_mm, since_ms) => {
                let made_mm = arm.x_mm() - from_mm;
                let (wanted_mm, ms) = (
                    f64::from(movement.length_um) * 1e-3,
                    (now - since_ms).max(1),
                );
                let over = match self.misbehaves {
                    Some(Misbehaves::SaysSpeed(_)) => {
                        ms as f64 * 1e-3 >= wanted_mm / (f64::from(movement.speed_um_s) * 1e-3)
                    }
                    Some(Misbehaves::Shorter(share)) => made_mm >= share * wanted_mm,
                    _ => made_mm >= wanted_mm || arm.x_mm() >= LENGTH_MM,
                };
                if over {
                    let mut made = (made_mm * 1e3, made_mm * 1e6 / ms as f64);
                    if self.share() != 1.0 {
                        made = (movement.length_um.into(), movement.speed_um_s.into());
                    }
                    self.doing = Doing::Brakes(made.0 as u32, made.1 as u32);
                }
            }
            Doing::Brakes(length_um, speed_um_s) => {
                arm.go(0.0, 0.0);
                if arm.stands() {
                    let slid = ArmState::Slid {
                        length_um,
                        speed_um_s,
                    };
                    self.reach(slid, Doing::Nothing);
                }
            }
            // until then it continues its motion
            Doing::Stops(at_ms) if now < at_ms => {}
            Doing::Stops(_) => {
                arm.go(0.0, 0.0);
                if arm.stands() {
                    self.doing = Doing::Lifts;
                }
            }
            Doing::Lifts if self.misbehaves == Some(Misbehaves::SaysLifted) => {
                arm.go(0.0, 0.0);
                self.reach(ArmState::Lifted, Doing::Nothing);
            }
            Doing::Lifts => {
                let missing_mm = SAFE_MM - arm.height_mm();
                arm.go(0.0, (missing_mm * 10.0).clamp(0.0, LIFTS_MM_S));
                if missing_mm < 0.2 {
                    arm.go(0.0, 0.0);
                    if arm.stands() {
                        self.reach(ArmState::Lifted, Doing::Nothing);
                    }
                }
            }
        }
    }
}

/// Place where the slide of a movement begins, mm from the sample's edge.
fn begins_mm(movement: &ArmMovement) -> f64 {
    let speed = f64::from(movement.speed_um_s) * 1e-3;
    // two ramps, and what an axis is late
    let ramps_mm = speed * speed * 1e-3 + 0.1 * speed;
    let travel_mm = f64::from(movement.length_um) * 1e-3 + ramps_mm;
    let room_mm = (LENGTH_MM - 2.0 * MARGIN_MM - travel_mm).max(0.0);
    MARGIN_MM + room_mm * f64::from(movement.start) * 1e-3
}
