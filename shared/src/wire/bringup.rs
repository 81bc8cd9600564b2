//! What the host and the self-test image say to each other while a new rig is brought up: the board measures, the host
//! judges.
//!
//! Frames are those of the link. [`MARK`] stands where a [`Request`](super::Request) and a [`Report`](super::Report)
//! have the number of their variant, and none has this one: the images of the rig and of the handheld take such a frame
//! for damaged, and the self-test takes no frame of theirs.

pub mod limits;

use core::fmt;

use heapless::{String, Vec};
use serde::{Deserialize, Serialize};

use super::event::Reset;
use super::text::{Text, text};
use crate::sensor::FingerCode;

/// See above: 16383 as a variant's number.
pub const MARK: [u8; 2] = [0xFF, 0x7F];
/// Version of these messages. The two ends must have the same.
pub const BRINGUP: u8 = 1;
/// Points of a series in one message, and points that the board keeps.
pub const POINTS: usize = 120;
/// See [`POINTS`].
pub const MAX_POINTS: usize = 480;

/// From the host.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Ask {
    /// Comes back in the answer.
    pub id: u16,
    /// [`MARK`].
    pub mark: [u8; 2],
    /// What is to be measured.
    pub measure: Measure,
}

/// From the self-test: one for each [`Ask`].
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Answer {
    /// Of the question.
    pub id: u16,
    /// Since the board started, ms.
    pub at_ms: u32,
    /// [`MARK`].
    pub mark: [u8; 2],
    /// What was seen.
    pub saw: Saw,
}

/// What can be measured. Whatever comes while a motor moves stops it.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub enum Measure {
    /// Which image this is.
    Hello,
    /// Clocks, reset, option bytes.
    Chip,
    /// What hangs on the pins, as it was at the start.
    Pins,
    /// The sensor for a second; a series of P_AC and P_DC, counts.
    Sensor,
    /// Switches, encoder and current now.
    Look,
    /// Waits for 30 s until somebody squeezes the finger in the hand and lays it down: from then on motors may move.
    Squeeze,
    /// So many steps of the lever, downwards positive, 3200 at most; up, to its switch at most. A series of steps / 4
    /// and of P_DC above its rest, counts * 16.
    Lever(i16),
    /// Up to the switch, by 20 mm at most.
    LeverTop,
    /// Moves the stage by 1 mm and brakes it, to the right if so. A series of places, um, and currents, mA, each ms.
    Stage(bool),
    /// Duties of the bridge from -0.48 to 0.48 into a resistor. A series of duties, thousandths, and currents, mA.
    Ramp,
    /// Writes a record of the store and reads it.
    Store,
    /// Hangs until the watchdog starts the board again. No answer: see [`Saw::Hello`].
    Watchdog,
    /// Starts the board again. No answer.
    Restart,
    /// The points from this one on of the last series.
    Series(u16),
    /// A kernel in assembly, by its number up to [`KERNELS`]: its results are those of its plain twin, its cycles.
    Kernel(u8),
    /// The timer of the slots, and the ring of the motor's current.
    Timers,
    /// A write to a sector that nobody uses, and its erase.
    Flash,
    /// An MCP3202 in the sensor's place for [`READINGS`]; a series of both its channels, counts.
    Converter,
    /// The pins of the sensor's bus.
    Wires,
    /// A handheld's button; its display is lit, and its buzzer sounds, for 0.5 s.
    Hand,
}

/// Kernels that can be asked for.
pub const KERNELS: u8 = 3;
/// Readings of each channel of a converter.
pub const READINGS: u16 = 240;

/// What was seen.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant)] // no allocation here, and only one at a time
pub enum Saw {
    /// The image.
    Hello {
        /// [`BRINGUP`].
        protocol: u8,
        /// Version of the firmware.
        version: String<16>,
        /// Why it started.
        reset: Reset,
        /// Why the firmware gave up before, if it did.
        last_words: Option<Text>,
    },
    /// See [`ChipSeen`].
    Chip(ChipSeen),
    /// See [`PinsSeen`].
    Pins(PinsSeen),
    /// See [`SensorSeen`].
    Sensor(SensorSeen),
    /// See [`Look`].
    Look(Look),
    /// True if the finger was squeezed.
    Squeeze(Result<(), Stopped>),
    /// See [`LeverSeen`].
    Lever(LeverSeen),
    /// See [`StageSeen`].
    Stage(StageSeen),
    /// Why the ramp ended.
    Ramp(Result<(), Stopped>),
    /// Work that the skin has seen, mJ, before and after its record was written, or why not.
    Store(Result<[u32; 2], Text>),
    /// Points of the last series.
    Series(Vec<[i16; 2], POINTS>),
    /// See [`Checked`].
    Checks(Vec<Checked, 2>),
    /// See [`ConverterSeen`].
    Converter(ConverterSeen),
    /// Clock, MISO, MOSI and chip select: 16 times the port, A is 0, and the pin.
    Wires([u8; 4]),
    /// See [`HandSeen`].
    Hand(HandSeen),
}

/// A handheld's parts beside the finger.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct HandSeen {
    /// The display answers.
    pub display: bool,
    /// PC13 is high.
    pub pressed: bool,
}

/// A check of the chip alone.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Checked {
    /// Its name.
    pub name: String<16>,
    /// True if it has passed.
    pub good: bool,
    /// The measurement, with its limit.
    pub measured: Text,
}

impl Checked {
    /// Cuts off what is too long.
    pub fn new(name: &str, good: bool, measured: impl fmt::Display) -> Self {
        Self {
            name: name.try_into().unwrap_or_default(),
            good,
            measured: text(measured),
        }
    }
}

/// Readings of a converter of two channels.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct ConverterSeen {
    /// Readings of both channels, and those of them that the converter did not drive: they have no null bit.
    pub read: u16,
    /// See [`ConverterSeen::read`].
    pub undriven: u16,
    /// Least and most of each channel, counts.
    pub counts: [[u16; 2]; 2],
}

/// Clocks and option bytes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct ChipSeen {
    /// The core's clock by the clock of the timers, kHz.
    pub khz: u32,
    /// The 8 MHz are there.
    pub external: bool,
    /// PLL locked and in use.
    pub locked: bool,
    /// PA12 is high.
    pub pa12: bool,
    /// BOR_LEV: 0 is level 3, 3 is off.
    pub brown_out: u8,
}

/// A pin that something hangs on.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
#[allow(missing_docs)] // their names
pub enum Pin {
    LeverTop,
    StageLeft,
    StageRight,
    EStop,
    EncoderA,
    EncoderB,
    /// While the sensor is selected, as the two after it.
    Miso,
    Mosi,
    Select,
    LeverEnable,
    StageEnable,
}

impl Pin {
    /// In the order of the bits of [`PinsSeen`].
    pub const ALL: [Self; 11] = [
        Self::LeverTop,
        Self::StageLeft,
        Self::StageRight,
        Self::EStop,
        Self::EncoderA,
        Self::EncoderB,
        Self::Miso,
        Self::Mosi,
        Self::Select,
        Self::LeverEnable,
        Self::StageEnable,
    ];
}

/// What a pin is tied to, by its levels with the chip's pull-up and with its pull-down.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Tied {
    /// To nothing: it follows the pulls.
    Floating,
    /// High.
    High,
    /// Low.
    Low,
}

/// Levels of [`Pin::ALL`] with the chip's pull-up and with its pull-down, a bit each, the first one the lowest.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, Serialize, Deserialize)]
pub struct PinsSeen {
    /// With the pull-up.
    pub up: u16,
    /// With the pull-down.
    pub down: u16,
}

impl PinsSeen {
    /// What a pin is tied to. One that is low when pulled up and high when pulled down changed by itself meanwhile:
    /// driven low.
    pub fn tied(&self, pin: Pin) -> Tied {
        let bit = pin as u16;
        match (self.up >> bit & 1, self.down >> bit & 1) {
            (1, 0) => Tied::Floating,
            (1, _) => Tied::High,
            _ => Tied::Low,
        }
    }
}

/// A second of the sensor.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct SensorSeen {
    /// The finger that answered when the board started; a BioTac if none did.
    pub finger: FingerCode,
    /// Serial number, firmware and flexible circuit, or what is wrong with a part.
    pub identity: Result<Text, Text>,
    /// Words, and those of them that were garbled, error frames, and FF FF or 00 00.
    pub words: u32,
    /// Parity or padding.
    pub garbled: u32,
    /// Error frames, or readings that no sound part gives.
    pub error_frames: u32,
    /// FF FF or 00 00.
    pub silent: u32,
    /// Slots that began too late.
    pub late: u32,
    /// The last word as it was read.
    pub last: [u8; 2],
    /// P_AC, counts: mean, standard deviation.
    pub pac: [f32; 2],
    /// P_DC likewise.
    pub pdc: [f32; 2],
}

/// Now.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Look {
    /// The lever's switch is open.
    pub lever_top: bool,
    /// The stage's left one is.
    pub stage_left: bool,
    /// The stage's right one is.
    pub stage_right: bool,
    /// The emergency stop's is.
    pub e_stop: bool,
    /// Count of the encoder since the start.
    pub encoder: i32,
    /// Conversions of the motor's current over some 80 ms, counts: mean, standard deviation. `None`: nothing is
    /// converted.
    pub current: Option<[f32; 2]>,
}

/// A move of the lever.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct LeverSeen {
    /// Steps made, downwards positive.
    pub steps: i32,
    /// The switch is open at the end.
    pub at_top: bool,
    /// Most that P_DC rose above its rest, counts.
    pub rise: f32,
    /// Why it ended.
    pub ended: Result<(), Stopped>,
}

/// A move of the stage.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct StageSeen {
    /// By the encoder, to the right positive, braking included.
    pub moved_um: i32,
    /// Highest duty, to the right positive.
    pub duty: f32,
    /// The motor's current while it was driven, mA, and ...
    pub driven_ma: f32,
    /// ... without duty, while it braked.
    pub braking_ma: f32,
    /// Why it ended.
    pub ended: Result<(), Stopped>,
}

/// The reasons why a motor was stopped, or did not start.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum Stopped {
    #[error("the finger was not squeezed in the hand before")]
    NotSqueezed,
    #[error("nobody squeezed it and laid it down")]
    NobodySqueezed,
    #[error("a switch is open")]
    SwitchOpen,
    #[error("emergency stop")]
    EStop,
    #[error("it ran into a limit switch: push it to its middle and run the test again")]
    Limit,
    #[error(
        "P_DC rises: the finger is on its mount, or somebody holds it. If the lever went down, DIR is inverted"
    )]
    Pressed,
    #[error("P_DC says nothing, so nobody would see the finger pressed")]
    Silent,
    #[error("the switch at its top stays closed on the way up: it does not move, or moves down")]
    TopStaysClosed,
    #[error(
        "the switch at its top stays open 2 mm below: its wire is broken, or the lever does not move"
    )]
    TopStaysOpen,
    #[error("it came back to its switch too early: it loses steps on the way down")]
    TopTooEarly,
    #[error("the encoder counts backwards: swap its lines A and B, or the motor's wires")]
    Backwards,
    #[error("hardly any current: the motor, the bridge's enable or its supply")]
    NoCurrent,
    #[error("the encoder does not count: a line of it is cut, or the stage does not move")]
    NoCount,
    #[error("the stage moves: its motor is still connected")]
    Moves,
    #[error("the motor's current is not converted")]
    Converter,
    #[error("another question came")]
    Asked,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::{Command, Event, FrameError, MAX_FRAME, Report, Request, decode, encode};

    fn frame(message: &impl Serialize) -> std::vec::Vec<u8> {
        let mut buffer = [0; MAX_FRAME + 1];
        let frame = encode(message, &mut buffer).unwrap();
        frame[..frame.len() - 1].to_vec()
    }

    #[test]
    fn the_images_do_not_take_each_others_frames() {
        for id in [0, 1, 127, 128, u16::MAX] {
            let ask = Ask {
                id,
                mark: MARK,
                measure: Measure::LeverTop,
            };
            let request = decode::<Request>(&mut frame(&ask));
            assert_eq!(request, Err(FrameError::Message));
            assert_eq!(decode::<Ask>(&mut frame(&ask)), Ok(ask));
            for command in [Command::Home, Command::Calibrate, Command::Stream(true)] {
                let request = frame(&Request { id, command });
                let taken = decode::<Ask>(&mut request.clone());
                assert!(!taken.is_ok_and(|ask| ask.mark == MARK));
            }
            let answer = Answer {
                id,
                at_ms: 1000,
                mark: MARK,
                saw: Saw::Ramp(Err(Stopped::EStop)),
            };
            let report = decode::<Report>(&mut frame(&answer));
            assert_eq!(report, Err(FrameError::Message));
            let report = frame(&Report {
                number: id,
                at_ms: 1000,
                event: Event::Done(id),
            });
            let taken = decode::<Answer>(&mut report.clone());
            assert!(!taken.is_ok_and(|answer| answer.mark == MARK));
        }
    }

    #[test]
    fn the_longest_answer_fits_into_a_frame() {
        let saw = Saw::Series(Vec::from_slice(&[[i16::MIN; 2]; POINTS]).unwrap());
        let answer = Answer {
            id: u16::MAX,
            at_ms: u32::MAX,
            mark: MARK,
            saw,
        };
        assert_eq!(decode::<Answer>(&mut frame(&answer)), Ok(answer));
    }

    #[test]
    fn the_longest_checks_fit_into_a_frame() {
        let [name, measured] = ["n", "m"].map(|letter| letter.repeat(200));
        let checked = Checked {
            name: name[..16].try_into().unwrap(),
            ..Checked::new("", true, &measured)
        };
        let saw = Saw::Checks(Vec::from_slice(&[checked.clone(), checked]).unwrap());
        let (id, at_ms, mark) = (u16::MAX, u32::MAX, MARK);
        let answer = Answer {
            id,
            at_ms,
            mark,
            saw,
        };
        assert_eq!(decode::<Answer>(&mut frame(&answer)), Ok(answer));
    }

    #[test]
    fn a_pin_is_what_it_does_with_the_pulls() {
        let seen = PinsSeen {
            up: 0b011,
            down: 0b010,
        };
        assert_eq!(seen.tied(Pin::LeverTop), Tied::Floating);
        assert_eq!(seen.tied(Pin::StageLeft), Tied::High);
        assert_eq!(seen.tied(Pin::StageRight), Tied::Low);
    }
}
