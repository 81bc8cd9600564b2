//! The slots of the texture table.

use embedded_storage_async::nor_flash::NorFlash;

use super::error::StoreError;
use super::layout::{
    COMMIT, COMMIT_AT, Correct, HEADER, LAYOUT, MAGIC, Push, Slot, StoredTable, TABLE_AT, WORD,
    header, is_committed,
};
use super::sectors::Store;
use crate::CRC32;
use crate::sensor::FingerCode;
use crate::table::{self, Table, TableError};

const CHUNK: usize = 128;

impl<F: NorFlash> Store<F> {
    /// Bytes that a table may have at most.
    pub const MAX_TABLE: usize = Slot::C.capacity::<F>();

    /// The table to be used: the newest one that was committed and is whole; `None`: the factory's.
    ///
    /// The store has checked its own header and the table's checksum. [`Table::read`] checks the rest: the table may
    /// have been written for another version of the program.
    ///
    /// The chip reads the bytes where they lie in the flash. They stay there until the table after the next one is
    /// begun: after [`Store::commit_table`] or [`Store::factory_table`], no one may use the former table any more when
    /// [`Store::begin_table`] is called again.
    pub fn table(&self) -> Option<StoredTable> {
        self.slots.active.map(|(_, table)| table)
    }

    /// What is wrong with the newest table that was committed, if [`Store::table`] had to fall back on the one before
    /// it, or on none: its bytes have changed since. It ends with the next table, and with [`Store::factory_table`].
    ///
    /// More damage to the header of the newest table than is put right is not noticed while the one before it is whole:
    /// an erase that was interrupted leaves the same.
    pub fn damaged_table(&self) -> Option<TableError> {
        self.slots.damaged
    }

    /// Reads the table to be used into the beginning of `buffer`; `None`: the factory's is.
    /// Errors: [`StoreError::Flash`], [`StoreError::Buffer`]; [`StoreError::Table`] when [`Table::read`] refuses it.
    pub async fn read_table<'r>(
        &mut self,
        buffer: &'r mut [u8],
    ) -> Result<Option<Table<'r>>, StoreError> {
        match self.table() {
            Some(table) => self
                .read_back(table.offset, table.length, buffer)
                .await
                .map(Some),
            None => Ok(None),
        }
    }

    /// Begins a table of `length` bytes, in a slot of which the loss matters least: see [`crate::store`]. That is
    /// erased when the header of a table of this length has come, not before. The table in use stays until the new one
    /// is committed. One that was begun before and not committed is given up.
    pub async fn begin_table(&mut self, length: usize) -> Result<(), StoreError> {
        self.slots.push = None;
        if length > Self::MAX_TABLE {
            return Err(StoreError::TooLong {
                length,
                capacity: Self::MAX_TABLE,
            });
        }
        if length < table::HEADER {
            let (got, wanted) = (length, table::HEADER);
            return Err(StoreError::Table(TableError::Truncated { got, wanted }));
        }
        self.slots.push = Some(Push {
            slot: self.slots.next::<F>(length),
            length,
            at: 0,
            word: [0xFF; WORD],
            header: [0; table::HEADER],
        });
        Ok(())
    }

    /// Writes the next part of the table, of any size; `offset` says where it belongs. Offset and length are checked
    /// before anything is written. Errors: [`StoreError::NoTable`], [`StoreError::Part`]; [`StoreError::Flash`] and
    /// [`StoreError::Table`], after which the table must be begun anew.
    pub async fn write_table(&mut self, offset: usize, bytes: &[u8]) -> Result<(), StoreError> {
        // taken out, so that a part that fails or is cancelled ends the table
        let mut push = self.slots.push.take().ok_or(StoreError::NoTable)?;
        if offset != push.at || bytes.len() > push.length - push.at {
            let wanted = push.at;
            self.slots.push = Some(push);
            return Err(StoreError::Part { offset, wanted });
        }
        let table_at = push.slot.start::<F>() + TABLE_AT;
        let mut rest = bytes;
        if push.at < table::HEADER {
            let (now, tail) = rest.split_at(rest.len().min(table::HEADER - push.at));
            for (to, from) in push.header.iter_mut().skip(push.at).zip(now) {
                *to = *from;
            }
            push.at += now.len();
            rest = tail;
            if push.at == table::HEADER && !now.is_empty() {
                Table::check_header(&push.header, push.length).map_err(StoreError::Table)?;
                *self.slots.usable(push.slot) = 0;
                self.erase(push.slot.start::<F>(), push.slot.end::<F>())
                    .await?;
                self.program(table_at, &push.header).await?;
            }
        }
        while !rest.is_empty() {
            let within = push.at % WORD;
            let word_at = table_at + (push.at - within) as u32;
            if within == 0 && rest.len() >= WORD {
                let (whole, tail) = rest.split_at(rest.len() - rest.len() % WORD);
                self.program(word_at, whole).await?;
                push.at += whole.len();
                rest = tail;
            } else {
                let (now, tail) = rest.split_at(rest.len().min(WORD - within));
                for (to, from) in push.word.iter_mut().skip(within).zip(now) {
                    *to = *from;
                }
                push.at += now.len();
                rest = tail;
                if push.at.is_multiple_of(WORD) || push.at == push.length {
                    self.program(word_at, &push.word).await?;
                    push.word = [0xFF; WORD];
                }
            }
        }
        self.slots.push = Some(push);
        Ok(())
    }

    /// Reads the new table back into the beginning of `buffer`, checks it, and commits it: from here on it is the one
    /// to be used. Where a finger is given, the table must have been learned with it. Errors: the former table stays
    /// then, and the new one must be begun anew, except after [`StoreError::NoTable`], [`StoreError::Unfinished`] and
    /// [`StoreError::Buffer`].
    pub async fn commit_table<'r>(
        &mut self,
        finger: Option<FingerCode>,
        buffer: &'r mut [u8],
    ) -> Result<(StoredTable, Table<'r>), StoreError> {
        let push = self.slots.push.as_ref().ok_or(StoreError::NoTable)?;
        let (slot, length, got) = (push.slot, push.length, push.at);
        if got != length {
            return Err(StoreError::Unfinished {
                got,
                wanted: length,
            });
        }
        if buffer.len() < length {
            return Err(StoreError::Buffer(length));
        }
        self.slots.push = None;
        let start = slot.start::<F>();
        let table = self.read_back(start + TABLE_AT, length, buffer).await?;
        let finger = finger.unwrap_or(table.finger());
        let table = table.of_finger(finger).map_err(StoreError::Table)?;
        let stored = StoredTable {
            offset: start + TABLE_AT,
            length,
            crc: table.crc(),
            generation: self.slots.generation.saturating_add(1),
        };
        let header = header(&stored);
        self.program(start, &header).await?;
        let mut back = [0; HEADER];
        self.read(start, &mut back).await?;
        if back != header {
            self.slots.set_worn(slot);
            return Err(StoreError::Worn);
        }
        self.program(start + COMMIT_AT, &COMMIT.to_le_bytes())
            .await?;
        self.slots.generation = stored.generation;
        if self.commit_word(slot).await? != COMMIT {
            self.slots.set_worn(slot);
            // it may count as one, with bits that are wrong
            self.give_up(slot).await?;
            return Err(StoreError::Worn);
        }
        *self.slots.usable(slot) = stored.generation;
        self.slots.active = Some((slot, stored));
        self.slots.damaged = None;
        Ok((stored, table))
    }

    /// Makes the table of `length` bytes at the beginning of `buffer` the one to be used; the buffer is then read back
    /// from the flash. The former table stays in use until the new one is whole.
    pub async fn replace_table(
        &mut self,
        buffer: &mut [u8],
        length: usize,
    ) -> Result<(), StoreError> {
        self.begin_table(length).await?;
        let table = buffer.get(..length).unwrap_or_default();
        self.write_table(0, table).await?;
        self.commit_table(None, buffer).await?;
        Ok(())
    }

    /// Gives the stored tables up: from here on the factory's is to be used.
    pub async fn factory_table(&mut self) -> Result<(), StoreError> {
        self.slots.push = None;
        let active = self.slots.active.map(|(slot, _)| slot);
        let others = Slot::ALL.into_iter().filter(|slot| Some(*slot) != active);
        // the older ones first: the active one hides them until it is given up itself
        for slot in others.chain(active) {
            self.give_up(slot).await?;
            *self.slots.usable(slot) = 0;
        }
        self.slots.active = None;
        self.slots.damaged = None;
        Ok(())
    }

    /// Makes the table of a slot none: clears its commit word, or erases it where bits of that word stay.
    /// Errors: [`StoreError::Worn`] where it counts as one still.
    async fn give_up(&mut self, slot: Slot) -> Result<(), StoreError> {
        let (start, end) = (slot.start::<F>(), slot.end::<F>());
        if is_committed(self.commit_word(slot).await?) {
            self.program(start + COMMIT_AT, &[0; WORD]).await?;
        }
        if is_committed(self.commit_word(slot).await?) {
            self.erase(start, end).await?;
        }
        match is_committed(self.commit_word(slot).await?) {
            true => Err(StoreError::Worn),
            false => Ok(()),
        }
    }

    pub(super) async fn find_tables(&mut self, correct: Correct) -> Result<(), StoreError> {
        // of the newest table that is damaged: its generation, where that can be read
        let mut damaged: Option<(Option<u32>, TableError)> = None;
        for slot in Slot::ALL {
            let is_committed = is_committed(self.commit_word(slot).await?);
            let correct = if is_committed {
                correct
            } else {
                |_: &mut _| ()
            };
            let header = self.slot_header(slot, correct).await?;
            if let Ok((table, _)) = &header {
                self.slots.generation = self.slots.generation.max(table.generation);
            }
            if !is_committed {
                continue;
            }
            let generation = header.as_ref().ok().map(|(table, _)| table.generation);
            let whole = match header {
                Ok((_, layout)) if layout != LAYOUT => Err(TableError::Version(layout as u16)),
                Ok((table, _)) => self.whole(table).await?,
                Err(why) => Err(why),
            };
            match whole {
                Ok(table) => {
                    *self.slots.usable(slot) = table.generation;
                    let active = self.slots.active;
                    if active.is_none_or(|(_, other)| other.generation < table.generation) {
                        self.slots.active = Some((slot, table));
                    }
                }
                Err(why) if damaged.is_none_or(|(other, _)| other < generation) => {
                    damaged = Some((generation, why));
                }
                Err(_) => {}
            }
        }
        let active = self.slots.active.map(|(_, table)| table.generation);
        self.slots.damaged = damaged
            .filter(|(generation, _)| active.is_none() || *generation > active)
            .map(|(_, why)| why);
        Ok(())
    }

    /// The contents of a slot's header, and the version of its layout, if it is one.
    async fn slot_header(
        &mut self,
        slot: Slot,
        correct: Correct,
    ) -> Result<Result<(StoredTable, u32), TableError>, StoreError> {
        let start = slot.start::<F>();
        let mut bytes = [0; HEADER];
        self.read(start, &mut bytes).await?;
        correct(&mut bytes);
        let mut words = bytes
            .as_chunks::<WORD>()
            .0
            .iter()
            .map(|word| u32::from_le_bytes(*word));
        let mut word = || words.next().unwrap_or_default();
        let [magic, layout, generation, length, crc, stored] = core::array::from_fn(|_| word());
        let table = StoredTable {
            offset: start + TABLE_AT,
            length: length as usize,
            crc,
            generation,
        };
        let (body, _) = bytes.split_at(HEADER - WORD);
        let computed = CRC32.checksum(body);
        let is_whole = magic == MAGIC && stored == computed;
        Ok(if is_whole && table.length <= slot.capacity::<F>() {
            Ok((table, layout))
        } else {
            Err(TableError::Crc { stored, computed })
        })
    }

    async fn commit_word(&mut self, slot: Slot) -> Result<u32, StoreError> {
        let mut word = [0; WORD];
        self.read(slot.start::<F>() + COMMIT_AT, &mut word).await?;
        Ok(u32::from_le_bytes(word))
    }

    /// The table, if its bytes still have its checksum.
    async fn whole(
        &mut self,
        table: StoredTable,
    ) -> Result<Result<StoredTable, TableError>, StoreError> {
        let Some(body) = table.length.checked_sub(WORD) else {
            return Ok(Err(TableError::Header));
        };
        let mut digest = CRC32.digest();
        let mut chunk = [0; CHUNK];
        let mut stored = [0; WORD];
        for at in (0..table.length).step_by(CHUNK) {
            self.read(table.offset + at as u32, &mut chunk).await?;
            let (here, _) = chunk.split_at((table.length - at).min(CHUNK));
            let (here, crc) = here.split_at(body.saturating_sub(at).min(here.len()));
            digest.update(here);
            for byte in crc {
                let [_, a, b, c] = stored;
                stored = [a, b, c, *byte];
            }
        }
        let (stored, computed) = (u32::from_le_bytes(stored), digest.finalize());
        Ok(if computed == table.crc && stored == table.crc {
            Ok(table)
        } else {
            Err(TableError::Crc { stored, computed })
        })
    }

    async fn read_back<'r>(
        &mut self,
        offset: u32,
        length: usize,
        buffer: &'r mut [u8],
    ) -> Result<Table<'r>, StoreError> {
        let buffer = buffer.get_mut(..length).ok_or(StoreError::Buffer(length))?;
        let (words, tail) = buffer.split_at_mut(length - length % WORD);
        self.read(offset, words).await?;
        if !tail.is_empty() {
            let mut word = [0; WORD];
            self.read(offset + words.len() as u32, &mut word).await?;
            for (to, from) in tail.iter_mut().zip(word) {
                *to = from;
            }
        }
        Table::read(buffer).map_err(StoreError::Table)
    }
}
