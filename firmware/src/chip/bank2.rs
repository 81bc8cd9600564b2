//! The store's sectors by embassy's driver.
use embassy_stm32::flash::{Async, Error, Flash};
use embassy_stm32::pac::FLASH;
use embassy_stm32::pac::flash::vals::Psize;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

use crate::board;
use crate::chip::store_place::{STORE_LENGTH, within};

/// Places are counted from the store's first byte on.
pub(crate) struct Bank2(Flash<'static, Async>);

impl Bank2 {
    pub(super) fn new(flash: board::Storage) -> Self {
        Self(Flash::new(flash.flash, board::Irqs))
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
        // The driver leaves the width as it is, 8 bits, which doubles the time. The supply allows 32 (RM0090 3.6.2). It
        // keeps what an unlocked register holds, and locks it in the end.
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
