//! The two sectors of the settings, as `sequential-storage` sees them: pages that are a little smaller than a sector.
//!
//! `sequential-storage` fills one page, copies what is still valid to the other one, and erases the first. A cut in the
//! middle of that erase can leave any words of the old page, and it cannot tell such a page from one whose copying was
//! cut short: it would erase the copy. The last words of every sector, which it does not see, say what is going on.
//! Erasing a sector can turn their bits into ones in any order, so a state counts only when its word matches exactly.

use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

use super::layout::WORD;
use super::mend::exact_length;
use super::records::RECORD;

const ERASING: [u8; WORD] = *b"eras";
const WIPING: [u8; WORD] = *b"wipe";
const DONE: [u8; WORD] = [0; WORD];
/// Bytes in front of a record's data: checksum, length, checksum of the length.
pub(super) const HEAD: usize = 8;
/// The second word of a head: a record of [`SEALED`] bytes. No word that a cut leaves of it is another length that fits
/// into a page.
const SEAL: [u8; WORD] = [SEALED as u8, 0, 0x7F, 0xFD];
pub(super) const SEALED: u32 = 20;
/// Bytes at the end of a sector that are not the page's.
const TRAILER: usize = 16;
/// `sequential-storage` takes a page for a used one from so many zero bits on in the page's first word.
const MARKED: u32 = 4;

pub(super) const fn page_size<F: NorFlash>() -> usize {
    F::ERASE_SIZE - TRAILER
}

/// The flash, and how many sectors of it were erased.
pub(super) struct Pages<'f, F>(pub(super) &'f mut F, pub(super) &'f mut u32);

#[derive(Clone, Copy)]
enum Word {
    /// [`ERASING`], then [`DONE`].
    Erase,
    /// [`WIPING`].
    Wipe,
}

impl<F: NorFlash> Pages<'_, F> {
    const SIZE: usize = page_size::<F>();
    const FIRST: u32 = 2;

    fn sector(page: u32) -> u32 {
        (Self::FIRST + page) * F::ERASE_SIZE as u32
    }

    fn place(offset: u32) -> u32 {
        let size = Self::SIZE as u32;
        Self::sector(offset / size) + offset % size
    }

    fn word_at(page: u32, word: Word) -> u32 {
        let at = match word {
            Word::Erase => 0,
            Word::Wipe => WORD as u32,
        };
        Self::sector(page) + Self::SIZE as u32 + at
    }

    async fn word(&mut self, page: u32, word: Word) -> Result<[u8; WORD], F::Error> {
        let mut bytes = [0; WORD];
        self.0.read(Self::word_at(page, word), &mut bytes).await?;
        Ok(bytes)
    }

    async fn mark(&mut self, page: u32, word: Word, to: [u8; WORD]) -> Result<(), F::Error> {
        self.0.write(Self::word_at(page, word), &to).await
    }

    async fn erase_sector(&mut self, page: u32) -> Result<(), F::Error> {
        let start = Self::sector(page);
        *self.1 = self.1.saturating_add(1);
        self.0.erase(start, start + F::ERASE_SIZE as u32).await
    }

    async fn erase_page(&mut self, page: u32) -> Result<(), F::Error> {
        let other = 1 - page;
        // A page erases the other one once for good; where it has done so, what is erased now is an unfinished copy of
        // it, and half a copy cannot be mistaken for anything else.
        if self.word(other, Word::Erase).await? == DONE {
            return self.erase_sector(page).await;
        }
        self.mark(other, Word::Erase, ERASING).await?;
        self.erase_sector(page).await?;
        self.mark(other, Word::Erase, DONE).await
    }

    /// Finishes what a power cut has interrupted.
    pub(super) async fn recover(&mut self) -> Result<(), F::Error> {
        for page in 0..2 {
            if self.word(page, Word::Wipe).await? == WIPING {
                return self.wipe().await;
            }
        }
        for page in 0..2 {
            if self.word(page, Word::Erase).await? == ERASING {
                self.erase_sector(1 - page).await?;
                self.mark(page, Word::Erase, DONE).await?;
            }
        }
        for page in 0..2 {
            let mut first = [0; WORD];
            self.0.read(Self::sector(page), &mut first).await?;
            let used = u32::from_le_bytes(first).count_zeros() >= MARKED;
            if !used && !self.is_blank(page).await? {
                self.erase_sector(page).await?;
            }
        }
        self.seal().await
    }

    /// Makes what a cut has left of a head, one word or parts of two, a head of its own: the map would take
    /// the checksum of the next record for its length, once in 65536 times, and lose what is behind it. A head that is
    /// longer than any record is none, and is cleared: every reading of the page would end there.
    pub(super) async fn seal(&mut self) -> Result<(), F::Error> {
        let size = Self::SIZE as u32;
        for page in 0..2 {
            let end = (page + 1) * size - WORD as u32;
            let mut at = page * size + WORD as u32;
            let mut is_loose = false;
            let mut head = [0; HEAD];
            while at + HEAD as u32 <= end {
                self.read(at, &mut head).await?;
                if head == [0xFF; HEAD] {
                    break;
                }
                let [_, _, _, _, length @ ..] = head;
                let whole = exact_length(length).map(|bytes| bytes.next_multiple_of(WORD) as u32);
                let next = whole
                    .map(|bytes| at + HEAD as u32 + bytes)
                    .filter(|next| *next <= end);
                let is_record = whole.is_some_and(|bytes| bytes <= RECORD as u32);
                if next.is_some() && !is_record {
                    self.write(at + WORD as u32, &[0; WORD]).await?;
                }
                is_loose = next.is_none() || !is_record;
                at = next.filter(|_| is_record).unwrap_or(at + WORD as u32);
            }
            if !is_loose || at + HEAD as u32 > end {
                continue;
            }
            if at + WORD as u32 + SEALED <= end {
                self.write(at, &SEAL).await?;
                continue;
            }
            // nothing fits behind it any more
            for at in (at..end).step_by(WORD) {
                self.write(at, &[0; WORD]).await?;
            }
        }
        Ok(())
    }

    pub(super) async fn wipe(&mut self) -> Result<(), F::Error> {
        self.mark(0, Word::Wipe, WIPING).await?;
        self.erase_sector(1).await?;
        self.erase_page(0).await
    }

    async fn is_blank(&mut self, page: u32) -> Result<bool, F::Error> {
        let mut chunk = [0; TRAILER];
        for at in (0..F::ERASE_SIZE as u32).step_by(TRAILER) {
            self.0.read(Self::sector(page) + at, &mut chunk).await?;
            if chunk != [0xFF; TRAILER] {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

impl<F: ErrorType> ErrorType for Pages<'_, F> {
    type Error = F::Error;
}

impl<F: NorFlash> ReadNorFlash for Pages<'_, F> {
    const READ_SIZE: usize = WORD;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        // turning a page reads for a second or more: other tasks must have their turn meanwhile
        embassy_futures::yield_now().await;
        self.0.read(Self::place(offset), bytes).await
    }

    fn capacity(&self) -> usize {
        2 * Self::SIZE
    }
}

impl<F: NorFlash> NorFlash for Pages<'_, F> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = Self::SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        let size = Self::SIZE as u32;
        for page in from / size..to / size {
            self.erase_page(page).await?;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        self.0.write(Self::place(offset), bytes).await
    }
}
