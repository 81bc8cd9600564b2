//! An arm that holds the finger: the motion of its joints under the commanded velocities of [`crate::arm_program`].
//!
//! Its frame is the sample's, as a person has measured it: the height is off by some tenths of a millimetre, and the
//! sample is not level in it. So only the force shows where the sample is.

use super::conditions::TICK_S;
use super::noise::Noise;
use super::surface::LENGTH_MM;

/// Stream of the seed that arms draw from.
const STREAM: u64 = 0xa3;
/// Fastest change of a velocity, mm/s^2, and how slowly an axis follows its command, s (chosen: a light arm at low
/// speed).
const ACCELERATION_MM_S2: f64 = 1000.0;
const FOLLOWS_S: f64 = 0.01;
/// Speed wanders by this share, rms, within this time, s (chosen: gears).
const RIPPLE: f64 = 0.003;
const RIPPLE_S: f64 = 0.03;
/// Height by which the sample's top may be off, and by which it rises along its length, mm (chosen: a careful
/// teach-in).
const TOP_MM: (f64, f64) = (-0.5, 0.5);
const SLOPE_MM: (f64, f64) = (-0.04, 0.04);
/// Highest that it goes, mm.
const HIGHEST_MM: f64 = 60.0;

/// An arm.
#[derive(Clone, Debug)]
pub struct Arm {
    noise: Noise,
    /// True height of the sample's top, mm, and its slope.
    top_mm: f64,
    slope_mm: f64,
    x_mm: f64,
    height_mm: f64,
    /// Velocity along the sample and up: commanded, and actual, mm/s.
    wanted_mm_s: [f64; 2],
    speed_mm_s: [f64; 2],
    ripple: f64,
}

impl Arm {
    /// Height at power-up over the sample as it was measured, mm.
    pub(crate) const BEGINS_MM: f64 = 10.0;

    /// An arm with its finger in the air, over the middle of the sample.
    pub fn new(seed: u64) -> Self {
        let mut noise = Noise::new(seed, STREAM);
        Self {
            top_mm: noise.between(TOP_MM.0, TOP_MM.1),
            slope_mm: noise.between(SLOPE_MM.0, SLOPE_MM.1),
            noise,
            x_mm: LENGTH_MM / 2.0,
            height_mm: Self::BEGINS_MM,
            wanted_mm_s: [0.0; 2],
            speed_mm_s: [0.0; 2],
            ripple: 0.0,
        }
    }

    /// Commands velocities: along the sample, and up, mm/s. They hold until the next command.
    pub fn go(&mut self, along_mm_s: f64, up_mm_s: f64) {
        self.wanted_mm_s = [along_mm_s, up_mm_s];
    }

    /// Place of the finger on the sample by its encoders, mm from the edge.
    pub fn x_mm(&self) -> f64 {
        self.x_mm
    }

    /// Height of the fingertip over the sample as it was measured, mm.
    pub fn height_mm(&self) -> f64 {
        self.height_mm
    }

    /// Speed along the sample, mm/s.
    pub fn speed_mm_s(&self) -> f64 {
        self.speed_mm_s[0]
    }

    /// Returns true if it stands.
    pub fn stands(&self) -> bool {
        self.speed_mm_s.iter().all(|speed| speed.abs() < 0.02)
    }

    /// Depth of the sample in the fingertip, mm; negative is a gap.
    pub fn indentation_mm(&self) -> f64 {
        let rises = self.slope_mm * (self.x_mm / LENGTH_MM - 0.5);
        self.top_mm + rises - self.height_mm
    }

    pub(super) fn tick(&mut self) {
        let [white, _] = self.noise.white();
        let step = TICK_S / RIPPLE_S;
        self.ripple += (2.0 * step).sqrt() * white - step * self.ripple;
        let most = ACCELERATION_MM_S2 * TICK_S;
        for (speed, wanted) in self.speed_mm_s.iter_mut().zip(self.wanted_mm_s) {
            *speed += ((wanted - *speed) * TICK_S / FOLLOWS_S).clamp(-most, most);
        }
        let [along, up] = self.speed_mm_s;
        let along = along * (1.0 + RIPPLE * self.ripple);
        self.x_mm = (self.x_mm + along * TICK_S).clamp(0.0, LENGTH_MM);
        self.height_mm = (self.height_mm + up * TICK_S).min(HIGHEST_MM);
    }
}
