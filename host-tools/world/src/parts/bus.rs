//! The bus as a part has it.

/// MISO while no part drives it, by its pull-up.
pub(super) const FLOATING: u8 = 0xFF;

/// Polarity and phase of the clock, as the bus's master has them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ClockMode {
    /// The clock is high between transfers.
    pub(crate) idle_high: bool,
    /// Bits are taken on the second edge.
    pub(crate) second_edge: bool,
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
    pub(crate) const fn on_rising(self) -> bool {
        self.idle_high == self.second_edge
    }
}

/// A part whose master takes bits on the wrong edge: both lines come a bit late.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Late {
    mosi: bool,
    miso: bool,
}

impl Late {
    pub(super) fn hear(&mut self, mosi: u8) -> u8 {
        u8::from(std::mem::replace(&mut self.mosi, mosi & 1 != 0)) << 7 | mosi >> 1
    }

    pub(super) fn say(&mut self, miso: u8) -> u8 {
        u8::from(std::mem::replace(&mut self.miso, miso & 1 != 0)) << 7 | miso >> 1
    }
}
