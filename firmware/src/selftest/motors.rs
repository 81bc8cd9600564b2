//! Lever, stage, switches and current amplifier, used directly. Each move ends at a bound, at the emergency stop, at a
//! limit switch and, of the lever, when P_DC rises; with it the motor stands.
use embassy_time::Timer;
use heapless::Vec;
use tactus_core::rig::lever::{MAX_STEPS, RETRACT_STEPS_S};
use tactus_core::rig::stage::StageConstants;
use tactus_core::wire::bringup::limits::{CURRENT_ZERO, WEAK_A};
use tactus_core::wire::bringup::{MAX_POINTS, StageSeen, Stopped};

use super::chip::wait_us;
use super::sensor::{Spread, Touch};
use crate::chip::{current, finger};
use crate::tasks::servo::Pins;

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

pub(super) struct Motors {
    pub(super) pins: Pins,
    pub(super) zero: f32,
    /// The last move, a point each ms or [`LEVER_POINT_MS`]: see `tactus_core::wire::bringup::Measure`.
    pub(super) series: Vec<[i16; 2], MAX_POINTS>,
}

impl Motors {
    pub(super) fn new(pins: Pins) -> Self {
        Self {
            pins,
            zero: CURRENT_ZERO.0,
            series: Vec::new(),
        }
    }

    pub(super) fn stop(&mut self) {
        self.pins.lever.drive(false, 0);
        self.pins.drive_stage(0.0);
        self.pins.bridge.set_low();
    }

    fn position_mm(&mut self) -> f32 {
        self.pins.count() as f32 * StageConstants::REFERENCE.mm_per_count
    }

    /// Conversions of so many rings, one after the other: each begins after the call.
    pub(super) fn conversions(&mut self, rings: u32) -> Result<Spread, Stopped> {
        let mut found = Spread::default();
        for _ in 0..rings {
            wait_us(1000 * current::RING_MS as u32);
            for code in self.pins.current.ring().ok_or(Stopped::Converter)? {
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

    fn note(&mut self, x: f32, y: f32) {
        // the conversion saturates
        let _ = self.series.push([x as i16, y as i16]);
    }

    /// Drives the lever by at most so many steps, or until its switch is open, three times in a row; the most that P_DC
    /// rose.
    pub(super) async fn drive_lever(
        &mut self,
        touch: &mut Touch,
        rate: i32,
        most: i32,
        to_switch: bool,
    ) -> (f32, Result<(), Stopped>) {
        let from = self.pins.lever.steps();
        let (mut seen, mut risen, mut ms) = (0, 0.0_f32, 0_u32);
        // a timer that stands makes no steps
        let longest_ms = 1000 * most.unsigned_abs() / rate.unsigned_abs().max(1) + 1000;
        self.pins.lever.drive(true, rate);
        let ended = loop {
            Timer::after_millis(1).await;
            ms += 1;
            let made = self.pins.lever.steps() - from;
            seen = if to_switch && self.pins.lever_top.is_high() {
                seen + 1
            } else {
                0
            };
            if self.pins.e_stop.is_high() {
                break Err(Stopped::EStop);
            }
            match touch.rise() {
                Ok(rise) => {
                    risen = risen.max(rise);
                    if ms % LEVER_POINT_MS == 0 {
                        self.note(self.pins.lever.steps() as f32 / 4.0, rise * 16.0);
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
                break if to_switch {
                    Err(Stopped::TopStaysClosed)
                } else {
                    Ok(())
                };
            }
        };
        self.pins.lever.drive(true, 0);
        // the step that is under way
        Timer::after_millis(2).await;
        (risen, ended)
    }

    /// Gives the lever current: its driver wants a while with it before it steps.
    pub(super) async fn hold_lever(&mut self) {
        self.pins.lever.drive(true, 0);
        Timer::after_millis(10).await;
    }

    pub(super) async fn lever_up(&mut self, touch: &mut Touch) -> (f32, Result<(), Stopped>) {
        let most = MAX_STEPS * 5 / 4;
        self.drive_lever(touch, RETRACT_STEPS_S, most, true).await
    }

    pub(super) async fn move_stage(&mut self, to_the_right: bool) -> StageSeen {
        self.pins.bridge.set_high();
        let moved = self.moved(if to_the_right { 1.0 } else { -1.0 }).await;
        self.pins.bridge.set_low();
        moved
    }

    async fn moved(&mut self, direction: f32) -> StageSeen {
        let from_mm = self.position_mm();
        let mut duty = STAGE_DUTY * direction;
        self.pins.drive_stage(duty);
        let (mut ms, mut weak, mut driven_a) = (0, false, 0.0);
        let mut ended = loop {
            Timer::after_millis(1).await;
            ms += 1;
            let moved_mm = self.position_mm() - from_mm;
            if let Some(now_a) = self.pins.current.amperes() {
                driven_a = now_a - current::amperes(self.zero);
            }
            self.note(moved_mm * 1e3, driven_a * 1e3);
            let moved_mm = moved_mm * direction;
            let limit = match direction > 0.0 {
                true => &self.pins.stage_right,
                false => &self.pins.stage_left,
            };
            if self.pins.e_stop.is_high() {
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
                self.pins.drive_stage(duty);
            }
            if !weak && ms >= STAGE_MS || ms >= 2 * STAGE_MS {
                break Err(Stopped::NoCount);
            }
        };
        // without duty the bridge shorts the motor
        self.pins.drive_stage(0.0);
        let braking_a = self.current_a();
        Timer::after_millis(200).await;
        ended = ended.and(braking_a.map(|_| ()));
        StageSeen {
            moved_um: 0,
            duty,
            driven_ma: 1e3 * driven_a,
            braking_ma: 1e3 * braking_a.unwrap_or(0.0),
            ended,
        }
    }

    /// Drives a resistor in the place of the motor, by duties one after the other.
    pub(super) async fn ramp(&mut self) -> Result<(), Stopped> {
        let from_mm = self.position_mm();
        self.pins.bridge.set_high();
        for step in (0..=RAMP).chain((1..=RAMP).map(|step| -step)) {
            let duty = f32::from(step) * RAMP_DUTY;
            self.pins.drive_stage(duty);
            // a motor would have moved by then
            for _ in 0..STEP_MS {
                Timer::after_millis(1).await;
                if self.pins.e_stop.is_high() {
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
