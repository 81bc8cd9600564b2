//! A probe on somebody else's arm. Who runs where, and who tells whom what:
//!
//! | executor | task | does | tells |
//! |---|---|---|---|
//! | interrupts of TIM2 and SPI1 | `chip::slots` | a sensor word every 227 us | words to `arm` |
//! | UART5's interrupt | `arm` | rig, guard, permission and watchdog, 1 kHz | samples to `probe`, orders, a snapshot |
//! | thread mode | `probe` | explorations, training, tables; owns the store | commands to `arm`, reports to `send` |
//! | thread mode | `acquire` | starts the slots when the sensor is ready | |
//! | thread mode | `watch` | phases, faults and force as they change | reports to `send` |
//! | thread mode | `orders` | what the arm is to do | reports to `send` |
//! | thread mode | `receive`, `send` | frames of USART3 | requests to `probe`, the arm's words to `arm` |

use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::interrupt;

use crate::boot::{Ends, ends, start};
use crate::chip::thread;
use crate::tasks::drive::{BODY_ON_ARM, SERVO, ServoHandle};
use crate::tasks::{acquire, arm as task, link, only, probe, watch};

/// Starts everything. To be called once, from thread mode.
pub fn arm() -> ! {
    let (r, reset, last_words) = start("tactus-arm");
    let Ends {
        tx,
        rx,
        words_in,
        words_out,
        samples_in,
        samples_out,
    } = ends(r.link);
    let booted = (reset, last_words);
    thread::run(|thread| {
        thread.spawn(only(link::send(tx)));
        thread.spawn(only(link::receive(rx, BODY_ON_ARM)));
        thread.spawn(only(watch::watch(true)));
        thread.spawn(only(task::orders()));
        let handle = ServoHandle {
            samples: samples_out,
            has_stage: false,
            button: Input::new(r.handle.button, Pull::Down),
        };
        thread.spawn(only(probe::probe(r.store, r.go, handle, booted)));
        thread.spawn(only(acquire::acquire(r.sensor, r.slots, words_in, reset)));
        SERVO
            .start(interrupt::UART5)
            .spawn(only(task::arm(r.lever, r.watchdog, words_out, samples_in)));
    })
}
