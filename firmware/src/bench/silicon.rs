//! What only silicon can answer: whether the kernels in assembly give what their plain twins give, how many cycles
//! they take, how long the flash takes to write and to erase, how often the ring of the motor's current turns and a
//! slot begins.
//!
//! It has a runner of its own. The host of `embedded-test` names each test by a semihosting call (SYS_GET_CMDLINE)
//! that the emulated board does not answer, and `defmt-test` ends with the first test that fails, by a panic, which
//! here lifts a lever and starts again. This image makes all checks, prints a line for each over defmt, and leaves by
//! semihosting's exit, which probe-rs hands on. No motor moves.
use core::arch::asm;

use cortex_m::peripheral::DCB;
use embassy_time::Timer;
use heapless::Vec;
use tactus_core::wire::bringup::{Checked, KERNELS};

use super::{bench, is_wanted};
use crate::board;
use crate::checks::{self, Kernels};
use crate::chip::current::Current;

#[derive(Default)]
struct Results {
    passed: u32,
    failed: u32,
}

impl Results {
    fn take(&mut self, checks: Vec<Checked, 2>) {
        for check in &checks {
            let (name, measured) = (check.name.as_str(), check.measured.as_str());
            if check.good {
                self.passed += 1;
                defmt::info!("PASS {=str}: {=str}", name, measured);
            } else {
                self.failed += 1;
                defmt::error!("FAIL {=str}: {=str}", name, measured);
            }
        }
    }
}

/// Makes all checks, says how they went, and leaves if a debugger is there. To be called once, from thread mode.
pub async fn silicon() {
    if is_wanted() {
        bench();
    }
    let mut r = board::start();
    // a probe attaches
    Timer::after_millis(20).await;
    defmt::info!("tactus-silicon {=str}", env!("CARGO_PKG_VERSION"));
    // SAFETY: the cycle counter is nobody else's.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
    let mut results = Results::default();
    let mut kernels = Kernels::new();
    (0..KERNELS).for_each(|number| results.take(kernels.check(number)));
    results.take(checks::timers(&mut Current::new(r.current)));
    results.take(checks::flash(&mut r.store).await);
    let good = results.failed == 0;
    if good {
        defmt::info!("SILICON PASSED: {=u32} checks", results.passed);
    } else {
        defmt::error!(
            "SILICON FAILED: {=u32} passed, {=u32} failed",
            results.passed,
            results.failed
        );
    }
    // for the probe to read the log
    Timer::after_millis(100).await;
    leave(good);
    core::future::pending().await
}

/// Ends the run of a debugger, with whether all is well; without one it comes back.
fn leave(good: bool) {
    /// SYS_EXIT, and its reasons: the application's end, an error at run time.
    const EXIT: u32 = 0x18;
    let reason: u32 = if good { 0x2_0026 } else { 0x2_0023 };
    if DCB::is_debugger_attached() {
        // SAFETY: a debugger is there to answer; without one it would be a fault.
        unsafe { asm!("bkpt #0xAB", inout("r0") EXIT => _, in("r1") reason) }
    }
}
