//! Opens a store and closes it.

use embedded_storage_async::nor_flash::NorFlash;

use super::error::{SettingsError, StoreError};
use super::layout::{Slots, UNITS};
use super::sectors::Store;

impl<F: NorFlash> Store<F> {
    /// Opens the store, and finishes what a power cut has interrupted. Blank flash is an empty store. [`Store::mend`] is due.
    ///
    /// Settings that cannot be read are no error here, see [`Store::settings`]: tables can be used without them.
    ///
    /// # Errors
    /// [`StoreError::Flash`], [`StoreError::NoSpace`].
    pub async fn open(flash: F) -> Result<Self, StoreError> {
        let () = Self::CHECK;
        let mut store = Self {
            flash,
            slots: Slots::default(),
            settings: Err(SettingsError::Corrupt),
            lost: None,
        };
        if store.flash.capacity() < UNITS * F::ERASE_SIZE {
            return Err(StoreError::NoSpace(store.flash.capacity()));
        }
        store.find_tables(|_| ()).await?;
        store.open_settings().await?;
        Ok(store)
    }

    /// Gives the flash back.
    pub fn close(self) -> F {
        self.flash
    }
}
