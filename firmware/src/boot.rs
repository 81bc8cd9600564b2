//! The beginning that images share: watchdog, stack guard, clocks and pins; and the line to the host with the queues
//! between the tasks of a rig and of a probe on an arm.
use embassy_stm32::usart::{BufferedUartRx, BufferedUartTx};
use heapless::spsc::{Consumer, Producer, Queue};
use static_cell::ConstStaticCell;
use tactus_core::probe::servo_rig::Samples;
use tactus_core::wire::{Reset, Text};

use crate::board;
use crate::chip::slots::{WORDS, Word};
use crate::chip::{rescue, watchdog};
use crate::tasks::drive::SAMPLES;
use crate::tasks::link;

/// Starts the board: the pins, why the chip started, and what was said before that. To be called once, from thread
/// mode.
pub(crate) fn start(image: &str) -> (board::AssignedResources, Reset, Option<Text>) {
    let (reset, last_words) = rescue::reset_cause();
    watchdog::start();
    rescue::guard_stack();
    let r = board::start();
    defmt::info!("{=str} {=str}", image, env!("CARGO_PKG_VERSION"));
    if let Some(words) = &last_words {
        defmt::error!("before the reset: {=str}", words.as_str());
    }
    (r, reset, last_words)
}

/// The ends of the line to the host, and of the queues from the sensor's slots to the rig and from there to the
/// features.
pub(crate) struct Ends {
    pub(crate) tx: BufferedUartTx<'static>,
    pub(crate) rx: BufferedUartRx<'static>,
    pub(crate) words_in: Producer<'static, Word>,
    pub(crate) words_out: Consumer<'static, Word>,
    pub(crate) samples_in: Producer<'static, Samples>,
    pub(crate) samples_out: Consumer<'static, Samples>,
}

/// Opens the line and makes the queues. To be called once.
pub(crate) fn ends(link: board::Link) -> Ends {
    static WORD_QUEUE: ConstStaticCell<Queue<Word, WORDS>> = ConstStaticCell::new(Queue::new());
    static SAMPLE_QUEUE: ConstStaticCell<Queue<Samples, SAMPLES>> =
        ConstStaticCell::new(Queue::new());
    let (words_in, words_out) = WORD_QUEUE.take().split();
    let (samples_in, samples_out) = SAMPLE_QUEUE.take().split();
    let Some((tx, rx)) = link::open(link) else {
        rescue::refuse("the link's rate cannot be had");
    };
    Ends {
        tx,
        rx,
        words_in,
        words_out,
        samples_in,
        samples_out,
    }
}
