//! What the probe and the link say to the task that drives the rig a thousand times a second, and what they hear of it:
//! `servo`, or `arm` where somebody else's arm moves the finger.
use core::cell::Cell;
use core::sync::atomic::Ordering::Relaxed;
use core::sync::atomic::{AtomicBool, AtomicU32};

use embassy_executor::InterruptExecutor;
use embassy_stm32::interrupt;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::channel::Channel;
use embassy_sync::signal::Signal;
use tactus_core::probe::RigState;
use tactus_core::probe::servo_rig::RigCommand;
use tactus_core::rig::Refused;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::sensor::FingerName;
use tactus_core::wire::ArmReport;

use super::link::Body;

/// Runs the task that drives the rig, and nothing else.
pub(crate) static SERVO: InterruptExecutor = InterruptExecutor::new();

#[interrupt]
fn UART5() {
    // SAFETY: called from here only, and started before the interrupt is on.
    unsafe { SERVO.on_interrupt() }
}

/// Samples on their way to the features: a quarter of a second.
pub(crate) const SAMPLES: usize = 256;

pub(super) static COMMAND: Signal<CriticalSectionRawMutex, RigCommand> = Signal::new();
pub(super) static ANSWER: Signal<CriticalSectionRawMutex, Result<(), Refused>> = Signal::new();
/// A slide has ended; its finger is being lifted.
pub(super) static ENDED: Signal<CriticalSectionRawMutex, ()> = Signal::new();
/// Stop and lift, whatever is being done.
pub(super) static STOP: AtomicBool = AtomicBool::new(false);
/// No more of the slide is needed.
pub(super) static END_SLIDE: AtomicBool = AtomicBool::new(false);
/// The session was told to stop: between two movements the rig has nothing to stop.
static STOPPED: AtomicBool = AtomicBool::new(false);
pub(super) static STATE: Mutex<CriticalSectionRawMutex, Cell<RigState>> =
    Mutex::new(Cell::new(RigState::parked(unmeasured(FingerName::Biotac))));
/// Samples dropped because the queue to the probe was full, or without a current of their own.
pub(crate) static LOST: AtomicU32 = AtomicU32::new(0);
/// Milliseconds since the tasks in thread mode have checked in.
static SILENT_MS: AtomicU32 = AtomicU32::new(0);
/// Milliseconds since the session made progress, or [`WAITS`].
static STUCK_MS: AtomicU32 = AtomicU32::new(0);
/// It waits for the host, and may do so for ever.
const WAITS: u32 = u32::MAX;

/// Words of an arm between two ticks: it says one in 50 ms.
pub(super) const REPORTS: usize = 8;
/// What the arm has said; what has no room is said again.
pub(super) static HEARD: Channel<CriticalSectionRawMutex, ArmReport, REPORTS> = Channel::new();

/// The reference rig's constants, until measured ones are read from the store.
pub(crate) const fn unmeasured(finger: FingerName) -> RigCalibration {
    RigCalibration {
        pressure: finger.parts().model.calibration,
        unloaded_a: (0.037, 0.0),
        newton_per_ampere: 16.4,
        date: 0,
        air_known: false,
        turned: 0,
        serial: [0; 16],
    }
}

/// Tasks that are silent for longer hang: the longest that they compute, the choice among the actions of a whole grid, is
/// half of it.
const HUNG_MS: u32 = 2000;
/// A session without progress for longer waits for something that does not come, such as an interrupt of the flash. All
/// that it does without the rig, the sectors of the store erased and written, takes less than 15 s.
const STUCK_LIMIT_MS: u32 = 30_000;

/// Gives a command and waits for the answer. For one task at a time.
pub(crate) async fn command(command: RigCommand) -> Result<(), Refused> {
    progress();
    ANSWER.reset();
    COMMAND.signal(command);
    ANSWER.wait().await
}

/// Stops what is being done now.
pub(crate) fn stop() {
    STOP.store(true, Relaxed);
}

/// Ends the slide that is being made, if one is.
pub(crate) fn end_slide() {
    END_SLIDE.store(true, Relaxed);
}

/// Stops what is being done, and what would come after it until [`forget_stop`].
pub(crate) fn stop_for_good() {
    STOPPED.store(true, Relaxed);
    stop();
}

/// Whether [`stop_for_good`] was called.
pub(crate) fn is_stopped() -> bool {
    STOPPED.load(Relaxed)
}

/// What was stopped is over.
pub(crate) fn forget_stop() {
    STOPPED.store(false, Relaxed);
}

/// What the rig is doing.
pub(crate) fn state() -> RigState {
    STATE.lock(Cell::get)
}

/// Waits for the end of a slide.
pub(crate) async fn ended() {
    ENDED.wait().await;
}

/// The tasks in thread mode are alive. Board tests break it by its name.
#[unsafe(export_name = "tactus_check_in")]
#[inline(never)]
pub(crate) fn check_in() {
    SILENT_MS.store(0, Relaxed);
}

/// The session goes on with what it was asked for.
pub(crate) fn progress() {
    STUCK_MS.store(0, Relaxed);
}

/// The session waits for a request.
pub(crate) fn waits() {
    STUCK_MS.store(WAITS, Relaxed);
}

/// Another millisecond: why the tasks that the rig serves are taken for hung, if they are. Board tests break it by its name.
#[unsafe(export_name = "tactus_servo_tick")]
#[inline(never)]
pub(super) fn hung() -> Option<&'static str> {
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

/// The rig as the link asks it at any time.
pub(crate) static BODY: Body = MOVED_BY_MOTORS;
const MOVED_BY_MOTORS: Body = Body {
    state,
    stop: |all| if all { stop_for_good() } else { stop() },
    lost: || LOST.load(Relaxed),
    arm: |_| false,
};

/// The same where somebody else's arm moves the finger.
pub(crate) static BODY_ON_ARM: Body = Body {
    arm: |report| {
        // what has no room is said again
        let _ = HEARD.try_send(report);
        true
    },
    ..MOVED_BY_MOTORS
};
