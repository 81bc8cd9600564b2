//! A debugger at the core: a halt leaves the stage's PWM as it is, and its tool may have the watchdog stand meanwhile
//! (see [`crate::board::keep_watchdog`]).
use cortex_m::peripheral::DCB;

/// True for an image that drives motors under a debugger, the finger off: built with `TACTUS_DEBUG_MOTORS=1`.
const MOTORS: bool = option_env!("TACTUS_DEBUG_MOTORS").is_some();

/// Returns true if one is there, which no motor is to be driven with (C_DEBUGEN, ARMv7-M C1.6.2). Board tests replace
/// it by its name.
#[unsafe(export_name = "tactus_is_debugged")]
#[inline(never)]
pub(crate) fn is_there() -> bool {
    // SAFETY: it is only read.
    !MOTORS && unsafe { (*DCB::PTR).dhcsr.read() & 1 == 1 }
}
