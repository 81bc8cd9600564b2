//! What the probe and the link say to the task that drives the rig a thousand times a second, and what they hear of it:
//! `servo`, or `arm` where somebody else's arm moves the finger.
use core::cell::Cell;
use core::mem;
use core::sync::atomic::Ordering::Relaxed;
use core::sync::atomic::{AtomicBool, AtomicU32};

use embassy_executor::InterruptExecutor;
use embassy_stm32::gpio::Input;
use embassy_stm32::interrupt;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Ticker, with_timeout};
use heapless::spsc::{Consumer, Producer};
use tactus_core::probe::RigState;
use tactus_core::probe::servo_rig::{LOOK_MS, RigCommand, Samples, Servo};
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::pins::{Inputs, MAX_WORDS, Outputs};
use tactus_core::rig::{Ended, Refused};
use tactus_core::sensor::FingerName;
use tactus_core::wire::{ArmReport, Event};

use super::link::Body;
use super::outbox::{STREAM, tell};
use crate::chip::slots::{self, Word};
use crate::chip::{rescue, watchdog};

pub(crate) static SERVO: InterruptExecutor = InterruptExecutor::new();

#[interrupt]
fn UART5() {
    // SAFETY: called from here only, and started before the interrupt is on.
    unsafe { SERVO.on_interrupt() }
}

/// Samples on their way to the features: a quarter of a second.
pub(crate) const SAMPLES: usize = 256;

static COMMAND: Signal<CriticalSectionRawMutex, RigCommand> = Signal::new();
static ANSWER: Signal<CriticalSectionRawMutex, Result<(), Refused>> = Signal::new();
static ENDED: Signal<CriticalSectionRawMutex, ()> = Signal::new();
pub(super) static STOP: AtomicBool = AtomicBool::new(false);
pub(super) static END_SLIDE: AtomicBool = AtomicBool::new(false);
/// The session was told to stop: between two movements the rig has nothing to stop.
static STOPPED: AtomicBool = AtomicBool::new(false);
static STATE: Mutex<CriticalSectionRawMutex, Cell<RigState>> =
    Mutex::new(Cell::new(RigState::parked(unmeasured(FingerName::Biotac))));
/// Samples dropped because the queue to the probe was full, or without a current of their own.
pub(super) static LOST: AtomicU32 = AtomicU32::new(0);
/// Milliseconds since the tasks in thread mode have checked in.
static SILENT_MS: AtomicU32 = AtomicU32::new(0);
/// Milliseconds since the session made progress, or [`WAITS`].
static STUCK_MS: AtomicU32 = AtomicU32::new(0);
const WAITS: u32 = u32::MAX;

/// Words of an arm between two ticks: it says one in 50 ms.
pub(super) const REPORTS: usize = 8;
/// The arm's words; those without a place in the queue are said again.
pub(super) static HEARD: Channel<CriticalSectionRawMutex, ArmReport, REPORTS> = Channel::new();

pub(crate) const fn unmeasured(finger: FingerName) -> RigCalibration {
    RigCalibration::unmeasured(&finger.parts().model)
}

/// Tasks that are silent for longer hang: the longest that they compute, the choice among the actions of a whole grid,
/// is half of it.
const HUNG_MS: u32 = 2000;
/// A session without progress for longer waits for something that does not come, such as an interrupt of the flash. All
/// that it does without the rig, the sectors of the store erased and written, takes less than 15 s.
const STUCK_LIMIT_MS: u32 = 30_000;

pub(crate) fn forget_stop() {
    STOPPED.store(false, Relaxed);
}

pub(crate) fn state() -> RigState {
    STATE.lock(Cell::get)
}

/// The tasks in thread mode are alive. Board tests break it by its name.
#[unsafe(export_name = "tactus_check_in")]
#[inline(never)]
pub(crate) fn check_in() {
    SILENT_MS.store(0, Relaxed);
}

pub(crate) fn progress() {
    STUCK_MS.store(0, Relaxed);
}

pub(crate) fn waits() {
    STUCK_MS.store(WAITS, Relaxed);
}

/// Another millisecond: why the tasks that the rig serves are taken for hung, if they are. Board tests break it by its
/// name.
#[unsafe(export_name = "tactus_servo_tick")]
#[inline(never)]
fn hung() -> Option<&'static str> {
    let silent_ms = SILENT_MS.fetch_add(1, Relaxed);
    // thread mode does not come between: the servo interrupts it
    let stuck_ms = match STUCK_MS.load(Relaxed) {
        WAITS => 0,
        _ => STUCK_MS.fetch_add(1, Relaxed),
    };
    if silent_ms > HUNG_MS {
        Some("the tasks in thread mode did not check in for 2 s")
    } else if stuck_ms > STUCK_LIMIT_MS {
        Some("what was asked for made no progress for 30 s")
    } else {
        None
    }
}

pub(crate) const BODY: Body = Body {
    state,
    stop: |all| {
        if all {
            STOPPED.store(true, Relaxed);
        }
        STOP.store(true, Relaxed);
    },
    lost: || LOST.load(Relaxed),
    arm: |_| false,
};

/// The same where somebody else's arm moves the finger.
pub(crate) const BODY_ON_ARM: Body = Body {
    arm: |report| {
        // what has no room is said again
        let _ = HEARD.try_send(report);
        true
    },
    ..BODY
};

pub(crate) struct ServoHandle {
    pub(crate) samples: Consumer<'static, Samples>,
    pub(crate) has_stage: bool,
    pub(crate) button: Input<'static>,
}

impl Servo for ServoHandle {
    fn has_stage(&self) -> bool {
        self.has_stage
    }

    async fn command(&mut self, command: RigCommand) -> Result<(), Refused> {
        progress();
        ANSWER.reset();
        COMMAND.signal(command);
        ANSWER.wait().await
    }

    async fn wait(&mut self) {
        let _ = with_timeout(Duration::from_millis(LOOK_MS.into()), ENDED.wait()).await;
        progress();
    }

    fn pressed(&self) -> Option<bool> {
        Some(self.button.is_high())
    }

    fn state(&self) -> RigState {
        state()
    }

    fn samples(&mut self) -> Option<Samples> {
        self.samples.dequeue()
    }

    fn gravity(&self) -> Option<f32> {
        slots::gravity()
    }

    fn lost(&self) -> u32 {
        let acquired = slots::LOST.load(Relaxed);
        acquired.wrapping_add(LOST.load(Relaxed))
    }

    fn stop(&mut self) {
        STOP.store(true, Relaxed);
    }

    fn end_slide(&mut self) {
        END_SLIDE.store(true, Relaxed);
    }

    fn is_stopped(&self) -> bool {
        STOPPED.load(Relaxed)
    }

    fn streams(&self) -> bool {
        STREAM.load(Relaxed)
    }

    fn tell(&mut self, event: Event) {
        tell(event);
    }
}

/// The begin and the end of every tick of a rig: words in, samples and the rig's state out, and the watchdog.
pub(super) struct Ticks {
    words: Consumer<'static, Word>,
    samples: Producer<'static, Samples>,
    ticker: Ticker,
    ended: Option<Ended>,
    /// The reason why the watchdog is not petted any more once the rig is at rest.
    pub(super) hung: Option<&'static str>,
    remembered: bool,
}

impl Ticks {
    pub(super) fn new(words: Consumer<'static, Word>, samples: Producer<'static, Samples>) -> Self {
        Self {
            words,
            samples,
            ticker: Ticker::every(Duration::from_millis(1)),
            ended: None,
            hung: None,
            remembered: false,
        }
    }

    pub(super) async fn next(&mut self) -> Inputs {
        self.ticker.next().await;
        // once hung, hung until the watchdog has done its work
        self.hung = self.hung.or(hung());
        let mut inputs = Inputs::default();
        while inputs.words.len() < MAX_WORDS
            && let Some(word) = self.words.dequeue()
        {
            // the loop ends before `words` is full
            let _ = inputs.words.push(word);
        }
        inputs
    }

    pub(super) fn obey(&mut self, apply: impl FnOnce(RigCommand) -> Result<(), Refused>) {
        if let Some(command) = COMMAND.try_take() {
            self.ended = None;
            ANSWER.signal(apply(command));
        }
    }

    /// The tick is over: `ended` is the end of a movement in it, and `state` makes the rig's state of the last one.
    pub(super) fn over(
        &mut self,
        outputs: &Outputs,
        ended: Option<Ended>,
        state: impl FnOnce(Option<Ended>) -> RigState,
    ) {
        Samples::of(outputs, |part| {
            let many = part.pac.len() as u32;
            if self.samples.enqueue(part).is_err() {
                LOST.fetch_add(many, Relaxed);
            }
        });
        if ended.is_some() {
            self.ended = ended;
            ENDED.signal(());
        }
        let state = state(self.ended);
        STATE.lock(|cell| cell.set(state));
        match self.hung {
            Some(why) if state.at_rest => {
                // once: the reset may come while it is written
                if !mem::replace(&mut self.remembered, true) {
                    rescue::remember(why);
                }
            }
            _ => watchdog::pet(),
        }
    }
}
