//! A thousand times a second: the pins into [`Control`], what it says to the pins, and the samples of the slide on
//! their way to the features. Lever, stage and guard live in the core; here is only where their pins are.
use core::sync::atomic::Ordering::Relaxed;

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AnyPin, Input, Level, Output, Pull, Speed};
use embassy_stm32::peripherals::{TIM3, TIM4};
use embassy_stm32::timer::qei::Qei;
use embassy_stm32::timer::simple_pwm::SimplePwm;
use embassy_time::Timer;
use heapless::spsc::{Consumer, Producer};
use tactus_core::probe::RigState;
use tactus_core::probe::servo_rig::Samples;
use tactus_core::rig::control::Control;
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::pins::{Inputs, Outputs};
use tactus_core::rig::stage::StageConstants;

use super::drive::{END_SLIDE, LOST, STOP, Ticks, unmeasured};
use crate::board;
use crate::chip::current::{self, Current};
use crate::chip::lever::Lever;
use crate::chip::slots::Word;
use crate::chip::{debugger, encoder, finger, rescue, watchdog};

/// Without a conversion of the motor's current for so many ms the motor is not driven on.
const NO_CURRENT_MS: u32 = 10;

/// The rig's pins. Switches are normally closed: high is open.
pub(crate) struct Pins {
    pub(crate) current: Current,
    current_a: f32,
    no_current_ms: u32,
    pub(crate) lever: Lever,
    pwm: SimplePwm<'static, TIM3>,
    pub(crate) bridge: Output<'static>,
    right: Output<'static>,
    encoder: Qei<'static, TIM4>,
    count: i32,
    pub(crate) lever_top: Input<'static>,
    pub(crate) stage_left: Input<'static>,
    pub(crate) stage_right: Input<'static>,
    pub(crate) e_stop: Input<'static>,
    debugged: bool,
}

impl Pins {
    pub(crate) fn new(
        lever: board::Lever,
        stage: board::Stage,
        current: board::Current,
        switches: board::Switches,
    ) -> Self {
        let switch = |pin: Peri<'static, AnyPin>| Input::new(pin, Pull::Up);
        Self {
            current: Current::new(current),
            current_a: 0.0,
            no_current_ms: 0,
            lever: Lever::new(lever),
            pwm: current::pwm(stage.timer, stage.pwm),
            bridge: Output::new(stage.enable, Level::Low, Speed::Low),
            right: Output::new(stage.direction, Level::Low, Speed::Low),
            encoder: encoder::filtered(stage.encoder, stage.encoder_a, stage.encoder_b),
            count: 0,
            lever_top: switch(switches.lever_top.into()),
            stage_left: switch(switches.stage_left.into()),
            stage_right: switch(switches.stage_right.into()),
            e_stop: switch(switches.e_stop.into()),
            debugged: false,
        }
    }

    /// Count of the encoder; to be asked before it has gone on by 32767.
    pub(crate) fn count(&mut self) -> i32 {
        let moved = self.encoder.count().wrapping_sub(self.count as u16) as i16;
        self.count = self.count.wrapping_add(moved.into());
        self.count
    }

    /// Drives the stage, to the right positive; without duty the bridge shorts the motor.
    pub(crate) fn drive_stage(&mut self, duty: f32) {
        self.right.set_level((duty > 0.0).into());
        let mut pwm = self.pwm.ch1();
        let full = pwm.max_duty_cycle();
        pwm.set_duty_cycle((libm::fabsf(duty).min(1.0) * full as f32) as u32);
    }

    /// Reads all inputs but the sensor's; returns why the rig is to be stopped, if the motor's current stays away.
    fn read(&mut self, inputs: &mut Inputs) -> Option<&'static str> {
        inputs.steps = self.lever.steps();
        inputs.encoder = self.count();
        inputs.lever_top = self.lever_top.is_high();
        inputs.stage_limits = (self.stage_left.is_high(), self.stage_right.is_high());
        self.debugged = debugger::is_there();
        if !self.debugged {
            board::keep_watchdog();
        }
        inputs.e_stop = self.e_stop.is_high() || self.debugged;
        if let Some(now_a) = self.current.amperes() {
            (self.current_a, self.no_current_ms) = (now_a, 0);
        } else {
            // the last one stands for it, and the slide does not count
            LOST.fetch_add(1, Relaxed);
            self.no_current_ms += 1;
        }
        inputs.current_a = self.current_a;
        (self.no_current_ms > NO_CURRENT_MS)
            .then_some("the motor's current was not converted for 10 ms")
    }

    fn write(&mut self, outputs: &Outputs) {
        self.lever
            .drive(outputs.lever_enabled, outputs.lever_steps_s);
        // also in the ms in which a stop is not believed yet
        self.drive_stage(match self.debugged {
            true => 0.0,
            false => outputs.stage_duty,
        });
        self.bridge.set_level(outputs.stage_enabled.into());
    }
}

#[embassy_executor::task]
pub(crate) async fn servo(
    mut pins: Pins,
    watchdog: board::Watchdog,
    words: Consumer<'static, Word>,
    samples: Producer<'static, Samples>,
) {
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
    Timer::after_millis(current::RING_MS).await;
    let mut ticks = Ticks::new(words, samples);
    loop {
        let mut inputs = ticks.next().await;
        if STOP.swap(false, Relaxed) {
            control.stop();
        }
        // before a command: what was to be ended is not the next one
        if END_SLIDE.swap(false, Relaxed) {
            control.end_slide();
        }
        ticks.obey(|command| command.apply(&mut control));
        ticks.hung = ticks.hung.or(pins.read(&mut inputs));
        inputs.hung = ticks.hung.is_some();
        let outputs = control.tick(&inputs);
        pins.write(&outputs);
        let ended = control.take_ended();
        ticks.over(&outputs, ended, |ended| {
            RigState::of(&mut control, inputs.steps, inputs.current_a, ended)
        });
    }
}
