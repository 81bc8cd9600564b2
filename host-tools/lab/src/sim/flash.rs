//! A flash in RAM, for probes and stores on a PC.

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use tactus_core::store::{SECTORS, Store};

/// Bytes of the smallest sector of the chip's store.
pub const SECTOR: usize = 16 * 1024;
/// Bytes of the longest table: for buffers.
pub const TABLE: usize = Store::<RamFlash>::MAX_TABLE;

/// The flash has lost its power, and does nothing before it is back: see [`RamFlash::halves`].
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PowerLost;

impl NorFlashError for PowerLost {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

/// The sectors of a store, the smallest of `S` bytes. They obey the rules: words are read and written whole, sectors
/// are erased whole, and writing only clears bits, but for those that are stuck.
#[derive(Clone, Debug)]
pub struct RamFlash<const S: usize = SECTOR> {
    /// Their contents.
    pub bytes: Vec<u8>,
    /// Sectors that were erased so far.
    pub erases: u32,
    /// Bits that stay 1 whatever is written: a byte, and which of it.
    pub stuck: Vec<(usize, u8)>,
    /// Halves of words, and of sectors that are erased, that the power lasts for; `None`: for ever.
    pub halves: Option<u32>,
}

impl<const S: usize> RamFlash<S> {
    /// Erased.
    pub fn blank() -> Self {
        Self::of(Vec::new())
    }

    /// Flash that begins with these bytes, and is blank behind them.
    pub fn of(mut bytes: Vec<u8>) -> Self {
        let end = SECTORS.iter().map(|&(_, end)| end as usize * S).max();
        bytes.resize(bytes.len().max(end.unwrap_or_default()), 0xFF);
        Self {
            bytes,
            erases: 0,
            stuck: Vec::new(),
            halves: None,
        }
    }

    /// Takes the power for half a word or half a sector.
    fn half(&mut self) -> Result<(), PowerLost> {
        if let Some(left) = &mut self.halves {
            *left = left.checked_sub(1).ok_or(PowerLost)?;
        }
        Ok(())
    }

    fn words(&mut self, offset: u32, length: usize) -> &mut [u8] {
        let at = offset as usize;
        assert!(
            at.is_multiple_of(4) && length.is_multiple_of(4),
            "flash is read and written in words: {length} bytes at {at}"
        );
        &mut self.bytes[at..at + length]
    }
}

impl<const S: usize> ErrorType for RamFlash<S> {
    type Error = PowerLost;
}

impl<const S: usize> ReadNorFlash for RamFlash<S> {
    const READ_SIZE: usize = 4;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), PowerLost> {
        bytes.copy_from_slice(self.words(offset, bytes.len()));
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl<const S: usize> NorFlash for RamFlash<S> {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = S;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), PowerLost> {
        let unit = S as u32;
        let is_it = |&(begin, end): &(u32, u32)| (begin * unit, end * unit) == (from, to);
        assert!(
            SECTORS.iter().any(is_it),
            "flash is erased sector by sector: {from} to {to}"
        );
        self.erases += 1;
        let middle = from.midpoint(to);
        for (begin, end) in [(from, middle), (middle, to)] {
            self.half()?;
            self.bytes[begin as usize..end as usize].fill(0xFF);
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), PowerLost> {
        self.words(offset, bytes.len());
        for (half, at) in bytes.chunks(2).zip((offset as usize..).step_by(2)) {
            self.half()?;
            for (byte, at) in half.iter().zip(at..) {
                let stuck = self.stuck.iter().filter(|(cell, _)| *cell == at);
                let stuck = stuck.fold(0, |bits, (_, stuck)| bits | stuck);
                self.bytes[at] = self.bytes[at] & byte | stuck;
            }
        }
        Ok(())
    }
}
