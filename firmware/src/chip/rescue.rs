//! What is left to do when the firmware gives up: stop the stage, lift the finger, remember why, start again.
use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr::{addr_of, addr_of_mut};
use core::sync::atomic::{AtomicBool, Ordering::Relaxed};

use cortex_m::peripheral::{MPU, SCB};
use cortex_m_rt::{ExceptionFrame, exception};
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::pac::RCC;
use heapless::String;
use tactus_core::rig::lever::MAX_STEPS;
use tactus_core::wire::{Reset, Text};

use super::{finger, lever, slots, watchdog};
use crate::board::{self, Named, held};

const MAGIC: u32 = 0x7ac7_1a57;
const WORDS: usize = 120;
const CALLERS: usize = 10;

/// Last words that survive a reset; RAM that the start-up code leaves alone. Every bit pattern is a value.
struct LastWords {
    magic: u32,
    length: usize,
    bytes: [u8; WORDS],
}

#[unsafe(link_section = ".uninit.LAST_WORDS")]
static mut LAST_WORDS: MaybeUninit<LastWords> = MaybeUninit::uninit();

/// The pins are set up: lever and stage can be driven by hand.
pub(crate) static ARMED: AtomicBool = AtomicBool::new(false);

/// Returns the cause of the chip's start, and the firmware's words before it; forgets both.
pub(crate) fn reset_cause() -> (Reset, Option<Text>) {
    let flags = RCC.csr().read();
    RCC.csr().modify(|w| w.set_rmvf(true));
    let reset = if flags.wdgrstf() || flags.wwdgrstf() {
        Reset::Watchdog
    } else if flags.sftrstf() {
        Reset::Software
    } else if flags.porrstf() || flags.borrstf() {
        Reset::Power
    } else if flags.padrstf() {
        Reset::Pin
    } else {
        Reset::Other
    };
    // SAFETY: no other code uses it before interrupts are on or after they are off. Until the magic number says that it
    // was written there is no reference to what is in it.
    let said = unsafe {
        let at = addr_of_mut!(LAST_WORDS).cast::<LastWords>();
        let magic = addr_of_mut!((*at).magic);
        let said = (magic.read_volatile() == MAGIC).then(|| &*at);
        said.and_then(|words| words.bytes.get(..words.length))
            .and_then(|bytes| core::str::from_utf8(bytes).ok())
            .and_then(|text| Text::try_from(text).ok())
            .inspect(|_| magic.write_volatile(0))
    };
    (reset, said)
}

/// Keeps a sentence over the next reset.
pub(crate) fn remember(text: &str) {
    critical_section::with(|_| {
        // SAFETY: interrupts are off.
        let words = unsafe { &mut *addr_of_mut!(LAST_WORDS) }.write(LastWords {
            magic: MAGIC,
            length: text.len().min(WORDS),
            bytes: [0; WORDS],
        });
        while !text.is_char_boundary(words.length) {
            words.length -= 1;
        }
        for (to, from) in words.bytes.iter_mut().zip(text.as_bytes()) {
            *to = *from;
        }
    });
}

/// Brakes the stage, lifts the finger up to the limit switch, unless that presses it, and starts the chip again.
/// Whatever went wrong: nothing here needs an interrupt, memory or another task.
pub(crate) fn give_up(why: &str) -> ! {
    cortex_m::interrupt::disable();
    remember(why);
    if ARMED.load(Relaxed) {
        // SAFETY: nothing else runs any more.
        let (mut pwm, mut bridge, top) = unsafe {
            (
                held(<Named<board::StagePwm>>::steal()),
                held(<Named<board::StageEnable>>::steal()),
                held(<Named<board::LeverTop>>::steal()),
            )
        };
        // taken from its timer; the bridge stays on: without duty it shorts the motor
        pwm.set_low();
        pwm.set_as_output(Speed::Low);
        bridge.set_high();
        let mut closed = 0;
        let mut force = Force::new();
        lever::lift_by_hand(|steps| {
            watchdog::pet();
            // pressed, or its wire is broken: three times, for it bounces
            closed = if top.is_high() { closed + 1 } else { 0 };
            closed >= 3
                || steps > MAX_STEPS as u32 * 5 / 4
                || steps % LOOK_STEPS == 0 && force.rises()
        });
    }
    SCB::sys_reset()
}

/// Steps from one look at P_DC to the next: 10 um.
const LOOK_STEPS: u32 = 16;

/// P_DC while the finger is lifted: it rises where the wire of DIR is broken, and the lever presses.
struct Force {
    least: Option<u16>,
    /// The rise that says so, in three looks, counts: half a newton.
    rise: u16,
    looks: u8,
}

impl Force {
    fn new() -> Self {
        Self {
            least: None,
            rise: finger::parts().model.counts(500.0) as u16,
            looks: 0,
        }
    }

    fn rises(&mut self) -> bool {
        let Some(now) = slots::pdc_by_hand() else {
            return false;
        };
        let least = self.least.map_or(now, |least| least.min(now));
        self.least = Some(least);
        let rises = now.saturating_sub(least) > self.rise;
        self.looks = if rises { self.looks + 1 } else { 0 };
        self.looks >= 3
    }
}

/// Stops a start that cannot be completed: no motor gets current, the red LED is on. To be called before a motor could
/// move.
pub(crate) fn refuse(why: &str) -> ! {
    cortex_m::interrupt::disable();
    defmt::error!("not started: {=str}", why);
    // SAFETY: nothing else runs any more.
    let _pins = unsafe {
        (
            Output::new(<Named<board::LeverEnable>>::steal(), Level::Low, Speed::Low),
            Output::new(<Named<board::StageEnable>>::steal(), Level::Low, Speed::Low),
            Output::new(<Named<board::RedLed>>::steal(), Level::High, Speed::Low),
        )
    };
    loop {
        watchdog::pet();
        // 18 ms by 168 MHz
        cortex_m::asm::delay(1_000_000);
    }
}

/// Guards the end of the stack: nobody may use the memory between it and the variables. Who does so gets a hard fault,
/// and has all of the guard as stack for what comes then, as the MPU is not for hard faults.
pub(crate) fn guard_stack() {
    unsafe extern "C" {
        static __stack_guard: u32;
    }
    // a region of 16 KB (2^(13 + 1)), on; without access, and no code (ARMv7-M B3.5.9)
    const SIZE: u32 = 13 << 1 | 1;
    const NO_CODE: u32 = 1 << 28;
    // the rest is as without the MPU; on
    const PRIVDEFENA: u32 = 1 << 2;
    // SAFETY: nobody else uses the MPU, and the linker has left the guard free: memory.x.
    unsafe {
        let mpu = &*MPU::PTR;
        mpu.rnr.write(0);
        mpu.rbar.write(addr_of!(__stack_guard) as u32);
        mpu.rasr.write(NO_CODE | SIZE);
        mpu.ctrl.write(PRIVDEFENA | 1);
    }
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
}

/// Says where from, and not what: the sentences and places of all panics would take 10 KB of flash. `addr2line` and the
/// ELF know the lines.
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    let mut text: String<WORDS> = String::new();
    let _ = text.push_str("panic, called from");
    callers(|at| address(&mut text, at as u32));
    give_up(&text)
}

/// Writes an address behind a text, as far as there is space. What formats numbers of any kind would take 1 KB of
/// flash.
fn address(text: &mut String<WORDS>, at: u32) {
    let _ = text.push_str(" 0x");
    let digits = (35 - (at | 1).leading_zeros()) / 4;
    for place in (0..digits).rev() {
        let digit = char::from_digit(at >> (4 * place) & 15, 16);
        let _ = text.push(digit.unwrap_or('?'));
    }
}

/// Where functions on the stack return to, the last one first. What looks like it and is left over of others is among
/// them.
fn callers(mut each: impl FnMut(usize)) {
    unsafe extern "C" {
        static __stext: u32;
        static __etext: u32;
        static _stack_start: u32;
    }
    let code = addr_of!(__stext) as usize..addr_of!(__etext) as usize;
    let top = addr_of!(_stack_start) as usize;
    let mut at = cortex_m::register::msp::read() as usize;
    let mut found = 0;
    while found < CALLERS && at < top {
        // SAFETY: it is the stack, down from where it begins.
        let word = unsafe { (at as *const usize).read_volatile() };
        let is_thumb = word % 2 == 1;
        if is_thumb && code.contains(&word) && code.contains(&(word - 5)) {
            // SAFETY: it is code, in flash.
            let [first, second] = unsafe { ((word - 5) as *const [u16; 2]).read_volatile() };
            let is_bl = first & 0xf800 == 0xf000 && second & 0xd000 == 0xd000;
            if is_bl || second & 0xff87 == 0x4780 {
                each(word);
                found += 1;
            }
        }
        at += size_of::<usize>();
    }
}

/// The clock security system: the probe's 8 MHz have stopped, the chip goes on at 16 MHz by itself.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    RCC.cir().modify(|w| w.set_cssc(true));
    lever::slow_clock();
    give_up("the 8 MHz from the ST-LINK stopped")
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    // accesses to data, of exception frames and of those of the FPU that the MPU refused
    const REFUSED: u32 = 1 << 1 | 1 << 4 | 1 << 5;
    // SAFETY: it is only read.
    let status = unsafe { (*SCB::PTR).cfsr.read() };
    if status & REFUSED != 0 {
        // the frame may be missing
        give_up("the stack overflowed");
    }
    let mut text: String<WORDS> = String::new();
    let _ = text.push_str("hard fault at");
    address(&mut text, frame.pc());
    give_up(&text)
}
