//! USART3 at 921600: frames of `tactus_core::wire` in both directions.
use core::cell::Cell;
use core::sync::atomic::{AtomicBool, AtomicU16, AtomicU32, Ordering::Relaxed};

use embassy_stm32::usart::{self, BufferedUart, BufferedUartRx, BufferedUartTx};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::ThreadModeRawMutex;
use embassy_sync::channel::Channel;
use embassy_sync::pipe::Pipe;
use embassy_time::{Duration, Instant, Ticker};
use embedded_io_async::{Read as _, Write as _};
use static_cell::ConstStaticCell;
use tactus_core::rig::control::Phase;
use tactus_core::session::text;
use tactus_core::wire::{
    self, Ask, Counts, Live, MAX_FRAME, Receiver, Report, Request, Status, Tell,
};

use crate::board::{self, Irqs};
use crate::{acquire, servo};

/// What is on its way to the host: 90 ms of the line.
const OUT: usize = 8192;
/// embassy's buffer for the line, and the longest write: a longer one would fail, and the flush after it never end.
const CHUNK: usize = 256;

static OUTBOX: Pipe<ThreadModeRawMutex, OUT> = Pipe::new();
static NUMBER: AtomicU16 = AtomicU16::new(0);
static LOST_REPORTS: AtomicU32 = AtomicU32::new(0);
static DAMAGED_FRAMES: AtomicU32 = AtomicU32::new(0);
/// Raw samples are wanted.
pub(crate) static STREAM: AtomicBool = AtomicBool::new(false);
/// Requests for the session.
pub(crate) static JOBS: Channel<ThreadModeRawMutex, Request, 1> = Channel::new();
/// The session works on a request.
pub(crate) static BUSY: AtomicBool = AtomicBool::new(false);

/// What the session knows of the table in use.
#[derive(Clone, Copy)]
pub(crate) struct TableInUse {
    pub(crate) textures: u16,
    pub(crate) bytes: u32,
    pub(crate) crc: u32,
    pub(crate) factory: bool,
}

pub(crate) static TABLE: Mutex<ThreadModeRawMutex, Cell<TableInUse>> =
    Mutex::new(Cell::new(TableInUse {
        textures: 0,
        bytes: 0,
        crc: 0,
        factory: true,
    }));

/// Opens the line.
pub(crate) fn open(
    pins: board::Link,
) -> Option<(BufferedUartTx<'static>, BufferedUartRx<'static>)> {
    static TX: ConstStaticCell<[u8; CHUNK]> = ConstStaticCell::new([0; CHUNK]);
    static RX: ConstStaticCell<[u8; 1024]> = ConstStaticCell::new([0; 1024]);
    let mut config = usart::Config::default();
    config.baudrate = 921_600;
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

/// Tells the host. What finds no room is lost, and counted; it leaves a gap in the numbers.
pub(crate) fn tell(tell: Tell) {
    let report = Report {
        number: NUMBER.fetch_add(1, Relaxed),
        at_ms: Instant::now().as_millis() as u32,
        tell,
    };
    let mut room = [0; MAX_FRAME + 1];
    let sent = wire::encode(&report, &mut room).is_ok_and(|mut frame| {
        // all writers are in thread mode and none is interrupted by another: what is free stays free
        if OUTBOX.free_capacity() < frame.len() {
            return false;
        }
        while !frame.is_empty() {
            match OUTBOX.try_write(frame) {
                Ok(written) => frame = frame.get(written..).unwrap_or_default(),
                Err(_) => return false,
            }
        }
        true
    });
    if !sent {
        LOST_REPORTS.fetch_add(1, Relaxed);
    }
}

/// Refuses a request.
pub(crate) fn refuse(id: u16, why: impl core::fmt::Display) {
    tell(Tell::Refused { id, why: text(why) });
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

#[embassy_executor::task]
pub(crate) async fn receive(mut uart: BufferedUartRx<'static>) {
    static RECEIVER: ConstStaticCell<Receiver> = ConstStaticCell::new(Receiver::new());
    let receiver = RECEIVER.take();
    let mut bytes = [0; 64];
    loop {
        // a framing or overrun error costs bytes, which the CRC notices
        let Ok(length) = uart.read(&mut bytes).await else {
            continue;
        };
        for &byte in bytes.get(..length).unwrap_or_default() {
            match receiver.push::<Request>(byte) {
                None => {}
                Some(Ok(request)) => answer(request),
                Some(Err(_)) => {
                    let frames = DAMAGED_FRAMES.fetch_add(1, Relaxed) + 1;
                    tell(Tell::Damaged(frames));
                }
            }
        }
    }
}

/// Answers what can be answered at any time; everything else waits for the session.
fn answer(request: Request) {
    let id = request.id;
    match request.ask {
        Ask::Status => {
            tell(Tell::Status(status()));
            tell(Tell::Done(id));
        }
        Ask::Stop => {
            if BUSY.load(Relaxed) || !JOBS.is_empty() {
                servo::stop_for_good();
            } else {
                servo::stop();
            }
            tell(Tell::Done(id));
        }
        Ask::Stream(on) => {
            STREAM.store(on, Relaxed);
            tell(Tell::Done(id));
        }
        Ask::ReadCalibration => {
            tell(calibration());
            tell(Tell::Done(id));
        }
        _ => {
            if BUSY.load(Relaxed) || JOBS.try_send(request).is_err() {
                refuse(id, "busy: wait, or stop what is being done");
            }
        }
    }
}

/// The constants in use.
pub(crate) fn calibration() -> Tell {
    let bytes = servo::snapshot().calibration.to_bytes();
    Tell::Calibration(heapless::Vec::from_slice(&bytes).unwrap_or_default())
}

fn status() -> Status {
    let rig = servo::snapshot();
    let table = TABLE.lock(Cell::get);
    Status {
        phase: rig.phase.into(),
        fault: match rig.phase {
            Phase::Faulted(fault) => Some(fault),
            _ => None,
        },
        textures: table.textures,
        table_bytes: table.bytes,
        table_crc: table.crc,
        factory: table.factory,
        calibrated: rig.calibration.date,
        counts: Counts {
            slots: acquire::SLOTS.load(Relaxed),
            late_slots: acquire::LATE.load(Relaxed),
            parity_errors: acquire::PARITY.load(Relaxed),
            error_frames: acquire::ERROR_FRAMES.load(Relaxed),
            lost_samples: acquire::LOST.load(Relaxed) + servo::LOST.load(Relaxed),
            lost_reports: LOST_REPORTS.load(Relaxed),
            damaged_frames: DAMAGED_FRAMES.load(Relaxed),
        },
        skin_mj: (
            (rig.skin.energy_j() * 1e3) as u32,
            (rig.skin.wear_j() * 1e3) as u32,
        ),
    }
}

/// Tells of every phase and fault, and where the rig is while it moves; and checks in for the tasks of thread mode.
#[embassy_executor::task]
pub(crate) async fn watch() {
    let mut ticker = Ticker::every(Duration::from_millis(5));
    let mut phase = None;
    let mut tick: u32 = 0;
    loop {
        ticker.next().await;
        servo::check_in();
        let rig = servo::snapshot();
        if phase != Some(rig.phase) {
            phase = Some(rig.phase);
            if let Phase::Faulted(fault) = rig.phase {
                tell(Tell::Fault(fault));
            }
            tell(Tell::Phase(rig.phase.into()));
        }
        tick = tick.wrapping_add(1);
        if tick % 10 == 0 && !rig.at_rest {
            tell(Tell::Live(Live {
                force_mn: rig.force_mn as i16,
                steps: rig.steps,
                stage_um: (rig.stage_mm * 1e3) as i32,
                speed_um_s: (rig.velocity_mm_s * 1e3) as i32,
                current_ma: (rig.current_a * 1e3) as i16,
            }));
        }
    }
}
