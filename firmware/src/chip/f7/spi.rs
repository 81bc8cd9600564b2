//! Frames of an SPI, of a byte or of two (`wide`). Its buffers hold four bytes: an access to its data register of the wrong width
//! would move two frames, or half of one (RM0410, SPI: data packing). The width is in the second control register, and so is when
//! a frame counts as received.
use embassy_stm32::pac::spi::Spi;
use embassy_stm32::pac::spi::regs::{Cr1, Cr2};
use embassy_stm32::pac::spi::vals::{Ds, Frxth};

/// The first control register has nothing of it.
#[inline(always)]
pub(in crate::chip) fn set_width(_control: &mut Cr1, _wide: bool) {}

/// The second control register, with an interrupt for each frame or without. To be written while the bus is off.
#[inline(always)]
pub(in crate::chip) fn second_control(interrupts: bool, wide: bool) -> Cr2 {
    let mut control = Cr2::default();
    control.set_rxneie(interrupts);
    let (width, threshold) = if wide {
        (Ds::BITS16, Frxth::HALF)
    } else {
        (Ds::BITS8, Frxth::QUARTER)
    };
    control.set_ds(width);
    control.set_frxth(threshold);
    control
}

/// After a reset, frames are bytes, but count as received in twos.
#[inline(always)]
pub(in crate::chip) fn use_bytes(spi: Spi) {
    spi.cr2().write_value(second_control(false, false));
}

/// Sends a frame. The one before has been read, so the data register is free, and the next that is received belongs to this one.
#[inline(always)]
pub(in crate::chip) fn send(spi: Spi, frame: u16, wide: bool) {
    if wide {
        spi.dr16().write_value(frame);
    } else {
        spi.dr8().write_value(frame as u8);
    }
}

/// The frame that is over.
#[inline(always)]
pub(in crate::chip) fn received(spi: Spi, wide: bool) -> u16 {
    if wide {
        spi.dr16().read()
    } else {
        spi.dr8().read().into()
    }
}
