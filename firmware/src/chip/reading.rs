//! Remembers over a reset what of the store was being read: no content of the flash costs more than one reset.
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use tactus_core::wire::Reset;

/// A part of the store, as a word that memory has by chance only rarely.
#[derive(Clone, Copy, PartialEq)]
#[repr(u32)]
pub(crate) enum Part {
    /// The headers of tables, and the settings.
    Store = 0x7ac7_0501,
    /// The stored table.
    Table = 0x7ac7_0502,
}

/// The part that is being read. RAM that the start-up code leaves alone: every bit pattern is a value.
#[unsafe(link_section = ".uninit.READING")]
static READING: AtomicU32 = AtomicU32::new(0);

/// The part whose reading the firmware's own reset has ended; forgets it. A person who switches the probe off, or
/// resets it, has it read all again.
pub(crate) fn failed(reset: Reset) -> Option<Part> {
    let was = READING.swap(0, Relaxed);
    let by_itself = matches!(reset, Reset::Watchdog | Reset::Software);
    let parts = [Part::Store, Part::Table].into_iter();
    parts.filter(|_| by_itself).find(|part| *part as u32 == was)
}

/// From here on this part is being read.
pub(crate) fn begin(part: Part) {
    READING.store(part as u32, Relaxed);
}

/// All is read.
pub(crate) fn over() {
    READING.store(0, Relaxed);
}
