//! Limits of what is right in a new rig, for the host that judges its measurements.

/// P_DC rises by so much when a hand squeezes the finger, mN.
pub const SQUEEZED_MN: f32 = 230.0;
/// What the converter reads without current, counts: half of its reference; and how far it may be off, which is far
/// beyond what the amplifier's resistors can do.
pub const CURRENT_ZERO: (f32, f32) = (2048.0, 60.0);
/// Noise of the motor's current at rest, counts rms: 13 mA; the slowest slide draws 40.
pub const CURRENT_RMS: f32 = 16.0;
/// A motor that stands and draws less than this is hardly driven, A: friction alone takes more.
pub const WEAK_A: f32 = 0.025;
/// A shorted motor that is turned by the stage draws more than this the other way, A.
pub const BRAKING_A: f32 = 0.02;
/// How far from where it opened the lever's switch may open again, steps: 0.1 mm.
pub const LEVER_PLAY: i32 = 160;
