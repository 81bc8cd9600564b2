//! Where everything lies in the flash, and the header of a table's slot.

use crc::{CRC_32_ISO_HDLC, Crc};
use embedded_storage_async::nor_flash::NorFlash;

use crate::table::TableError;

pub(super) const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
/// Bytes that the flash programs at once.
pub(super) const WORD: usize = 4;
/// Sectors of a store.
pub const SECTORS: usize = 4;
/// Version of the records and of the map they are in (`sequential-storage` 8).
pub const SCHEMA: u16 = 2;
pub(super) const MAGIC: u32 = u32::from_le_bytes(*b"SLOT");
pub(super) const LAYOUT: u32 = 1;
pub(super) const COMMIT: u32 = u32::from_le_bytes(*b"COMM");
/// Header without the commit word.
pub(super) const HEADER: usize = 24;
pub(super) const COMMIT_AT: u32 = 28;
/// Where the table begins in its sector.
pub(super) const TABLE_AT: u32 = 32;

/// A table that is stored whole.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct StoredTable {
    /// Where its bytes begin in the store, a multiple of 4.
    pub offset: u32,
    /// Bytes it has.
    pub length: usize,
    /// Its checksum, as [`crate::table::Table::crc`] gives it.
    pub crc: u32,
    /// Larger than that of every table before it.
    pub generation: u32,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) enum Slot {
    A,
    #[default]
    B,
}

impl Slot {
    pub(super) fn other(self) -> Self {
        match self {
            Self::A => Self::B,
            Self::B => Self::A,
        }
    }

    pub(super) fn start<F: NorFlash>(self) -> u32 {
        match self {
            Self::A => 0,
            Self::B => F::ERASE_SIZE as u32,
        }
    }
}

/// A table on its way into the flash.
pub(super) struct Push {
    pub(super) slot: Slot,
    pub(super) length: usize,
    /// Bytes taken; those of an unfinished word are in `word`.
    pub(super) at: usize,
    pub(super) word: [u8; WORD],
}

#[derive(Default)]
pub(super) struct Slots {
    /// The slot in use, and the table in it.
    pub(super) active: Option<(Slot, StoredTable)>,
    /// Why the newest table that was committed is none any more: the one before it is in use, or none.
    pub(super) damaged: Option<TableError>,
    /// Largest generation that either slot has had.
    pub(super) generation: u32,
    pub(super) push: Option<Push>,
}

pub(super) fn header(table: &StoredTable) -> [u8; HEADER] {
    let mut bytes = [0; HEADER];
    let (body, end) = bytes.split_at_mut(HEADER - WORD);
    let fields = [
        MAGIC,
        LAYOUT,
        table.generation,
        table.length as u32,
        table.crc,
    ];
    let fields = fields.into_iter().flat_map(u32::to_le_bytes);
    for (slot, byte) in body.iter_mut().zip(fields) {
        *slot = byte;
    }
    for (slot, byte) in end.iter_mut().zip(CRC32.checksum(body).to_le_bytes()) {
        *slot = byte;
    }
    bytes
}
