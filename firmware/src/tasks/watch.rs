//! Tells of the rig as it moves, and checks in for the tasks of thread mode.
use embassy_time::{Duration, Ticker};
use tactus_core::probe::Watch;

use super::drive;
use super::outbox::tell;
use crate::chip::finger;

#[embassy_executor::task]
pub(crate) async fn watch(on_arm: bool) {
    finger::found().await;
    let mut ticker = Ticker::every(Duration::from_millis(Watch::EVERY_MS));
    let mut watch = Watch::default();
    loop {
        ticker.next().await;
        drive::check_in();
        if on_arm {
            watch.look_for_arm(&drive::state(), tell);
        } else {
            watch.look(&drive::state(), tell);
        }
    }
}
