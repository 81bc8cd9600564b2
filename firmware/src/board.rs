//! The NUCLEO-F429ZI (MB1137, UM1974): its clocks, and who gets which pin and timer. Pins are named by their Arduino
//! and Zio connectors in docs/src/rig.md.

use core::mem::ManuallyDrop;

use assign_resources::assign_resources;
use embassy_stm32::gpio::{Flex, Level, OutputOpenDrain, Pin, Pull, Speed};
use embassy_stm32::interrupt::{self, InterruptExt as _, Priority};
use embassy_stm32::pac::rcc::vals::Pllsrc;
use embassy_stm32::pac::{DBGMCU, FLASH as FLASH_INTERFACE, RCC};
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllQDiv, PllSource,
    Sysclk,
};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Peri, PeripheralType, bind_interrupts, flash, peripherals, usart};

bind_interrupts!(pub(crate) struct Irqs {
    USART3 => usart::BufferedInterruptHandler<peripherals::USART3>;
    FLASH => flash::InterruptHandler;
});

/// Interrupts of the chip (RM0090, table 62).
const INTERRUPTS: usize = 91;
/// Cycles that a turn of cortex-m's delay takes on an M4: one, and two of a branch that is taken at the least.
pub(crate) const TURN_CYCLES: u32 = 3;

assign_resources! {
    sensor: Sensor {
        spi: SPI1,
        sck: PA5,
        miso: PA6,
        // not PA7, which is the Ethernet PHY's CRS_DV
        mosi: PB5,
        select: PD14,
        /// Of a finger's second part.
        select_2: PD15,
    }
    slots: Slots {
        timer: TIM2,
    }
    lever: Lever {
        timer: TIM1,
        step: PE9,
        /// High is down.
        direction: PE11 = LeverDirection,
        /// High gives current.
        enable: PE13 = LeverEnable,
    }
    stage: Stage {
        timer: TIM3,
        pwm: PC6 = StagePwm,
        /// High drives to higher positions.
        direction: PC7,
        /// High turns the bridge on.
        enable: PC8 = StageEnable,
        encoder: TIM4,
        encoder_a: PD12,
        encoder_b: PD13,
    }
    /// Of the stage's motor.
    current: Current {
        adc: ADC1,
        stream: DMA2_CH0,
        /// 1 V/A about half of 3.3 V.
        pin: PA3,
    }
    /// Normally closed to ground: high is pressed, or a broken wire.
    switches: Switches {
        lever_top: PF12 = LeverTop,
        stage_left: PF14,
        stage_right: PF15,
        e_stop: PF13,
    }
    link: Link {
        uart: USART3,
        tx: PD8,
        rx: PD9,
    }
    store: Storage {
        flash: FLASH,
    }
    watchdog: Watchdog {
        iwdg: IWDG,
    }
    leds: Leds {
        green: PB0,
        blue: PB7,
        red: PB14 = RedLed,
    }
    go: Go {
        /// High is "the same".
        same: PC10,
    }
    display: Display {
        i2c: I2C1,
        scl: PB8,
        sda: PB9,
        tx: DMA1_CH6,
        rx: DMA1_CH0,
    }
    handle: Handle {
        /// High is pressed.
        button: PC13,
        buzzer: PC9,
        tones: TIM8,
    }
    motion: Motion {
        spi: SPI4,
        sck: PE2,
        miso: PE5,
        mosi: PE6,
        select: PE4,
    }
    errata: Errata {
        pa12: PA12,
    }
}

/// The peripheral of a name that the table above gives: for who uses pins that others have, when
/// nothing else works any more.
pub(crate) type Named<P> = <P as Named_>::Peripheral;

pub(crate) trait Named_ {
    type Peripheral;
}

impl<T: PeripheralType> Named_ for Peri<'static, T> {
    type Peripheral = T;
}

/// A pin as its driver has set it up.
pub(crate) fn held(pin: Peri<'static, impl Pin>) -> ManuallyDrop<Flex<'static>> {
    ManuallyDrop::new(Flex::new(pin))
}

/// The highest priority that critical sections mask.
pub(crate) const MASKED: Priority = Priority::P1;

/// How often the 8 MHz are looked for, 100 us apart: 0.1 s, in which the probe has started too.
const LOOKS: u32 = 1000;
/// The core after its reset.
pub(crate) const RESET_HZ: u32 = 16_000_000;

/// Has the watchdog count on in a halt again: OpenOCD and st-flash leave it standing at each attach, until the power is
/// off. With a debugger at the core its tool may have it so.
pub(crate) fn keep_watchdog() {
    DBGMCU.apb1fzr().modify(|w| w.set_iwdg(false));
}

/// Starts the clocks, sets the priorities and hands out the pins. To be called once, first of all. Board tests break it
/// by its name.
#[unsafe(export_name = "tactus_board_start")]
#[inline(never)]
pub(crate) fn start() -> AssignedResources {
    // A debugger that halts the core halts the lever's pulses with it; the stage's PWM goes on, which would stop at
    // either level: at the high one the motor would get all of its supply.
    DBGMCU.apb2fzr().modify(|w| w.set_tim1(true));
    keep_watchdog();
    let external = find_clock();
    let p = embassy_stm32::init(clocks(external));
    start_caches();
    if external {
        // should it stop later: an NMI, see `rescue`
        RCC.cr().modify(|w| w.set_csson(true));
    } else {
        defmt::error!("{=str}", NO_CLOCK);
    }
    let r = split_resources!(p);
    // Chips before revision 3 misread bank 2 while PA12 moves (errata sheet ES0206, 2.2.11), and the store is in bank
    // 2. embassy's flash driver wants exactly this, an output that is low and pulled down, and panics otherwise; so
    // PA12 is taken before anything can read the store, and is no one else's. Other chips do without, and lose nothing.
    core::mem::forget(OutputOpenDrain::new_pull(
        // SAFETY: nobody else takes PA12, and it is never given back.
        unsafe { r.errata.pa12.clone_unchecked() },
        Level::Low,
        Speed::Low,
        Pull::Down,
    ));
    // Critical sections mask all but the slots' priority, so nobody else may have it, as whoever is not set below
    // would. not by `Peripherals::steal`, after which nobody could take them SAFETY: nobody else sets priorities.
    let nvic = unsafe { &*cortex_m::peripheral::NVIC::PTR };
    for priority in nvic.ipr.iter().take(INTERRUPTS) {
        // SAFETY: no critical section is open.
        unsafe { priority.write(MASKED as u8) };
    }
    // The slots of the sensor before all; a byte of the link waits at most 10.8 us, then it is lost; the lever's steps,
    // the clock and the servo have more time.
    interrupt::TIM2.set_priority(Priority::P0);
    interrupt::SPI1.set_priority(Priority::P0);
    interrupt::USART3.set_priority(Priority::P2);
    interrupt::TIM1_UP_TIM10.set_priority(Priority::P3);
    interrupt::TIM5.set_priority(Priority::P4);
    interrupt::UART5.set_priority(Priority::P5);
    interrupt::FLASH.set_priority(Priority::P6);
    r
}

/// embassy sets the wait states alone, five at 168 MHz: prefetch and the instruction cache make up for them (RM0090
/// 3.5.2). No line of that cache goes stale: bank 2 alone is ever erased, and no code is in it. The data cache stays
/// off. It must be off while one bank is written and the other one read (ES0206 2.2.12), and would keep what was there
/// before; embassy's driver means to see to both, but takes this part for one with a single bank, since the list of its
/// regions ends with the OTP area.
fn start_caches() {
    FLASH_INTERFACE.acr().modify(|w| {
        w.set_prften(true);
        w.set_icen(true);
    });
}

/// The fault of the board, in words for the host.
pub(crate) fn flaw() -> Option<&'static str> {
    (!has_clock()).then_some(NO_CLOCK)
}

/// The sentence about a board whose probe gives no clock.
const NO_CLOCK: &str =
    "no 8 MHz from the ST-LINK (see its solder bridges): runs by the chip's own clock, 1 % off";

/// True if the debug probe's 8 MHz are there. embassy would wait for them without end.
fn find_clock() -> bool {
    RCC.cr().modify(|w| w.set_hsebyp(true));
    RCC.cr().modify(|w| w.set_hseon(true));
    let found = (0..LOOKS).any(|_| {
        cortex_m::asm::delay(RESET_HZ / 10_000 / TURN_CYCLES);
        RCC.cr().read().hserdy()
    });
    if !found {
        RCC.cr().modify(|w| w.set_hseon(false));
    }
    found
}

pub(crate) fn has_clock() -> bool {
    RCC.pllcfgr().read().pllsrc() == Pllsrc::HSE
}

/// 168 MHz: the fastest without overdrive, and its PLL gives the 48 MHz of USB. By the debug probe's 8 MHz on OSC_IN,
/// or by the chip's own 16.
fn clocks(external: bool) -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    let (source, prediv) = if external {
        config.rcc.hse = Some(Hse {
            freq: Hertz::mhz(8),
            mode: HseMode::Bypass,
        });
        (PllSource::HSE, PllPreDiv::DIV4)
    } else {
        (PllSource::HSI, PllPreDiv::DIV8)
    };
    config.rcc.pll_src = source;
    // 8 / 4 or 16 / 8, * 168 = 336 MHz: halved for the core, a seventh for USB
    config.rcc.pll = Some(Pll {
        prediv,
        mul: PllMul::MUL168,
        divp: Some(PllPDiv::DIV2),
        divq: Some(PllQDiv::DIV7),
        divr: None,
    });
    config.rcc.sys = Sysclk::PLL1_P;
    config.rcc.ahb_pre = AHBPrescaler::DIV1;
    // the peripheral buses end at 42 and 84 MHz; their timers run at twice that
    config.rcc.apb1_pre = APBPrescaler::DIV4;
    config.rcc.apb2_pre = APBPrescaler::DIV2;
    config
}
