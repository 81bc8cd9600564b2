//! Questions about the chip itself.
use cortex_m::peripheral::DWT;
use embassy_stm32::pac::{FLASH, GPIOA, RCC, gpio::vals::Idr, rcc::vals::Sw};
use embassy_time::{Duration, block_for};
use tactus_core::rig::skin::SkinCare;
use tactus_core::store::StoreError;
use tactus_core::wire::bringup::ChipSeen;

use crate::board;
use crate::chip::{flash, watchdog};

const CORE_HZ: u32 = 168_000_000;
const WATCHDOG_US: u32 = 100_000;

/// So long, by the core's cycle counter; a look at it takes a cycle and more, which is the bound if it does not run.
pub(super) fn wait_us(us: u32) {
    let (began, cycles) = (DWT::cycle_count(), us * (CORE_HZ / 1_000_000));
    let _ = (0..cycles).find(|_| DWT::cycle_count().wrapping_sub(began) >= cycles);
}

/// The chip's clocks, the pin that bank 2 of the flash depends on, and the option bytes' level of the brown-out reset.
pub(super) fn chip() -> ChipSeen {
    let began = DWT::cycle_count();
    block_for(Duration::from_millis(10));
    let khz = DWT::cycle_count().wrapping_sub(began) / 10;
    let control = RCC.cr().read();
    ChipSeen {
        khz,
        external: control.hserdy() && board::has_clock(),
        locked: control.pllrdy() && RCC.cfgr().read().sws() == Sw::PLL1_P,
        pa12: GPIOA.idr().read().idr(12) == Idr::HIGH,
        brown_out: FLASH.optcr().read().bor_lev(),
    }
}

/// Writes the skin's record as it is and reads it again: nothing else is changed, and nothing at all where it is not
/// read. The skin before and after.
pub(super) async fn rewrite(store: &mut flash::Storage) -> Result<[SkinCare; 2], StoreError> {
    let before = store.skin().await?;
    store.set_skin(&before).await?;
    Ok([before, store.skin().await?])
}

/// Hangs with the watchdog on, for longer than it waits.
pub(super) fn hang(watchdog: board::Watchdog) {
    watchdog::tighten(watchdog);
    // 0.5 s at the least, 1.5 s on a chip: no clock is asked, which could stand
    critical_section::with(|_| cortex_m::asm::delay(5 * WATCHDOG_US * (CORE_HZ / 1_000_000)));
}
