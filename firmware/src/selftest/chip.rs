//! What both self-tests ask of the chip itself.
use cortex_m::peripheral::DWT;
use embassy_stm32::pac::{FLASH, GPIOA, RCC, gpio::vals::Idr, rcc::vals::Sw};
use embassy_time::{Duration, block_for};
use tactus_core::rig::skin::SkinCare;
use tactus_core::store::StoreError;

use super::account::CORE_HZ;
use crate::board;
use crate::chip::{flash, watchdog};

const WATCHDOG_US: u32 = 100_000;

/// The chip's clocks, and the pin that bank 2 of the flash depends on.
pub(super) struct Clock {
    pub(super) khz: u32,
    pub(super) external: bool,
    pub(super) locked: bool,
    pub(super) pa12: bool,
}

pub(super) fn clock() -> Clock {
    let began = DWT::cycle_count();
    block_for(Duration::from_millis(10));
    let khz = DWT::cycle_count().wrapping_sub(began) / 10;
    let control = RCC.cr().read();
    Clock {
        khz,
        external: control.hserdy(),
        locked: control.pllrdy() && RCC.cfgr().read().sws() == Sw::PLL1_P,
        pa12: GPIOA.idr().read().idr(12) == Idr::HIGH,
    }
}

/// The level of the brown-out reset in the option bytes: 0 is the highest voltage, 3 is off.
pub(super) fn bor_level() -> u8 {
    FLASH.optcr().read().bor_lev()
}

/// Writes the skin's record as it is and reads it again: nothing else is changed, and nothing at all where it is not read. The skin
/// before and after, and whether there is a table.
pub(super) async fn rewrite(
    store: &mut flash::Storage,
) -> Result<(SkinCare, SkinCare, bool), StoreError> {
    let before = store.skin().await?;
    store.set_skin(&before).await?;
    let after = store.skin().await?;
    Ok((before, after, store.table().is_some()))
}

/// Hangs with the watchdog on, for longer than it waits.
pub(super) fn hang(watchdog: board::Watchdog) {
    watchdog::tighten(watchdog);
    // 0.5 s at the least, 1.5 s on a chip: no clock is asked, which could stand
    critical_section::with(|_| cortex_m::asm::delay(5 * WATCHDOG_US * (CORE_HZ / 1_000_000)));
}
