//! Tells of the rig as it moves, and checks in for the tasks of thread mode.
use core::mem;

use embassy_time::{Duration, Ticker};
use tactus_core::probe::Watch;
use tactus_core::wire::{Event, Failure};

use super::drive;
use super::outbox::tell;
use crate::chip::{debugger, finger};

const NO_MOTORS: &str =
    "a debugger is attached: no motor moves until it is off and the power was off, too";

#[embassy_executor::task]
pub(crate) async fn watch(on_arm: bool) {
    finger::found().await;
    let mut ticker = Ticker::every(Duration::from_millis(Watch::EVERY_MS));
    let mut watch = Watch::default();
    let mut debugged = on_arm;
    loop {
        ticker.next().await;
        drive::check_in();
        let is = debugger::is_there();
        if is && !mem::replace(&mut debugged, is) {
            let why = NO_MOTORS.try_into().unwrap_or_default();
            tell(Event::Trouble(Failure::Said(why)));
        }
        if on_arm {
            watch.look_for_arm(&drive::state(), tell);
        } else {
            watch.look(&drive::state(), tell);
        }
    }
}
