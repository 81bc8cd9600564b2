//! A thousand times a second: the sensor's words and what the arm said into [`RigOverLink`], its orders on their way to
//! the arm, and the samples of the slide on their way to the features. The guard lives in the core.
use core::sync::atomic::Ordering::Relaxed;

use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use heapless::Vec;
use heapless::spsc::{Consumer, Producer};
use tactus_core::probe::RigState;
use tactus_core::probe::servo_rig::Samples;
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::over_link::RigOverLink;
use tactus_core::wire::{ArmOrder, ArmReport, Event};

use super::drive::{HEARD, REPORTS, STOP, Ticks, unmeasured};
use super::outbox::tell;
use crate::board;
use crate::chip::slots::Word;
use crate::chip::{finger, watchdog};

static ORDER: Signal<CriticalSectionRawMutex, ArmOrder> = Signal::new();

/// Hands orders to the link, whose writers are all at one level: the tick's is another.
#[embassy_executor::task]
pub(crate) async fn orders() {
    loop {
        let order = ORDER.wait().await;
        tell(Event::Arm(order));
    }
}

#[embassy_executor::task]
pub(crate) async fn arm(
    permission: board::Lever,
    watchdog: board::Watchdog,
    words: Consumer<'static, Word>,
    samples: Producer<'static, Samples>,
) {
    // low from power-up on, and when this chip does nothing any more
    let mut permission = Output::new(permission.enable, Level::Low, Speed::Low);
    // the watchdog of the start leaves time for it
    finger::found().await;
    watchdog::tighten(watchdog);
    let model = &finger::parts().model;
    let mut rig = RigOverLink::new(model, unmeasured(finger::name()), Unguarded::default());
    let mut ticks = Ticks::new(words, samples);
    loop {
        let mut inputs = ticks.next().await;
        if STOP.swap(false, Relaxed) {
            rig.stop();
        }
        ticks.obey(|command| command.apply_over_link(&mut rig));
        inputs.hung = ticks.hung.is_some();
        let mut reports: Vec<ArmReport, REPORTS> = Vec::new();
        while let Ok(report) = HEARD.try_receive() {
            // there is as much room as in the channel; more is said again
            if reports.push(report).is_err() {
                break;
            }
        }
        let (outputs, order) = rig.tick(&inputs, &reports);
        permission.set_level(outputs.lever_enabled.into());
        if let Some(order) = order {
            ORDER.signal(order);
        }
        let ended = rig.take_ended();
        ticks.over(&outputs, ended, |ended| {
            RigState::over_link(&mut rig, ended)
        });
    }
}
