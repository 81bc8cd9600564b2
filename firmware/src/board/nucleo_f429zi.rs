//! The NUCLEO-F429ZI.
use embassy_stm32::pac::FLASH as FLASH_INTERFACE;
use embassy_stm32::{bind_interrupts, flash, peripherals, usart};

bind_interrupts!(pub(crate) struct Irqs {
    USART3 => usart::BufferedInterruptHandler<peripherals::USART3>;
    FLASH => flash::InterruptHandler;
});

/// Of the chip (RM0090, table 62).
pub(super) const INTERRUPTS: usize = 91;
/// Cycles that a turn of cortex-m's delay takes on an M4: one, and two of a branch that is taken at the least.
pub(crate) const TURN_CYCLES: u32 = 3;

/// embassy sets the wait states alone, five at 168 MHz: prefetch and the instruction cache make up for them (RM0090 3.5.2).
/// No line of that cache goes stale: bank 2 alone is ever erased, and no code is in it. The data cache stays off. It must
/// be off while one bank is written and the other one read (ES0206 2.2.12), and would keep what was there before;
/// embassy's driver means to see to both, but takes this part for one with a single bank, since the list of its
/// regions ends with the OTP area.
pub(super) fn start_caches() {
    FLASH_INTERFACE.acr().modify(|w| {
        w.set_prften(true);
        w.set_icen(true);
    });
}

/// What is wrong with this board alone: nothing, its flash has two banks whatever the option bytes say.
pub(super) fn flaw() -> Option<&'static str> {
    None
}
