//! A thousand times a second: the sensor's words and what the arm said into [`RigOverLink`], its orders on their way to the arm, and the
//! samples of the slide on their way to the features. The guard lives in the core.
use core::mem;
use core::sync::atomic::Ordering::Relaxed;

use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Ticker};
use heapless::Vec;
use heapless::spsc::{Consumer, Producer};
use tactus_core::probe::RigState;
use tactus_core::probe::servo_rig::Samples;
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::over_link::RigOverLink;
use tactus_core::rig::pins::{Inputs, MAX_WORDS};
use tactus_core::wire::{ArmOrder, ArmReport, Event};

use super::drive::{self, ANSWER, COMMAND, ENDED, HEARD, LOST, REPORTS, STATE, STOP, unmeasured};
use super::outbox::tell;
use crate::board;
use crate::chip::slots::Word;
use crate::chip::{finger, rescue, watchdog};

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
    mut words: Consumer<'static, Word>,
    mut samples: Producer<'static, Samples>,
) {
    // low from power-up on, and when this chip does nothing any more
    let mut permission = Output::new(permission.enable, Level::Low, Speed::Low);
    // the watchdog of the start leaves time for it
    finger::found().await;
    watchdog::tighten(watchdog);
    let model = &finger::parts().model;
    let mut rig = RigOverLink::new(model, unmeasured(finger::name()), Unguarded::default());
    let (mut ended, mut hung, mut remembered) = (None, None, false);
    let mut ticker = Ticker::every(Duration::from_millis(1));
    loop {
        ticker.next().await;
        if STOP.swap(false, Relaxed) {
            rig.stop();
        }
        if let Some(command) = COMMAND.try_take() {
            ended = None;
            ANSWER.signal(command.apply_over_link(&mut rig));
        }
        // once hung, hung until the watchdog has done its work
        hung = hung.or(drive::hung());

        let mut inputs = Inputs::default();
        while inputs.words.len() < MAX_WORDS
            && let Some(word) = words.dequeue()
        {
            // the loop ends before `words` is full
            let _ = inputs.words.push(word);
        }
        inputs.hung = hung.is_some();
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
        Samples::of(&outputs, |part| {
            let many = part.pac.len() as u32;
            if samples.enqueue(part).is_err() {
                LOST.fetch_add(many, Relaxed);
            }
        });
        if let now @ Some(_) = rig.take_ended() {
            ended = now;
            ENDED.signal(());
        }
        STATE.lock(|cell| cell.set(RigState::over_link(&mut rig, ended)));
        match hung {
            Some(why) if rig.is_at_rest() => {
                // once: the reset may come while it is written
                if !mem::replace(&mut remembered, true) {
                    rescue::remember(why);
                }
            }
            _ => watchdog::pet(),
        }
    }
}
