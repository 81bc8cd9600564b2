//! The chip selects of the sensor's bus.
use core::mem::ManuallyDrop;

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AnyPin, Flex, Pin as _, Speed};
use embassy_stm32::pac::gpio::{Gpio, regs::Bsrr};

use crate::board::held;

/// A chip select. embassy's output computes port and bit from the pin's number each time, four times in a slot.
pub(super) struct Select {
    _pin: ManuallyDrop<Flex<'static>>,
    port: Gpio,
    mask: u32,
}

impl Select {
    pub(super) fn new(pin: Peri<'static, AnyPin>) -> Self {
        let (port, mask) = (pin.block(), 1 << pin.pin());
        let mut pin = held(pin);
        pin.set_high();
        pin.set_as_output(Speed::VeryHigh);
        Self {
            _pin: pin,
            port,
            mask,
        }
    }

    pub(super) fn set(&self, low: bool) {
        let mask = if low { self.mask << 16 } else { self.mask };
        self.port.bsrr().write_value(Bsrr(mask));
    }
}
