//! The firmware's log: defmt over RTT.

use defmt_decoder::{DecodeError, Encoding, Table};
use rigless::emulator::Host;
use rigless::soc::Width;

/// Offsets in the RTT control block (SEGGER's): its mark, then up-channel 0's buffer, size, write and read offsets.
const BUFFER: u64 = 28;
const SIZE: u64 = 32;
const WRITE: u64 = 36;
const READ: u64 = 40;
const MARK: u64 = u32::from_le_bytes(*b"SEGG") as u64;

/// Reads up-channel 0 as a debug probe does, and decodes it.
pub(crate) struct Log {
    block: u64,
    table: Table,
    /// bytes of a frame that has no end yet
    rest: Vec<u8>,
    lines: Vec<(u64, String)>,
}

impl Log {
    /// The log of an ELF, if it has one; `block` is the address of `_SEGGER_RTT`.
    pub(crate) fn new(elf: &[u8], block: u64) -> Option<Self> {
        Some(Self {
            block,
            table: Table::parse(elf).ok()??,
            rest: Vec::new(),
            lines: Vec::new(),
        })
    }

    pub(crate) fn drain(&mut self, now_ns: u64, host: &mut dyn Host) {
        let mut word = |offset| host.read(self.block + offset, Width::W32).unwrap_or(0);
        let (size, write) = (word(SIZE), word(WRITE));
        let mut read = word(READ);
        if read == write || word(0) != MARK || size == 0 || read >= size || write >= size {
            return;
        }
        let buffer = word(BUFFER);
        while read != write {
            self.rest
                .push(host.read(buffer + read, Width::W8).unwrap_or(0) as u8);
            read = (read + 1) % size;
        }
        // its RAM is there: it has just been read
        let _ = host.write(self.block + READ, Width::W32, read);
        self.decode(now_ns);
    }

    fn decode(&mut self, now_ns: u64) {
        let whole = match self.table.encoding() {
            // frames end with a 0
            Encoding::Rzcobs => match self.rest.iter().rposition(|byte| *byte == 0) {
                Some(end) => self.rest.drain(..=end).collect::<Vec<_>>(),
                None => return,
            },
            _ => std::mem::take(&mut self.rest),
        };
        let mut decoder = self.table.new_stream_decoder();
        decoder.received(&whole);
        loop {
            match decoder.decode() {
                Ok(frame) => self.lines.push((now_ns, frame.display(false).to_string())),
                Err(DecodeError::Malformed) => {
                    self.lines.push((now_ns, "(a damaged frame)".into()));
                }
                Err(DecodeError::UnexpectedEof) => break,
            }
        }
    }

    /// Lines since the last call, with the time at which they were read, at most 1 ms late.
    pub(crate) fn take(&mut self) -> Vec<(u64, String)> {
        std::mem::take(&mut self.lines)
    }
}
