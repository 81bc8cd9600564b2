//! Starts the sensor's slots. What is done in them are interrupts: `chip::slots`.
use embassy_time::Timer;
use heapless::spsc::Producer;
use tactus_core::sensor::PressureSensor as _;

use crate::board;
use crate::chip::slots::{self, Bus, Finger, Word};

#[embassy_executor::task]
pub(crate) async fn acquire(
    sensor: board::Sensor,
    timer: board::Slots,
    words: Producer<'static, Word>,
) {
    let bus = Bus::new(sensor);
    Timer::after_millis(Finger::POWER_UP_MS.into()).await;
    slots::begin(bus, timer, words);
}
