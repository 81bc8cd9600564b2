//! The lever's STEP and DIR, from TIM1: which of its periods have a pulse is [`Steps`]' to say.
use core::cell::Cell;
use core::sync::atomic::{AtomicI32, AtomicU32, Ordering::Relaxed};

use embassy_stm32::gpio::{Level, Output, OutputType, Speed};
use embassy_stm32::interrupt;
use embassy_stm32::pac::{GPIOE, TIM1 as REGISTERS, timer::vals::Ocm};
use embassy_stm32::peripherals::TIM1;
use embassy_stm32::timer::Ch1;
use embassy_stm32::timer::low_level::Timer;
use embassy_stm32::timer::simple_pwm::PwmPin;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use tactus_core::rig::steps::{BASE_HZ, Steps};

use crate::board;

/// The timer counts at 2 MHz.
const PRESCALER: u16 = 83;
const PERIOD: u16 = (2_000_000 / BASE_HZ) as u16;
static CORE_HZ: AtomicU32 = AtomicU32::new(168_000_000);
/// STEP is high for 5 us.
const HIGH: u16 = 10;
const DIRECTION_PIN: usize = 11;
const ENABLE_PIN: usize = 13;

/// Steps per second that are wanted, downwards positive, and steps made.
static RATE: AtomicI32 = AtomicI32::new(0);
static MADE: AtomicI32 = AtomicI32::new(0);
static STEPS: Mutex<CriticalSectionRawMutex, Cell<Steps>> = Mutex::new(Cell::new(Steps::new()));

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
        MADE.load(Relaxed)
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
    GPIOE.bsrr().write(|w| match down {
        true => w.set_bs(DIRECTION_PIN, true),
        false => w.set_br(DIRECTION_PIN, true),
    });
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

/// Steps upwards, without interrupts, until `done` says so; it is asked before every step and told how many were made. For
/// when nothing else works any more.
pub(crate) fn lift_by_hand(mut done: impl FnMut(u32) -> bool) {
    REGISTERS.dier().write(|w| w.set_uie(false));
    REGISTERS.ccr(0).write(|w| w.set_ccr(0));
    REGISTERS.cr1().modify(|w| w.set_cen(true));
    let core_hz = CORE_HZ.load(Relaxed);
    let period = || {
        REGISTERS.sr().write(|w| w.0 = 0);
        // most of the period, so that the register is not asked all the time
        cortex_m::asm::delay(core_hz / BASE_HZ * 9 / 10);
        while !REGISTERS.sr().read().uif() {}
    };
    // the pulse that may be under way
    period();
    set_direction(false);
    GPIOE.bsrr().write(|w| w.set_bs(ENABLE_PIN, true));
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
