//! A store's flash, and what is known of its sectors.

use embedded_storage_async::nor_flash::NorFlash;

use super::error::{SettingsError, StoreError};
use super::layout::{Slots, WORD};

/// Tables and settings in the first sectors of a flash. [`super::SECTORS`] are erased, each as a whole; `F::ERASE_SIZE` is the
/// size of the smallest.
///
/// The flash programs words of one, two or four bytes and reads as many or fewer.
pub struct Store<F> {
    pub(super) flash: F,
    pub(super) slots: Slots,
    /// Whether the settings can be used, and whether their schema has been written.
    pub(super) settings: Result<bool, SettingsError>,
    /// Key of a record that was damaged when the store was opened, and could not be put right.
    pub(super) lost: Option<u8>,
}

impl<F: NorFlash> Store<F> {
    pub(super) const CHECK: () = assert!(
        WORD.is_multiple_of(F::WRITE_SIZE)
            && WORD.is_multiple_of(F::READ_SIZE)
            && F::ERASE_SIZE.is_multiple_of(WORD)
            && F::ERASE_SIZE >= 256
    );

    pub(super) async fn read(&mut self, offset: u32, buffer: &mut [u8]) -> Result<(), StoreError> {
        self.flash
            .read(offset, buffer)
            .await
            .map_err(StoreError::flash)
    }

    pub(super) async fn program(&mut self, offset: u32, words: &[u8]) -> Result<(), StoreError> {
        self.flash
            .write(offset, words)
            .await
            .map_err(StoreError::flash)
    }
}
