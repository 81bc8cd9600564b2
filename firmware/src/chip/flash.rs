//! The store in bank 2, which is read where it lies.
use embassy_stm32::flash::{Async, Bank2Region1, Flash};
use tactus_core::probe::seams::StoredBytes;
use tactus_core::store::{Store, StoreError};

use crate::board;

/// Bank 2 in the chip's memory: memory.x, STORE.
const STORE_AT: usize = 0x0810_0000;
const STORE_LENGTH: usize = 64 * 1024;

pub(crate) type Bank2 = Bank2Region1<'static, Async>;
pub(crate) type Storage = Store<Bank2>;

/// The store.
///
/// # Errors
/// It cannot be opened.
pub(crate) async fn open(flash: board::Storage) -> Result<Storage, StoreError> {
    let flash = Flash::new(flash.flash, board::Irqs)
        .into_regions()
        .bank2_region1;
    Store::open(flash).await
}

/// The stored table, where it lies.
pub(crate) struct MappedTable;

impl StoredBytes<Bank2> for MappedTable {
    fn bytes(&mut self, store: &mut Storage) -> Option<&[u8]> {
        let table = store.table()?;
        let at = table.offset as usize;
        // SAFETY: the store's sectors are mapped at this address and are nothing else; the slot in use is erased only when
        // the one after next is begun, and no reader of this slice lives that long.
        let store = unsafe { core::slice::from_raw_parts(STORE_AT as *const u8, STORE_LENGTH) };
        store.get(at..at.checked_add(table.length)?)
    }
}
