//! Starts the parts of the finger, and the sensor's slots. What is done in them are interrupts: `chip::slots`.
use embassy_time::Timer;
use heapless::spsc::Producer;
use tactus_core::sensor::PressureSensor as _;
use tactus_core::sensor::pressure::SLOTS_HZ;
use tactus_core::sensor::slot::{self, Unexpected};
#[cfg(feature = "finger-mems")]
use tactus_core::wire::{Event, Failure};

#[cfg(feature = "finger-mems")]
use super::outbox::tell;
use crate::board::{self, Finger};
use crate::chip;
use crate::chip::slots::{self, Bus, Word};

/// Cycles of the core in a us.
const CYCLES_US: u32 = 168;

#[embassy_executor::task]
pub(crate) async fn acquire(
    sensor: board::Sensor,
    timer: board::Slots,
    words: Producer<'static, Word>,
) {
    #[cfg_attr(not(feature = "finger-mems"), expect(unused_mut))]
    let mut bus = Bus::new(sensor);
    Timer::after_millis(Finger::POWER_UP_MS.into()).await;
    #[cfg(feature = "finger-mems")]
    start(&mut bus).await;
    slots::begin(bus, timer, words);
    if Finger::DEAF_MS > 0 {
        leave_alone().await;
    }
}

/// Stops the slots for a while when nothing readable has come for half a minute: a sensor that took noise for a command may be deaf
/// as long as it is clocked. Whoever plugs in a loose cable is done by then. The rig has stood still since the first 10 ms of it.
async fn leave_alone() {
    const LOOK_S: u32 = 30;
    /// All but those of half a second: in fewer a handheld sleeps.
    const SLOTS: u32 = LOOK_S * SLOTS_HZ - SLOTS_HZ / 2;
    loop {
        let before = slots::unreadable();
        Timer::after_secs(LOOK_S.into()).await;
        if slots::unreadable().wrapping_sub(before) > SLOTS {
            slots::pause(true);
            Timer::after_millis(Finger::DEAF_MS.into()).await;
            slots::pause(false);
        }
    }
}

// as a condition in `acquire` it would leave its code in every image
#[cfg(not(feature = "finger-mems"))]
const _: () = assert!(Finger::START.is_empty());

/// Starts the finger's parts, again and again until each of them answers as it must. Without slots the rig knows that its sensor
/// is silent; the host is told which part it is.
#[cfg(feature = "finger-mems")]
async fn start(bus: &mut Bus) {
    /// From one attempt to the next, ms; and attempts from one word about it to the next.
    const AGAIN_MS: u64 = 500;
    const SAY: u32 = 20;
    let mut attempts = 0;
    let mut told = None;
    while let Err(why) = parts(bus) {
        if attempts % SAY == 0 || told != Some(why) {
            tell(Event::Trouble(Failure::Said(why.sentence())));
            told = Some(why);
        }
        attempts += 1;
        Timer::after_millis(AGAIN_MS).await;
    }
}

/// Does the finger's start-up list, and waits for it: 25 ms of a `mems`.
pub(crate) fn parts(bus: &mut Bus) -> Result<(), Unexpected> {
    for step in Finger::START {
        let answer = slot::perform(&[step.transaction], |transaction, bytes| {
            bus.transact(transaction, bytes)
        });
        // a bus that is off reads as a part that is not there
        step.check(Finger::PORTS, &answer.unwrap_or_default())?;
        let waits_us = step.transaction.gap_us + step.wait_us;
        chip::wait_cycles(waits_us * CYCLES_US);
    }
    Ok(())
}
