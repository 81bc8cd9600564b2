//! The lever's STEP and DIR, from TIM1: a period of 1/3200 s either has a pulse or has none, so that the rates in use
//! (3200, 800 and 200 steps/s) come out even, and any other with one period of jitter.
use core::sync::atomic::{AtomicBool, AtomicI32, AtomicU32, Ordering::Relaxed};

use embassy_stm32::gpio::{Level, Output, OutputType, Speed};
use embassy_stm32::interrupt;
use embassy_stm32::pac::{GPIOE, TIM1 as REGISTERS, timer::vals::Ocm};
use embassy_stm32::peripherals::TIM1;
use embassy_stm32::timer::Ch1;
use embassy_stm32::timer::low_level::Timer;
use embassy_stm32::timer::simple_pwm::PwmPin;

use crate::board;

/// Periods, and at most steps, per second.
const BASE_HZ: u32 = 3200;
/// The timer counts at 2 MHz.
const PRESCALER: u16 = 83;
const PERIOD: u16 = 625;
const CORE_HZ: u32 = 168_000_000;
/// STEP is high for 5 us.
const HIGH: u16 = 10;
const DIRECTION_PIN: usize = 11;

/// Steps per second that are wanted, downwards positive.
static RATE: AtomicI32 = AtomicI32::new(0);
static STEPS: AtomicI32 = AtomicI32::new(0);
/// The period that begins with the next update has a pulse.
static PULSE: AtomicBool = AtomicBool::new(false);
static DOWN: AtomicBool = AtomicBool::new(false);
static PHASE: AtomicU32 = AtomicU32::new(0);

/// The lever's driver.
pub(crate) struct Lever {
    enable: Output<'static>,
    _direction: Output<'static>,
    _step: PwmPin<'static, TIM1, Ch1>,
    _timer: Timer<'static, TIM1>,
}

impl Lever {
    /// Takes the pins: no current, no steps.
    pub(crate) fn new(pins: board::Lever) -> Self {
        let step = PwmPin::new(pins.step, OutputType::PushPull);
        let timer = Timer::new(pins.timer);
        REGISTERS.psc().write_value(PRESCALER);
        REGISTERS.arr().write(|w| w.set_arr(PERIOD - 1));
        REGISTERS.ccmr_output(0).modify(|w| {
            w.set_ocm(0, Ocm::PWM_MODE1);
            w.set_ocpe(0, true);
        });
        REGISTERS.ccr(0).write(|w| w.set_ccr(0));
        REGISTERS.ccer().modify(|w| w.set_cce(0, true));
        REGISTERS.bdtr().modify(|w| w.set_moe(true));
        // loads prescaler and compare
        REGISTERS.egr().write(|w| w.set_ug(true));
        REGISTERS.sr().write(|w| w.0 = 0);
        REGISTERS.dier().write(|w| w.set_uie(true));
        // SAFETY: the handler is below, its state is ready.
        unsafe { interrupt::InterruptExt::enable(interrupt::TIM1_UP_TIM10) };
        Self {
            enable: Output::new(pins.enable, Level::Low, Speed::Low),
            _direction: Output::new(pins.direction, Level::Low, Speed::Low),
            _step: step,
            _timer: timer,
        }
    }

    /// Steps made so far, downwards positive.
    pub(crate) fn steps(&self) -> i32 {
        STEPS.load(Relaxed)
    }

    /// Gives the motor current, or takes it away, and steps at this rate from the next period on.
    pub(crate) fn drive(&mut self, enabled: bool, rate: i32) {
        self.enable.set_level(enabled.into());
        if RATE.swap(rate, Relaxed) == rate {
            return;
        }
        if rate != 0 {
            // the handler lets the timer run while there is a rate
            REGISTERS.cr1().modify(|w| w.set_cen(true));
        }
    }
}

#[interrupt]
fn TIM1_UP_TIM10() {
    REGISTERS.sr().write(|w| w.0 = 0);
    let rate = RATE.load(Relaxed);
    let mut down = DOWN.load(Relaxed);
    let pulses_now = PULSE.load(Relaxed);
    if pulses_now {
        STEPS.fetch_add(if down { 1 } else { -1 }, Relaxed);
    }
    let mut phase = PHASE.load(Relaxed);
    if rate == 0 {
        // the next rate begins with a step
        phase = BASE_HZ;
        if !pulses_now {
            REGISTERS.cr1().modify(|w| w.set_cen(false));
        }
    } else if (rate > 0) != down && !pulses_now {
        // a whole period before the next pulse can come
        down = rate > 0;
        GPIOE.bsrr().write(|w| {
            if down {
                w.set_bs(DIRECTION_PIN, true);
            } else {
                w.set_br(DIRECTION_PIN, true);
            }
        });
        DOWN.store(down, Relaxed);
    }
    let mut pulse = false;
    if rate != 0 && (rate > 0) == down {
        phase = (phase + rate.unsigned_abs()).min(2 * BASE_HZ);
        pulse = phase >= BASE_HZ;
        if pulse {
            phase -= BASE_HZ;
        }
    }
    PHASE.store(phase, Relaxed);
    PULSE.store(pulse, Relaxed);
    REGISTERS
        .ccr(0)
        .write(|w| w.set_ccr(if pulse { HIGH } else { 0 }));
}

/// Steps upwards, without interrupts, until `done` says so; it is asked before every step and told how many were made. For
/// when nothing else works any more.
pub(crate) fn lift_by_hand(mut done: impl FnMut(u32) -> bool) {
    REGISTERS.dier().write(|w| w.set_uie(false));
    REGISTERS.ccr(0).write(|w| w.set_ccr(0));
    REGISTERS.cr1().modify(|w| w.set_cen(true));
    let period = || {
        REGISTERS.sr().write(|w| w.0 = 0);
        // most of the period, so that the register is not asked all the time
        cortex_m::asm::delay(CORE_HZ / BASE_HZ * 9 / 10);
        while !REGISTERS.sr().read().uif() {}
    };
    // the pulse that may be under way
    period();
    GPIOE.bsrr().write(|w| {
        w.set_br(DIRECTION_PIN, true);
        w.set_bs(13, true);
    });
    period();
    let mut steps = 0;
    while !done(steps) {
        REGISTERS.ccr(0).write(|w| w.set_ccr(HIGH));
        period();
        steps += 1;
    }
    REGISTERS.ccr(0).write(|w| w.set_ccr(0));
    period();
}
