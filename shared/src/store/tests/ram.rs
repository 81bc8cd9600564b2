//! Flash in RAM that obeys the rules, and loses its power on demand.

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use std::vec;
use std::vec::Vec;

use crate::store::SECTORS;

/// Sectors of a sixteenth of the chip's, unless others are wanted, so that every word of every operation can be cut.
pub(crate) const SECTOR: usize = 1024;

/// The state of the operation that the power was cut in.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Torn {
    /// Nothing of the word; the erase had not begun.
    Nothing,
    /// Any bits of the word; any words of the sector are erased, and any bits of the others. From this seed.
    Bits(u32),
    /// The sector is erased up to here, in hundredths; half of the word.
    Begin(usize),
    /// The sector is erased from here on, in hundredths; half of the word.
    End(usize),
    /// Everything of it.
    All,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum RamError {
    Cut,
    Rules,
}

impl NorFlashError for RamError {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

#[derive(Clone)]
pub(crate) struct Ram<const S: usize = SECTOR> {
    pub(crate) bytes: Vec<u8>,
    /// Words programmed and sectors erased.
    pub(crate) operations: usize,
    pub(crate) erases: usize,
    /// Erases of each sector.
    pub(crate) worn: [u32; SECTORS.len()],
    /// The operation that the power is cut in.
    pub(crate) cut: Option<(usize, Torn)>,
    /// Bits have changed by themselves: writing to them is no mistake, and clears what it can.
    pub(crate) rotten: bool,
    /// Bits that stay 1 whatever is written: byte, and which of it.
    pub(crate) stuck: Vec<(usize, u8)>,
    dead: bool,
}

impl<const S: usize> Ram<S> {
    pub(crate) fn new() -> Self {
        Self {
            bytes: vec![0xFF; 16 * S],
            operations: 0,
            erases: 0,
            worn: [0; SECTORS.len()],
            cut: None,
            rotten: false,
            stuck: Vec::new(),
            dead: false,
        }
    }

    /// The flash when the power is back.
    pub(crate) fn again(self) -> Self {
        Self {
            bytes: self.bytes,
            stuck: self.stuck,
            ..Self::new()
        }
    }

    /// Counts an operation; what is left of it if the power is cut in it.
    fn operate(&mut self) -> Result<Option<Torn>, RamError> {
        if self.dead {
            return Err(RamError::Cut);
        }
        self.operations += 1;
        match self.cut {
            Some((at, torn)) if at == self.operations => {
                self.dead = true;
                Ok(Some(torn))
            }
            _ => Ok(None),
        }
    }
}

fn next(seed: &mut u32) -> u32 {
    *seed ^= *seed << 13;
    *seed ^= *seed >> 17;
    *seed ^= *seed << 5;
    *seed
}

impl<const S: usize> ErrorType for Ram<S> {
    type Error = RamError;
}

impl<const S: usize> ReadNorFlash for Ram<S> {
    const READ_SIZE: usize = 4;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), RamError> {
        let at = offset as usize;
        assert!(
            at.is_multiple_of(4) && bytes.len().is_multiple_of(4),
            "alignment"
        );
        assert!(at + bytes.len() <= self.bytes.len(), "bounds");
        bytes.copy_from_slice(&self.bytes[at..at + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl<const S: usize> NorFlash for Ram<S> {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = S;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), RamError> {
        let (from, to) = (from as usize, to as usize);
        let is_it =
            |&(begin, end): &(u32, u32)| [begin, end].map(|at| at as usize * S) == [from, to];
        let number = SECTORS.iter().position(is_it).expect("a sector");
        let torn = self.operate()?;
        self.erases += 1;
        self.worn[number] += 1;
        let sector = &mut self.bytes[from..to];
        let length = sector.len();
        match torn {
            None | Some(Torn::All) => sector.fill(0xFF),
            Some(Torn::Nothing) => {}
            Some(Torn::Begin(part)) => sector[..length * part / 100].fill(0xFF),
            Some(Torn::End(part)) => sector[length * part / 100..].fill(0xFF),
            Some(Torn::Bits(mut seed)) => {
                for word in sector.as_chunks_mut::<4>().0 {
                    let erased = match next(&mut seed) % 3 {
                        0 => 0,
                        1 => u32::MAX,
                        _ => next(&mut seed),
                    };
                    *word = (u32::from_le_bytes(*word) | erased).to_le_bytes();
                }
            }
        }
        torn.map_or(Ok(()), |_| Err(RamError::Cut))
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), RamError> {
        let at = offset as usize;
        assert!(
            at.is_multiple_of(4) && bytes.len().is_multiple_of(4),
            "alignment"
        );
        assert!(at + bytes.len() <= self.bytes.len(), "bounds");
        for (word, at) in bytes.as_chunks::<4>().0.iter().zip((at..).step_by(4)) {
            let torn = self.operate()?;
            let buffer: &mut [u8; 4] = self.bytes[at..].first_chunk_mut().unwrap();
            let (old, new) = (u32::from_le_bytes(*buffer), u32::from_le_bytes(*word));
            if torn.is_none() && old & new != new && !self.rotten {
                return Err(RamError::Rules);
            }
            let cleared = match torn {
                None | Some(Torn::All) => new,
                Some(Torn::Nothing) => u32::MAX,
                Some(Torn::Begin(_)) => new | 0xFFFF_0000,
                Some(Torn::End(_)) => new | 0xFFFF,
                Some(Torn::Bits(mut seed)) => new | next(&mut seed),
            };
            *buffer = (old & cleared).to_le_bytes();
            for (byte, bits) in &self.stuck {
                if let Some(cell) = byte.checked_sub(at).and_then(|n| buffer.get_mut(n)) {
                    *cell |= bits;
                }
            }
            if torn.is_some() {
                return Err(RamError::Cut);
            }
        }
        Ok(())
    }
}
