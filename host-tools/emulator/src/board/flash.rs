//! The chip's flash array: effects of stores and erases on it (RM0090 3.6 and 3.7).

use std::ops::Range;

use rigless::soc::Width;

/// Address of the array.
pub const FLASH: u64 = 0x0800_0000;
/// The firmware's store: bank 2's four sectors of 16 KB, the one of 64 KB and the first of 128 KB.
pub const STORE: Range<u64> = 0x0810_0000..0x0814_0000;
/// The array, both banks.
pub(crate) const ARRAY: Range<u64> = FLASH..FLASH + (2 << 20);

/// CR: program, sector erase, mass erase, sector number, parallelism, start, lock.
const PG: u64 = 1;
const SER: u64 = 1 << 1;
const SNB_SHIFT: u32 = 3;
const PSIZE_SHIFT: u32 = 8;
pub(super) const STRT: u64 = 1 << 16;
const LOCK: u64 = 1 << 31;
/// SR: operations in the wrong sequence, of the wrong width, busy.
const PGSERR: u64 = 1 << 7;
const PGPERR: u64 = 1 << 6;
pub(super) const BSY: u64 = 1 << 16;

/// A write of the firmware to its store.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum FlashWrite {
    /// It programmed a word.
    Program {
        /// Its place, from the store's first byte on.
        at: usize,
        /// The word afterwards.
        word: u32,
    },
    /// It erased a sector.
    Erase {
        /// Its number in the store.
        sector: usize,
    },
}

/// SNB of the store's first sector.
const FIRST: u64 = 16;

/// The places of a sector of the store, from its first byte on; none where there is no such sector.
pub fn places(number: usize) -> Range<usize> {
    let addresses = sector(FIRST + number as u64).filter(|at| at.end <= STORE.end);
    addresses.map_or(0..0, |at| {
        (at.start - STORE.start) as usize..(at.end - STORE.start) as usize
    })
}

impl FlashWrite {
    /// A store to the array that left this there; `None` outside of the store's sectors, which are programmed by words.
    pub(crate) fn program(address: u64, width: Width, new: u64) -> Option<Self> {
        let inside = STORE.contains(&address) && width == Width::W32;
        inside.then(|| Self::Program {
            at: (address - STORE.start) as usize,
            word: new as u32,
        })
    }

    pub(crate) fn erase(addresses: &Range<u64>) -> Option<Self> {
        let all = FIRST..FIRST + 12;
        let snb = all.filter(|_| STORE.contains(&addresses.start));
        let mut snb = snb.filter(|snb| sector(*snb).as_ref() == Some(addresses));
        snb.next().map(|snb| Self::Erase {
            sector: (snb - FIRST) as usize,
        })
    }
}

/// OPTCR with this BOR_LEV, its bits 2 and 3.
pub(crate) fn with_brown_out(optcr: u64, level: u8) -> u64 {
    optcr & !(3 << 2) | u64::from(level & 3) << 2
}

/// The flags of SR that a store to the array raises in vain; 0 if the store programs it.
pub(crate) fn refusal(cr: u64, width: Width) -> u64 {
    let parallelism = match width {
        Width::W8 => 0,
        Width::W16 => 1,
        Width::W32 => 2,
        Width::W64 => 3,
    };
    if cr & LOCK != 0 || cr & PG == 0 {
        PGSERR
    } else if cr >> PSIZE_SHIFT & 3 != parallelism {
        PGPERR
    } else {
        0
    }
}

/// The addresses that an erase which the interface has just begun sets to ones.
pub(crate) fn erased(cr: u64, sr: u64) -> Option<Range<u64>> {
    let begun = sr & BSY != 0 && cr & SER != 0;
    begun.then(|| sector(cr >> SNB_SHIFT & 0x1F)).flatten()
}

/// The value to store to CR in place of the one that prepares an erase, for words of 8 bits; `None` for any other
/// store.
pub(crate) fn slower(cr: u64) -> Option<u64> {
    (cr & (PG | STRT | LOCK) == 0).then_some(cr & !(3 << PSIZE_SHIFT))
}

/// The addresses of a sector by SNB: 0 to 11, and 16 to 27 for bank 2 (RM0090 tables 6 and 16).
fn sector(snb: u64) -> Option<Range<u64>> {
    let (bank, index) = match snb {
        0..=11 => (0, snb),
        16..=27 => (1 << 20, snb - 16),
        _ => return None,
    };
    let (offset, size) = match index {
        0..=3 => (index << 14, 1 << 14),
        4 => (1 << 16, 1 << 16),
        _ => ((index - 4) << 17, 1 << 17),
    };
    let from = FLASH + bank + offset;
    Some(from..from + size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sectors_are_those_of_the_manual() {
        assert_eq!(sector(0), Some(0x0800_0000..0x0800_4000));
        assert_eq!(sector(4), Some(0x0801_0000..0x0802_0000));
        assert_eq!(sector(11), Some(0x080E_0000..0x0810_0000));
        assert_eq!(sector(16), Some(0x0810_0000..0x0810_4000));
        assert_eq!(sector(19), Some(0x0810_C000..0x0811_0000));
        assert_eq!(sector(27), Some(0x081E_0000..0x0820_0000));
        assert_eq!(sector(12), None);
        assert_eq!(sector(28), None);
    }

    #[test]
    fn what_happens_to_the_store_is_noted_by_its_place_in_it() {
        assert_eq!(
            FlashWrite::program(0x0810_4008, Width::W32, 7),
            Some(FlashWrite::Program {
                at: 0x4008,
                word: 7
            })
        );
        assert_eq!(FlashWrite::program(0x080F_FFFC, Width::W32, 7), None);
        assert_eq!(
            FlashWrite::erase(&(0x0810_C000..0x0811_0000)),
            Some(FlashWrite::Erase { sector: 3 })
        );
        assert_eq!(
            FlashWrite::erase(&(0x0812_0000..0x0814_0000)),
            Some(FlashWrite::Erase { sector: 5 })
        );
        assert_eq!(FlashWrite::erase(&(0x0814_0000..0x0816_0000)), None);
        assert_eq!(FlashWrite::erase(&(0x0800_0000..0x0800_4000)), None);
        assert_eq!(places(0), 0..0x4000);
        assert_eq!(places(3), 0xC000..0x1_0000);
        assert_eq!(places(4), 0x1_0000..0x2_0000);
        assert_eq!(places(5), 0x2_0000..0x4_0000);
        assert_eq!(places(6), 0..0);
    }
}
