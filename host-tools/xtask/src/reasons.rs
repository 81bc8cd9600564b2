//! Why the functions of the rig's image that panic are not called while it runs. The last words of a panic that comes all the
//! same are in `firmware/src/chip/rescue.rs`: the finger is lifted, and the probe starts again.

/// Callers, by parts of their names, that do not panic, and why.
struct Reason {
    /// Parts of the names of what would be called; none for any of them.
    panics: &'static [&'static str],
    callers: &'static [&'static str],
    why: &'static str,
}

/// For any panic that these callers have.
const fn never(callers: &'static [&'static str], why: &'static str) -> Reason {
    Reason {
        panics: &[],
        callers,
        why,
    }
}

/// The first one that fits counts.
const REASONS: &[Reason] = &[
    never(
        &[
            "tactus_firmware::rig::rig",
            "chip::thread::run",
            "InterruptExecutor>::start",
            "embassy_stm32::rcc::",
            "embassy_stm32::time::Hertz",
            "embassy_stm32::time::MaybeHertz",
            "embassy_stm32::adc::",
            "embassy_stm32::wdg::",
            "embassy_stm32::timer::simple_pwm::SimplePwm<",
        ],
        "start-up: clocks, pins and tasks are the same at every start, before the lever moves",
    ),
    // all panics without a number or a name to tell are one function, which has the name of any of them: the handler looks at none
    // of their words
    Reason {
        panics: &["async_fn_resumed", "result::unwrap_failed", "div_by_zero"],
        callers: &["{closure#", "TaskStorage<", "Future>::poll"],
        why: "an async fn that is polled after its end: no executor polls a task that has ended, and each future is awaited once",
    },
    never(
        &["sequential_storage::"],
        "the store's records: lengths have checksums of their own and are compared with the page's before use, and all keys, \
         pages and buffers are this firmware's (cut at every word in store/tests/cuts.rs, damaged in tests/fuzz)",
    ),
    never(
        &["embassy_stm32::flash::", "nor_flash::"],
        "the store's four sectors are whole sectors of bank 2; it asks for no others, and its words are aligned",
    ),
    never(
        &["embassy_stm32::timer::simple_pwm::SimplePwmChannel"],
        "TIM3 has 16 bits, and the duty is cut off at its full one",
    ),
    never(
        &["embassy_stm32::dma::"],
        "the rig starts no DMA: its interrupts are off",
    ),
    never(
        &["usart::buffered::drop_tx_rx"],
        "the line is never given back",
    ),
    never(
        &["ring_buffer::RingBuffer"],
        "takes back what it handed out, at most its room",
    ),
    never(
        &[
            "RefCell<",
            "embassy_sync::mutex::",
            "_embassy_time_schedule_wake",
            "TIM5",
        ],
        "borrowed with interrupts off or in thread mode, and given back before anything else runs",
    ),
    never(
        &["__embassy_time_queue_item_from_waker"],
        "all wakers are those of embassy's executors",
    ),
    never(
        &["_defmt_acquire", "_defmt_release"],
        "the log is taken and given back with interrupts off, and nothing that it prints logs",
    ),
    never(
        &["Ticker>::next", "embassy_time::instant::Instant"],
        "microseconds have room for 584 000 years",
    ),
    never(
        &["heapless::spsc::QueueInner"],
        "divides by the queue's room, a constant",
    ),
    never(
        &["postcard::"],
        "a number of 32 bits takes at most the five bytes that it has",
    ),
    never(
        &["tactus_firmware::chip::dsp_kernels::fold"],
        "divides by half the length of a plan's table, which is not empty",
    ),
    never(
        &["slide::Slide<", "fir::BandPower>"],
        "moves the end of its block to its beginning: the block is never longer than its room",
    ),
    never(
        &["servo_task"],
        "start-up: its timer's frequency is a constant; later its ticker, whose microseconds have room for 584 000 years",
    ),
    never(
        &[
            "send_task",
            "receive_task",
            "watch_task",
            "probe_task",
            "outbox::tell",
            "tasks::probe::Told",
            "tasks::link::AtAnyTime",
        ],
        "what only thread mode may use is used by tasks of thread mode; bytes are copied between slices cut to one length, and \
         COBS compares a block's length with the frame's",
    ),
    Reason {
        panics: &["expect_failed", "option::unwrap_failed"],
        callers: &[
            "explorer::posterior::Explorer<",
            "explorer::Explorer<",
            "probe::identify::identify<",
        ],
        why: "gathers what a table has of movements, actions and textures, which is checked to fit when the table is read",
    },
];

/// Why this caller does not panic this way; `None` if nobody says.
pub(crate) fn why(panics: &str, caller: &str) -> Option<&'static str> {
    let within = |parts: &[&str], name: &str| parts.iter().any(|part| name.contains(part));
    let reason = REASONS.iter().find(|reason| {
        (reason.panics.is_empty() || within(reason.panics, panics))
            && within(reason.callers, caller)
    });
    reason.map(|reason| reason.why)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_is_for_its_callers_and_panics_only() {
        let task = "<TaskStorage<tactus_firmware::tasks::watch::__watch_task::{closure#0}>>::poll";
        let work = "<tactus_core::probe::dispatch::Probe<R, F, B, E>>::perform::{closure#0}";
        let resumed = "core::panicking::panic_const::panic_const_async_fn_resumed";
        assert!(why(resumed, task).is_some_and(|why| why.contains("polled after its end")));
        assert!(why(resumed, work).is_some());
        assert_eq!(why("core::panicking::panic_bounds_check", work), None);
        assert_eq!(why(resumed, "tactus_core::rig::control::tick"), None);
        assert!(
            why("core::panicking::panic", "embassy_stm32::rcc::init_pll")
                .is_some_and(|why| why.contains("start-up"))
        );
        for reason in REASONS {
            assert!(!reason.callers.is_empty() && !reason.callers.contains(&""));
        }
    }
}
