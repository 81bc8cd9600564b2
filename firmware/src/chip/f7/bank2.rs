//! The store's sectors by the flash's registers. embassy's driver of this flash waits for an erase with the core, writes four words
//! at least, and numbers the sectors of bank 2 as those of bank 1: the field of its register description has four bits, and
//! the bank is the fifth.
//!
//! The core of an STM32F7 reads ahead, also where no code asks for it, and a read of a bank that is being erased makes the whole core wait for
//! the end of it: others have seen that for up to 0.7 s on this chip (rusefi 7700, FOME 775). So while bank 2 is written or erased
//! the MPU has it as a device's memory without code, which the core does not read ahead.
use core::ptr::write_volatile;

use cortex_m::asm::{dsb, isb};
use cortex_m::peripheral::MPU;
use embassy_futures::yield_now;
use embassy_stm32::flash::{Error, FLASH_BASE};
use embassy_stm32::pac::FLASH;
use embassy_stm32::pac::flash::regs::Cr;
use embassy_stm32::pac::flash::vals::Psize;
use embassy_stm32::{Peri, peripherals};
use embassy_time::Timer;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

use crate::board;
use crate::chip::store_place::{STORE_AT, STORE_LENGTH, within};

const WORD: usize = 4;
/// Where the store's sectors begin, and where the last one ends.
const BOUNDS: [u32; 7] = [
    0,
    16 << 10,
    32 << 10,
    48 << 10,
    64 << 10,
    128 << 10,
    256 << 10,
];
const _: () = assert!(BOUNDS[6] as usize == STORE_LENGTH);
/// Number of bank 2's first sector (RM0410, FLASH_CR: SNB).
const FIRST_SECTOR: u32 = 0b1_0000;
/// Where that number is in the control register.
const SECTOR_SHIFT: u32 = 3;
/// Between looks at an erase, which takes 0.1 to 2 s.
const LOOK_MS: u64 = 1;

/// Places are counted from the store's first byte on.
pub(crate) struct Bank2(Peri<'static, peripherals::FLASH>);

impl Bank2 {
    pub(in crate::chip) fn new(flash: board::Storage) -> Self {
        Self(flash.flash)
    }

    /// Waits for what is under way, also of a future that was dropped, and locks the flash. Not before: a write to its control register
    /// would have the core stand until the flash is ready.
    ///
    /// # Errors
    /// The flash is one bank.
    async fn ready(&mut self) -> Result<(), Error> {
        if FLASH.optcr().read().n_dbank() {
            return Err(Error::Protected);
        }
        while FLASH.sr().read().bsy() {
            Timer::after_millis(LOOK_MS).await;
        }
        if !FLASH.cr().read().lock() {
            FLASH.cr().write(|w| w.set_lock(true));
        }
        attribute(NORMAL);
        Ok(())
    }

    /// Waits until the flash is ready, and has it do what `mode` says.
    async fn begin(&mut self, mode: impl FnOnce(&mut Cr)) -> Result<(), Error> {
        self.ready().await?;
        attribute(DEVICE);
        FLASH.keyr().write_value(0x4567_0123);
        FLASH.keyr().write_value(0xCDEF_89AB);
        // a flag is cleared by writing 1
        FLASH.sr().modify(|_| {});
        let mut control = Cr::default();
        // the supply allows it from 2.7 V on
        control.set_psize(Psize::PSIZE32);
        mode(&mut control);
        FLASH.cr().write_value(control);
        Ok(())
    }

    /// Erases the store's sector of this number.
    async fn erase_sector(&mut self, number: u32) -> Result<(), Error> {
        self.begin(|control| {
            control.set_ser(true);
            control.0 |= (FIRST_SECTOR + number) << SECTOR_SHIFT;
        })
        .await?;
        FLASH.cr().modify(|w| w.set_strt(true));
        dsb();
        self.ready().await?;
        outcome()
    }
}

/// Writes words where the flash is told to, from this address on.
async fn program(first: usize, words: &[[u8; WORD]]) -> Result<(), Error> {
    for (place, word) in (first..).step_by(WORD).zip(words) {
        // SAFETY: the caller has seen that it is within the store.
        unsafe { write_volatile(place as *mut u32, u32::from_le_bytes(*word)) };
        dsb();
        // 16 us, at most 0.1 ms: the other tasks get on
        while FLASH.sr().read().bsy() {
            yield_now().await;
        }
        outcome()?;
    }
    Ok(())
}

/// What the flash says of the operation that is over.
fn outcome() -> Result<(), Error> {
    let status = FLASH.sr().read();
    let errors = [
        (status.wrperr(), Error::Protected),
        (status.pgaerr(), Error::Unaligned),
        (status.pgperr(), Error::Parallelism),
        (status.erserr(), Error::Seq),
        (status.operr(), Error::Prog),
    ];
    let error = errors.into_iter().find(|(is_set, _)| *is_set);
    error.map_or(Ok(()), |(_, error)| Err(error))
}

/// Memory without a cache, which may be read by any width and ahead; and a device's, which may not (ARMv7-M B3.5.9: TEX, C, B).
const NORMAL: u32 = 0b001_0_0_0 << 16;
const DEVICE: u32 = 0b000_0_0_1 << 16;

/// Gives bank 2 an attribute, by the MPU's region after that of the stack's guard.
fn attribute(attribute: u32) {
    // a region of 1 MB (2^(19 + 1)), on; for all, and no code
    const SIZE: u32 = 19 << 1 | 1;
    const ALL: u32 = 0b011 << 24;
    const NO_CODE: u32 = 1 << 28;
    dsb();
    // SAFETY: nobody else uses this region, nobody uses the MPU in an interrupt, and what is mapped stays where it is.
    unsafe {
        let mpu = &*MPU::PTR;
        mpu.rnr.write(1);
        mpu.rbar.write(STORE_AT as u32);
        mpu.rasr.write(NO_CODE | ALL | attribute | SIZE);
    }
    dsb();
    isb();
}

impl ErrorType for Bank2 {
    type Error = Error;
}

impl ReadNorFlash for Bank2 {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, at: u32, bytes: &mut [u8]) -> Result<(), Error> {
        let from = FLASH_BASE + within(at, bytes.len())? as usize;
        self.ready().await?;
        // SAFETY: it is flash, and nobody writes it: that takes `self`, too.
        bytes.copy_from_slice(unsafe {
            core::slice::from_raw_parts(from as *const u8, bytes.len())
        });
        Ok(())
    }

    fn capacity(&self) -> usize {
        STORE_LENGTH
    }
}

impl NorFlash for Bank2 {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = 16 * 1024;

    /// Of whole sectors.
    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        let number = |bound: u32| (0_u32..).zip(BOUNDS).find(|(_, at)| *at == bound);
        let (Some((first, _)), Some((end, _))) = (number(from), number(to)) else {
            return Err(Error::Unaligned);
        };
        for number in first..end {
            self.erase_sector(number).await?;
        }
        Ok(())
    }

    async fn write(&mut self, at: u32, bytes: &[u8]) -> Result<(), Error> {
        let first = FLASH_BASE + within(at, bytes.len())? as usize;
        let (words, []) = bytes.as_chunks::<WORD>() else {
            return Err(Error::Unaligned);
        };
        if !first.is_multiple_of(WORD) {
            return Err(Error::Unaligned);
        }
        self.begin(|control| control.set_pg(true)).await?;
        let written = program(first, words).await;
        self.ready().await?;
        written
    }
}
