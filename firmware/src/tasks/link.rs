//! USART3 at 921600: frames of `tactus_core::wire` in both directions.
use core::cell::Cell;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::usart::{self, BufferedUart, BufferedUartRx, BufferedUartTx};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::channel::Channel;
use embedded_io_async::{Read as _, Write as _};
use static_cell::ConstStaticCell;
use tactus_core::probe::seams::{Events, Panel};
use tactus_core::probe::{RigState, TableInUse, Turn, receive as receive_request};
use tactus_core::sensor::FingerCode;
use tactus_core::wire::ArmReport;
use tactus_core::wire::{Counts, Event, Receiver, Request};

use super::level::OneLevel;
use super::outbox::{self, OUTBOX, STREAM, tell};
use crate::board::{self, Irqs};
use crate::chip::{finger, slots};

const BAUD: u32 = 921_600;
/// USART3's clock divides to 913 043 baud, -0.93 %. The probe's chip makes 923 077 of its own 72 MHz. A receiver of ten
/// bits at 16 samples stands 3.33 % (RM0090, table 137), of which this is a third.
const BUS_HZ: u32 = 42_000_000;
const OFF_PER_MILLE: u32 = (BUS_HZ / ((BUS_HZ + BAUD / 2) / BAUD)).abs_diff(BAUD) * 1000 / BAUD;
const _: () = assert!(OFF_PER_MILLE < 33 / 3);

/// embassy's buffer for the line, and the longest write: a longer one would fail, and the flush after it never end.
pub(crate) const CHUNK: usize = 256;

static DAMAGED_FRAMES: AtomicU32 = AtomicU32::new(0);
static ERASURES: AtomicU32 = AtomicU32::new(0);
pub(crate) static JOBS: Channel<OneLevel, Request, 1> = Channel::new();
pub(crate) static BUSY: AtomicBool = AtomicBool::new(false);
/// Somebody has asked for something since the probe booted.
pub(crate) static HEARD: AtomicBool = AtomicBool::new(false);

static TABLE: Mutex<OneLevel, Cell<TableInUse>> = Mutex::new(Cell::new(TableInUse::NONE));

pub(crate) fn open(
    pins: board::Link,
) -> Option<(BufferedUartTx<'static>, BufferedUartRx<'static>)> {
    static TX: ConstStaticCell<[u8; CHUNK]> = ConstStaticCell::new([0; CHUNK]);
    static RX: ConstStaticCell<[u8; 1024]> = ConstStaticCell::new([0; 1024]);
    let mut config = usart::Config::default();
    config.baudrate = BAUD;
    let uart = BufferedUart::new(
        pins.uart,
        pins.rx,
        pins.tx,
        TX.take(),
        RX.take(),
        Irqs,
        config,
    );
    uart.ok().map(BufferedUart::split)
}

#[embassy_executor::task]
pub(crate) async fn send(mut uart: BufferedUartTx<'static>) {
    let mut chunk = [0; CHUNK];
    loop {
        let length = OUTBOX.read(&mut chunk).await;
        let mut rest = chunk.get(..length).unwrap_or_default();
        // the line itself reports no error while sending; not `write_all`, which panics at a write of nothing
        while !rest.is_empty() {
            let Ok(written @ 1..) = uart.write(rest).await else {
                break;
            };
            rest = rest.get(written..).unwrap_or_default();
        }
        let _ = uart.flush().await;
    }
}

/// The body of a probe, for requests that are answered at any time.
pub(crate) struct Body {
    pub(crate) state: fn() -> RigState,
    /// Stops it; whether all that was asked for.
    pub(crate) stop: fn(bool),
    /// Samples that were lost behind the acquisition.
    pub(crate) lost: fn() -> u32,
    /// Takes what the arm says, if one moves the finger.
    pub(crate) arm: fn(ArmReport) -> bool,
}

#[embassy_executor::task]
pub(crate) async fn receive(mut uart: BufferedUartRx<'static>, mut body: Body) {
    static RECEIVER: ConstStaticCell<Receiver> = ConstStaticCell::new(Receiver::new());
    let receiver = RECEIVER.take();
    let mut bytes = [0; 64];
    // the first report says that the probe has booted, and with which finger
    finger::found().await;
    loop {
        // a framing or overrun error costs bytes, which the CRC notices
        let Ok(length) = uart.read(&mut bytes).await else {
            continue;
        };
        for &byte in bytes.get(..length).unwrap_or_default() {
            match receiver.push::<Request>(byte) {
                None => {}
                Some(Ok(request)) => received(request, &mut body),
                Some(Err(_)) => {
                    let frames = DAMAGED_FRAMES.fetch_add(1, Relaxed) + 1;
                    tell(Event::Damaged(frames));
                }
            }
        }
    }
}

fn received(request: Request, body: &mut Body) {
    HEARD.store(true, Relaxed);
    let busy = BUSY.load(Relaxed) || !JOBS.is_empty();
    if receive_request(&request, busy, body) == Turn::Queue {
        // the queue has space: no other task queues requests
        let _ = JOBS.try_send(request);
    }
}

impl Panel for Body {
    fn finger(&self) -> FingerCode {
        finger::code()
    }

    fn rig(&self) -> RigState {
        (self.state)()
    }

    fn table(&self) -> TableInUse {
        TABLE.lock(Cell::get)
    }

    fn counts(&self) -> Counts {
        Counts {
            slots: slots::SLOTS.load(Relaxed),
            late_slots: slots::LATE.load(Relaxed),
            parity_errors: slots::PARITY.load(Relaxed),
            error_frames: slots::ERROR_FRAMES.load(Relaxed),
            lost_samples: slots::LOST.load(Relaxed) + (self.lost)(),
            lost_reports: outbox::LOST_REPORTS.load(Relaxed),
            damaged_frames: DAMAGED_FRAMES.load(Relaxed),
            erasures: ERASURES.load(Relaxed),
        }
    }

    fn stop(&mut self, all: bool) {
        (self.stop)(all);
    }

    fn arm(&mut self, report: ArmReport) -> bool {
        (self.arm)(report)
    }

    fn stream(&mut self, on: bool) {
        STREAM.store(on, Relaxed);
    }

    fn tell(&mut self, event: Event) {
        tell(event);
    }
}

/// The sink of a probe's events: the line, the table that is answered with, and the go / no-go output.
pub(crate) struct EventSink {
    go: Output<'static>,
    /// Nothing is sent before somebody has asked for something: a probe without a host saves the work.
    waits: bool,
}

impl EventSink {
    pub(crate) fn new(go: board::Go, waits: bool) -> Self {
        let go = Output::new(go.same, Level::Low, Speed::Low);
        Self { go, waits }
    }
}

impl Events for EventSink {
    fn tell(&mut self, event: Event) {
        if let Event::Trouble(_) = &event {
            defmt::error!("trouble: the host is told what it is");
        }
        if !self.waits || HEARD.load(Relaxed) {
            tell(event);
        }
    }

    fn table(&mut self, table: TableInUse) {
        TABLE.lock(|cell| cell.set(table));
    }

    fn erased(&mut self, sectors: u32) {
        ERASURES.store(sectors, Relaxed);
    }

    fn go(&mut self, on: bool) {
        self.go.set_level(on.into());
    }
}
