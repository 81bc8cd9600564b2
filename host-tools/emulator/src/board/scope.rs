//! What the probes of an oscilloscope see at the chip's pins, beside [`Rig::trace`](super::Rig::trace): the sensor's bus, the encoder,
//! the motor's current and the emergency stop.

use tactus_world::encoder::Edge;

/// A frame over the sensor's bus.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Frame {
    /// When its last bit was over, ns.
    pub at_ns: u64,
    /// Bits, the highest first.
    pub bits: u8,
    /// To the sensor.
    pub mosi: u32,
    /// From it.
    pub miso: u32,
    /// Clocks of the bus' peripheral in a bit, by its CR1.
    pub divider: u32,
}

/// What was seen since the probes were put there, oldest first.
#[derive(Clone, Debug, Default)]
pub struct Scope {
    /// Levels of chip select with their times, ns.
    pub select: Vec<(u64, bool)>,
    /// Frames of the bus.
    pub frames: Vec<Frame>,
    /// Edges of the encoder's lines.
    pub encoder: Vec<Edge>,
    /// What the converter was given of the motor's current whenever somebody looked at it: time, ns, and counts.
    pub current: Vec<(u64, u16)>,
    /// Levels of the emergency stop's pin, ns.
    pub stop: Vec<(u64, bool)>,
}

/// The stage's PWM as its timer makes it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct BridgePwm {
    /// Length of a period, s.
    pub period_s: f64,
    /// Share of it that the pin is high.
    pub duty: f64,
    /// When a period began, s before now.
    pub since_s: f64,
}
