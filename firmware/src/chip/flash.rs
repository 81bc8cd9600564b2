//! The store in bank 2, which is read where it lies, and the buffer for a table.
use core::mem::{ManuallyDrop, MaybeUninit};
use core::pin::Pin;
use core::ptr::addr_of_mut;

use embassy_stm32::flash::{Async, Error, FLASH_BASE, Flash};
use embassy_stm32::pac::FLASH;
use embassy_stm32::pac::flash::vals::Psize;
use embassy_time::{Duration, with_timeout};
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use static_cell::ConstStaticCell;
use tactus_core::probe::seams::StoredBytes;
use tactus_core::sensor::FingerCode;
use tactus_core::store::{Store, StoreError};

use crate::board;

/// The store in the chip's memory: memory.x, STORE.
const STORE_AT: usize = 0x0810_0000;
const STORE_LENGTH: usize = 256 * 1024;
/// The same from the flash's first byte on.
const OFFSET: u32 = (STORE_AT - FLASH_BASE) as u32;

pub(crate) type Storage = Store<Bank2>;
const MAX_TABLE: usize = Storage::MAX_TABLE;

/// The store is open after so many looks, or will never be: two of its sectors erased take less than 2 s.
const LOOKS: u32 = 100;
/// A look finds an erase over that no interrupt has told of.
const LOOK: Duration = Duration::from_millis(100);

/// Room for the longest table, in the CCM, which nothing else uses and the start-up code does not clear: memory.x.
#[unsafe(link_section = ".ccm.BUFFER")]
static mut BUFFER: MaybeUninit<[u8; MAX_TABLE]> = MaybeUninit::uninit();

/// The buffer for a table, once.
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

/// The first six sectors of bank 2: four of 16 KB, one of 64, one of 128. Places are counted from its first byte on.
pub(crate) struct Bank2(Flash<'static, Async>);

/// The place in the flash of a place in the store.
fn within(at: u32, length: usize) -> Result<u32, Error> {
    let end = (at as usize).checked_add(length);
    match end.is_some_and(|end| end <= STORE_LENGTH) {
        true => Ok(OFFSET + at),
        false => Err(Error::Size),
    }
}

impl ErrorType for Bank2 {
    type Error = Error;
}

impl ReadNorFlash for Bank2 {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, at: u32, bytes: &mut [u8]) -> Result<(), Error> {
        self.0.blocking_read(within(at, bytes.len())?, bytes)
    }

    fn capacity(&self) -> usize {
        STORE_LENGTH
    }
}

impl NorFlash for Bank2 {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 16 * 1024;

    /// Of whole sectors, which the driver checks.
    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        let length = to.saturating_sub(from);
        let from = within(from, length as usize)?;
        // The driver leaves the width as it is, 8 bits, which doubles the time. The supply allows 32 (RM0090 3.6.2). It keeps
        // what an unlocked register holds, and locks it in the end.
        if FLASH.cr().read().lock() {
            FLASH.keyr().write_value(0x4567_0123);
            FLASH.keyr().write_value(0xCDEF_89AB);
        }
        FLASH.cr().modify(|w| w.set_psize(Psize::PSIZE32));
        self.0.erase(from, from + length).await
    }

    async fn write(&mut self, at: u32, bytes: &[u8]) -> Result<(), Error> {
        self.0.write(within(at, bytes.len())?, bytes).await
    }
}

/// The store.
///
/// # Errors
/// It cannot be opened.
pub(crate) async fn open(flash: board::Storage) -> Result<Storage, StoreError> {
    Store::open(Bank2(Flash::new(flash.flash, board::Irqs))).await
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
    fn finger(&self) -> FingerCode {
        board::FINGER
    }

    fn bytes(&mut self, store: &mut Storage) -> Option<&[u8]> {
        let table = store.table()?;
        let at = table.offset as usize;
        // SAFETY: the store's sectors are mapped at this address and are nothing else; the slot in use is erased only when
        // the one after next is begun, and no reader of this slice lives that long.
        let store = unsafe { core::slice::from_raw_parts(STORE_AT as *const u8, STORE_LENGTH) };
        store.get(at..at.checked_add(table.length)?)
    }
}
