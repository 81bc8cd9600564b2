//! Finds the finger, starts its parts, and then the sensor's slots. What is done in them are interrupts: `chip::slots`.
use embassy_time::Timer;
use heapless::spsc::Producer;
use tactus_core::sensor::pressure::SLOTS_HZ;
use tactus_core::wire::{Event, Failure, Reset, text};

use super::outbox::tell;
use crate::board;
use crate::chip::finger;
use crate::chip::slots::{self, Bus, Word};

const NOBODY: &str = "no finger answers: check its power, its cable and its chip select";
/// From one attempt to the next, ms; and attempts from one word about it to the next.
const AGAIN_MS: u64 = 500;
const SAY: u32 = 20;

#[embassy_executor::task]
pub(crate) async fn acquire(
    sensor: board::Sensor,
    timer: board::Slots,
    words: Producer<'static, Word>,
    reset: Reset,
) {
    let mut bus = Bus::new(sensor);
    if !finger::find_at_boot(&mut bus, reset).await {
        wait_for_it(&mut bus).await;
    }
    start(&mut bus).await;
    slots::begin(bus, timer, words);
    let deaf_ms = finger::parts().deaf_ms;
    if deaf_ms > 0 {
        leave_alone(deaf_ms).await;
    }
}

/// Looks for a finger until there is one. Without slots the rig knows that its sensor is silent; the host is told why.
/// One that took noise for a command answers only when it was left alone for a while: after some looks these are as far
/// apart.
async fn wait_for_it(bus: &mut Bus) {
    const SOON: u32 = 10;
    let mut looks = 0;
    while !finger::find_again(bus) {
        if looks % SAY == 0 {
            let why = NOBODY.try_into().unwrap_or_default();
            tell(Event::Trouble(Failure::Said(why)));
        }
        looks += 1;
        let deaf_ms = u64::from(finger::parts().deaf_ms);
        Timer::after_millis(if looks % SOON == 0 { deaf_ms } else { AGAIN_MS }).await;
    }
}

/// Stops the slots for a while when nothing readable has come for half a minute: a sensor that took noise for a command
/// may be deaf as long as it is clocked. Whoever plugs in a loose cable is done by then. The rig has stood still since
/// the first 10 ms of it.
async fn leave_alone(deaf_ms: u32) {
    const LOOK_S: u32 = 30;
    /// All but those of half a second: in fewer a handheld sleeps.
    const SLOTS: u32 = LOOK_S * SLOTS_HZ - SLOTS_HZ / 2;
    loop {
        let before = slots::unreadable();
        Timer::after_secs(LOOK_S.into()).await;
        if slots::unreadable().wrapping_sub(before) > SLOTS {
            slots::pause(true);
            Timer::after_millis(deaf_ms.into()).await;
            slots::pause(false);
        }
    }
}

/// Starts the finger's parts, again and again until each of them answers as it must. Without slots the rig knows that
/// its sensor is silent; the host is told which part it is.
async fn start(bus: &mut Bus) {
    let mut attempts = 0;
    let mut told = None;
    while let Err(why) = finger::start(bus) {
        if attempts % SAY == 0 || told != Some(why) {
            tell(Event::Trouble(Failure::Said(text(why))));
            told = Some(why);
        }
        attempts += 1;
        Timer::after_millis(AGAIN_MS).await;
    }
}
