//! What has other bits than it was written with.
//!
//! `sequential-storage` passes over a record that does not have its checksum, and the one before it would be in force
//! again without a word. Here every record is looked at once more, at boot. One that a newer one has replaced is no
//! loss. Of the others, up to two bits are put right by the checksum, and the record is stored anew, because a flash
//! can only clear bits. What cannot be put right is told. A record that a power cut has left unfinished ends with a
//! blank word.

use embedded_storage_async::nor_flash::{NorFlash, ReadNorFlash};
use heapless::Vec;

use super::correct::Checksum;
use super::error::StoreError;
use super::layout::{WORD, correct_header};
use super::pages::{HEAD, Pages, SEALED, page_size};
use super::records::RECORD;
use super::sectors::Store;

const DATA: Checksum = Checksum {
    polynomial: 0x82F6_3B78,
    highest: 1 << 31,
};
const DATA_FIRST: u32 = 0xEEEE_EEEE;
const LENGTH: Checksum = Checksum {
    polynomial: 0x1A2E,
    highest: 1 << 15,
};
const LENGTH_FIRST: u32 = 0xFFFF;
/// Bits of a record that are put right: less than half of the distance of its code, which is 6.
const MOST: u8 = 2;
/// Records that are kept in mind: as many as bits that the flash may have lost.
const KEPT: usize = 3;

struct Item {
    key: u8,
    bytes: usize,
    next: usize,
    state: State,
}

#[derive(Clone, Copy, PartialEq)]
enum State {
    Whole,
    /// It says nothing: a power cut has left it unfinished, or it is none.
    Torn,
    /// Bits of it had changed, and are put right.
    Corrected,
    Lost,
}

impl<F: NorFlash> Store<F> {
    /// Puts bits right that have changed by themselves, up to three of a table's header and two of a record; to be
    /// called once, after opening. What could not be put right, [`Store::damaged_table`] and [`Store::damaged_record`]
    /// tell. A store that is not mended passes over all that is damaged, and what was stored before it is in force.
    pub async fn mend(&mut self) -> Result<(), StoreError> {
        self.find_tables(correct_header).await?;
        self.mend_records().await?;
        self.look_at_settings().await
    }

    async fn mend_records(&mut self) -> Result<(), StoreError> {
        self.lost = None;
        let mut word = [0; RECORD + WORD];
        // the key of a record, and what it says where that is known again
        let mut damaged: Vec<(u8, Option<Vec<u8, RECORD>>), KEPT> = Vec::new();
        let size = page_size::<F>() as u32;
        // a page that is closed comes before the other one, which its records are copied to
        let mut last = [0; WORD];
        self.in_pages(2 * size - WORD as u32, &mut last).await?;
        let first = u32::from(u32::from_le_bytes(last).count_zeros() > u32::BITS / 2);
        for page in [first, 1 - first] {
            let mut at = page * size + WORD as u32;
            let end = (page + 1) * size - WORD as u32;
            while let Some(item) = self.item(at, end, &mut word).await? {
                if item.state != State::Torn {
                    damaged.retain(|(key, _)| *key != item.key);
                }
                let record = word.get(1..item.bytes).unwrap_or_default();
                let record = match item.state {
                    State::Corrected => Some(Vec::from_slice(record).ok()),
                    State::Lost => Some(None),
                    State::Whole | State::Torn => None,
                };
                // of more than are looked for, the first ones are told
                if let Some(record) = record {
                    let _ = damaged.push((item.key, record));
                }
                at += item.next as u32;
            }
        }
        // only now: storing may turn the page, which leaves out what is damaged
        for (key, record) in &damaged {
            match record {
                Some(record) => self.store_checked(*key, record).await?,
                None => self.lost = Some(*key),
            }
        }
        Ok(())
    }

    async fn in_pages(&mut self, at: u32, bytes: &mut [u8]) -> Result<(), StoreError> {
        let read = Pages(&mut self.flash, &mut self.erasures)
            .read(at, bytes)
            .await;
        read.map_err(StoreError::flash)
    }

    /// What there is at `at`, key and record at the beginning of `word`; `None` where nothing more is written before
    /// `end`.
    async fn item(
        &mut self,
        at: u32,
        end: u32,
        word: &mut [u8; RECORD + WORD],
    ) -> Result<Option<Item>, StoreError> {
        let mut head = [0xFF; HEAD];
        if at + HEAD as u32 <= end {
            self.in_pages(at, &mut head).await?;
        }
        if head == [0xFF; HEAD] {
            return Ok(None);
        }
        let mut item = Item {
            key: 0,
            bytes: 0,
            next: WORD,
            state: State::Torn,
        };
        let [a, b, c, d, length @ ..] = head;
        let (bytes, is_exact) = length_of(length);
        let data_at = at + HEAD as u32;
        let padded = bytes.next_multiple_of(WORD);
        let Some(data) = word.get_mut(..padded) else {
            return Ok(Some(item));
        };
        if data.is_empty() || data_at + padded as u32 > end {
            return Ok(Some(item));
        }
        self.in_pages(data_at, data).await?;
        let blank = data.as_chunks::<WORD>().0.iter();
        let blank = blank.filter(|word| **word == [0xFF; WORD]).count();
        let is_sealed = bytes == SEALED as usize && blank > 1;
        let is_torn = data.ends_with(&[0xFF; WORD]) || is_sealed;
        [item.key, ..] = *word;
        item.bytes = bytes;
        let Some((data, behind)) = word
            .get_mut(..bytes + WORD)
            .and_then(|word| word.split_last_chunk_mut::<WORD>())
        else {
            return Ok(Some(item));
        };
        *behind = [a, b, c, d];
        let computed = !DATA.remainder(data, DATA_FIRST);
        let syndrome = computed ^ u32::from_le_bytes(*behind);
        // a checksum whose first byte would be 0 or FF is stored with its lowest bit changed
        let is_marked = matches!(computed.to_le_bytes(), [0 | 0xFF, ..]);
        let is_whole = syndrome == u32::from(is_marked);
        item.state = match () {
            () if is_whole && is_exact => State::Whole,
            () if is_whole => State::Corrected,
            () if is_torn => State::Torn,
            () => State::Lost,
        };
        if item.state == State::Lost
            && let Some(word) = word.get_mut(..bytes + WORD)
            && DATA.correct(word, syndrome, MOST)
        {
            item.state = State::Corrected;
            item.key = word.first().copied().unwrap_or_default();
        }
        if is_exact || item.state == State::Corrected {
            item.next = HEAD + padded;
        }
        Ok(Some(item))
    }
}

/// The length in a head whose checksum fits.
pub(super) fn exact_length([low, high, a, b]: [u8; WORD]) -> Option<usize> {
    let computed = LENGTH.remainder(&[low, high], LENGTH_FIRST) ^ LENGTH_FIRST;
    // that of a length is never blank
    let stored = u32::from(u16::from_le_bytes([a, b]));
    (computed.min(0xFFFE) == stored).then_some(u16::from_le_bytes([low, high]).into())
}

/// The length in front of a record, by its checksum behind it, and whether no bit of them had changed; 0 where there is
/// none.
fn length_of(mut word: [u8; WORD]) -> (usize, bool) {
    let [low, high, a, b] = word;
    let computed = LENGTH.remainder(&[low, high], LENGTH_FIRST) ^ LENGTH_FIRST;
    let syndrome = computed ^ u32::from(u16::from_le_bytes([a, b]));
    let is_exact = syndrome == 0;
    // three wrong bits may look like those of another length, but of none that is so short
    if !is_exact && !LENGTH.correct(&mut word, syndrome, MOST + 1) {
        return (0, false);
    }
    let [low, high, ..] = word;
    let length = usize::from(u16::from_le_bytes([low, high]));
    (if length <= RECORD { length } else { 0 }, is_exact)
}
