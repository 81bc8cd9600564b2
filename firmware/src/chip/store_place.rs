//! Where the store is: the first six sectors of bank 2, four of 16 KB, one of 64, one of 128.
use embassy_stm32::flash::{Error, FLASH_BASE};

/// The store in the chip's memory: memory.x, STORE.
pub(super) const STORE_AT: usize = 0x0810_0000;
pub(super) const STORE_LENGTH: usize = 256 * 1024;
/// The same from the flash's first byte on.
const OFFSET: u32 = (STORE_AT - FLASH_BASE) as u32;

/// The place in the flash of a place in the store.
pub(super) fn within(at: u32, length: usize) -> Result<u32, Error> {
    let end = (at as usize).checked_add(length);
    match end.is_some_and(|end| end <= STORE_LENGTH) {
        true => Ok(OFFSET + at),
        false => Err(Error::Size),
    }
}
