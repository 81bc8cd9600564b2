//! What tasks share that never interrupt each other: on the rig those in thread mode, on the handheld those of UART7's
//! executor. Nothing is locked then, and no sensor slot waits.
use cortex_m::peripheral::SCB;
use cortex_m::peripheral::scb::VectActive;
use embassy_stm32::interrupt::Interrupt;
use embassy_sync::blocking_mutex::raw::RawMutex;

use crate::chip::rescue;

pub(crate) struct OneLevel;

/// True if this runs where an image's tasks for the host do. An image has those of one level only: `rig.rs`,
/// `handheld.rs`.
fn is_there() -> bool {
    match SCB::vect_active() {
        VectActive::ThreadMode => true,
        VectActive::Interrupt { irqn } => u16::from(irqn) == Interrupt::UART7 as u16,
        VectActive::Exception(_) => false,
    }
}

// SAFETY: whoever locks runs at the one level, which is checked, and is not interrupted by another who does.
unsafe impl RawMutex for OneLevel {
    const INIT: Self = Self;

    fn lock<R>(&self, f: impl FnOnce() -> R) -> R {
        if !is_there() {
            rescue::give_up("not where the tasks for the host are");
        }
        f()
    }
}

// SAFETY: see above.
unsafe impl Sync for OneLevel {}
// SAFETY: it is empty.
unsafe impl Send for OneLevel {}
