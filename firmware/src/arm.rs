//! A probe on somebody else's arm. Who runs where, and who tells whom what:
//!
//! | executor | task | does | tells |
//! |---|---|---|---|
//! | interrupts of TIM2 and SPI1 | `chip::slots` | a sensor word every 227 us | words to `arm` |
//! | UART5's interrupt, woken by the clock's | `arm` | the rig over the link, guard, line of permission and watchdog, 1 kHz | samples to `probe`, orders to `orders`, a snapshot to all |
//! | thread mode | `probe` | explorations, training, tables; owns the store | commands to `arm`, reports to `send` |
//! | thread mode | `acquire` | starts the slots when the sensor is ready | |
//! | thread mode | `watch` | phases, faults and force as they change | reports to `send` |
//! | thread mode | `orders` | what the arm is to do | reports to `send` |
//! | thread mode | `receive`, `send` | frames of USART3 | requests to `probe`, the arm's words to `arm` |

use embassy_stm32::interrupt;
use heapless::spsc::Queue;
use static_cell::ConstStaticCell;
use tactus_core::probe::servo_rig::Samples;
use tactus_core::wire::{Event, PROTOCOL};

use crate::board;
use crate::chip::slots::{WORDS, Word};
use crate::chip::{rescue, thread, watchdog};
use crate::tasks::drive::{self, SAMPLES, SERVO};
use crate::tasks::{acquire, arm as task, link, only, outbox, probe, watch};

/// Starts everything. To be called once, from thread mode.
pub fn arm() -> ! {
    static WORD_QUEUE: ConstStaticCell<Queue<Word, WORDS>> = ConstStaticCell::new(Queue::new());
    static SAMPLE_QUEUE: ConstStaticCell<Queue<Samples, SAMPLES>> =
        ConstStaticCell::new(Queue::new());
    let (reset, last_words) = rescue::reset_cause();
    watchdog::start();
    rescue::guard_stack();
    let r = board::start();
    defmt::info!("tactus-arm {=str}", env!("CARGO_PKG_VERSION"));
    let (words_in, words_out) = WORD_QUEUE.take().split();
    let (samples_in, samples_out) = SAMPLE_QUEUE.take().split();

    let Some((tx, rx)) = link::open(r.link) else {
        rescue::refuse("the link's rate cannot be had");
    };
    outbox::tell(Event::Booted {
        protocol: PROTOCOL,
        version: env!("CARGO_PKG_VERSION").try_into().unwrap_or_default(),
        reset,
        last_words: last_words.or_else(|| board::flaw()?.try_into().ok()),
        finger: board::FINGER,
    });
    thread::run(|thread| {
        thread.spawn(only(link::send(tx)));
        thread.spawn(only(link::receive(rx, &drive::BODY_ON_ARM)));
        thread.spawn(only(watch::watch(true)));
        thread.spawn(only(task::orders()));
        thread.spawn(only(probe::probe_on_arm(r.store, r.go, samples_out)));
        thread.spawn(only(acquire::acquire(r.sensor, r.slots, words_in)));
        SERVO
            .start(interrupt::UART5)
            .spawn(only(task::arm(r.lever, r.watchdog, words_out, samples_in)));
    })
}
