//! The rig. Who runs where, and who tells whom what:
//!
//! | executor | task | does | tells |
//! |---|---|---|---|
//! | interrupts of TIM2 and SPI1 | `chip::slots` | a sensor word every 227 us | words to `servo` |
//! | UART5's interrupt, by the clock's | `servo` | control, guard, watchdog, 1 kHz | samples to `probe`, a snapshot |
//! | thread mode | `probe` | explorations, training, tables; owns the store | commands to `servo`, reports to `send` |
//! | thread mode | `acquire` | starts the slots when the sensor is ready | |
//! | thread mode | `watch` | phases, faults and places as they change | reports to `send` |
//! | thread mode | `receive`, `send` | frames of USART3 | requests to `probe` |
//!
//! Their priorities, and between slots and servo those of the link's bytes and of the lever's steps (TIM1), are in
//! `board`.

use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::interrupt;

use crate::boot::{Ends, ends, start};
use crate::chip::thread;
use crate::tasks::drive::{BODY, SERVO, ServoHandle};
use crate::tasks::{acquire, link, only, probe, servo, watch};

/// Starts everything. To be called once, from thread mode.
pub fn rig() -> ! {
    let (r, reset, last_words) = start("tactus-rig");
    let Ends {
        tx,
        rx,
        words_in,
        words_out,
        samples_in,
        samples_out,
    } = ends(r.link);
    let booted = (reset, last_words);
    // those of thread mode run when all are there, `servo`, which has the motors, at once: it is the last one
    thread::run(|thread| {
        thread.spawn(only(link::send(tx)));
        thread.spawn(only(link::receive(rx, BODY)));
        thread.spawn(only(watch::watch(false)));
        let handle = ServoHandle {
            samples: samples_out,
            has_stage: true,
            button: Input::new(r.handle.button, Pull::Down),
        };
        thread.spawn(only(probe::probe(r.store, r.go, handle, booted)));
        thread.spawn(only(acquire::acquire(r.sensor, r.slots, words_in, reset)));
        let pins = servo::Pins::new(r.lever, r.stage, r.current, r.switches);
        let servo = servo::servo(pins, r.watchdog, words_out, samples_in);
        SERVO.start(interrupt::UART5).spawn(only(servo));
    })
}
