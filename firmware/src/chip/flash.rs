//! The store in bank 2, which is read where it lies.
use core::mem::ManuallyDrop;
use core::pin::Pin;

use embassy_stm32::flash::{Async, Bank2Region1, Flash};
use embassy_time::{Duration, with_timeout};
use tactus_core::probe::seams::StoredBytes;
use tactus_core::store::{Store, StoreError};

use crate::board;

/// Bank 2 in the chip's memory: memory.x, STORE.
const STORE_AT: usize = 0x0810_0000;
const STORE_LENGTH: usize = 64 * 1024;

pub(crate) type Bank2 = Bank2Region1<'static, Async>;
pub(crate) type Storage = Store<Bank2>;

/// The store is open after so many looks, or will never be: two of its sectors erased take less than 2 s.
const LOOKS: u32 = 100;
/// A look finds an erase over that no interrupt has told of.
const LOOK: Duration = Duration::from_millis(100);

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

/// Waits for a store that is being opened; `progress` is called at every look. An erase under way must not be dropped:
/// embassy's driver would lock the flash then, and a write to its control register has the core stand until the flash is ready
/// (RM0090 3.6.1).
///
/// # Errors
/// It cannot be opened, or the flash says nothing for 10 s.
pub(crate) async fn wait(
    opening: impl Future<Output = Result<Storage, StoreError>>,
    progress: impl Fn(),
) -> Result<Storage, StoreError> {
    let mut opening = ManuallyDrop::new(opening);
    // SAFETY: it stays where it is while it is polled. Given up, nothing refers to it: the driver keeps a waker of the task.
    let mut opening = unsafe { Pin::new_unchecked(&mut *opening) };
    for _ in 0..LOOKS {
        progress();
        if let Ok(store) = with_timeout(LOOK, opening.as_mut()).await {
            return store;
        }
    }
    Err(StoreError::Silent)
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
