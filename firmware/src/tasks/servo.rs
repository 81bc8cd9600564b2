//! A thousand times a second: the pins into [`Control`], what it says to the pins, and the samples of the slide on their
//! way to the features. Lever, stage and guard live in the core; here is only where their pins are.
use core::mem;
use core::sync::atomic::Ordering::Relaxed;

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AnyPin, Input, Level, Output, OutputType, Pull, Speed};
use embassy_stm32::timer::qei::Qei;
use embassy_stm32::timer::simple_pwm::{PwmPin, SimplePwm};
use embassy_time::{Duration, Ticker, Timer};
use heapless::spsc::{Consumer, Producer};
use tactus_core::probe::RigState;
use tactus_core::probe::servo_rig::Samples;
use tactus_core::rig::control::Control;
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::pins::{Inputs, MAX_WORDS};
use tactus_core::rig::stage::StageConstants;

use super::drive::{self, ANSWER, COMMAND, END_SLIDE, ENDED, LOST, STATE, STOP, unmeasured};
use crate::board;
use crate::chip::current::{self, Current};
use crate::chip::slots::Word;
use crate::chip::{finger, lever, rescue, watchdog};

/// Without a conversion of the motor's current for so many ms the motor is not driven on.
const NO_CURRENT_MS: u32 = 10;

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
    // the watchdog of the start leaves time for it
    finger::found().await;
    watchdog::tighten(watchdog);

    let mut control = Control::new(
        &finger::parts().model,
        StageConstants::REFERENCE,
        unmeasured(finger::name()),
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
        if END_SLIDE.swap(false, Relaxed) {
            control.end_slide();
        }
        if let Some(command) = COMMAND.try_take() {
            ended = None;
            ANSWER.signal(command.apply(&mut control));
        }
        // once hung, hung until the watchdog has done its work
        hung = hung.or(drive::hung());

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
