//! A flash in RAM, for probes and stores on a PC.

use std::convert::Infallible;

use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use tactus_core::store::{SECTORS, Store};

/// Bytes of the smallest sector of the chip's store.
pub const SECTOR: usize = 16 * 1024;
/// Bytes of the longest table: for buffers.
pub const TABLE: usize = Store::<RamFlash>::MAX_TABLE;

/// The sectors of a store, the smallest of `S` bytes. They obey the rules: words are read and written whole, sectors
/// are erased whole, and writing only clears bits.
#[derive(Clone, Debug)]
pub struct RamFlash<const S: usize = SECTOR> {
    /// Their contents.
    pub bytes: Vec<u8>,
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
        Self { bytes }
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
    type Error = Infallible;
}

impl<const S: usize> ReadNorFlash for RamFlash<S> {
    const READ_SIZE: usize = 4;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Infallible> {
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

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Infallible> {
        let unit = S as u32;
        let is_it = |&(begin, end): &(u32, u32)| (begin * unit, end * unit) == (from, to);
        assert!(
            SECTORS.iter().any(is_it),
            "flash is erased sector by sector: {from} to {to}"
        );
        self.bytes[from as usize..to as usize].fill(0xFF);
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Infallible> {
        for (stored, byte) in self.words(offset, bytes.len()).iter_mut().zip(bytes) {
            *stored &= byte;
        }
        Ok(())
    }
}
