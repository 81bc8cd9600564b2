//! Sensor words, alone in the highest executor: a slot every 227 us from TIM2, P_AC and P_DC in turn. The command goes out
//! at the timer's update and the answer is read at its compare, so that the sensor's 50 us are not waited for.
use core::future::poll_fn;
use core::sync::atomic::Ordering::Relaxed;
use core::sync::atomic::{AtomicBool, AtomicU8, AtomicU32};
use core::task::Poll;

use embassy_executor::InterruptExecutor;
use embassy_stm32::gpio::{Level, Output, Pull, Speed};
use embassy_stm32::interrupt;
use embassy_stm32::pac::spi::regs::Cr1;
use embassy_stm32::pac::{RCC, SPI1, TIM2};
use embassy_stm32::spi::{self, Spi};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::Timer as SlotTimer;
use embassy_sync::waitqueue::AtomicWaker;
use embassy_time::Timer;
use heapless::spsc::Producer;
use tactus_core::sensor::PressureSensor as _;
use tactus_core::sensor::biotac::{BioTac, WordError, WordStats};
use tactus_core::sensor::pressure::{Channel, Pressure};

use crate::{board, chip};

/// A sensor word; `None` is a damaged or missing one.
pub(crate) type Word = Option<Pressure>;
/// Words on their way to the servo: 29 ms.
pub(crate) const WORDS: usize = 128;

/// The bus: 84 MHz / 16.
const SPI_HZ: u32 = 5_250_000;
/// Cycles of the core, 168 MHz, in a frame of 16 bits.
const FRAME_CYCLES: u32 = 16 * (168_000_000 / SPI_HZ);

/// Looks at a frame in its time.
const LOOKS: u32 = 32;

/// 84 MHz / 19 091: 4399.98 slots a second.
const SLOT_TICKS: u32 = 19_091;
/// The answer is read 60 us after the slot began.
const READ_TICKS: u32 = 60 * 84;
/// A command that ends later than this, 10 us, leaves the sensor less than its 50 us.
const LATE_TICKS: u32 = 10 * 84;

/// Slots since boot, those that came too late, and words by what was wrong with them.
pub(crate) static SLOTS: AtomicU32 = AtomicU32::new(0);
pub(crate) static LATE: AtomicU32 = AtomicU32::new(0);
pub(crate) static PARITY: AtomicU32 = AtomicU32::new(0);
pub(crate) static ERROR_FRAMES: AtomicU32 = AtomicU32::new(0);
pub(crate) static LOST: AtomicU32 = AtomicU32::new(0);

const BEGIN: u8 = 1;
const READ: u8 = 2;
static DUE: AtomicU8 = AtomicU8::new(0);
/// Slots that began before the one before them was served.
static MISSED: AtomicU32 = AtomicU32::new(0);
static WAKER: AtomicWaker = AtomicWaker::new();

#[interrupt]
fn TIM2() {
    let flags = TIM2.sr().read();
    // a flag is cleared by writing 0; 1 leaves it
    TIM2.sr().write(|w| w.0 = !flags.0);
    let mut due = 0;
    if flags.uif() {
        due |= BEGIN;
    }
    if flags.ccif(0) {
        due |= READ;
    }
    if DUE.fetch_or(due, Relaxed) & due & BEGIN != 0 {
        MISSED.fetch_add(1, Relaxed);
    }
    WAKER.wake();
}

/// Until the timer says so.
async fn due(what: u8) {
    poll_fn(|context| {
        WAKER.register(context.waker());
        if DUE.fetch_and(!what, Relaxed) & what == 0 {
            Poll::Pending
        } else {
            Poll::Ready(())
        }
    })
    .await;
}

/// Sends two bytes as one frame, while select is low, and gives what came in meanwhile; `None` if the frame is not over in
/// three times its time.
///
/// embassy's transfers look at the status register all the time, 104 times a slot; here it is first looked at when the frame
/// may be over. To the chip that is the same; of the emulator's accesses to registers it was more than half.
fn transfer(bytes: [u8; 2]) -> Option<[u8; 2]> {
    // the last frame has been read, so the data register is free and the next word received belongs to this frame
    SPI1.dr().write(|w| w.set_dr(u16::from_be_bytes(bytes)));
    chip::wait_cycles(FRAME_CYCLES);
    for _ in 0..2 * LOOKS {
        if SPI1.sr().read().rxne() {
            return Some(SPI1.dr().read().dr().to_be_bytes());
        }
        chip::wait_cycles(FRAME_CYCLES / LOOKS);
    }
    None
}

/// Sets the bus up anew: a disturbance may have switched it off, and what is left in its buffers belongs to no word.
fn restart(control: Cr1) {
    RCC.apb2rstr().modify(|w| w.set_spi1rst(true));
    RCC.apb2rstr().modify(|w| w.set_spi1rst(false));
    SPI1.cr1().write_value(control);
}

/// Whether words are wanted, and whether the timer is set up.
static WANTED: AtomicBool = AtomicBool::new(true);
static SET_UP: AtomicBool = AtomicBool::new(false);

/// Stops the slots, or lets them go on where they stopped. Before the sensor has started it is heard, too.
pub(crate) fn listen(on: bool) {
    WANTED.store(on, Relaxed);
    if SET_UP.load(Relaxed) {
        TIM2.cr1().modify(|w| w.set_cen(on));
    }
}

pub(crate) static ACQUIRE: InterruptExecutor = InterruptExecutor::new();

#[interrupt]
fn UART4() {
    // SAFETY: called from here only, and started before the interrupt is on.
    unsafe { ACQUIRE.on_interrupt() }
}

#[embassy_executor::task]
pub(crate) async fn acquire(pins: board::Acquire, mut words: Producer<'static, Word>) {
    let mut config = spi::Config::default();
    // mode 0
    config.frequency = Hertz(SPI_HZ);
    // nobody there then reads as FF FF
    config.miso_pull = Pull::Up;
    let mut spi = Spi::new_blocking(pins.spi, pins.sck, pins.mosi, pins.miso, config);
    // nothing, in frames of 16 bits: from here on they are what the bus sends
    let _ = spi.blocking_write::<u16>(&[]);
    let control = SPI1.cr1().read();
    let mut select = Output::new(pins.select, Level::High, Speed::VeryHigh);
    Timer::after_millis(BioTac::POWER_UP_MS.into()).await;

    let timer = SlotTimer::new(pins.slots);
    TIM2.arr().write_value(SLOT_TICKS - 1);
    TIM2.ccr(0).write_value(READ_TICKS);
    TIM2.dier().write(|w| {
        w.set_uie(true);
        w.set_ccie(0, true);
    });
    // SAFETY: the handler is above, its state is ready.
    unsafe { interrupt::InterruptExt::enable(interrupt::TIM2) };
    // nobody who listens runs before this does
    SET_UP.store(true, Relaxed);
    if WANTED.load(Relaxed) {
        timer.start();
    }

    let mut stats = WordStats::default();
    let mut slot: u32 = 0;
    let mut gap = false;
    let mut put = |word: Word| {
        // who takes the words sees where some are missing: the next one is no good
        gap = words.enqueue(if gap { None } else { word }).is_err();
        if gap {
            LOST.fetch_add(1, Relaxed);
        }
    };
    loop {
        due(BEGIN).await;
        for _ in 0..MISSED.swap(0, Relaxed) {
            slot = slot.wrapping_add(1);
            LATE.fetch_add(1, Relaxed);
            put(None);
        }
        let channel = if slot % 2 == 0 {
            Channel::Pac
        } else {
            Channel::Pdc
        };
        slot = slot.wrapping_add(1);
        SLOTS.store(slot, Relaxed);
        let exchange = BioTac::exchange(channel);
        let mut sent = true;
        if let Some(command) = exchange.command {
            select.set_low();
            // no mode fault with software select, no overrun as each frame is read
            sent = transfer(command).is_some();
            select.set_high();
        }
        if !sent {
            restart(control);
        }
        let late = !sent || TIM2.cnt().read() > LATE_TICKS;
        if !late {
            // this slot's is yet to come: one that is there belongs to a slot that was not served
            DUE.fetch_and(!READ, Relaxed);
        }
        due(READ).await;
        if late {
            LATE.fetch_add(1, Relaxed);
            put(None);
            continue;
        }
        select.set_low();
        let reply = transfer(exchange.read);
        select.set_high();
        if reply.is_none() {
            restart(control);
        }
        let word = reply.ok_or(WordError::NoSensor);
        let word = word.and_then(|reply| BioTac::decode(channel, reply));
        stats.count(&word);
        PARITY.store(stats.parity.saturating_add(stats.padding), Relaxed);
        ERROR_FRAMES.store(stats.error_frames.saturating_add(stats.no_sensor), Relaxed);
        put(word.ok());
    }
}
