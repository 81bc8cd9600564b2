//! The handheld probe. Who runs where, and who tells whom what:
//!
//! | executor | task | does | tells |
//! |---|---|---|---|
//! | interrupts of TIM2 and SPI1 | `chip::slots` | a sensor word every 227 us, if wanted | words to `hand` |
//! | UART7's interrupt | `hand` | states, button, buzzer, requests, the store | pictures to `show`, reports to `send` |
//! | UART7's interrupt | `receive`, `send` | frames of USART3 | requests to `hand` |
//! | UART7's interrupt | `show` | the display, by I2C1 and its DMA | |
//! | UART7's interrupt | `acquire` | starts the slots when the sensor is ready | |
//! | UART7's interrupt | `watch` | the watchdog, as long as `hand` gets on | |
//! | thread mode | | sleeps, and counts for how long | `hand` |
use embassy_executor::InterruptExecutor;
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{self as irq, InterruptExt as _, Priority};
use heapless::spsc::Queue;
use static_cell::ConstStaticCell;

use crate::boot::start;
use crate::chip::rescue;
use crate::chip::slots::{self, WORDS, Word};
use crate::tasks::{acquire, display, hand, link, only};

static HAND: InterruptExecutor = InterruptExecutor::new();

#[interrupt]
fn UART7() {
    // SAFETY: called from here only, and started before the interrupt is on.
    unsafe { HAND.on_interrupt() }
}

/// Starts everything, and sleeps whenever nothing is to be done. To be called once, from thread mode.
pub fn handheld() -> ! {
    static WORD_QUEUE: ConstStaticCell<Queue<Word, WORDS>> = ConstStaticCell::new(Queue::new());
    let (r, reset, last_words) = start("tactus-handheld");
    let (words_in, words_out) = WORD_QUEUE.take().split();
    irq::I2C1_EV.set_priority(Priority::P6);
    irq::I2C1_ER.set_priority(Priority::P6);
    irq::DMA1_STREAM0.set_priority(Priority::P6);
    irq::DMA1_STREAM6.set_priority(Priority::P6);
    irq::UART7.set_priority(Priority::P7);
    let hands = HAND.start(interrupt::UART7);
    // until `hand` can take them
    slots::listen(false);
    hands.spawn(only(acquire::acquire(r.sensor, r.slots, words_in, reset)));
    let Some((tx, rx)) = link::open(r.link) else {
        rescue::refuse("the link's rate cannot be had");
    };
    hands.spawn(only(link::send(tx)));
    hands.spawn(only(link::receive(rx, hand::BODY)));
    hands.spawn(only(hand::hand(
        r.store,
        r.handle,
        r.go,
        r.motion,
        words_out,
        (reset, last_words),
    )));
    hands.spawn(only(display::show(r.display)));
    hands.spawn(only(hand::watch()));
    hand::sleep()
}
