//! A store: its flash, and the state of its sectors.

use embedded_storage_async::nor_flash::NorFlash;

use super::error::{SettingsError, StoreError};
use super::layout::{Slots, UNITS, WORD};

/// Tables and settings in the first sectors of a flash. [`super::SECTORS`] are erased, each as a whole; `F::ERASE_SIZE`
/// is the size of the smallest.
///
/// The flash programs words of one, two or four bytes and reads as many or fewer. Each function may fail with
/// [`StoreError::Flash`], those of settings with [`StoreError::Settings`], and those that write with
/// [`StoreError::Worn`].
pub struct Store<F> {
    pub(super) flash: F,
    pub(super) slots: Slots,
    /// True if the settings can be used, and whether their schema has been written.
    pub(super) settings: Result<bool, SettingsError>,
    /// Key of a record that was damaged when the store was opened, and could not be put right.
    pub(super) lost: Option<u8>,
    /// A write to the settings has not ended well: what it left may have to be sealed.
    pub(super) is_unsure: bool,
    pub(super) erasures: u32,
}

impl<F: NorFlash> Store<F> {
    const CHECK: () = assert!(
        WORD.is_multiple_of(F::WRITE_SIZE)
            && WORD.is_multiple_of(F::READ_SIZE)
            && F::ERASE_SIZE.is_multiple_of(WORD)
            && F::ERASE_SIZE >= 256
    );

    /// Opens the store, and finishes what a power cut has interrupted. Blank flash is an empty store. [`Store::mend`]
    /// is due.
    ///
    /// Settings that cannot be read are no error here, see [`Store::settings`]: tables can be used without them.
    pub async fn open(flash: F) -> Result<Self, StoreError> {
        let mut store = Self::open_tables(flash).await?;
        store.open_settings().await?;
        Ok(store)
    }

    /// Opens the tables only: the settings are taken for damaged, and not looked at.
    pub async fn open_tables(flash: F) -> Result<Self, StoreError> {
        let () = Self::CHECK;
        let mut store = Self {
            flash,
            slots: Slots::default(),
            settings: Err(SettingsError::Corrupt),
            lost: None,
            is_unsure: false,
            erasures: 0,
        };
        if store.flash.capacity() < UNITS * F::ERASE_SIZE {
            return Err(StoreError::NoSpace(store.flash.capacity()));
        }
        store.find_tables(|_| ()).await?;
        Ok(store)
    }

    /// Sectors that were erased since it was opened.
    pub fn erasures(&self) -> u32 {
        self.erasures
    }

    /// Gives the flash back.
    pub fn close(self) -> F {
        self.flash
    }

    pub(super) async fn read(&mut self, offset: u32, buffer: &mut [u8]) -> Result<(), StoreError> {
        let done = self.flash.read(offset, buffer).await;
        done.map_err(StoreError::flash)
    }

    pub(super) async fn erase(&mut self, from: u32, to: u32) -> Result<(), StoreError> {
        self.erasures = self.erasures.saturating_add(1);
        let done = self.flash.erase(from, to).await;
        done.map_err(StoreError::flash)
    }

    pub(super) async fn program(&mut self, offset: u32, words: &[u8]) -> Result<(), StoreError> {
        let done = self.flash.write(offset, words).await;
        done.map_err(StoreError::flash)
    }
}
