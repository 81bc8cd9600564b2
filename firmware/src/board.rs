//! The NUCLEO-F429ZI: its clocks and its pins (UM1974).
use embassy_stm32::Peri;
use embassy_stm32::gpio::{AnyPin, Level, Output, OutputOpenDrain, Pull, Speed};
use embassy_stm32::rcc::{
    AHBPrescaler, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllQDiv, PllSource,
    Sysclk,
};
use embassy_stm32::time::Hertz;

/// What is on the board's pins.
pub(crate) struct Board {
    /// LD1 green, LD2 blue, LD3 red.
    pub(crate) leds: [Output<'static>; 3],
    /// Dropping it would let go of the pin.
    _pa12: OutputOpenDrain<'static>,
}

impl Board {
    /// Starts the clocks and takes the pins. To be called once, first of all.
    pub(crate) fn new() -> Self {
        let p = embassy_stm32::init(clocks());
        let led = |pin: Peri<'static, AnyPin>| Output::new(pin, Level::Low, Speed::Low);
        Self {
            // Chips before revision 3 misread bank 2 while PA12 moves (errata sheet ES0206, 2.2.11), and the store is in
            // bank 2. embassy's flash driver wants exactly this, an output that is low and pulled down, and panics
            // otherwise; so PA12 is taken before anything can read the store, and is no one else's.
            _pa12: OutputOpenDrain::new_pull(p.PA12, Level::Low, Speed::Low, Pull::Down),
            leds: [led(p.PB0.into()), led(p.PB7.into()), led(p.PB14.into())],
        }
    }
}

/// 168 MHz: the fastest without overdrive, and its PLL gives the 48 MHz of USB.
fn clocks() -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    // the board's debug probe feeds 8 MHz into OSC_IN
    config.rcc.hse = Some(Hse {
        freq: Hertz::mhz(8),
        mode: HseMode::Bypass,
    });
    config.rcc.pll_src = PllSource::HSE;
    // 8 / 4 * 168 = 336 MHz: halved for the core, a seventh for USB
    config.rcc.pll = Some(Pll {
        prediv: PllPreDiv::DIV4,
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
