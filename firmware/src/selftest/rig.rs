//! Current amplifier, switches, lever and stage. Motors move only after all switches were seen closed and the finger was off.
use core::fmt::Display;
use core::sync::atomic::Ordering::Relaxed;

use embassy_stm32::gpio::{Input, Output};
use embassy_time::Timer;
use tactus_core::wire::bringup::limits::{BRAKING_A, CURRENT_RMS, CURRENT_ZERO};

use super::account::Account;
use super::motors::{AT_REST, Motors};
use super::sensor::Touch;
use crate::board;
use crate::chip::rescue;

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
    let mut motors = Motors::new(lever, stage, converter, switches);
    motors.zero = match motors.conversions(AT_REST) {
        Ok(current) => {
            let (mean, rms) = (current.mean(), current.rms());
            let (zero, off) = CURRENT_ZERO;
            account.check(
                (mean - zero).abs() <= off && rms <= CURRENT_RMS,
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
            account.leave_out("lever", "since the converter stands");
            account.leave_out("stage", "since the converter stands");
            return;
        }
    };
    let switches = &motors.switches;

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
    if !account.check(
        off.is_ok(),
        "finger off",
        match &off {
            Ok(()) => &"squeezed, and left alone" as &dyn Display,
            Err(why) => why,
        },
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

    let lifted = match motors.test_lever(&mut touch).await {
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
    motors.stop();
    if !lifted {
        rescue::ARMED.store(false, Relaxed);
        blue.set_low();
        account.leave_out("stage", "since the lever may be down");
        return;
    }

    let there = motors.move_stage(true).await;
    let moved = match there.ended {
        Ok(()) => {
            let back = motors.move_stage(false).await;
            back.ended.map(|()| (there, back))
        }
        Err(why) => Err(why),
    };
    motors.stop();
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

fn level(input: &Input<'_>) -> &'static str {
    if input.is_low() { "closed" } else { "open" }
}
