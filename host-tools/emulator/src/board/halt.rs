//! A debugger that halts the core: the parts that run on meanwhile, and those that DBGMCU stops with it.
//!
//! Timers and the watchdog count on in a halt unless the firmware, or the debugger's tool, has asked DBGMCU to stop
//! them with the core (RM0090 38.16.4 and 38.16.5): rigless keeps its registers, and has no debugger that halts. An
//! interrupt that comes meanwhile waits.

use rigless::mcu::{Mcu as _, Operate as _};
use rigless::soc::Width;
use rigless::soc::stm32f427::generated::dbg::Register;
use rigless::time::VirtualNanos;

use super::chip::Part;

/// CR1 of the timers that can be stopped with the core, by the bit that does it: TIM2 to TIM5 of APB1_FZ, TIM1 and TIM8
/// of APB2_FZ.
const TIMERS: [(Register, u64, u64); 6] = [
    (Register::DbgmcuApb1Fz, 1 << 0, 0x4000_0000),
    (Register::DbgmcuApb1Fz, 1 << 1, 0x4000_0400),
    (Register::DbgmcuApb1Fz, 1 << 2, 0x4000_0800),
    (Register::DbgmcuApb1Fz, 1 << 3, 0x4000_0C00),
    (Register::DbgmcuApb2Fz, 1 << 0, 0x4001_0000),
    (Register::DbgmcuApb2Fz, 1 << 1, 0x4001_0400),
];
const CEN: u64 = 1;
/// DBG_IWDG_STOP of APB1_FZ.
const IWDG_STOP: u64 = 1 << 12;
const APB1_FZ: u64 = 0xE004_2008;
const IWDG_KR: u64 = 0x4000_3000;
const RELOAD: u64 = 0xAAAA;

#[derive(Debug)]
pub(super) struct Halt {
    /// CR1 of the timers that ran and stand now.
    standing: Vec<u64>,
    watchdog_stands: bool,
}

impl Halt {
    /// The core stands from now on. With `watchdog_stands` the tool has set DBGMCU to stop the watchdog.
    pub(super) fn begin(part: &mut Part, at: VirtualNanos, watchdog_stands: bool) -> Self {
        let bits = |part: &Part, register| {
            let registers = part.bus().registers("DBG");
            registers.map_or(0, |registers| registers.get(register))
        };
        if watchdog_stands {
            let others = bits(part, Register::DbgmcuApb1Fz);
            // the register is there
            let _ = part.write(at, APB1_FZ, Width::W32, others | IWDG_STOP);
        }
        let mut standing = Vec::new();
        for (register, bit, cr1) in TIMERS {
            // a timer whose clock is off reads as 0
            let before = part.read(at, cr1, Width::W32).unwrap_or_default();
            if bits(part, register) & bit != 0 && before & CEN != 0 {
                let _ = part.write(at, cr1, Width::W32, before & !CEN);
                standing.push(cr1);
            }
        }
        Self {
            standing,
            watchdog_stands: bits(part, Register::DbgmcuApb1Fz) & IWDG_STOP != 0,
        }
    }

    /// It lasts. A watchdog that stands is one that is reloaded often enough.
    pub(super) fn last(&self, part: &mut Part, at: VirtualNanos) {
        if self.watchdog_stands {
            let _ = part.write(at, IWDG_KR, Width::W32, RELOAD);
        }
    }

    pub(super) fn end(self, part: &mut Part, at: VirtualNanos) {
        for cr1 in self.standing {
            let now = part.read(at, cr1, Width::W32).unwrap_or_default();
            let _ = part.write(at, cr1, Width::W32, now | CEN);
        }
    }
}
