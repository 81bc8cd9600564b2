//! The store in bank 2, which is read where it lies, and the buffer for a table.
use core::mem::{ManuallyDrop, MaybeUninit};
use core::pin::Pin;
use core::ptr::addr_of_mut;

use embassy_time::{Duration, with_timeout};
use static_cell::ConstStaticCell;
use tactus_core::probe::Memory;
use tactus_core::probe::seams::{Events, StoredBytes};
use tactus_core::sensor::FingerCode;
use tactus_core::store::{Store, StoreError};

use super::bank2::Bank2;
use super::finger;
use super::reading::{self, Part};
use super::store_place::{STORE_AT, STORE_LENGTH};
use crate::board;

pub(crate) type Storage = Store<Bank2>;
const MAX_TABLE: usize = Storage::MAX_TABLE;

/// The store is open after so many looks, or will never be: two of its sectors erased take less than 2 s.
const LOOKS: u32 = 100;
/// A look finds an erase over that no interrupt has told of.
const LOOK: Duration = Duration::from_millis(100);

/// Room for the longest table, which the start-up code does not clear: memory.x; in the CCM, which nothing else uses.
#[unsafe(link_section = ".ccm.BUFFER")]
static mut BUFFER: MaybeUninit<[u8; MAX_TABLE]> = MaybeUninit::uninit();

pub(crate) fn buffer() -> &'static mut [u8] {
    static ONCE: ConstStaticCell<()> = ConstStaticCell::new(());
    ONCE.take();
    // SAFETY: nobody gets it twice, and the bytes are written before anybody reads them.
    unsafe {
        let at = addr_of_mut!(BUFFER).cast::<u8>();
        at.write_bytes(0, MAX_TABLE);
        core::slice::from_raw_parts_mut(at, MAX_TABLE)
    }
}

/// Opens the store, without its settings where reading it has failed before the reset.
pub(crate) async fn open(
    flash: board::Storage,
    failed: Option<Part>,
) -> Result<Storage, StoreError> {
    let bank = Bank2::new(flash);
    reading::begin(Part::Store);
    match failed {
        Some(Part::Store) => Store::open_tables(bank).await,
        _ => Store::open(bank).await,
    }
}

/// Puts the table in force: the stored one, unless reading it has failed before the reset.
pub(crate) async fn reload(
    memory: &mut Memory<'_, Bank2, MappedTable>,
    failed: Option<Part>,
    events: &mut impl Events,
) {
    if failed == Some(Part::Table) {
        memory.distrust();
    }
    reading::begin(Part::Table);
    memory.reload(events).await;
    reading::over();
}

/// Waits for a store that is being opened; `progress` is called at every look. An erase under way must not be dropped:
/// embassy's driver would lock the flash then, and a write to its control register has the core stand until the flash
/// is ready (RM0090 3.6.1).
///
/// # Errors
/// It cannot be opened, or the flash says nothing for 10 s.
pub(crate) async fn wait(
    opening: impl Future<Output = Result<Storage, StoreError>>,
    progress: impl Fn(),
) -> Result<Storage, StoreError> {
    let mut opening = ManuallyDrop::new(opening);
    // SAFETY: it stays where it is while it is polled. Given up, nothing refers to it: the driver keeps a waker of the
    // task.
    let mut opening = unsafe { Pin::new_unchecked(&mut *opening) };
    for _ in 0..LOOKS {
        progress();
        if let Ok(store) = with_timeout(LOOK, opening.as_mut()).await {
            return store;
        }
    }
    Err(StoreError::Silent)
}

pub(crate) struct MappedTable;

impl StoredBytes<Bank2> for MappedTable {
    fn finger(&self) -> FingerCode {
        finger::code()
    }

    /// Board tests break it by its name.
    #[unsafe(export_name = "tactus_stored_table")]
    #[inline(never)]
    fn bytes(&mut self, store: &mut Storage) -> Option<&[u8]> {
        let table = store.table()?;
        let at = table.offset as usize;
        // SAFETY: the store's sectors are mapped at this address and are nothing else; the slot in use is erased only
        // when the one after next is begun, and no reader of this slice lives that long.
        let store = unsafe { core::slice::from_raw_parts(STORE_AT as *const u8, STORE_LENGTH) };
        store.get(at..at.checked_add(table.length)?)
    }
}
