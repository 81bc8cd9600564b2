//! The parts of fingers that can be ordered, as they answer on the bus: written from their data sheets, independently
//! of the core's decoders, which are tested with them. Values that no data sheet gives are chosen and marked.

pub mod ads1220;
mod bus;
pub(super) mod fault;
pub mod iis3dwb;
pub mod mcp3202;
#[cfg(test)]
mod tests;

use super::finger::{Finger, Signals};
use super::sensor::SensorPeer;
pub use bus::ClockMode;
use bus::FLOATING;
pub use fault::PartFault;

/// The parts that answer on the bus.
#[allow(clippy::large_enum_variant)]
pub(super) enum Peers {
    BioTac(SensorPeer),
    Analog(mcp3202::Mcp3202),
    Mems {
        accelerometer: iis3dwb::Iis3dwb,
        cell: ads1220::Ads1220,
        selected: Option<bool>,
        unplugged: bool,
        /// Only the accelerometer is.
        without_accelerometer: bool,
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
                without_accelerometer: false,
            },
        }
    }

    /// Number of complaints of the parts.
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

    /// Plugs in and repairs everything; parts may have lost their settings.
    pub(super) fn mend(&mut self, now_ns: u64) {
        match self {
            Self::BioTac(sensor) => sensor.plug(now_ns),
            Self::Analog(converter) => *converter = mcp3202::Mcp3202::default(),
            Self::Mems {
                cell,
                unplugged,
                without_accelerometer,
                ..
            } => {
                cell.mend_wire();
                (*unplugged, *without_accelerometer) = (false, false);
            }
        }
    }

    /// A tick of the world is over: advances the parts that run without the bus.
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

    /// A byte to the selected part; returns the part's byte.
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
                without_accelerometer,
            } => match *selected {
                _ if *unplugged => FLOATING,
                Some(true) if *without_accelerometer => FLOATING,
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

    /// Breaks a part; a fault of a part that the finger does not have is ignored.
    pub(super) fn break_part(&mut self, now_ns: u64, fault: PartFault, finger: &mut Finger) {
        match (self, fault) {
            (Self::Analog(converter), PartFault::Unplugged) => converter.unplug(),
            (Self::Mems { unplugged, .. }, PartFault::Unplugged) => *unplugged = true,
            (
                Self::Mems {
                    without_accelerometer,
                    ..
                },
                PartFault::AccelerometerUnplugged,
            ) => *without_accelerometer = true,
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
            (Self::Mems { accelerometer, .. }, PartFault::AccelerometerOff { share, zero_g }) => {
                accelerometer.set_scale(share, zero_g);
            }
            (Self::Mems { cell, .. }, PartFault::CellWire) => cell.cut_wire(),
            _ => finger.break_part(fault),
        }
    }
}
