//! Lever, stage, switches and current amplifier, used directly. Each move ends at a bound, at the emergency stop, at a limit switch
//! and, of the lever, when P_DC rises; with it the motor stands.
use embassy_stm32::Peri;
use embassy_stm32::gpio::{AnyPin, Input, Level, Output, OutputType, Pull, Speed};
use embassy_stm32::peripherals::{TIM3, TIM4};
use embassy_stm32::timer::qei::Qei;
use embassy_stm32::timer::simple_pwm::{PwmPin, SimplePwm};
use embassy_time::Timer;
use heapless::Vec;
use tactus_core::rig::lever::{APPROACH_STEPS_S, MAX_STEPS, RETRACT_STEPS_S};
use tactus_core::rig::stage::StageConstants;
use tactus_core::wire::bringup::limits::{CURRENT_ZERO, LEVER_PLAY, WEAK_A};
use tactus_core::wire::bringup::{MAX_POINTS, Stopped};

use super::account::wait_us;
use super::sensor::{Spread, Touch};
use crate::board;
use crate::chip::current::{self, Current};
use crate::chip::finger;
use crate::chip::lever::Lever;

/// Rings of conversions at rest: a thousand of them.
pub(super) const AT_REST: u32 = 40;
/// 2 mm of the lever.
pub(super) const LEVER_STEPS: i32 = 3200;
/// P_DC has risen by so much when the lever presses the finger, mN.
const PRESSED_MN: f32 = 92.0;
/// About 36 mm/s: enough to overcome friction, slow enough to stop by hand.
const STAGE_DUTY: f32 = 0.08;
const STAGE_MM: f32 = 1.0;
/// At that duty no more than 10 mm, should the encoder be silent.
const STAGE_MS: u32 = 250;
/// The duty of a motor that is hardly driven rises by steps, as far as [`MOST_DUTY`].
const STEP_MS: u32 = 30;
const STEP_DUTY: f32 = 0.02;
const MOST_DUTY: f32 = 0.3;
/// Duties of the ramp into a resistor: so many to each side, each a place of the ring of conversions, 1/25, more.
const RAMP: i16 = 12;
const RAMP_DUTY: f32 = 0.04;
/// A stage that moves by more than this has its motor, mm.
const RAMP_MM: f32 = 0.2;
/// Milliseconds between two points of the lever's series.
const LEVER_POINT_MS: u32 = 16;

/// Normally closed: high is open.
pub(super) struct Switches {
    pub(super) lever_top: Input<'static>,
    pub(super) stage_left: Input<'static>,
    pub(super) stage_right: Input<'static>,
    pub(super) e_stop: Input<'static>,
}

/// The rig's motors, and what is measured of them.
pub(super) struct Motors {
    pub(super) lever: Lever,
    pub(super) switches: Switches,
    pub(super) converter: Current,
    /// The converter's mean without current, counts.
    pub(super) zero: f32,
    /// The last move, a point each ms or [`LEVER_POINT_MS`]: see `tactus_core::wire::bringup::Measure`.
    pub(super) series: Vec<[i16; 2], MAX_POINTS>,
    pwm: SimplePwm<'static, TIM3>,
    bridge: Output<'static>,
    right: Output<'static>,
    encoder: Qei<'static, TIM4>,
    count: i32,
}

/// A move of the stage, to the right positive.
pub(super) struct Moved {
    pub(super) mm: f32,
    pub(super) duty: f32,
    /// The motor's current before it braked, and while it did.
    pub(super) driven_a: f32,
    pub(super) braking_a: f32,
    pub(super) ended: Result<(), Stopped>,
}

impl Motors {
    /// Takes the pins: no current in either motor.
    pub(super) fn new(
        lever: board::Lever,
        stage: board::Stage,
        converter: board::Current,
        switches: board::Switches,
    ) -> Self {
        let switch = |pin: Peri<'static, AnyPin>| Input::new(pin, Pull::Up);
        let mut pwm = SimplePwm::new(
            stage.timer,
            Some(PwmPin::new(stage.pwm, OutputType::PushPull)),
            None,
            None,
            None,
            current::PWM,
            Default::default(),
        );
        pwm.ch1().set_duty_cycle_fully_off();
        pwm.ch1().enable();
        let mut motors = Self {
            lever: Lever::new(lever),
            switches: Switches {
                lever_top: switch(switches.lever_top.into()),
                stage_left: switch(switches.stage_left.into()),
                stage_right: switch(switches.stage_right.into()),
                e_stop: switch(switches.e_stop.into()),
            },
            pwm,
            bridge: Output::new(stage.enable, Level::Low, Speed::Low),
            right: Output::new(stage.direction, Level::Low, Speed::Low),
            encoder: Qei::new(
                stage.encoder,
                stage.encoder_a,
                stage.encoder_b,
                Default::default(),
            ),
            count: 0,
            converter: Current::new(converter),
            zero: CURRENT_ZERO.0,
            series: Vec::new(),
        };
        motors.count();
        motors.count = 0;
        motors
    }

    /// Both stand, without current.
    pub(super) fn stop(&mut self) {
        self.lever.drive(false, 0);
        self.drive(0.0);
        self.bridge.set_low();
    }

    /// Count of the encoder since the start; to be asked before it has gone on by 32767.
    pub(super) fn count(&mut self) -> i32 {
        let moved = self.encoder.count().wrapping_sub(self.count as u16) as i16;
        self.count = self.count.wrapping_add(moved.into());
        self.count
    }

    fn position_mm(&mut self) -> f32 {
        self.count() as f32 * StageConstants::REFERENCE.mm_per_count
    }

    fn drive(&mut self, duty: f32) {
        self.right.set_level((duty > 0.0).into());
        let mut pwm = self.pwm.ch1();
        let full = pwm.max_duty_cycle();
        pwm.set_duty_cycle((libm::fabsf(duty) * full as f32) as u32);
    }

    /// Conversions of so many rings, one after the other: each begins after the call.
    pub(super) fn conversions(&mut self, rings: u32) -> Result<Spread, Stopped> {
        let mut found = Spread::default();
        for _ in 0..rings {
            wait_us(1000 * current::RING_MS as u32);
            for code in self.converter.ring().ok_or(Stopped::Converter)? {
                found.add(code);
            }
        }
        Ok(found)
    }

    fn current_a(&mut self) -> Result<f32, Stopped> {
        let mean = self.conversions(1)?.mean();
        Ok(self.above_zero_a(mean))
    }

    fn above_zero_a(&self, mean: f32) -> f32 {
        current::amperes(mean) - current::amperes(self.zero)
    }

    /// Another point; those that find no room are left out.
    fn note(&mut self, x: f32, y: f32) {
        // the conversion saturates
        let _ = self.series.push([x as i16, y as i16]);
    }

    /// Drives the lever until its switch is as wanted, three times in a row; the steps made, and the most that P_DC rose.
    pub(super) async fn drive_lever(
        &mut self,
        touch: &mut Touch,
        rate: i32,
        most: i32,
        until_open: Option<bool>,
    ) -> (i32, f32, Result<(), Stopped>) {
        let from = self.lever.steps();
        let (mut seen, mut risen, mut ms) = (0, 0.0_f32, 0_u32);
        // a timer that stands makes no steps
        let longest_ms = 1000 * most.unsigned_abs() / rate.unsigned_abs().max(1) + 1000;
        self.lever.drive(true, rate);
        let ended = loop {
            Timer::after_millis(1).await;
            ms += 1;
            let made = self.lever.steps() - from;
            seen = match until_open {
                Some(open) if self.switches.lever_top.is_high() == open => seen + 1,
                _ => 0,
            };
            if self.switches.e_stop.is_high() {
                break Err(Stopped::EStop);
            }
            match touch.rise() {
                Ok(rise) => {
                    risen = risen.max(rise);
                    if ms % LEVER_POINT_MS == 0 {
                        self.note(self.lever.steps() as f32 / 4.0, rise * 16.0);
                    }
                    if rise >= finger::parts().model.counts(PRESSED_MN) {
                        break Err(Stopped::Pressed);
                    }
                }
                Err(why) => break Err(why),
            }
            if seen >= 3 {
                break Ok(());
            }
            if made.abs() >= most || ms >= longest_ms {
                break match until_open {
                    Some(_) => Err(Stopped::TopStaysClosed),
                    None => Ok(()),
                };
            }
        };
        let made = (self.lever.steps() - from).abs();
        self.lever.drive(true, 0);
        // the step that is under way
        Timer::after_millis(2).await;
        (made, risen, ended)
    }

    /// Gives the lever current: its driver wants a while with it before it steps.
    pub(super) async fn hold_lever(&mut self) {
        self.lever.drive(true, 0);
        Timer::after_millis(10).await;
    }

    /// Up to the switch.
    pub(super) async fn lever_up(&mut self, touch: &mut Touch) -> (i32, f32, Result<(), Stopped>) {
        let most = MAX_STEPS * 5 / 4;
        self.drive_lever(touch, RETRACT_STEPS_S, most, Some(true))
            .await
    }

    /// Up to the switch, 2 mm down and up again: steps to the switch, and the difference between the ways.
    pub(super) async fn test_lever(&mut self, touch: &mut Touch) -> Result<(i32, i32), Stopped> {
        self.hold_lever().await;
        let (up, _, ended) = self.lever_up(touch).await;
        ended?;
        let down = 2 * APPROACH_STEPS_S;
        let (_, _, ended) = self.drive_lever(touch, down, LEVER_STEPS, None).await;
        ended?;
        if self.switches.lever_top.is_high() {
            return Err(Stopped::TopStaysOpen);
        }
        let most = LEVER_STEPS + LEVER_PLAY;
        let (back, _, ended) = self.drive_lever(touch, -down, most, Some(true)).await;
        ended?;
        let play = (back - LEVER_STEPS).abs();
        if play > LEVER_PLAY {
            return Err(Stopped::TopTooEarly);
        }
        Ok((up, play))
    }

    /// Moves the stage by at least [`STAGE_MM`] and brakes it.
    pub(super) async fn move_stage(&mut self, to_the_right: bool) -> Moved {
        self.bridge.set_high();
        let moved = self.moved(if to_the_right { 1.0 } else { -1.0 }).await;
        self.bridge.set_low();
        moved
    }

    async fn moved(&mut self, direction: f32) -> Moved {
        let from_mm = self.position_mm();
        let mut duty = STAGE_DUTY * direction;
        self.drive(duty);
        let (mut ms, mut weak, mut driven_a) = (0, false, 0.0);
        let mut ended = loop {
            Timer::after_millis(1).await;
            ms += 1;
            let moved_mm = self.position_mm() - from_mm;
            if let Some(now_a) = self.converter.amperes() {
                driven_a = now_a - current::amperes(self.zero);
            }
            self.note(moved_mm * 1e3, driven_a * 1e3);
            let moved_mm = moved_mm * direction;
            let limit = match direction > 0.0 {
                true => &self.switches.stage_right,
                false => &self.switches.stage_left,
            };
            if self.switches.e_stop.is_high() {
                break Err(Stopped::EStop);
            }
            if limit.is_high() {
                break Err(Stopped::Limit);
            }
            if moved_mm > STAGE_MM {
                break Ok(());
            }
            if moved_mm < -STAGE_MM / 2.0 {
                break Err(Stopped::Backwards);
            }
            if ms == STEP_MS {
                weak = match self.current_a() {
                    Ok(now_a) => moved_mm <= 0.0 && now_a * direction < WEAK_A,
                    Err(why) => break Err(why),
                };
            }
            if weak && ms % STEP_MS == 0 && moved_mm <= 0.0 {
                duty += STEP_DUTY * direction;
                if duty.abs() > MOST_DUTY {
                    break Err(Stopped::NoCurrent);
                }
                self.drive(duty);
            }
            if !weak && ms >= STAGE_MS || ms >= 2 * STAGE_MS {
                break Err(Stopped::NoCount);
            }
        };
        // without duty the bridge shorts the motor
        self.drive(0.0);
        let braking_a = self.current_a();
        Timer::after_millis(200).await;
        ended = ended.and(braking_a.map(|_| ()));
        Moved {
            mm: self.position_mm() - from_mm,
            duty,
            driven_a,
            braking_a: braking_a.unwrap_or(0.0),
            ended,
        }
    }

    /// Drives a resistor in the place of the motor, by duties one after the other.
    pub(super) async fn ramp(&mut self) -> Result<(), Stopped> {
        let from_mm = self.position_mm();
        self.bridge.set_high();
        for step in (0..=RAMP).chain((1..=RAMP).map(|step| -step)) {
            let duty = f32::from(step) * RAMP_DUTY;
            self.drive(duty);
            // a motor would have moved by then
            for _ in 0..STEP_MS {
                Timer::after_millis(1).await;
                if self.switches.e_stop.is_high() {
                    return Err(Stopped::EStop);
                }
                if (self.position_mm() - from_mm).abs() > RAMP_MM {
                    return Err(Stopped::Moves);
                }
            }
            let now_a = self.current_a()?;
            self.note(duty * 1e3, now_a * 1e3);
        }
        Ok(())
    }
}
