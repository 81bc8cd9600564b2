//! The lever's STEP and DIR, from TIM1: which of its periods have a pulse is [`Steps`]' to say. This module owns the
//! timer.
use core::cell::Cell;
use core::sync::atomic::{AtomicI32, AtomicU32, Ordering::Relaxed};

use embassy_stm32::gpio::{Level, Output, OutputType, Speed};
use embassy_stm32::interrupt;
use embassy_stm32::pac::{TIM1 as REGISTERS, timer::vals::Ocm};
use embassy_stm32::peripherals::TIM1;
use embassy_stm32::timer::Ch1;
use embassy_stm32::timer::simple_pwm::PwmPin;
use embassy_stm32::{Peri, rcc};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time::{Duration, Instant};
use tactus_core::rig::steps::{BASE_HZ, Steps};

use crate::board::{Named, held};
use crate::{board, chip};

const PRESCALER: u16 = 83;
const PERIOD: u16 = (2_000_000 / BASE_HZ) as u16;
static CORE_HZ: AtomicU32 = AtomicU32::new(168_000_000);
/// From current to the first step: the driver wants a while.
const ENABLE: Duration = Duration::from_millis(10);
/// STEP is high for 5 us.
const HIGH: u16 = 10;

/// Steps per second that are wanted, downwards positive, and steps made.
static RATE: AtomicI32 = AtomicI32::new(0);
static MADE: AtomicI32 = AtomicI32::new(0);
static STEPS: Mutex<CriticalSectionRawMutex, Cell<Steps>> = Mutex::new(Cell::new(Steps::new()));

pub(crate) struct Lever {
    enable: Output<'static>,
    enabled: Instant,
    _direction: Output<'static>,
    _step: PwmPin<'static, TIM1, Ch1>,
    _timer: Peri<'static, TIM1>,
}

impl Lever {
    pub(crate) fn new(pins: board::Lever) -> Self {
        let step = PwmPin::new(pins.step, OutputType::PushPull);
        rcc::enable_and_reset::<TIM1>();
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
            enabled: Instant::now(),
            _direction: Output::new(pins.direction, Level::Low, Speed::Low),
            _step: step,
            _timer: pins.timer,
        }
    }

    pub(crate) fn steps(&self) -> i32 {
        MADE.load(Relaxed)
    }

    /// Gives the motor current, or takes it away, and steps at this rate from the next period on; 10 ms after it got
    /// current at the earliest, for which this is to be called again.
    pub(crate) fn drive(&mut self, enabled: bool, rate: i32) {
        if enabled && self.enable.is_set_low() {
            self.enabled = Instant::now();
        }
        self.enable.set_level(enabled.into());
        let rate = if self.enabled.elapsed() < ENABLE {
            0
        } else {
            rate
        };
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
    let (next, made) = STEPS.lock(|cell| {
        let mut steps = cell.get();
        let next = steps.begin(rate);
        cell.set(steps);
        (next, steps.made())
    });
    MADE.store(made, Relaxed);
    set_direction(next.down);
    if next.rests {
        REGISTERS.cr1().modify(|w| w.set_cen(false));
    }
    let high = if next.pulse { HIGH } else { 0 };
    REGISTERS.ccr(0).write(|w| w.set_ccr(high));
}

fn set_direction(down: bool) {
    // SAFETY: its driver does nothing but hold it.
    held(unsafe { <Named<board::LeverDirection>>::steal() }).set_level(down.into());
}

/// Core and timer run at 16 MHz from now on: for [`lift_by_hand`].
pub(crate) fn slow_clock() {
    CORE_HZ.store(board::RESET_HZ, Relaxed);
    // 2 MHz again; loaded at once
    REGISTERS
        .psc()
        .write_value((board::RESET_HZ / 2_000_000 - 1) as u16);
    REGISTERS.egr().write(|w| w.set_ug(true));
}

/// Steps upwards, without interrupts, until `done` says so; it is asked before every step and told how many were made.
/// For when nothing else works any more.
pub(crate) fn lift_by_hand(mut done: impl FnMut(u32) -> bool) {
    REGISTERS.dier().write(|w| w.set_uie(false));
    REGISTERS.ccr(0).write(|w| w.set_ccr(0));
    REGISTERS.cr1().modify(|w| w.set_cen(true));
    let cycles = CORE_HZ.load(Relaxed) / BASE_HZ;
    let period = || {
        REGISTERS.sr().write(|w| w.0 = 0);
        // most of the period, so that the register is not asked all the time
        chip::wait_cycles(cycles * 9 / 10);
        // a timer that does not run ends this, too
        for _ in 0..cycles {
            if REGISTERS.sr().read().uif() {
                break;
            }
        }
    };
    // the pulse that may be under way
    period();
    set_direction(false);
    // SAFETY: nothing else runs any more.
    let mut enable = held(unsafe { <Named<board::LeverEnable>>::steal() });
    let mut wait = if enable.is_set_high() {
        1
    } else {
        BASE_HZ * ENABLE.as_millis() as u32 / 1000
    };
    enable.set_high();
    while wait > 0 {
        wait -= 1;
        period();
    }
    let mut steps = 0;
    while !done(steps) {
        REGISTERS.ccr(0).write(|w| w.set_ccr(HIGH));
        period();
        steps += 1;
    }
    REGISTERS.ccr(0).write(|w| w.set_ccr(0));
    period();
}
