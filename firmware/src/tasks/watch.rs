//! Tells of the rig as it moves, and checks in for the tasks of thread mode.
use embassy_time::{Duration, Ticker};
use tactus_core::probe::Watch;

use super::outbox::tell;
use super::servo;

#[embassy_executor::task]
pub(crate) async fn watch() {
    let mut ticker = Ticker::every(Duration::from_millis(Watch::EVERY_MS));
    let mut watch = Watch::default();
    loop {
        ticker.next().await;
        servo::check_in();
        watch.look(&servo::state(), tell);
    }
}
