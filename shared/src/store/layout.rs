//! Where everything lies in the flash, and the header of a table's slot.

use embedded_storage_async::nor_flash::NorFlash;

use super::correct::Checksum;
use crate::CRC32;
use crate::table::{self, TableError};

pub(super) const WORD: usize = 4;
/// Where the sectors of a store begin and end, in the smallest of them: two for small tables, two of the settings, two
/// for larger tables. So bank 2 of an STM32F42x begins; a flash of equal sectors erases several for one.
pub const SECTORS: [(u32, u32); 6] = [
    Slot::A.place(),
    Slot::B.place(),
    (2, 3),
    (3, 4),
    Slot::C.place(),
    Slot::D.place(),
];
pub(super) const UNITS: usize = 16;
/// Version of the records and of the map they are in (`sequential-storage` 8).
pub const SCHEMA: u16 = 1;
pub(super) const MAGIC: u32 = u32::from_le_bytes(*b"SLOT");
pub(super) const LAYOUT: u32 = 1;
pub(super) const COMMIT: u32 = u32::from_le_bytes(*b"COMM");
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

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Slot {
    A,
    B,
    C,
    D,
}

impl Slot {
    pub(super) const ALL: [Self; 4] = [Self::A, Self::B, Self::C, Self::D];
    const fn place(self) -> (u32, u32) {
        match self {
            Self::A => (0, 1),
            Self::B => (1, 2),
            Self::C => (4, 8),
            Self::D => (8, 16),
        }
    }

    /// Bytes that a table in it may have. A pair takes what fits into the smaller one of it.
    pub(super) const fn capacity<F: NorFlash>(self) -> usize {
        let units = match self {
            Self::A | Self::B => 1,
            Self::C | Self::D => 4,
        };
        units * F::ERASE_SIZE - TABLE_AT as usize
    }

    pub(super) const fn start<F: NorFlash>(self) -> u32 {
        self.place().0 * F::ERASE_SIZE as u32
    }

    pub(super) const fn end<F: NorFlash>(self) -> u32 {
        self.place().1 * F::ERASE_SIZE as u32
    }
}

pub(super) struct Push {
    pub(super) slot: Slot,
    pub(super) length: usize,
    /// Bytes taken; those of an unfinished word are in `word`, and all of them in `header` as long as they are less
    /// than a header. Nothing is erased before that is a table's.
    pub(super) at: usize,
    pub(super) word: [u8; WORD],
    pub(super) header: [u8; table::HEADER],
}

#[derive(Default)]
pub(super) struct Slots {
    /// Of [`Slot::ALL`], the generations of the tables that can be used; 0 where there is none.
    pub(super) usable: [u32; 4],
    /// The slot in use, and the table in it: the newest of them.
    pub(super) active: Option<(Slot, StoredTable)>,
    /// The reason why the newest committed table is none any more: the one before it is in use, or none.
    pub(super) damaged: Option<TableError>,
    /// Largest generation that any slot has had.
    pub(super) generation: u32,
    pub(super) push: Option<Push>,
    /// Of [`Slot::ALL`], those that did not keep a table.
    pub(super) worn: [bool; 4],
}

impl Slots {
    /// Generation of the table in a slot that can be used.
    pub(super) fn usable(&mut self, slot: Slot) -> &mut u32 {
        let [a, b, c, d] = &mut self.usable;
        match slot {
            Slot::A => a,
            Slot::B => b,
            Slot::C => c,
            Slot::D => d,
        }
    }

    /// The slot has not kept a table: others are preferred until the next start.
    pub(super) fn set_worn(&mut self, slot: Slot) {
        for (worn, it) in self.worn.iter_mut().zip(Slot::ALL) {
            *worn |= it == slot;
        }
    }

    /// The slot for a table of so many bytes: none of the newest two tables, the one in use and the one that is in its
    /// place when that is damaged, unless both are large and the new one is; one of those that are erased the soonest,
    /// where it fits into it; and the one whose loss matters least.
    pub(super) fn next<F: NorFlash>(&mut self, length: usize) -> Slot {
        let newest = self.usable.iter().max().copied().unwrap_or(0);
        let others = self.usable.iter().filter(|other| **other != newest);
        let second = others.max().copied().unwrap_or(0);
        let state = self.usable.into_iter().zip(self.worn);
        let of_each = Slot::ALL.into_iter().zip(state);
        let fitting = of_each.filter(|(slot, _)| slot.capacity::<F>() >= length);
        let loss = |(slot, (generation, worn)): &(Slot, (u32, bool))| {
            let is_kept = *generation != 0 && *generation >= second;
            let is_large = slot.capacity::<F>() > Slot::A.capacity::<F>();
            (is_kept, *worn, is_large, *generation)
        };
        fitting.min_by_key(loss).map_or(Slot::D, |(slot, _)| slot)
    }
}

const HEADER_SUM: Checksum = Checksum {
    polynomial: 0xEDB8_8320,
    highest: 1 << 31,
};
/// Bits of a header and of a commit word that may be wrong: less than half of the distance of the header's code, which
/// is 7.
const WRONG: u8 = 3;

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

/// The change of the header of a committed slot before it is read.
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
