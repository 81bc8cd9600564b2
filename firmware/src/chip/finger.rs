//! The finger that is on the sensor's bus: looked for when the chip starts, before anything needs to know it. Every
//! task that does waits for [`found`].
use core::sync::atomic::{AtomicU8, Ordering::Relaxed};

use cortex_m::peripheral::SCB;
use embassy_time::{Duration, Timer, block_for};
use tactus_core::sensor::slot::{self, Unexpected};
use tactus_core::sensor::{FingerCode, FingerName, FingerParts, find};
use tactus_core::wire::Reset;

use super::rescue;
use super::slots::Bus;

/// The slowest finger, a BioTac, answers so long after it has got its power, ms.
const POWER_UP_MS: u64 = {
    let all: &[FingerName] = &FingerName::ALL;
    let (mut longest, mut fingers) = (0, all);
    while let [finger, others @ ..] = fingers {
        let this = finger.parts().power_up_ms;
        longest = if this > longest { this } else { longest };
        fingers = others;
    }
    longest as u64
};
/// Looks at boot, and from one to the next, ms: one that had its power before answers within them, too.
const LOOKS: u32 = 12;
const EVERY_MS: u64 = 10;

/// Not one of [`FingerName::ALL`].
const UNKNOWN: u8 = u8::MAX;
static FINGER: AtomicU8 = AtomicU8::new(UNKNOWN);

fn known() -> Option<FingerName> {
    FingerName::ALL
        .get(usize::from(FINGER.load(Relaxed)))
        .copied()
}

/// The finger that this start is for; a BioTac before it is known.
pub(crate) fn name() -> FingerName {
    known().unwrap_or_default()
}

pub(crate) fn code() -> FingerCode {
    FingerCode::of(name())
}

pub(crate) fn parts() -> &'static FingerParts {
    name().parts()
}

/// Waits until it is known which finger there is: 0.1 s after the power came, at once after another reset.
pub(crate) async fn found() {
    while known().is_none() {
        Timer::after_millis(1).await;
    }
}

/// Looks for a finger, and lets all who wait for it go on; `false`: nothing answers, and the start is for a BioTac.
pub(crate) async fn find_at_boot(bus: &mut Bus, reset: Reset) -> bool {
    let mut finger = None;
    if matches!(reset, Reset::Power | Reset::Other) {
        Timer::after_millis(POWER_UP_MS).await;
    }
    for _ in 0..LOOKS {
        finger = look(bus);
        if finger.is_some() {
            break;
        }
        Timer::after_millis(EVERY_MS).await;
    }
    FINGER.store(finger.unwrap_or_default() as u8, Relaxed);
    finger.is_some()
}

/// Looks again, where there was nothing: whether it is there now. All that was begun is for the finger of this start,
/// so that another one starts the chip anew; the lever's first act is then to lift.
pub(crate) fn find_again(bus: &mut Bus) -> bool {
    match look(bus) {
        None => false,
        Some(finger) if finger == name() => true,
        Some(_) => {
            rescue::remember("another finger than a BioTac was plugged in");
            SCB::sys_reset()
        }
    }
}

fn look(bus: &mut Bus) -> Option<FingerName> {
    find(|finger, transaction, wait_us| {
        let port = finger.parts().ports.get(usize::from(transaction.port));
        let answer = slot::perform(&[*transaction], |transaction, bytes| {
            bus.transact(port, transaction, bytes)
        });
        wait(transaction.gap_us + wait_us);
        // a bus that is off reads as a part that is not there
        answer.unwrap_or_default()
    })
}

fn wait(us: u32) {
    block_for(Duration::from_micros((us + 1).into()));
}

/// Does the finger's start-up list, and waits for it: 25 ms of a `mems`.
pub(crate) fn start(bus: &mut Bus) -> Result<(), Unexpected> {
    let parts = parts();
    for step in parts.start {
        let port = parts.ports.get(usize::from(step.transaction.port));
        let answer = slot::perform(&[step.transaction], |transaction, bytes| {
            bus.transact(port, transaction, bytes)
        });
        // a bus that is off reads as a part that is not there
        step.check(parts.ports, &answer.unwrap_or_default())?;
        wait(step.transaction.gap_us + step.wait_us);
    }
    Ok(())
}
