//! What the probe tells the host, on its way to the line.
use core::sync::atomic::{AtomicBool, AtomicU16, AtomicU32, Ordering::Relaxed};

use embassy_sync::pipe::Pipe;
use embassy_time::Instant;
use tactus_core::wire::{self, Event, MAX_FRAME, PROTOCOL, Report, Reset, Text};

use super::level::OneLevel;
use crate::chip::finger;

/// Bytes on their way to the host: 66 ms of the line.
const OUT: usize = 6144;

pub(crate) static OUTBOX: Pipe<OneLevel, OUT> = Pipe::new();
static NUMBER: AtomicU16 = AtomicU16::new(0);
pub(crate) static LOST_REPORTS: AtomicU32 = AtomicU32::new(0);
pub(crate) static STREAM: AtomicBool = AtomicBool::new(false);

pub(crate) fn booted(reset: Reset, last_words: Option<Text>) {
    tell(Event::Booted {
        protocol: PROTOCOL,
        version: env!("CARGO_PKG_VERSION").try_into().unwrap_or_default(),
        reset,
        last_words,
        finger: finger::code(),
    });
}

/// Sends an event to the host. An event that does not fit into the outbox is dropped and counted; it leaves a gap in
/// the numbers.
pub(crate) fn tell(event: Event) {
    let report = Report {
        number: NUMBER.fetch_add(1, Relaxed),
        at_ms: Instant::now().as_millis() as u32,
        event,
    };
    let mut buffer = [0; MAX_FRAME + 1];
    let sent = wire::encode(&report, &mut buffer).is_ok_and(|mut frame| {
        // all writers are at one level and none is interrupted by another: what is free stays free
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
