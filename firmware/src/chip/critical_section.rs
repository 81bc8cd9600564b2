//! Critical sections that the sensor's slots do not wait for: they mask all interrupts but those of the highest
//! priority, which TIM2 and SPI1 alone have ([`board::start`](crate::board::start)). These two share nothing with other
//! code but queues and atomics, and enter no critical section. With all interrupts masked, as cortex-m's own section
//! has it, a slot began up to 200 instructions late.
use cortex_m::register::{basepri, basepri_max};
use critical_section::{Impl, RawRestoreState, set_impl};

use crate::board::MASKED;

struct AllButSlots;
set_impl!(AllButSlots);

// SAFETY: there is one core, and no interrupt that is not masked enters a critical section or shares data that one
// protects.
unsafe impl Impl for AllButSlots {
    unsafe fn acquire() -> RawRestoreState {
        let before = basepri::read();
        // raises the mask or leaves it; the compiler moves no access before it
        basepri_max::write(MASKED as u8);
        before.into()
    }

    unsafe fn release(before: RawRestoreState) {
        // SAFETY: as it was when this section began.
        unsafe { basepri::write(before as u8) };
    }
}
