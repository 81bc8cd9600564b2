//! The handheld's display: an SSD1306 on I2C1, told of a whole picture at a time, by DMA while the core sleeps.
use embassy_stm32::gpio::{Input, Level, OutputOpenDrain, Pull, Speed};
use embassy_stm32::i2c::{self, I2c, Master};
use embassy_stm32::mode::Async;
use embassy_stm32::time::Hertz;
use embassy_stm32::{bind_interrupts, dma, peripherals};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::mutex::Mutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Instant, Timer, with_timeout};
use tactus_core::handheld::picture::{HEIGHT, Picture, WIDTH};

use crate::board;

bind_interrupts!(struct Irqs {
    I2C1_EV => i2c::EventInterruptHandler<peripherals::I2C1>;
    I2C1_ER => i2c::ErrorInterruptHandler<peripherals::I2C1>;
    DMA1_STREAM6 => dma::InterruptHandler<peripherals::DMA1_CH6>;
    DMA1_STREAM0 => dma::InterruptHandler<peripherals::DMA1_CH0>;
});

/// True if [`NEXT`] is to be shown, or the display is to be off.
static SHOW: Signal<CriticalSectionRawMutex, bool> = Signal::new();
/// What is to be shown next. It is copied with interrupts on: a signal would move its 1 KB with them off, and for
/// longer than a sensor slot may be late.
static NEXT: Mutex<CriticalSectionRawMutex, Picture> = Mutex::new(Picture::new());

/// Has a picture shown; `None` switches the display off. A picture that comes too early takes the place of the one
/// before it.
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

/// SA0 to ground.
const ADDRESS: u8 = 0x3C;
/// The first byte of a transfer: commands follow, or points.
const COMMANDS: u8 = 0x00;
const POINTS: u8 = 0x40;
/// A module of 128 x 64 after its power came (SSD1306 rev 1.1, chapters 9 and 10; application note, figure 2).
const INIT: [u8; 26] = [
    COMMANDS, 0xAE, // off
    0xD5, 0x80, // its own clock
    0xA8, 63, // 64 rows
    0xD3, 0, 0x40, // from the first one on
    0x8D, 0x14, // the charge pump makes its voltage
    0x20, 0, // along the rows
    0xDA, 0x12, 0xA1, 0xC8, // as these modules are wired and mounted
    0x81, 0x5F, 0xD9, 0x21, 0xDB, 0x40, // contrast
    0xA4, 0xA6, 0x2E, // what is in its memory, lit where it is 1, standing
];
const ON: [u8; 2] = [COMMANDS, 0xAF];
/// All points, whatever is in its memory.
const LIT: [u8; 3] = [COMMANDS, 0xA5, 0xAF];
const OFF: [u8; 2] = [COMMANDS, 0xAE];
/// The next points are those of a whole picture.
const AREA: [u8; 7] = [
    COMMANDS,
    0x21,
    0,
    WIDTH as u8 - 1,
    0x22,
    0,
    HEIGHT as u8 / 8 - 1,
];

type Bus<'p> = I2c<'p, Async, Master>;

/// It does not answer, or the bus does not go on.
struct Hangs;

/// A picture takes 24 ms. A bus that is busy, or has lost its interrupt, would be waited for without end.
const LONGEST: Duration = Duration::from_millis(100);

async fn write(bus: &mut Bus<'_>, bytes: &[u8]) -> Result<(), Hangs> {
    match with_timeout(LONGEST, bus.write(ADDRESS, bytes)).await {
        Ok(Ok(())) => Ok(()),
        _ => Err(Hangs),
    }
}

/// Clocks a display that was interrupted in a byte and holds SDA down, until it lets go (UM10204, 3.1.16).
async fn free(pins: &mut board::Display) {
    let sda = Input::new(pins.sda.reborrow(), Pull::Up);
    let (high, slow) = (Level::High, Speed::Low);
    let mut scl = OutputOpenDrain::new_pull(pins.scl.reborrow(), high, slow, Pull::Up);
    for _ in 0..9 {
        Timer::after_micros(10).await;
        if sda.is_high() {
            break;
        }
        scl.set_low();
        Timer::after_micros(10).await;
        scl.set_high();
    }
}

struct Sent {
    bytes: [u8; 1 + WIDTH * HEIGHT / 8],
    any: bool,
}

impl Sent {
    fn take(&mut self, picture: &Picture) -> bool {
        let [_, points @ ..] = &mut self.bytes;
        let differs = !self.any || points != picture.bytes();
        *points = *picture.bytes();
        self.any = true;
        differs
    }
}

fn bus(pins: &mut board::Display) -> Bus<'_> {
    let mut config = i2c::Config::default();
    config.frequency = Hertz(400_000);
    I2c::new(
        pins.i2c.reborrow(),
        pins.scl.reborrow(),
        pins.sda.reborrow(),
        pins.tx.reborrow(),
        pins.rx.reborrow(),
        Irqs,
        config,
    )
}

/// Lights all points of the display: whether it answers.
pub(crate) async fn light(pins: &mut board::Display) -> bool {
    free(pins).await;
    let mut bus = bus(pins);
    write(&mut bus, &INIT).await.is_ok() && write(&mut bus, &LIT).await.is_ok()
}

#[embassy_executor::task]
pub(crate) async fn show(mut pins: board::Display) {
    let mut sent = Sent {
        bytes: [0; 1 + WIDTH * HEIGHT / 8],
        any: false,
    };
    if let Some(first) = sent.bytes.first_mut() {
        *first = POINTS;
    }
    loop {
        free(&mut pins).await;
        // made anew: one that hangs does not go on by itself
        let mut bus = bus(&mut pins);
        // its power may come late, or its plug be loose
        if run(&mut bus, &mut sent).await.is_err() {
            defmt::warn!("no display: it does not answer");
        }
        drop(bus);
        Timer::after(AGAIN).await;
    }
}

/// Shows one picture after the other, beginning with the last one, until the display does not answer.
async fn run(bus: &mut Bus<'_>, sent: &mut Sent) -> Result<(), Hangs> {
    write(bus, &INIT).await?;
    write(bus, &ON).await?;
    let (mut lit, mut due) = (true, sent.any);
    let mut answered = Instant::now();
    loop {
        if due {
            write(bus, &AREA).await?;
            write(bus, &sent.bytes).await?;
            answered = Instant::now();
        }
        due = false;
        if let Ok(next) = with_timeout(AGAIN, SHOW.wait()).await {
            if next != lit {
                lit = next;
                write(bus, if lit { &ON } else { &OFF }).await?;
            }
            let picture = NEXT.lock().await;
            due = lit && sent.take(&picture);
        }
        if !due && answered.elapsed() >= AGAIN {
            // nothing new: is it still there?
            write(bus, if lit { &ON } else { &OFF }).await?;
            answered = Instant::now();
        }
    }
}
