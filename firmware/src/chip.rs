//! What only this chip can do: its flash, the sensor's slots by its interrupts, its sleep, its timers' lever, its
//! converter's motor current, its last acts, and the core's kernels in its assembly.
mod bank2;
mod critical_section;
pub(crate) mod current;
pub(crate) mod debugger;
mod dsp_kernels;
pub(crate) mod encoder;
pub(crate) mod finger;
pub(crate) mod flash;
pub(crate) mod lever;
pub(crate) mod motion;
pub(crate) mod reading;
pub(crate) mod rescue;
mod select;
mod slot_plan;
pub(crate) mod slots;
mod spi;
mod store_place;
pub(crate) mod thread;
mod transform_kernel;
pub(crate) mod watchdog;

pub(crate) use dsp_kernels::KERNELS;

use crate::board::TURN_CYCLES;

/// Waits for at least so many cycles of the core. cortex-m's delay counts turns of its loop.
pub(crate) fn wait_cycles(cycles: u32) {
    cortex_m::asm::delay(cycles / TURN_CYCLES);
}
