//! A hand that holds the probe: it presses with about the force that it means to, slides at about the pace that it
//! means to, and trembles.
//!
//! The hand feels the force and gives way to it, so that it is a spring and a damper to the finger rather than a place.

use std::f64::consts::{PI, TAU};

use serde::{Deserialize, Serialize};

use super::conditions::TICK_S;
use super::finger::Held;
use super::maths::{cos, exp};
use super::noise::Noise;
use super::surface::LENGTH_MM;

/// Stream of the seed that hands draw from.
const STREAM: u64 = 0x4a4d;

/// Force that moves a hand, N s/mm: with the skin's stiffness of about 1 N/mm it follows its intention within 0.15 s
/// (chosen).
const DRAG_N_S_MM: f64 = 0.15;
/// Fastest that it lets the finger down and lifts it, mm/s (chosen).
const APPROACH_MM_S: f64 = 12.0;
const LIFT_MM_S: f64 = 60.0;
/// Gap between two touches, mm.
const AIR_MM: f64 = 5.0;
/// A hand comes up to its pace, and stops, within about this, s (chosen).
const PACE_S: f64 = 0.06;
/// Time over which force and pace wander, s (chosen: people do not notice it).
const WANDER_S: f64 = 0.5;
/// The pace changes faster: an arm is not a rail (chosen), s.
const UNEVEN_S: f64 = 0.2;
/// Physiological tremor, Hz, and its relative bandwidth (8 to 12 Hz in every textbook).
const TREMOR_HZ: f64 = 10.0;
const TREMOR_WIDTH: f64 = 0.4;
/// Motions that only a finger with a mass in it feels: acceleration by tremor, g rms, of a careful hand (Elble and
/// Koller 1990 have some 0.1 m/s^2 for a stretched hand); by the fingers that rub on the handle while it slides, g rms
/// at 70 mm/s, within a band about this frequency, Hz (chosen); and the lean of the handle, rad rms, over this time, s
/// (chosen).
const TREMOR_G: f64 = 0.01;
const RUB_G: f64 = 0.02;
const RUB_AT_MM_S: f64 = 70.0;
const RUB_HZ: f64 = 150.0;
const LEAN: f64 = 0.2;
const LEAN_S: f64 = 1.0;
/// Time that a hand takes to turn the probe over, s (chosen).
const TURN_S: f64 = 1.0;
/// Range in which a touch begins on the sample, mm from its edge.
const BEGINS_MM: (f64, f64) = (4.0, 16.0);

/// The steadiness of a hand.
#[derive(Clone, Copy, PartialEq, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct Manner {
    /// Tremor, relative to the force: rms.
    pub tremor: f64,
    /// Slow deviations of the force, relative to it: rms.
    pub wander: f64,
    /// Deviations of the pace within a slide, relative to it: rms.
    pub uneven: f64,
    /// Deviations of ln(force) from slide to slide: rms.
    pub force_spread: f64,
    /// Deviations of ln(pace) from slide to slide: rms.
    pub pace_spread: f64,
    /// The probe has a sensor of motion, whose height over the surface is off by so many mm from slide to slide: rms.
    /// `None` without one.
    pub tilt_mm: Option<f64>,
}

impl Default for Manner {
    /// A careful adult (chosen): force fluctuates by some per cent, a tenth of that at the tremor's frequency and
    /// above.
    fn default() -> Self {
        Self {
            tremor: 0.005,
            wander: 0.04,
            uneven: 0.08,
            // a person who looks at the display (chosen)
            force_spread: 0.10,
            pace_spread: 0.12,
            tilt_mm: None,
        }
    }
}

/// A hand.
#[derive(Clone, Debug, Default)]
pub struct Hand {
    noise: Noise,
    manner: Manner,
    /// its intention
    force_n: f64,
    pace_mm_s: f64,
    /// depth of the sample in the fingertip, mm; negative is a gap
    pub(super) indentation_mm: f64,
    x_mm: f64,
    pub(super) speed_mm_s: f64,
    wander: f64,
    uneven: f64,
    /// a band-pass of noise
    tremor: [f64; 2],
    /// the handle: noise of its own, tremor, rubbing, and how it leans
    handle: Noise,
    shakes: [f64; 2],
    rubs: [f64; 2],
    leans: f64,
    /// Its lean, rad rms.
    lean: f64,
    /// It holds the finger upside down, or means to; how far it is turned, rad.
    over: bool,
    turned: f64,
}

impl Hand {
    /// A hand that holds the finger in the air.
    pub fn new(seed: u64, manner: Manner) -> Self {
        let mut noise = Noise::new(seed, STREAM);
        let x_mm = noise.between(BEGINS_MM.0, BEGINS_MM.1);
        Self {
            noise,
            manner,
            indentation_mm: -AIR_MM,
            x_mm,
            handle: Noise::new(seed, STREAM + 1),
            lean: LEAN,
            ..Self::default()
        }
    }

    /// From now on it means to press this hard, and to slide at this pace; without force the finger is lifted.
    pub fn intend(&mut self, force_n: f64, pace_mm_s: f64) {
        self.force_n = force_n;
        self.pace_mm_s = pace_mm_s;
    }

    /// From now on it means to hold the finger upside down, or no more.
    pub fn turn(&mut self, over: bool) {
        self.over = over;
    }

    /// From now on it leans by so much, rad rms: less than in the hand where it stands on something.
    pub fn lean(&mut self, rad: f64) {
        self.lean = rad;
    }

    /// A tick against this force on the finger.
    pub(super) fn tick(&mut self, force_n: f64) {
        let [white, other] = self.noise.white();
        let follow = |state: &mut f64, memory_s: f64, white: f64| {
            let step = TICK_S / memory_s;
            *state += (2.0 * step).sqrt() * white - step * *state;
        };
        follow(&mut self.wander, WANDER_S, white);
        follow(&mut self.uneven, UNEVEN_S, other);
        // of rms 1: the noise that a resonance lets through
        resonate(&mut self.tremor, TREMOR_HZ, TREMOR_WIDTH, white);

        let [white, other] = self.handle.white();
        resonate(&mut self.shakes, TREMOR_HZ, TREMOR_WIDTH, white);
        resonate(&mut self.rubs, RUB_HZ, 1.0, other);
        let step = TICK_S / LEAN_S;
        self.leans += (2.0 * step).sqrt() * white - step * self.leans;

        let aim = if self.over { PI } else { 0.0 };
        let most = PI / TURN_S * TICK_S;
        self.turned += (aim - self.turned).clamp(-most, most);

        let steady = 1.0 + self.manner.wander * self.wander + self.manner.tremor * self.tremor[0];
        if self.force_n > 0.0 {
            let push = self.force_n * steady - force_n;
            let speed = (push / DRAG_N_S_MM).clamp(-LIFT_MM_S, APPROACH_MM_S);
            self.indentation_mm += speed * TICK_S;
        } else if self.indentation_mm > -AIR_MM {
            self.indentation_mm -= LIFT_MM_S * TICK_S;
            if self.indentation_mm <= -AIR_MM {
                // somewhere else next time
                self.x_mm = self.noise.between(BEGINS_MM.0, BEGINS_MM.1);
            }
        }
        let pace = self.pace_mm_s * exp(self.manner.uneven * self.uneven);
        self.speed_mm_s += (pace - self.speed_mm_s) * TICK_S / PACE_S;
        self.x_mm = (self.x_mm + self.speed_mm_s * TICK_S).clamp(0.0, LENGTH_MM);
        if self.x_mm >= LENGTH_MM {
            self.speed_mm_s = 0.0;
        }
    }

    /// The hold of the finger: felt only by transducers with a mass.
    pub fn held(&self) -> Held {
        let tremor = TREMOR_G * self.manner.tremor / Manner::default().tremor;
        let rub = RUB_G * self.speed_mm_s.abs() / RUB_AT_MM_S;
        Held {
            acceleration_g: tremor * self.shakes[0] + rub * self.rubs[0],
            down: cos(self.lean * self.leans + self.turned),
        }
    }

    /// Place of the finger on the sample, mm from its edge.
    pub fn x_mm(&self) -> f64 {
        self.x_mm
    }
}

/// A tick of the noise that a resonance lets through, of rms 1.
fn resonate(state: &mut [f64; 2], hz: f64, width: f64, white: f64) {
    let step = TAU * hz * TICK_S;
    state[0] += step * state[1];
    state[1] += (2.0 * width * step).sqrt() * white - step * (state[0] + width * state[1]);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hand against a spring of 1 N/mm: force and speed of every tick once it has come down, within 3 s, and slides.
    fn held(manner: Manner, seed: u64) -> (Vec<f64>, Vec<f64>) {
        let mut hand = Hand::new(seed, manner);
        let (mut forces, mut speeds) = (Vec::new(), Vec::new());
        for tick in 0..(13_200.0 * 5.5) as u32 {
            if tick == 1320 {
                hand.intend(0.5, 0.0);
            }
            if tick == 3 * 13_200 {
                hand.intend(0.5, 20.0);
            }
            let force = hand.indentation_mm.max(0.0);
            hand.tick(force);
            if tick > 43_400 {
                forces.push(force);
                speeds.push(hand.speed_mm_s);
            }
        }
        (forces, speeds)
    }

    fn statistics(values: &[f64]) -> (f64, f64) {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let squares = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
        (mean, (squares / values.len() as f64).sqrt())
    }

    #[test]
    fn a_steady_hand_does_what_it_means_and_a_real_one_about_that() {
        let none = Manner {
            tremor: 0.0,
            wander: 0.0,
            uneven: 0.0,
            ..Manner::default()
        };
        let (forces, speeds) = held(none, 1);
        let (force, speed) = (statistics(&forces), statistics(&speeds));
        assert!((force.0 - 0.5).abs() < 1e-3 && force.1 < 1e-3, "{force:?}");
        assert!((speed.0 - 20.0).abs() < 0.1 && speed.1 < 0.1, "{speed:?}");
        let (mut force, mut speed) = (0.0, 0.0);
        for seed in 0..20 {
            let (forces, speeds) = held(Manner::default(), seed);
            force += statistics(&forces).1 / 0.5 / 20.0;
            speed += statistics(&speeds).1 / 20.0 / 20.0;
        }
        assert!((0.01..0.06).contains(&force), "{force}");
        assert!((0.04..0.12).contains(&speed), "{speed}");
    }
}
