//! The executor of thread mode. embassy's own looks for work two times after each interrupt: an interrupt that ends
//! sets the event that the next `wfe` would wait for. The sensor's slots alone are 18 interrupts a millisecond, which
//! took 0.4 % of the core.
use cortex_m::interrupt::{InterruptNumber as _, disable, enable};
use cortex_m::peripheral::NVIC;
use embassy_executor::{Spawner, raw};
use embassy_stm32::pac::Interrupt;
use static_cell::StaticCell;

/// Nobody enables it: that it is pending says that a task was woken.
const WOKEN: Interrupt = Interrupt::UART7;

/// Runs the tasks that `init` spawns, and sleeps when none has anything to do. To be called once, from thread mode.
pub(crate) fn run(init: impl FnOnce(Spawner)) -> ! {
    static EXECUTOR: StaticCell<raw::Executor> = StaticCell::new();
    // embassy requests the interrupt of this number
    let woken = usize::from(WOKEN.number()) as *mut ();
    let executor: &'static _ = EXECUTOR.init(raw::Executor::new(woken));
    init(executor.spawner());
    loop {
        // what comes between the look and the sleep ends the sleep, and runs afterwards
        disable();
        let woken = NVIC::is_pending(WOKEN);
        if !woken {
            cortex_m::asm::dsb();
            cortex_m::asm::wfi();
        }
        // SAFETY: they were on before, and nothing here is in their way.
        unsafe { enable() };
        if woken {
            NVIC::unpend(WOKEN);
            // SAFETY: from here only, and no task of the executor calls this.
            unsafe { executor.poll() };
        }
    }
}
