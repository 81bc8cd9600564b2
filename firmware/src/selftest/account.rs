//! How the checks went, also across the reset that one of them ends in; and what all of them need.
use core::fmt::Display;
use core::mem::MaybeUninit;
use core::ptr::addr_of_mut;

use cortex_m::peripheral::DWT;
use defmt::Display2Format;

pub(super) const CORE_HZ: u32 = 168_000_000;

/// What survives the reset by the watchdog; RAM that the start-up code leaves alone.
#[derive(Clone, Copy)]
pub(super) struct Kept {
    /// [`Kept::HANGS`] while the watchdog is waited for.
    pub(super) magic: u32,
    pub(super) passed: u32,
    pub(super) failed: u32,
}

impl Kept {
    pub(super) const HANGS: u32 = 0x7ac7_d061;
}

#[unsafe(link_section = ".uninit.SELFTEST")]
static mut KEPT: MaybeUninit<Kept> = MaybeUninit::uninit();

/// Swaps what is kept; the test is one task, and no interrupt comes here.
pub(super) fn keep(kept: Kept) -> Kept {
    // SAFETY: as above; every bit pattern is a value.
    unsafe {
        let at = addr_of_mut!(KEPT).cast::<Kept>();
        let before = at.read_volatile();
        at.write_volatile(kept);
        before
    }
}

/// How the checks went so far.
#[derive(Default)]
pub(super) struct Account {
    pub(super) passed: u32,
    pub(super) failed: u32,
}

impl Account {
    pub(super) fn check(
        &mut self,
        good: bool,
        name: &str,
        measured: impl Display,
        remedy: &str,
    ) -> bool {
        let measured = Display2Format(&measured);
        if good {
            self.passed += 1;
            defmt::info!("PASS {=str}: {}", name, measured);
        } else {
            self.failed += 1;
            defmt::error!("FAIL {=str}: {}. {=str}", name, measured, remedy);
        }
        good
    }

    pub(super) fn leave_out(&mut self, name: &str, why: &str) {
        self.failed += 1;
        defmt::error!("FAIL {=str}: not tested, {=str}", name, why);
    }
}

pub(super) fn ready(is: bool) -> &'static str {
    if is { "ready" } else { "not ready" }
}

/// So long, by the core's cycle counter; a look at it takes a cycle and more, which is the bound if it does not run.
pub(super) fn wait_us(us: u32) {
    let (began, cycles) = (DWT::cycle_count(), us * (CORE_HZ / 1_000_000));
    let _ = (0..cycles).find(|_| DWT::cycle_count().wrapping_sub(began) >= cycles);
}
