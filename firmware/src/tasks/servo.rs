//! A thousand times a second: the pins into [`Control`], what it says to the pins, and the samples of the slide on their
//! way to the features. Lever, stage and guard live in the core; here is only where their pins are.
use core::cell::Cell;
use core::mem;
use core::sync::atomic::Ordering::Relaxed;
use core::sync::atomic::{AtomicBool, AtomicU32};

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AnyPin, Input, Level, Output, OutputType, Pull, Speed};
use embassy_stm32::timer::qei::Qei;
use embassy_stm32::timer::simple_pwm::{PwmPin, SimplePwm};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Ticker, Timer};
use heapless::spsc::{Consumer, Producer};
use tactus_core::probe::RigState;
use tactus_core::probe::servo_rig::{RigCommand, Samples};
use tactus_core::rig::Refused;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::control::Control;
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::pins::{Inputs, MAX_WORDS};
use tactus_core::rig::stage::StageConstants;
use tactus_core::sensor::PressureSensor as _;
use tactus_core::table::EARLY;

use super::link::Body;
use crate::board::{self, Finger};
use crate::chip::current::{self, Current};
use crate::chip::slots::Word;
use crate::chip::{lever, rescue, watchdog};

/// Samples on their way to the features: a quarter of a second.
pub(crate) const SAMPLES: usize = 256;

static COMMAND: Signal<CriticalSectionRawMutex, RigCommand> = Signal::new();
static ANSWER: Signal<CriticalSectionRawMutex, Result<(), Refused>> = Signal::new();
/// A slide has ended; its finger is being lifted.
static ENDED: Signal<CriticalSectionRawMutex, ()> = Signal::new();
/// Stop and lift, whatever is being done.
static STOP: AtomicBool = AtomicBool::new(false);
/// No more of the slide is needed.
static END_SLIDE: AtomicBool = AtomicBool::new(false);
/// The session was told to stop: between two movements the rig has nothing to stop.
static STOPPED: AtomicBool = AtomicBool::new(false);
static STATE: Mutex<CriticalSectionRawMutex, Cell<RigState>> =
    Mutex::new(Cell::new(RigState::parked(UNMEASURED)));
/// Samples dropped because the queue to the probe was full, or without a current of their own.
pub(crate) static LOST: AtomicU32 = AtomicU32::new(0);
/// Milliseconds since the tasks in thread mode have checked in.
static SILENT_MS: AtomicU32 = AtomicU32::new(0);
/// Milliseconds since the session made progress, or [`WAITS`].
static STUCK_MS: AtomicU32 = AtomicU32::new(0);
/// It waits for the host, and may do so for ever.
const WAITS: u32 = u32::MAX;

/// The reference rig's constants, until measured ones are read from the store.
pub(crate) const UNMEASURED: RigCalibration = RigCalibration {
    pressure: Finger::MODEL.calibration,
    unloaded_a: (0.037, 0.0),
    newton_per_ampere: 16.4,
    date: 0,
    air_known: false,
    turned: 0,
    serial: [0; 16],
};

/// Tasks that are silent for longer hang: the longest that they compute, the choice among the actions of a whole grid, is
/// half of it.
const HUNG_MS: u32 = 2000;
/// A session without progress for longer waits for something that does not come, such as an interrupt of the flash. All
/// that it does without the rig, the sectors of the store erased and written, takes less than 15 s.
const STUCK_LIMIT_MS: u32 = 30_000;
/// Without a conversion of the motor's current for so many ms the motor is not driven on.
const NO_CURRENT_MS: u32 = 10;

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
    END_SLIDE.store(EARLY, Relaxed);
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

/// The tasks in thread mode are alive.
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

/// The servo as the link asks it at any time.
pub(crate) static BODY: Body = Body {
    state,
    stop: |all| if all { stop_for_good() } else { stop() },
    lost: || LOST.load(Relaxed),
};

struct Switches {
    lever_top: Input<'static>,
    stage_left: Input<'static>,
    stage_right: Input<'static>,
    e_stop: Input<'static>,
}

#[embassy_executor::task]
pub(crate) async fn servo(
    lever: board::Lever,
    stage: board::Stage,
    current: board::Current,
    switches: board::Switches,
    watchdog: board::Watchdog,
    mut words: Consumer<'static, Word>,
    mut samples: Producer<'static, Samples>,
) {
    let mut current = Current::new(current);
    let mut lever = lever::Lever::new(lever);
    let mut pwm = SimplePwm::new(
        stage.timer,
        Some(PwmPin::new(stage.pwm, OutputType::PushPull)),
        None,
        None,
        None,
        current::PWM,
        Default::default(),
    );
    let mut pwm = pwm.ch1();
    pwm.set_duty_cycle_fully_off();
    pwm.enable();
    let mut bridge = Output::new(stage.enable, Level::Low, Speed::Low);
    let mut right = Output::new(stage.direction, Level::Low, Speed::Low);
    let encoder = Qei::new(
        stage.encoder,
        stage.encoder_a,
        stage.encoder_b,
        Default::default(),
    );
    let switch = |pin: Peri<'static, AnyPin>| Input::new(pin, Pull::Up);
    let switches = Switches {
        lever_top: switch(switches.lever_top.into()),
        stage_left: switch(switches.stage_left.into()),
        stage_right: switch(switches.stage_right.into()),
        e_stop: switch(switches.e_stop.into()),
    };
    rescue::ARMED.store(true, Relaxed);
    watchdog::tighten(watchdog);

    let mut control = Control::new(
        &Finger::MODEL,
        StageConstants::REFERENCE,
        UNMEASURED,
        Unguarded::default(),
    );
    let (mut ended, mut remembered) = (None, false);
    let mut count: i32 = 0;
    let mut hung = None;
    let (mut current_a, mut no_current_ms) = (0.0, 0);
    Timer::after_millis(current::RING_MS).await;
    let mut ticker = Ticker::every(Duration::from_millis(1));
    loop {
        ticker.next().await;
        if STOP.swap(false, Relaxed) {
            control.stop();
        }
        // before a command: what was to be ended is not the next one
        if EARLY && END_SLIDE.swap(false, Relaxed) {
            control.end_slide();
        }
        if let Some(command) = COMMAND.try_take() {
            ended = None;
            ANSWER.signal(command.apply(&mut control));
        }
        let silent_ms = SILENT_MS.fetch_add(1, Relaxed);
        // thread mode does not come between: the servo interrupts it
        let stuck_ms = match STUCK_MS.load(Relaxed) {
            WAITS => 0,
            _ => STUCK_MS.fetch_add(1, Relaxed),
        };
        // once hung, hung until the watchdog has done its work
        if silent_ms > HUNG_MS {
            hung.get_or_insert("the tasks in thread mode did not check in for 2 s");
        } else if stuck_ms > STUCK_LIMIT_MS {
            hung.get_or_insert("what was asked for made no progress for 30 s");
        }

        let mut inputs = Inputs::default();
        while inputs.words.len() < MAX_WORDS
            && let Some(word) = words.dequeue()
        {
            // the loop ends before `words` is full
            let _ = inputs.words.push(word);
        }
        inputs.steps = lever.steps();
        count += i32::from(encoder.count().wrapping_sub(count as u16) as i16);
        inputs.encoder = count;
        inputs.lever_top = switches.lever_top.is_high();
        inputs.stage_limits = (
            switches.stage_left.is_high(),
            switches.stage_right.is_high(),
        );
        inputs.e_stop = switches.e_stop.is_high();
        if let Some(now_a) = current.amperes() {
            (current_a, no_current_ms) = (now_a, 0);
        } else {
            // the last one stands for it, and the slide does not count
            LOST.fetch_add(1, Relaxed);
            no_current_ms += 1;
        }
        inputs.current_a = current_a;
        if no_current_ms > NO_CURRENT_MS {
            hung.get_or_insert("the motor's current was not converted for 10 ms");
        }
        inputs.hung = hung.is_some();

        let outputs = control.tick(&inputs);
        lever.drive(outputs.lever_enabled, outputs.lever_steps_s);
        right.set_level((outputs.stage_duty > 0.0).into());
        let full = pwm.max_duty_cycle();
        pwm.set_duty_cycle((libm::fabsf(outputs.stage_duty).min(1.0) * full as f32) as u32);
        bridge.set_level(outputs.stage_enabled.into());

        Samples::of(&outputs, |part| {
            let many = part.pac.len() as u32;
            if samples.enqueue(part).is_err() {
                LOST.fetch_add(many, Relaxed);
            }
        });
        if let now @ Some(_) = control.take_ended() {
            ended = now;
            ENDED.signal(());
        }
        STATE.lock(|cell| {
            let (steps, current_a) = (inputs.steps, inputs.current_a);
            cell.set(RigState::of(&mut control, steps, current_a, ended));
        });
        match hung {
            Some(why) if control.is_at_rest() => {
                // once: the reset may come while it is written
                if !mem::replace(&mut remembered, true) {
                    rescue::remember(why);
                }
            }
            _ => watchdog::pet(),
        }
    }
}
