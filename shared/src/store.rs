//! The data that survives a power cut: the texture table, and the settings of this rig.
//!
//! A [`Store`] owns six erase sectors (256 KB of the chip, `STORE` in `board.x`):
//!
//! | sector | KB | what |
//! |---|---|---|
//! | 0, 1 | 16 | one texture table each, see [`Store::begin_table`] |
//! | 2, 3 | 16 | settings: calibration, skin care, progress of the training, what the probe has learned by itself |
//! | 4, 5 | 64, 128 | one texture table each that is longer than fits into 0 and 1, of 64 KB at most |
//!
//! Of all tables that are committed and whole the newest is in use. A new one takes none of the slots of the newest
//! two, so that the one before it stays until it is whole; but of two large ones it takes the older one's, if it is
//! large, too. Nothing is erased before the header of a table has come.
//!
//! A cut at any moment, in the middle of a word or of an erase as well, leaves the state before an operation or the one
//! after it. So does a future that is dropped before its end; the store must then be opened anew.
//!
//! # Bits that change
//!
//! Everything has a checksum, and [`Store::mend`] looks at everything. It puts up to three wrong bits of a table's
//! header right, and two of a record. A damaged table gives way to the one before it, and so does a damaged record:
//! [`Store::damaged_table`] and [`Store::damaged_record`] tell. A record that the flash does not take is stored again
//! behind the words that were in its way. The handheld, whose image has no room for it, does not mend its store: it
//! tells of a damaged table, not of a damaged header or record.
//!
//! # A table slot, little-endian
//!
//! | bytes | what |
//! |---|---|
//! | 4 | magic `SLOT` |
//! | 4 | version of this layout, 1 |
//! | 4 | generation: the newer of two tables has the larger one, whatever their sectors are |
//! | 4 | length of the table |
//! | 4 | checksum of the table, its own last four bytes |
//! | 4 | CRC-32 (ISO-HDLC) of these five |
//! | 4 | free |
//! | 4 | commit word `COMM`, with up to three wrong bits, written last; anything else: no table, or one given up |
//! | | the table |
//!
//! # Words that are programmed again
//!
//! Only to clear further bits: a commit word becomes 0 when its table is given up, and a marker that a cut tore is
//! written again. The flash of an STM32F4 has no ECC and permits it.

mod correct;
mod error;
mod layout;
mod mend;
mod pages;
mod records;
mod sectors;
mod settings;
mod tables;

pub use error::{FlashFault, Setting, SettingsError, StoreError};
pub use layout::{SCHEMA, SECTORS, StoredTable};
pub use records::{MAX_RECORDS, SELF_MOVEMENTS, SelfLearnedRecord, TrainingRecord};
pub use sectors::Store;

#[cfg(test)]
pub(crate) mod tests;
