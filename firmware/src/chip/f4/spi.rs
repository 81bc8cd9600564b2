//! Frames of an SPI, of a byte or of two (`wide`).
use embassy_stm32::pac::spi::Spi;
use embassy_stm32::pac::spi::regs::{Cr1, Cr2};
use embassy_stm32::pac::spi::vals::Dff;

/// Has the control register for frames of this width.
#[inline(always)]
pub(in crate::chip) fn set_width(control: &mut Cr1, wide: bool) {
    control.set_dff(if wide { Dff::BITS16 } else { Dff::BITS8 });
}

/// The second control register, with an interrupt for each frame or without.
#[inline(always)]
pub(in crate::chip) fn second_control(interrupts: bool, _wide: bool) -> Cr2 {
    let mut control = Cr2::default();
    control.set_rxneie(interrupts);
    control
}

/// After a reset, frames are bytes already.
#[inline(always)]
pub(in crate::chip) fn use_bytes(_spi: Spi) {}

/// Sends a frame. The one before has been read, so the data register is free, and the next that is received belongs to this one.
#[inline(always)]
pub(in crate::chip) fn send(spi: Spi, frame: u16, _wide: bool) {
    spi.dr().write(|w| w.set_dr(frame));
}

/// The frame that is over.
#[inline(always)]
pub(in crate::chip) fn received(spi: Spi, _wide: bool) -> u16 {
    spi.dr().read().dr()
}
