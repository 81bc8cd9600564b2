//! Switches of the chip's peripherals that a disturbance turns off.

use rigless::mcu::Operate as _;
use rigless::soc::Width;
use rigless::time::VirtualNanos;

use super::chip::Part;

/// A switch of a peripheral: its register and the bit in it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Switch {
    /// SPI1's: without it no frame is ever over.
    Spi1,
    /// ADC1's: without it no conversion is ever over.
    Adc1,
    /// I2C1's: without it no start is ever made.
    I2c1,
    /// Of the stream of DMA2 that carries ADC1: without it no conversion arrives, and the converter stops.
    Dma2,
}

impl Switch {
    fn place(self) -> (u64, u64) {
        match self {
            // SPE of CR1, ADON of CR2, PE of CR1, EN of S0CR
            Self::Spi1 => (0x4001_3000, 1 << 6),
            Self::Adc1 => (0x4001_2008, 1),
            Self::I2c1 => (0x4000_5400, 1),
            Self::Dma2 => (0x4002_6410, 1),
        }
    }

    /// Turns it off, if a store to `address` could have turned it on.
    pub(super) fn hold(self, part: &mut Part, at: VirtualNanos, address: u64) {
        if self.place().0 == address {
            self.off(part, at);
        }
    }

    /// Turns it off.
    pub(super) fn off(self, part: &mut Part, at: VirtualNanos) {
        let (register, bit) = self.place();
        // it is there, and clocked while the firmware uses it
        let before = part.read(at, register, Width::W32).unwrap_or_default();
        let _ = part.write(at, register, Width::W32, before & !bit);
    }
}
