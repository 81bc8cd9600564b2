//! What a probe knows: the store in bank 2, and the table in force.
use embassy_stm32::flash::{Async, Bank2Region1, Flash};
use tactus_core::session::{Visited, text};
use tactus_core::store::Store;
use tactus_core::table::Table;
use tactus_core::teaching;
use tactus_core::wire::Text;

use crate::board;

/// Bank 2 in the chip's memory: memory.x, STORE.
const STORE_AT: usize = 0x0810_0000;
const STORE_LENGTH: usize = 64 * 1024;

pub(crate) type Storage = Store<Bank2Region1<'static, Async>>;

/// What the probe knows.
pub(crate) struct Memory {
    pub(crate) store: Option<Storage>,
    /// The table that comes with the firmware.
    factory: &'static [u8],
    /// Begins with the table in force: the stored one or the factory's, with what the probe has learned by itself. A new
    /// table is made here too; afterwards [`Memory::reload`] is due.
    pub(crate) room: &'static mut [u8],
    /// Bytes of the table in force.
    length: usize,
    /// What the last exploration felt, until the rig moves again.
    pub(crate) visited: Option<Visited>,
    /// Hears of every table that is put in force.
    changed: fn(&Memory),
}

/// The store; `None` if it cannot be opened, which is logged.
pub(crate) async fn open(flash: board::Storage) -> Option<Storage> {
    let flash = Flash::new(flash.flash, board::Irqs)
        .into_regions()
        .bank2_region1;
    match Store::open(flash).await {
        Ok(store) => Some(store),
        Err(why) => {
            defmt::error!("the store cannot be opened: {=str}", text(&why).as_str());
            None
        }
    }
}

/// The table that all learning begins with: the stored one, or the factory's.
fn base_bytes(store: Option<&Storage>, factory: &'static [u8]) -> &'static [u8] {
    let stored = store.and_then(Storage::table).and_then(|table| {
        let at = table.offset as usize;
        // SAFETY: the store's sectors are mapped at this address and are nothing else; the slot in use is erased only when
        // the one after next is begun, and no reader of this slice lives that long.
        let store = unsafe { core::slice::from_raw_parts(STORE_AT as *const u8, STORE_LENGTH) };
        store.get(at..at.checked_add(table.length)?)
    });
    // one that another version of this firmware wrote is not understood
    stored
        .filter(|bytes| Table::read(bytes).is_ok())
        .unwrap_or(factory)
}

pub(crate) fn broken() -> Text {
    text("the store is broken: see the log")
}

impl Memory {
    pub(crate) fn new(
        store: Option<Storage>,
        factory: &'static [u8],
        room: &'static mut [u8],
        changed: fn(&Memory),
    ) -> Self {
        Self {
            store,
            factory,
            room,
            length: 0,
            visited: None,
            changed,
        }
    }

    /// Puts the table in force, and tells whoever wants to hear of it.
    pub(crate) async fn reload(&mut self) {
        let bytes = base_bytes(self.store.as_ref(), self.factory);
        self.length = match Table::read(bytes) {
            Ok(base) => teaching::put_in_force(&base, self.store.as_mut(), self.room)
                .await
                .unwrap_or_else(|why| {
                    defmt::error!("no table in force: {=str}", text(why).as_str());
                    0
                }),
            Err(why) => {
                defmt::error!("no table: {=str}", text(why).as_str());
                0
            }
        };
        (self.changed)(self);
    }

    /// The bytes of the table in force.
    pub(crate) fn in_force(&self) -> &[u8] {
        self.room.get(..self.length).unwrap_or_default()
    }

    /// Whether nothing was taught or pushed.
    pub(crate) fn is_factory(&self) -> bool {
        core::ptr::eq(base_bytes(self.store.as_ref(), self.factory), self.factory)
    }

    pub(crate) fn store(&mut self) -> Result<&mut Storage, Text> {
        self.store.as_mut().ok_or_else(broken)
    }

    /// The store, the table that learning begins with, and the room for a new one.
    pub(crate) fn to_learn(&mut self) -> Result<(&mut Storage, Table<'static>, &mut [u8]), Text> {
        let base = Table::read(base_bytes(self.store.as_ref(), self.factory)).map_err(text)?;
        let store = self.store.as_mut().ok_or_else(broken)?;
        Ok((store, base, self.room))
    }
}
