//! Microchip's MCP3202, bit by bit (data sheet DS21034, section 5 and figures 1-1, 5-1).

use super::bus::{ClockMode, FLOATING};

/// Highest reading of 12 bits.
pub(crate) const FULL: u16 = 4095;

#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
enum State {
    #[default]
    Waits,
    /// So many of SGL/DIFF, ODD/SIGN and MSBF have come.
    Configured(u8),
    /// So many bits of the reading are out, the null bit not counted.
    Says(u8),
    /// 12 bits are out: least significant bit first from now on, or zeros.
    Over(u8),
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Mcp3202 {
    state: State,
    config: u8,
    reading: u16,
    /// chip select is low, in a mode that it works in
    on: bool,
    pub(super) unplugged: bool,
    /// something else than a finger is at its inputs
    pub(crate) inputs: Option<[u16; 2]>,
}

impl Mcp3202 {
    /// Chip select falls. Modes 0 and 3 work (features: "modes 0,0 and 1,1"); in the others DIN changes as it is taken,
    /// and no start bit is where it should be (chosen: none is heard).
    pub(super) fn select(&mut self, mode: ClockMode) {
        self.on = mode.on_rising() && !self.unplugged;
        self.state = State::Waits;
    }

    /// Chip select rises: the conversion ends (3.2).
    pub(super) fn deselect(&mut self) {
        self.on = false;
    }

    /// A byte, most significant bit first. `sample` gives what an input reads when it is sampled.
    pub(super) fn byte(&mut self, mosi: u8, mut sample: impl FnMut(u8) -> u16) -> u8 {
        if !self.on {
            return FLOATING;
        }
        (0..8).rev().fold(0, |miso, bit| {
            miso << 1 | u8::from(self.bit(mosi >> bit & 1 != 0, &mut sample))
        })
    }

    /// A clock: DIN is taken while it rises; the level of DOUT then was set as it fell before.
    fn bit(&mut self, din: bool, sample: &mut impl FnMut(u8) -> u16) -> bool {
        match self.state {
            State::Waits => {
                if din {
                    (self.state, self.config) = (State::Configured(0), 0);
                }
                // high impedance until the null bit (figure 5-1)
                true
            }
            State::Configured(bits) => {
                self.config = self.config << 1 | u8::from(din);
                // the sample is taken from the second rising edge after the start bit on, and ends within the third
                // (5.1)
                if bits == 1 {
                    self.reading = if self.config & 0b10 != 0 {
                        sample(self.config & 1)
                    } else {
                        // the difference of both, not below 0 (table 5-1)
                        let [a, b] = [0, 1].map(&mut *sample);
                        let (plus, minus) = if self.config & 1 == 0 { (a, b) } else { (b, a) };
                        plus.saturating_sub(minus)
                    }
                    .min(FULL);
                }
                if bits == 2 {
                    self.state = State::Says(0);
                } else {
                    self.state = State::Configured(bits + 1);
                }
                true
            }
            // the null bit comes first
            State::Says(0) => {
                self.state = State::Says(1);
                false
            }
            State::Says(bit) => {
                self.state = if bit == 12 {
                    State::Over(0)
                } else {
                    State::Says(bit + 1)
                };
                self.reading >> (12 - bit) & 1 != 0
            }
            State::Over(bit) => {
                self.state = State::Over((bit + 1).min(12));
                let msb_first_only = self.config & 1 != 0;
                // bit 0 was the last one out, and is shared by both orders (figure 5-2)
                !msb_first_only && bit < 11 && self.reading >> (bit + 1) & 1 != 0
            }
        }
    }
}
