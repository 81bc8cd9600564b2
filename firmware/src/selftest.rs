//! The self-test of a board and its rig: each part in turn, with what was measured and what to do about it, over defmt. A host that
//! asks in the first second, or when the self-test is over, is answered instead: see `bringup`.
//!
//! Motors move only after all switches were seen closed and somebody squeezed the finger in the hand, and no further than a
//! bound: the finger must be off its mount, its cable on. P_DC is watched while the lever moves. The watchdog comes last: it starts the chip again, and the next start says whether it did.
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_time::Timer;
use tactus_core::wire::Reset;

use self::account::{Account, CORE_HZ, Kept, keep, ready};
use self::bringup::Line;
use self::chip::{bor_level, clock, hang, rewrite};
use self::rig::rig;
use self::sensor::sensor;
use crate::board;
use crate::chip::{flash, rescue};
use crate::tasks::link;

mod account;
mod bringup;
mod chip;
mod motors;
mod rig;
mod sensor;

/// Tests the board and ends with the green or the red LED. To be called once, from thread mode.
pub async fn selftest() {
    let (reset, last_words) = rescue::reset_cause();
    let kept = keep(Kept {
        magic: 0,
        passed: 0,
        failed: 0,
    });
    let r = board::start();
    let Some((tx, rx)) = link::open(r.link) else {
        rescue::refuse("the link's rate cannot be had");
    };
    let mut line = Line::new(tx, rx);
    start_counter();
    if kept.magic != Kept::HANGS && line.is_asked().await {
        let parts = bringup::Parts {
            sensor: r.sensor,
            lever: r.lever,
            stage: r.stage,
            current: r.current,
            switches: r.switches,
            store: Some(r.store),
            watchdog: r.watchdog,
        };
        bringup::serve(parts, line, reset, last_words).await;
    }
    let mut green = Output::new(r.leds.green, Level::Low, Speed::Low);
    let mut blue = Output::new(r.leds.blue, Level::Low, Speed::Low);
    let mut red = Output::new(r.leds.red, Level::Low, Speed::Low);
    let mut account = Account::default();

    if kept.magic == Kept::HANGS {
        account = Account {
            passed: kept.passed,
            failed: kept.failed,
        };
        account.check(
            reset == Reset::Watchdog,
            "watchdog",
            format_args!("started again by {reset:?}"),
            "Something else ended the hang: leave the reset button alone and run the test again",
        );
    } else {
        defmt::info!("tactus-selftest {=str}", env!("CARGO_PKG_VERSION"));
        let well = match &last_words {
            Some(words) => account.check(
                false,
                "reset",
                format_args!("{reset:?}, last words: {}", words.as_str()),
                "The firmware gave up before: report this line. Motors stay off; run the test again for them",
            ),
            None => account.check(
                matches!(reset, Reset::Power | Reset::Pin | Reset::Software),
                "reset",
                format_args!("{reset:?}"),
                "Check the supply, power off and on, run the test again",
            ),
        };
        chip(&mut account);
        brown_out();
        let touch = sensor(r.sensor, reset, &mut account).await;
        rig(
            r.lever,
            r.stage,
            r.current,
            r.switches,
            touch,
            well,
            &mut blue,
            &mut account,
        )
        .await;
        store(r.store, &mut account).await;
        watch(r.watchdog, &mut account).await;
    }
    if account.failed == 0 {
        green.set_high();
        defmt::info!("SELF-TEST PASSED: {=u32} checks", account.passed);
    } else {
        red.set_high();
        defmt::error!(
            "SELF-TEST FAILED: {=u32} passed, {=u32} failed",
            account.passed,
            account.failed
        );
    }
    // the LEDs keep their levels while they are not dropped
    bringup::wait(line).await
}

/// Starts the core's cycle counter.
fn start_counter() {
    // SAFETY: the cycle counter is nobody else's.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
}

/// Clocks, and the pin that bank 2 of the flash depends on.
fn chip(account: &mut Account) {
    let clock = clock();
    let (khz, external) = (clock.khz, clock.external);
    account.check(
        external && clock.locked && khz.abs_diff(CORE_HZ / 1000) <= CORE_HZ / 100_000,
        "clock",
        format_args!("{khz} kHz; HSE {}, PLL {}", ready(external), ready(clock.locked)),
        "The 8 MHz come from the debug probe on the board: leave it on, and the solder bridges of OSC_IN as delivered (UM1974)",
    );
    account.check(
        !clock.pa12,
        "PA12",
        if clock.pa12 { "high" } else { "low" },
        "PA12 must be low while bank 2 of the flash is used: take the plug out of the USB user connector CN13",
    );
}

/// Below 2.7 V flash cannot be written by words, and a chip as delivered is reset only below some 1.7 V.
/// Option bytes are not the firmware's to write.
fn brown_out() {
    // BOR_LEV 0 is level 3, 2.7 to 3.6 V (RM0090 3.9.10)
    if bor_level() != 0 {
        defmt::warn!(
            "brown-out reset is not at level 3: set it once, STM32_Programmer_CLI -c port=SWD -ob BOR_LEV=0"
        );
    }
}

async fn store(pins: board::Storage, account: &mut Account) {
    const REMEDY: &str = "Nothing was erased. Report this line; the rig works without a store but forgets at power-off";
    let done = match flash::open(pins).await {
        Ok(mut store) => rewrite(&mut store).await,
        Err(why) => Err(why),
    };
    match done {
        Ok((before, after, table)) => account.check(
            (after.energy_j(), after.wear_j()) == (before.energy_j(), before.wear_j()),
            "store",
            format_args!(
                "the skin's record, {:.1} J, is {:.1} J after writing it; {} table",
                before.energy_j(),
                after.energy_j(),
                if table { "a" } else { "no" }
            ),
            REMEDY,
        ),
        Err(why) => account.check(false, "store", why, REMEDY),
    };
}

/// Hangs until the watchdog starts the chip again; comes back only if it does not.
async fn watch(watchdog: board::Watchdog, account: &mut Account) {
    defmt::info!(
        "the watchdog now: {=u32} passed, {=u32} failed so far. If no line follows within a second, look at the LEDs",
        account.passed,
        account.failed
    );
    // for the probe to read the log
    Timer::after_millis(100).await;
    keep(Kept {
        magic: Kept::HANGS,
        passed: account.passed,
        failed: account.failed,
    });
    hang(watchdog);
    keep(Kept {
        magic: 0,
        passed: 0,
        failed: 0,
    });
    account.check(
        false,
        "watchdog",
        "more than 0.5 s of hanging, and no reset",
        "The watchdog's oscillator does not run: replace the board",
    );
}
