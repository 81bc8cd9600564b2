//! The parts of fingers that can be ordered, as they answer on the bus: written from their data sheets, apart from the core's decoders,
//! which are what is tested with them. What no data sheet says is chosen and marked.

pub mod ads1220;
pub mod iis3dwb;
pub mod mcp3202;
#[cfg(test)]
mod tests;

use super::finger::{Finger, Signals};
use super::sensor::SensorPeer;

/// MISO with nobody driving it, by its pull-up.
const FLOATING: u8 = 0xFF;

/// Polarity and phase of the clock, as the bus's master has them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ClockMode {
    /// The clock is high between transfers.
    pub idle_high: bool,
    /// Bits are taken on the second edge.
    pub second_edge: bool,
}

impl ClockMode {
    /// Modes 0 to 3.
    pub const fn of(mode: u8) -> Self {
        Self {
            idle_high: mode & 2 != 0,
            second_edge: mode & 1 != 0,
        }
    }

    /// Bits are taken while the clock rises.
    pub const fn on_rising(self) -> bool {
        self.idle_high == self.second_edge
    }
}

/// Something that breaks in a finger of parts.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum PartFault {
    /// The supply of the accelerometer dips: its registers are those of power-up again, its identity too, and it is off.
    AccelerometerBrownOut,
    /// The supply of the cell's converter dips: its registers are those of power-up again, and it converts no more.
    CellBrownOut,
    /// A signal wire of the cell is broken: the input goes to an end of its range.
    CellWire,
    /// Signal wires of the cell are exchanged: it says less when it is pressed.
    CellReversed,
    /// The plug of all parts is out.
    Unplugged,
    /// Something blocks the cell: it says the same, pressed or not.
    CellBlocked,
    /// The clocks of accelerometer and converter are off by this share.
    ClocksOff {
        /// Of either sign.
        share: f64,
    },
}

/// What answers on the bus.
#[allow(clippy::large_enum_variant)]
pub(super) enum Peers {
    BioTac(SensorPeer),
    Analog(mcp3202::Mcp3202),
    Mems {
        accelerometer: iis3dwb::Iis3dwb,
        cell: ads1220::Ads1220,
        selected: Option<bool>,
        unplugged: bool,
    },
}

impl Peers {
    /// The parts of such a finger.
    pub(super) fn new(finger: &Finger, seed: u64) -> Self {
        match finger.signals() {
            Signals::Fluid(_) => Self::BioTac(SensorPeer::new(seed)),
            Signals::Analog(_) => Self::Analog(mcp3202::Mcp3202::default()),
            Signals::Mems(_) => Self::Mems {
                accelerometer: iis3dwb::Iis3dwb::new(seed),
                cell: ads1220::Ads1220::new(seed),
                selected: None,
                unplugged: false,
            },
        }
    }

    /// What the parts have to complain of.
    pub(super) fn complaints(&self) -> u64 {
        match self {
            Self::Mems {
                accelerometer,
                cell,
                ..
            } => accelerometer.complaints() + cell.complaints(),
            _ => 0,
        }
    }

    /// Everything is plugged in and whole again; what it was told it may have forgotten.
    pub(super) fn mend(&mut self, now_ns: u64) {
        match self {
            Self::BioTac(sensor) => sensor.plug(now_ns),
            Self::Analog(converter) => *converter = mcp3202::Mcp3202::default(),
            Self::Mems {
                cell, unplugged, ..
            } => {
                cell.mend_wire();
                *unplugged = false;
            }
        }
    }

    /// A tick of the world is over: what goes on without the bus.
    pub(super) fn tick(&mut self, now_ns: u64, finger: &Finger) {
        if let (
            Self::Mems {
                accelerometer,
                cell,
                ..
            },
            Signals::Mems(mems),
        ) = (self, finger.signals())
        {
            accelerometer.tick(now_ns, mems.acceleration_g());
            cell.tick(now_ns, mems.cell_ratio());
        }
    }

    /// Chip select of a part falls.
    pub(super) fn select(&mut self, now_ns: u64, part: u8, mode: ClockMode) {
        match self {
            Self::BioTac(sensor) => sensor.select(now_ns),
            Self::Analog(converter) => converter.select(mode),
            Self::Mems {
                accelerometer,
                cell,
                selected,
                ..
            } => {
                *selected = Some(part == 0);
                if part == 0 {
                    accelerometer.select(now_ns, mode);
                } else {
                    cell.select(now_ns, mode);
                }
            }
        }
    }

    /// A byte to the selected part, and what it says meanwhile.
    pub(super) fn byte(&mut self, now_ns: u64, mosi: u8, finger: &mut Finger, fraction: f64) -> u8 {
        match self {
            Self::BioTac(sensor) => {
                sensor.byte(mosi, finger, fraction);
                FLOATING
            }
            Self::Analog(converter) => {
                converter.byte(mosi, |channel| finger.sample_channel(channel, fraction))
            }
            Self::Mems {
                accelerometer,
                cell,
                selected,
                unplugged,
            } => match *selected {
                _ if *unplugged => FLOATING,
                Some(true) => accelerometer.byte(now_ns, mosi),
                Some(false) => cell.byte(now_ns, mosi),
                None => FLOATING,
            },
        }
    }

    /// Chip select rises.
    pub(super) fn deselect(&mut self, now_ns: u64) {
        match self {
            Self::BioTac(sensor) => sensor.deselect(now_ns),
            Self::Analog(converter) => converter.deselect(),
            Self::Mems {
                accelerometer,
                cell,
                selected,
                ..
            } => {
                if selected.take() == Some(true) {
                    accelerometer.deselect();
                } else {
                    cell.deselect();
                }
            }
        }
    }

    /// Breaks something; what a finger does not have cannot break.
    pub(super) fn break_part(&mut self, now_ns: u64, fault: PartFault, finger: &mut Finger) {
        match (self, fault) {
            (Self::Analog(converter), PartFault::Unplugged) => converter.unplug(),
            (Self::Mems { unplugged, .. }, PartFault::Unplugged) => *unplugged = true,
            (Self::Mems { accelerometer, .. }, PartFault::AccelerometerBrownOut) => {
                accelerometer.brown_out(now_ns);
            }
            (Self::Mems { cell, .. }, PartFault::CellBrownOut) => cell.brown_out(now_ns),
            (
                Self::Mems {
                    accelerometer,
                    cell,
                    ..
                },
                PartFault::ClocksOff { share },
            ) => {
                accelerometer.set_clock(share);
                cell.set_clock(share);
            }
            (Self::Mems { cell, .. }, PartFault::CellWire) => cell.cut_wire(),
            _ => finger.break_part(fault),
        }
    }
}

/// A part whose master takes bits on the wrong edge: both lines come a bit late.
#[derive(Clone, Copy, Debug, Default)]
struct Late {
    mosi: bool,
    miso: bool,
}

impl Late {
    /// What the part hears of a byte.
    fn hear(&mut self, mosi: u8) -> u8 {
        u8::from(std::mem::replace(&mut self.mosi, mosi & 1 != 0)) << 7 | mosi >> 1
    }

    /// What the master hears of the part's byte.
    fn say(&mut self, miso: u8) -> u8 {
        u8::from(std::mem::replace(&mut self.miso, miso & 1 != 0)) << 7 | miso >> 1
    }
}
