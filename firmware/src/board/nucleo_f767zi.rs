//! The NUCLEO-F767ZI. Nobody has run this on one: docs/src/another-board.md says what differs.
use cortex_m::peripheral::Peripherals;
use embassy_stm32::pac::FLASH;
use embassy_stm32::{bind_interrupts, peripherals, usart};

bind_interrupts!(pub(crate) struct Irqs {
    USART3 => usart::BufferedInterruptHandler<peripherals::USART3>;
});

/// Of the chip (RM0410, vector table): the last one is MDIOS.
pub(super) const INTERRUPTS: usize = 110;
/// Cycles that a turn of cortex-m's delay takes on an M7 at the least: its two instructions go together.
pub(crate) const TURN_CYCLES: u32 = 1;

/// Code is read over the AXI bus, where the flash's own accelerator does nothing (RM0410: it is on the bus of the ITCM): the core's
/// instruction cache makes up for five wait states. No line of it goes stale: bank 2 alone is ever erased, and no code is in it.
/// The data cache stays off: DMA writes to variables, and erasing to bank 2, behind its back.
pub(super) fn start_caches() {
    // once: nobody else takes them
    if let Some(mut core) = Peripherals::take() {
        core.SCB.enable_icache();
    }
}

/// What is wrong with this board alone. As it is delivered its flash is one bank, where code stands still for a
/// second while a sector is erased: nothing is stored then.
pub(super) fn flaw() -> Option<&'static str> {
    FLASH.optcr().read().n_dbank().then_some(
        "the flash is one bank, so nothing is stored: STM32_Programmer_CLI -c port=SWD -ob nDBANK=0",
    )
}
