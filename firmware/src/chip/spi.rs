//! Frames of an SPI, of a byte or of two.
use embassy_stm32::pac::spi::Spi;

/// Sends a frame. The one before has been read, so the data register is free, and the next that is received belongs to
/// this one.
#[inline(always)]
pub(super) fn send(spi: Spi, frame: u16) {
    spi.dr().write(|w| w.set_dr(frame));
}

#[inline(always)]
pub(super) fn received(spi: Spi) -> u16 {
    spi.dr().read().dr()
}
