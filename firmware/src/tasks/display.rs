//! The handheld's display: an SSD1306 on I2C1, told of a whole picture at a time, by DMA while the core sleeps.
use display_interface::DisplayError;
use embassy_stm32::i2c::{self, I2c};
use embassy_stm32::time::Hertz;
use embassy_stm32::{bind_interrupts, dma, peripherals};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::mutex::Mutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Instant, Timer, with_timeout};
use ssd1306::command::AddrMode;
use ssd1306::prelude::DisplayRotation;
use ssd1306::size::DisplaySize128x64;
use ssd1306::{I2CDisplayInterface, Ssd1306Async};
use tactus_core::handheld::picture::{HEIGHT, Picture, WIDTH};

use crate::board;

bind_interrupts!(struct Irqs {
    I2C1_EV => i2c::EventInterruptHandler<peripherals::I2C1>;
    I2C1_ER => i2c::ErrorInterruptHandler<peripherals::I2C1>;
    DMA1_STREAM6 => dma::InterruptHandler<peripherals::DMA1_CH6>;
    DMA1_STREAM0 => dma::InterruptHandler<peripherals::DMA1_CH0>;
});

/// Whether [`NEXT`] is to be shown, or the display is to be off.
static SHOW: Signal<CriticalSectionRawMutex, bool> = Signal::new();
/// What is to be shown next. It is copied with interrupts on: a signal would move its 1 KB with them off, and for longer
/// than a sensor slot may be late.
static NEXT: Mutex<CriticalSectionRawMutex, Picture> = Mutex::new(Picture::new());

/// Has a picture shown; `None` switches the display off. A picture that comes too early takes the place of the one before
/// it.
pub(crate) fn picture(picture: Option<&Picture>) {
    if let Some(picture) = picture {
        // who shows it copies it at once, and runs where those run who call this: nobody else has it now
        let Ok(mut next) = NEXT.try_lock() else {
            return;
        };
        next.clone_from(picture);
    }
    SHOW.signal(picture.is_some());
}

/// A display that does not answer is looked for again after this.
const AGAIN: Duration = Duration::from_secs(1);

#[embassy_executor::task]
pub(crate) async fn show(pins: board::Display) {
    let mut config = i2c::Config::default();
    config.frequency = Hertz(400_000);
    config.timeout = Duration::from_millis(50);
    let bus = I2c::new(pins.i2c, pins.scl, pins.sda, pins.tx, pins.rx, Irqs, config);
    let mut display = Ssd1306Async::new(
        I2CDisplayInterface::new(bus),
        DisplaySize128x64,
        DisplayRotation::Rotate0,
    );
    let mut last = None;
    loop {
        // its power may come late, or its plug be loose
        if let Err(why) = run(&mut display, &mut last).await {
            let why = match why {
                DisplayError::BusWriteError => "it does not answer",
                _ => "it is told what no display is",
            };
            defmt::warn!("no display: {=str}", why);
        }
        Timer::after(AGAIN).await;
    }
}

/// Shows one picture after the other, beginning with the last one, until the display does not answer.
async fn run<D>(
    display: &mut Ssd1306Async<D, DisplaySize128x64, ssd1306::mode::BasicMode>,
    last: &mut Option<Picture>,
) -> Result<(), DisplayError>
where
    D: display_interface::AsyncWriteOnlyDataCommand,
{
    const END: (u8, u8) = (WIDTH as u8, HEIGHT as u8);
    display.init_with_addr_mode(AddrMode::Horizontal).await?;
    let (mut lit, mut due) = (true, last.is_some());
    let mut answered = Instant::now();
    loop {
        if let Some(picture) = last.as_ref().filter(|_| due) {
            display.set_draw_area((0, 0), END).await?;
            display.draw(picture.bytes()).await?;
            answered = Instant::now();
        }
        due = false;
        if let Ok(next) = with_timeout(AGAIN, SHOW.wait()).await {
            if next != lit {
                lit = next;
                display.set_display_on(lit).await?;
            }
            let picture = NEXT.lock().await;
            if lit && last.as_ref() != Some(&*picture) {
                *last = Some(picture.clone());
                due = true;
            }
        }
        if !due && answered.elapsed() >= AGAIN {
            // nothing new: is it still there?
            display.set_display_on(lit).await?;
            answered = Instant::now();
        }
    }
}
