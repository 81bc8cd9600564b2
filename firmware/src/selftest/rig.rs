//! Current amplifier, switches, lever and stage. Motors move only after all switches were seen closed and the finger was off,
//! no further than a bound, and the lever no further than P_DC stays as it is.
use core::sync::atomic::Ordering::Relaxed;

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AnyPin, Input, Level, Output, OutputType, Pull, Speed};
use embassy_stm32::timer::qei::Qei;
use embassy_stm32::timer::simple_pwm::{PwmPin, SimplePwm};
use embassy_time::Timer;
use tactus_core::rig::lever::{APPROACH_STEPS_S, MAX_STEPS, RETRACT_STEPS_S};
use tactus_core::rig::stage::StageConstants;

use super::account::{Account, wait_us};
use super::sensor::{Spread, Touch};
use crate::board;
use crate::chip::current::{self, Current};
use crate::chip::lever::Lever;
use crate::chip::rescue;

/// The current amplifier's zero is half of the reference, 2048; this is far beyond what its resistors can do.
const ZERO_COUNTS: f32 = 60.0;
/// Rings of conversions at rest: a thousand of them.
const AT_REST: u32 = 40;
/// 13 mA; the slowest slide draws 40.
const CURRENT_NOISE_COUNTS: f32 = 16.0;
/// 2 mm of the lever.
const LEVER_STEPS: i32 = 3200;
/// P_DC has risen by so much when the lever presses the finger, counts: 0.09 N.
const PRESSED_COUNTS: f32 = 8.0;
/// 0.1 mm: how far from where it opened the lever's switch may close.
const LEVER_PLAY: i32 = 160;
/// About 36 mm/s: enough to overcome friction, slow enough to stop by hand.
const STAGE_DUTY: f32 = 0.08;
const STAGE_MM: f32 = 1.0;
/// At that duty no more than 10 mm, should the encoder be silent.
const STAGE_MS: u32 = 250;
/// A motor that stands and draws less than this is hardly driven, A: friction alone takes more. Then the duty rises by steps, as far as
/// [`MOST_DUTY`].
const WEAK_A: f32 = 0.025;
const STEP_MS: u32 = 30;
const STEP_DUTY: f32 = 0.02;
const MOST_DUTY: f32 = 0.3;
/// A shorted motor that is turned by the stage draws more than this the other way, A.
const BRAKING_A: f32 = 0.02;

struct Switches {
    lever_top: Input<'static>,
    stage_left: Input<'static>,
    stage_right: Input<'static>,
    e_stop: Input<'static>,
}

/// Current amplifier, switches, lever and stage; motors only if all is `well` so far.
pub(super) async fn rig(
    lever: board::Lever,
    stage: board::Stage,
    converter: board::Current,
    switches: board::Switches,
    mut touch: Touch,
    well: bool,
    blue: &mut Output<'static>,
    account: &mut Account,
) {
    let switch = |pin: Peri<'static, AnyPin>| Input::new(pin, Pull::Up);
    let switches = Switches {
        lever_top: switch(switches.lever_top.into()),
        stage_left: switch(switches.stage_left.into()),
        stage_right: switch(switches.stage_right.into()),
        e_stop: switch(switches.e_stop.into()),
    };
    let mut lever = Lever::new(lever);
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
    let full = pwm.max_duty_cycle();
    let mut bridge = Output::new(stage.enable, Level::Low, Speed::Low);
    let mut right = Output::new(stage.direction, Level::Low, Speed::Low);
    let encoder = Qei::new(
        stage.encoder,
        stage.encoder_a,
        stage.encoder_b,
        Default::default(),
    );
    let mut converter = Current::new(converter);
    let zero = match conversions(&mut converter, AT_REST) {
        Ok(current) => {
            let (mean, rms) = (current.mean(), current.rms());
            account.check(
                (mean - 2048.0).abs() <= ZERO_COUNTS && rms <= CURRENT_NOISE_COUNTS,
                "motor current at rest",
                format_args!("{mean:.0} counts, noise {rms:.1} rms"),
                "2048 +- 60 and below 16 rms are right. The amplifier's output belongs to PA3, its reference to half of 3.3 V",
            );
            mean
        }
        Err(why) => {
            account.check(
                false,
                "motor current at rest",
                why,
                "The chip's converter stands: start it again; if it stays so replace the board",
            );
            account.leave_out("lever", why);
            account.leave_out("stage", why);
            return;
        }
    };

    let mut closed = true;
    for (name, input) in [
        ("left switch PF14", &switches.stage_left),
        ("right switch PF15", &switches.stage_right),
        ("emergency stop PF13", &switches.e_stop),
    ] {
        closed &= account.check(
            input.is_low(),
            name,
            level(input),
            "Push the stage to its middle, release the emergency stop; if it stays so its wire is broken",
        );
    }
    // pressed is no fault here: the lever's own check tells it from a broken wire
    let top = level(&switches.lever_top);
    account.check(true, "lever switch PF12", top, "");

    if !(closed && well) {
        let why = if well {
            "since a switch is open"
        } else {
            "after this reset"
        };
        account.leave_out("lever", why);
        account.leave_out("stage", why);
        return;
    }
    defmt::warn!(
        "TAKE THE FINGER OFF ITS MOUNT, squeeze it once between two fingers and lay it down, within 30 s"
    );
    let off = touch.squeezed().await;
    let seen = off.err().unwrap_or("squeezed, and left alone");
    if !account.check(
        off.is_ok(),
        "finger off",
        seen,
        "Without it the motors stay off: they would move before anybody knows which way is up",
    ) {
        account.leave_out("lever", "since the finger may be on");
        account.leave_out("stage", "since the finger may be on");
        return;
    }
    defmt::warn!("THE MOTORS MOVE IN 3 s: hands away");
    for _ in 0..15 {
        blue.set_high();
        Timer::after_millis(100).await;
        blue.set_low();
        Timer::after_millis(100).await;
    }
    blue.set_high();
    // should the firmware give up now, the rescue can drive both
    rescue::ARMED.store(true, Relaxed);

    let lifted = match test_lever(&mut lever, &switches, &mut touch).await {
        Ok((up, play)) => account.check(
            true,
            "lever",
            format_args!("{up} steps up to its switch, 2 mm down and up again within {play} steps"),
            "",
        ),
        Err(why) => account.check(
            false,
            "lever",
            why,
            "STEP PE9, DIR PE11 (high is down), EN PE13, switch PF12, 16 microsteps, the driver's supply",
        ),
    };
    lever.drive(false, 0);
    if !lifted {
        rescue::ARMED.store(false, Relaxed);
        blue.set_low();
        account.leave_out("stage", "since the lever may be down");
        return;
    }

    let mut drive = |duty: f32| {
        right.set_level((duty > 0.0).into());
        pwm.set_duty_cycle((libm::fabsf(duty) * full as f32) as u32);
    };
    let mut current_a = || {
        let current = conversions(&mut converter, 1)?;
        Ok(current::amperes(current.mean()) - current::amperes(zero))
    };
    bridge.set_high();
    let mut count: i32 = 0;
    let mut position_mm = || {
        count += i32::from(encoder.count().wrapping_sub(count as u16) as i16);
        count as f32 * StageConstants::REFERENCE.mm_per_count
    };
    position_mm();
    let mut go = async |duty| {
        move_stage(
            duty,
            &mut drive,
            &mut position_mm,
            &mut current_a,
            &switches,
        )
        .await
    };
    let moved = match go(STAGE_DUTY).await {
        Ok(there) => go(-STAGE_DUTY).await.map(|back| (there, back)),
        Err(why) => Err(why),
    };
    bridge.set_low();
    match moved {
        Ok((there, back)) => {
            account.check(
                true,
                "stage",
                format_args!("{:.2} mm to the right, {:.2} mm back", there.mm, -back.mm),
                "",
            );
            account.check(
                there.braking_a < -BRAKING_A && back.braking_a > BRAKING_A,
                "bridge brakes",
                format_args!(
                    "{:.0} and {:.0} mA without duty",
                    1e3 * there.braking_a,
                    1e3 * back.braking_a
                ),
                "The bridge is off while its PWM is low (fast decay), and the stage coasts: it must short the motor then (slow decay). \
                 Look for that input of the bridge, or take another one. Or the amplifier's inputs are swapped",
            );
        }
        Err(why) => {
            account.check(
                false,
                "stage",
                why,
                "PWM PC6, DIR PC7 (high is right), EN PC8, encoder PD12 and PD13, the bridge's supply",
            );
        }
    }
    rescue::ARMED.store(false, Relaxed);
    blue.set_low();
}

/// Conversions of so many rings, one after the other: each begins after the call.
fn conversions(converter: &mut Current, rings: u32) -> Result<Spread, &'static str> {
    let mut found = Spread::default();
    for _ in 0..rings {
        wait_us(1000 * current::RING_MS as u32);
        let ring = converter.ring();
        for code in ring.ok_or("the motor's current is not converted")? {
            found.add(code);
        }
    }
    Ok(found)
}

fn level(input: &Input<'_>) -> &'static str {
    if input.is_low() { "closed" } else { "open" }
}

/// Drives the lever until its switch is as wanted, three times in a row; the steps made.
async fn drive_lever(
    lever: &mut Lever,
    switches: &Switches,
    touch: &mut Touch,
    rate: i32,
    most: i32,
    until_open: Option<bool>,
) -> Result<i32, &'static str> {
    let from = lever.steps();
    let mut seen = 0;
    lever.drive(true, rate);
    let done = loop {
        Timer::after_millis(1).await;
        let made = (lever.steps() - from).abs();
        seen = match until_open {
            Some(open) if switches.lever_top.is_high() == open => seen + 1,
            _ => 0,
        };
        if switches.e_stop.is_high() {
            break Err("emergency stop");
        }
        match touch.rise() {
            Ok(rise) if rise < PRESSED_COUNTS => {}
            Ok(_) => {
                break Err(
                    "P_DC rises: the finger is on its mount, or somebody holds it. If the lever went down, DIR is inverted",
                );
            }
            Err(why) => break Err(why),
        }
        if seen >= 3 {
            break Ok(made);
        }
        if made >= most {
            break if until_open.is_some() {
                Err(
                    "the switch at its top stays closed on the way up: it does not move, or moves down",
                )
            } else {
                Ok(made)
            };
        }
    };
    lever.drive(true, 0);
    // the step that is under way
    Timer::after_millis(2).await;
    done
}

/// Up to the switch, 2 mm down and up again: steps to the switch, and the difference between the ways.
async fn test_lever(
    lever: &mut Lever,
    switches: &Switches,
    touch: &mut Touch,
) -> Result<(i32, i32), &'static str> {
    // the drivers want a while with current before they step
    lever.drive(true, 0);
    Timer::after_millis(10).await;
    let most = MAX_STEPS * 5 / 4;
    let up = drive_lever(lever, switches, touch, RETRACT_STEPS_S, most, Some(true)).await?;
    let down = 2 * APPROACH_STEPS_S;
    drive_lever(lever, switches, touch, down, LEVER_STEPS, None).await?;
    if switches.lever_top.is_high() {
        return Err(
            "the switch at its top stays open 2 mm below: its wire is broken, or the lever does not move",
        );
    }
    let most = LEVER_STEPS + LEVER_PLAY;
    let back = drive_lever(lever, switches, touch, -down, most, Some(true)).await?;
    let play = (back - LEVER_STEPS).abs();
    if play > LEVER_PLAY {
        return Err("it came back to its switch too early: it loses steps on the way down");
    }
    Ok((up, play))
}

/// A move of the stage, to the right positive.
struct Moved {
    mm: f32,
    /// The motor's current while it braked.
    braking_a: f32,
}

/// Moves the stage by at least [`STAGE_MM`] and brakes it.
async fn move_stage(
    mut duty: f32,
    drive: &mut impl FnMut(f32),
    position_mm: &mut impl FnMut() -> f32,
    current_a: &mut impl FnMut() -> Result<f32, &'static str>,
    switches: &Switches,
) -> Result<Moved, &'static str> {
    let from_mm = position_mm();
    let direction = duty.signum();
    drive(duty);
    let (mut ms, mut weak) = (0, false);
    let done = loop {
        Timer::after_millis(1).await;
        ms += 1;
        let moved_mm = (position_mm() - from_mm) * direction;
        let limit = if duty > 0.0 {
            &switches.stage_right
        } else {
            &switches.stage_left
        };
        if switches.e_stop.is_high() {
            break Err("emergency stop");
        }
        if limit.is_high() {
            break Err("it ran into a limit switch: push it to its middle and run the test again");
        }
        if moved_mm > STAGE_MM {
            break Ok(());
        }
        if moved_mm < -STAGE_MM / 2.0 {
            break Err(
                "the encoder counts backwards: swap its lines A and B, or the motor's wires",
            );
        }
        if ms == STEP_MS {
            weak = match current_a() {
                Ok(now_a) => moved_mm <= 0.0 && now_a * direction < WEAK_A,
                Err(why) => break Err(why),
            };
        }
        if weak && ms % STEP_MS == 0 && moved_mm <= 0.0 {
            duty += STEP_DUTY * direction;
            if duty.abs() > MOST_DUTY {
                break Err("hardly any current: the motor, the bridge's enable or its supply");
            }
            drive(duty);
        }
        if !weak && ms >= STAGE_MS || ms >= 2 * STAGE_MS {
            break Err(
                "the encoder does not count: a line of it is cut, or the stage does not move",
            );
        }
    };
    // without duty the bridge shorts the motor
    drive(0.0);
    let braking_a = current_a();
    Timer::after_millis(200).await;
    let mm = position_mm() - from_mm;
    done?;
    Ok(Moved {
        mm,
        braking_a: braking_a?,
    })
}
