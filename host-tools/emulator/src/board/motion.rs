//! The handheld's sensor of motion on SPI4, if there is one.

use tactus_world::flow::{Flow, Ground};

/// CR1 of an SPI (RM0090 28.5.1): both bits of the mode, the divider of the clock, the order of the bits.
const CR1_MODE: u64 = 0b11;
const CR1_DIVIDER: u64 = 3;
const CR1_LSB_FIRST: u64 = 1 << 7;
/// Clock of the bus before it is divided, Hz.
const BUS_HZ: u64 = 84_000_000;
/// Reading of an input that nothing drives.
const FLOATING: u8 = 0xFF;

/// Its end of the bus.
#[derive(Debug, Default)]
pub struct MotionPeer {
    flow: Option<Flow>,
    control: u64,
    wired: bool,
    selected: bool,
    bytes: u64,
}

impl MotionPeer {
    /// It has got its power, over this ground; without a ground there is no sensor.
    pub(crate) fn new(seed: u64, ground: Option<Ground>) -> Self {
        Self {
            flow: ground.map(|ground| Flow::new(seed, ground)),
            ..Self::default()
        }
    }

    /// The part, where it is there.
    pub fn flow(&mut self) -> Option<&mut Flow> {
        self.flow.as_mut()
    }

    /// Bytes that went over the bus.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// CR1 of SPI4.
    pub(crate) fn control(&mut self, cr1: u64) {
        self.control = cr1;
    }

    pub(crate) fn wire(&mut self, wired: bool) {
        self.wired = wired;
    }

    pub(crate) fn select(&mut self, selected: bool) {
        if selected != self.selected
            && let Some(flow) = &mut self.flow
        {
            if selected {
                flow.select();
            } else {
                flow.deselect();
            }
        }
        self.selected = selected;
    }

    /// A byte that ends now, with the probe at this place.
    pub(crate) fn byte(&mut self, now_ns: u64, x_mm: f64, mosi: u8, bits: u8) -> u8 {
        self.bytes += 1;
        let Some(flow) = self.flow.as_mut().filter(|_| self.wired && self.selected) else {
            return FLOATING;
        };
        flow.moves(now_ns, x_mm);
        let divider = 2 << (self.control >> CR1_DIVIDER & 0b111);
        let begins_ns = now_ns - 8 * divider * 1_000_000_000 / BUS_HZ;
        let understood =
            self.control & CR1_MODE == CR1_MODE && self.control & CR1_LSB_FIRST == 0 && bits == 8;
        // chosen: a byte that it cannot understand is lost
        if understood {
            flow.byte(begins_ns, now_ns, mosi)
        } else {
            FLOATING
        }
    }
}
