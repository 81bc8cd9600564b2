//! What survives a power cut: the texture table, and the settings of this rig.
//!
//! A [`Store`] owns four erase sectors (64 KB of the chip, `STORE` in `memory.x`):
//!
//! | sector | what |
//! |---|---|
//! | 0, 1 | one texture table each, see [`Store::begin_table`] |
//! | 2, 3 | settings: calibration, skin care, progress of the training, what the probe has learned by itself |
//!
//! A cut at any moment, in the middle of a word or of an erase as well, leaves the state before an operation or the one
//! after it. The same goes for a future that is dropped before its end; open the store anew then.
//!
//! # A table slot, little-endian
//!
//! | bytes | what |
//! |---|---|
//! | 4 | magic `SLOT` |
//! | 4 | version of this layout, 1 |
//! | 4 | generation: the newer of two tables has the larger one |
//! | 4 | length of the table |
//! | 4 | checksum of the table, its own last four bytes |
//! | 4 | CRC-32 (ISO-HDLC) of these five |
//! | 4 | free |
//! | 4 | commit word `COMM`, written when all else has been read back; anything else: no table, or one given up |
//! | | the table |
//!
//! # Words that are programmed again
//!
//! Only to clear further bits: a commit word becomes 0 when its table is given up, and a marker that a cut tore is
//! written again. The flash of an STM32F4 has no ECC and permits it.

use core::fmt;

use crc::{CRC_32_ISO_HDLC, Crc};
use embedded_storage_async::nor_flash::NorFlash;

use crate::rig::calibration::RigCalibrationError;
use crate::table::TableError;

mod pages;
mod settings;
mod slots;

pub use settings::{MAX_RECORDS, SCHEMA, SELF_MOVEMENTS, SelfTaught, SettingsError, Trained};
pub use slots::StoredTable;

const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
/// Bytes that the flash programs at once.
const WORD: usize = 4;
/// Sectors of a store.
pub const SECTORS: usize = 4;

/// Why the store did not do what it was told.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum StoreError<E> {
    /// The flash itself failed.
    Flash(E),
    /// The flash has fewer than four sectors.
    Room(usize),
    /// The table does not fit into its sector.
    TooLong {
        /// Bytes of the table.
        length: usize,
        /// Bytes there are.
        room: usize,
    },
    /// No table is being written.
    NoTable,
    /// A part that does not follow on the one before, or that reaches beyond the length that was announced.
    Part {
        /// Where it was to go.
        offset: usize,
        /// Where the next one goes.
        wanted: usize,
    },
    /// The table was to be committed before all of it was there.
    Unfinished {
        /// Bytes written.
        got: usize,
        /// Bytes announced.
        wanted: usize,
    },
    /// The buffer for reading the table back is smaller than the table.
    Buffer(usize),
    /// What was written does not read as a table.
    Table(TableError),
    /// The flash does not hold what was written to it: it is worn out.
    Worn,
    /// The settings cannot be used.
    Settings(SettingsError),
    /// The calibration that is stored cannot be used.
    Calibration(RigCalibrationError),
}

impl<E: fmt::Debug> fmt::Display for StoreError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Flash(why) => write!(f, "the flash failed: {why:?}"),
            Self::Room(bytes) => write!(
                f,
                "{bytes} bytes of flash, and the store takes {SECTORS} sectors"
            ),
            Self::TooLong { length, room } => {
                write!(
                    f,
                    "the table takes {length} bytes, and there is room for {room}"
                )
            }
            Self::NoTable => f.write_str("no table is being written: begin one"),
            Self::Part { offset, wanted } => write!(
                f,
                "a part of the table at {offset}, and {wanted} comes next: send the table anew"
            ),
            Self::Unfinished { got, wanted } => {
                write!(f, "{got} of the {wanted} bytes of the table have come")
            }
            Self::Buffer(wanted) => write!(f, "reading the table back takes {wanted} bytes"),
            Self::Table(why) => why.fmt(f),
            Self::Worn => {
                f.write_str("the flash does not keep what was written: its sector is worn out")
            }
            Self::Settings(why) => why.fmt(f),
            Self::Calibration(why) => why.fmt(f),
        }
    }
}

impl<E: fmt::Debug> core::error::Error for StoreError<E> {}

/// Tables and settings in the first four sectors of a flash.
///
/// The flash programs words of one, two or four bytes and reads as many or fewer.
pub struct Store<F> {
    flash: F,
    slots: slots::Slots,
    /// Whether the settings can be used, and whether their schema has been written.
    settings: Result<bool, SettingsError>,
}

impl<F: NorFlash> Store<F> {
    const CHECK: () = assert!(
        WORD.is_multiple_of(F::WRITE_SIZE)
            && WORD.is_multiple_of(F::READ_SIZE)
            && F::ERASE_SIZE.is_multiple_of(WORD)
            && F::ERASE_SIZE >= 256
    );

    /// Opens the store, and finishes what a power cut has interrupted. Blank flash is an empty store.
    ///
    /// Settings that cannot be read are no error here, see [`Store::settings`]: tables can be used without them.
    ///
    /// # Errors
    /// [`StoreError::Flash`], [`StoreError::Room`].
    pub async fn open(flash: F) -> Result<Self, StoreError<F::Error>> {
        let () = Self::CHECK;
        let mut store = Self {
            flash,
            slots: slots::Slots::default(),
            settings: Err(SettingsError::Corrupt),
        };
        if store.flash.capacity() < SECTORS * F::ERASE_SIZE {
            return Err(StoreError::Room(store.flash.capacity()));
        }
        store.find_tables().await?;
        store.open_settings().await?;
        Ok(store)
    }

    /// Gives the flash back.
    pub fn close(self) -> F {
        self.flash
    }
}

#[cfg(test)]
pub(crate) mod tests;
