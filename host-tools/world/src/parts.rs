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
    Mems(Mems),
}

pub(super) struct Mems {
    accelerometer: iis3dwb::Iis3dwb,
    cell: ads1220::Ads1220,
    /// the accelerometer, or the cell
    selected: Option<bool>,
    unplugged: bool,
    /// only the accelerometer is
    without_accelerometer: bool,
}

impl Peers {
    pub(super) fn new(finger: &Finger, seed: u64) -> Self {
        match finger.signals() {
            Signals::Fluid(_) => Self::BioTac(SensorPeer::new(seed)),
            Signals::Analog(_) => Self::Analog(mcp3202::Mcp3202::default()),
            Signals::Mems(_) => Self::Mems(Mems {
                accelerometer: iis3dwb::Iis3dwb::new(seed),
                cell: ads1220::Ads1220::new(seed),
                selected: None,
                unplugged: false,
                without_accelerometer: false,
            }),
        }
    }

    pub(super) fn complaints(&self) -> u64 {
        match self {
            Self::Mems(parts) => parts.accelerometer.complaints + parts.cell.complaints,
            _ => 0,
        }
    }

    /// Plugs in and repairs everything; parts may have lost their settings.
    pub(super) fn mend(&mut self, now_ns: u64) {
        match self {
            Self::BioTac(sensor) => sensor.plug(now_ns),
            Self::Analog(converter) => *converter = mcp3202::Mcp3202::default(),
            Self::Mems(parts) => {
                parts.cell.wire_cut = false;
                (parts.unplugged, parts.without_accelerometer) = (false, false);
            }
        }
    }

    /// A tick of the world is over: advances the parts that run without the bus.
    pub(super) fn tick(&mut self, now_ns: u64, finger: &Finger) {
        if let (Self::Mems(parts), Signals::Mems(mems)) = (self, finger.signals()) {
            parts.accelerometer.tick(now_ns, mems.acceleration_g);
            parts.cell.tick(now_ns, mems.cell_ratio());
        }
    }

    pub(super) fn select(&mut self, now_ns: u64, part: u8, mode: ClockMode) {
        match self {
            Self::BioTac(sensor) => sensor.select(now_ns),
            Self::Analog(converter) => converter.select(mode),
            Self::Mems(parts) => {
                parts.selected = Some(part == 0);
                match part {
                    0 => parts.accelerometer.select(now_ns, mode),
                    _ => {
                        parts.accelerometer.overhear(mode);
                        parts.cell.select(now_ns, mode);
                    }
                }
            }
        }
    }

    pub(super) fn byte(&mut self, now_ns: u64, mosi: u8, finger: &mut Finger, fraction: f64) -> u8 {
        match self {
            Self::BioTac(sensor) => {
                sensor.byte(mosi, finger, fraction);
                FLOATING
            }
            Self::Analog(converter) => {
                let inputs = converter.inputs;
                converter.byte(mosi, |channel| match inputs {
                    Some([first, _]) if channel == 0 => first,
                    Some([_, second]) => second,
                    None => finger.sample_channel(channel, fraction),
                })
            }
            Self::Mems(parts) => match parts.selected {
                _ if parts.unplugged => FLOATING,
                Some(true) if parts.without_accelerometer => FLOATING,
                Some(true) => parts.accelerometer.byte(now_ns, mosi),
                Some(false) => parts.cell.byte(now_ns, mosi),
                None => FLOATING,
            },
        }
    }

    pub(super) fn deselect(&mut self, now_ns: u64) {
        match self {
            Self::BioTac(sensor) => sensor.deselect(now_ns),
            Self::Analog(converter) => converter.deselect(),
            Self::Mems(parts) => match parts.selected.take() {
                Some(true) => parts.accelerometer.deselect(),
                _ => parts.cell.deselect(),
            },
        }
    }

    /// Breaks a part; a fault of a part that the finger does not have is ignored.
    pub(super) fn break_part(&mut self, now_ns: u64, fault: PartFault, finger: &mut Finger) {
        match (self, fault) {
            (Self::Analog(converter), PartFault::Unplugged) => converter.unplugged = true,
            (Self::Mems(parts), PartFault::Unplugged) => parts.unplugged = true,
            (Self::Mems(parts), PartFault::AccelerometerUnplugged) => {
                parts.without_accelerometer = true;
            }
            (Self::Mems(parts), PartFault::AccelerometerBrownOut) => {
                parts.accelerometer.brown_out(now_ns);
            }
            (Self::Mems(parts), PartFault::CellBrownOut) => parts.cell.brown_out(now_ns),
            (Self::Mems(parts), PartFault::ClocksOff { share }) => {
                parts.accelerometer.set_clock(share);
                parts.cell.clock = share;
            }
            (Self::Mems(parts), PartFault::AccelerometerOff { share, zero_g }) => {
                parts.accelerometer.scale = (share, zero_g);
            }
            (Self::Mems(parts), PartFault::CellWire) => parts.cell.wire_cut = true,
            _ => finger.break_part(fault),
        }
    }
}
