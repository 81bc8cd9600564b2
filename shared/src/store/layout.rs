//! Where everything lies in the flash, and the header of a table's slot.

use crc::{CRC_32_ISO_HDLC, Crc};
use embedded_storage_async::nor_flash::NorFlash;

use super::correct::Checksum;
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

/// Of a slot's header.
const HEADER_SUM: Checksum = Checksum {
    polynomial: 0xEDB8_8320,
    highest: 1 << 31,
};
/// Bits of a header and of a commit word that may be wrong: less than half of the distance of the header's code, which is 7.
const WRONG: u8 = 3;

/// Whether a slot was committed.
pub(super) fn is_committed(word: u32) -> bool {
    (word ^ COMMIT).count_ones() <= WRONG.into()
}

/// Puts a header right, if it is one with no more than three wrong bits.
pub(super) fn correct_header(bytes: &mut [u8; HEADER]) {
    let (body, stored) = bytes.split_at(HEADER - WORD);
    let stored = stored
        .iter()
        .rev()
        .fold(0, |sum, byte| sum << 8 | u32::from(*byte));
    let syndrome = CRC32.checksum(body) ^ stored;
    if syndrome != 0 {
        HEADER_SUM.correct(bytes, syndrome, WRONG);
    }
}

/// What is done to the header of a committed slot before it is read.
pub(super) type Correct = fn(&mut [u8; HEADER]);

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
