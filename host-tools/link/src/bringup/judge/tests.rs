//! What each step judges, at both sides of its limits; and that no check of the judge could go without a case here
//! failing.

use std::cell::Cell;
use std::panic::Location;

use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::unloaded::SPEEDS_UM_S;
use tactus_core::sensor::FingerCode;
use tactus_core::sensor::pressure::Calibration;
use tactus_core::wire::bringup::{Checked, ConverterSeen, HandSeen};
use tactus_core::wire::{Live, SlideReport};

use super::mounted::SlideSeen;
use super::*;

thread_local! {
    /// File and line of the check that is switched off.
    static OFF: Cell<Option<(&'static str, u32)>> = const { Cell::new(None) };
}

pub(super) fn is_off(check: &Location<'_>) -> bool {
    OFF.get()
        .is_some_and(|(file, line)| check.file().ends_with(file) && check.line() == line)
}

/// Measurements, and the mistakes that are to be named, each with its place.
type Case = (
    &'static str,
    fn() -> Finding,
    &'static [(&'static str, &'static str)],
);

const CHIP: ChipSeen = ChipSeen {
    khz: 168_000,
    external: true,
    locked: true,
    pa12: false,
    brown_out: 0,
};

fn reset_by(words: Option<&str>) -> Finding {
    chip(&CHIP, Reset::Power, words)
}

fn chip_of(seen: ChipSeen) -> Finding {
    chip(&seen, Reset::Power, None)
}

/// A sound rig's pins but for these.
fn pins_but(others: &[(Pin, Tied)]) -> Finding {
    let mut seen = PinsSeen::default();
    for (pin, bit) in Pin::ALL.into_iter().zip(0..) {
        let other = others.iter().find(|(one, _)| *one == pin);
        let tied = other.map_or(
            match pin {
                Pin::EncoderA | Pin::Miso | Pin::Select => Tied::High,
                Pin::Mosi => Tied::Floating,
                _ => Tied::Low,
            },
            |(_, tied)| *tied,
        );
        seen.up |= u16::from(tied != Tied::Low) << bit;
        seen.down |= u16::from(tied == Tied::High) << bit;
    }
    pins(&seen)
}

fn sensor_second() -> SensorSeen {
    let text = |words: &str| words.try_into().unwrap();
    SensorSeen {
        finger: FingerCode::BIOTAC,
        identity: Ok(text("BT-1")),
        words: 4400,
        garbled: 0,
        error_frames: 0,
        silent: 0,
        late: 0,
        last: [0x12, 0x34],
        pac: [1980.0, 2.0],
        pdc: [2640.0, 0.5],
    }
}

fn sensor_but(change: impl Fn(&mut SensorSeen)) -> Finding {
    let mut seen = sensor_second();
    change(&mut seen);
    sensor(&seen)
}

fn noise_of(pac_rms: f32, pdc: f32) -> Finding {
    noise(&SensorSeen {
        pac: [1980.0, pac_rms],
        pdc: [pdc, 0.5],
        ..sensor_second()
    })
}

const LOOK: Look = Look {
    lever_top: false,
    stage_left: false,
    stage_right: false,
    e_stop: false,
    encoder: 0,
    current: Some([2048.0, 4.0]),
};

fn with_open(pins: &[Pin]) -> Look {
    let open = |pin| pins.contains(&pin);
    Look {
        lever_top: open(Pin::LeverTop),
        stage_left: open(Pin::StageLeft),
        stage_right: open(Pin::StageRight),
        e_stop: open(Pin::EStop),
        ..LOOK
    }
}

/// The right switch, before and while it is pressed; the others are sound.
fn right_switch(before: &[Pin], pressed: &[Pin]) -> Finding {
    let looks = SWITCHES.map(|pin| match pin {
        Pin::StageRight => [with_open(before), with_open(pressed)],
        _ => [LOOK, with_open(&[pin])],
    });
    switches(&looks)
}

/// A hand pushed the stage so far, mm; switches that are open at its two ends.
fn pushed(mm: f64, left: &[Pin], right: &[Pin]) -> Finding {
    let end = Look {
        encoder: (mm * 1e3) as i32,
        ..with_open(right)
    };
    by_hand(&with_open(left), &end)
}

fn sound_push(mm: f64) -> Finding {
    pushed(mm, &[Pin::StageLeft], &[Pin::StageRight])
}

fn resting(current: Option<[f32; 2]>) -> Finding {
    rest(&Look { current, ..LOOK })
}

fn lever(steps: i32, at_top: bool, ended: Result<(), Stopped>) -> LeverSeen {
    LeverSeen {
        steps,
        at_top,
        rise: 0.0,
        ended,
    }
}

fn up_down_up(up: Result<(), Stopped>, opens_below: bool, back: i32) -> Finding {
    lever_switch(
        &lever(-800, true, up),
        &lever(3200, opens_below, Ok(())),
        &lever(-back, true, Ok(())),
    )
}

fn pressed_foam(up: i32, ended: Result<(), Stopped>) -> Finding {
    let sound = [lever(6400, false, Ok(())), lever(-6400, true, Ok(()))];
    foam(&[
        sound,
        [lever(6400, false, ended), lever(-up, true, Ok(()))],
        sound,
    ])
}

const RIGHT: StageSeen = StageSeen {
    moved_um: 1000,
    duty: 0.1,
    driven_ma: 80.0,
    braking_ma: -60.0,
    ended: Ok(()),
};
const LEFT: StageSeen = StageSeen {
    moved_um: -1000,
    duty: -0.1,
    driven_ma: -80.0,
    braking_ma: 60.0,
    ended: Ok(()),
};

fn moved(ended: Result<(), Stopped>, went: Went) -> Finding {
    stage_sense(&StageSeen { ended, ..RIGHT }, &LEFT, went)
}

fn braked(right_ma: f32, left_ma: f32) -> Finding {
    let (braking_ma, driven) = (right_ma, left_ma);
    bridge(
        &StageSeen {
            braking_ma,
            ..RIGHT
        },
        &StageSeen {
            braking_ma: driven,
            ..LEFT
        },
    )
}

/// 22 ohm at 12 V and an amplifier of so many V/A.
fn of_gain(gain: f64) -> Finding {
    let points: Vec<[f64; 2]> = (-4..=4)
        .map(|at| {
            let duty = f64::from(at) * 100.0;
            [duty, gain * duty * 12.0 / 22.0 + 3.0]
        })
        .collect();
    resistor(Ok(()), &points, 12.0, 22.0)
}

/// Weights of 50, 100 and 150 g at so many mN a count, the second one off by a share.
fn weighed(mn_per_count: f64, off: f64, after: f32) -> Finding {
    let points = [(490.0, 0.0), (981.0, off), (1471.0, 0.0)];
    let points = points.map(|(mn, off)| [mn * (1.0 + off) / mn_per_count, mn]);
    mounted::scale(&points, 7.0, after)
}

fn calibrated(pdc_no_contact: f32) -> Result<RigCalibration, String> {
    Ok(RigCalibration {
        pressure: Calibration {
            pdc_no_contact,
            ..Calibration::PAPER
        },
        unloaded_a: (0.03, 1e-4),
        newton_per_ampere: 16.4,
        date: 0,
        air_known: true,
        turned: 0,
        serial: [0; 16],
    })
}

fn zeroed(second: f32, kept: Option<&Result<(f32, bool), String>>) -> Finding {
    mounted::zero(&calibrated(2640.0), &calibrated(second), kept)
}

/// Runs of the stage at shares of the speeds that are asked for; the fastest one is slower in its first half by so many
/// mm.
fn runs(shares: [f64; 4], uneven_mm: f64) -> Finding {
    let mut places: Vec<(u32, Live)> = Vec::new();
    let (mut at_ms, mut stage_um) = (0, 5_000.0);
    for (um_s, share) in SPEEDS_UM_S.into_iter().zip(shares) {
        let speed = f64::from(um_s) * share;
        let reports = (70_000.0 / speed / 0.05) as u32;
        for way in [1.0, -1.0] {
            for report in 0..reports {
                let late = um_s == 63_000 && report == reports / 2;
                let late_um = if late { uneven_mm * 1e3 } else { 0.0 };
                places.push((
                    at_ms,
                    Live {
                        stage_um: (stage_um - way * late_um) as i32,
                        speed_um_s: (way * speed) as i32,
                        ..Live::default()
                    },
                ));
                at_ms += 50;
                stage_um += way * speed * 0.05;
            }
        }
    }
    mounted::speed(None, &places)
}

fn slid(change: impl Fn(&mut SlideSeen)) -> Finding {
    let mut seen = SlideSeen {
        force: vec![[0.0, 0.0], [1000.0, 1260.0]],
        observed: Some(SlideReport {
            properties: [Some(0.4), Some(3.0), Some(200.0)],
            background: 4.0,
            ..SlideReport::default()
        }),
        ..SlideSeen::default()
    };
    change(&mut seen);
    mounted::slide(&seen, true)
}

fn slid_with(change: impl Fn(&mut SlideReport)) -> Finding {
    slid(|seen| seen.observed.iter_mut().for_each(&change))
}

/// A second of the line: answers of 100 questions, damaged frames, the PC's ms.
fn lines(answered: u32, damaged: u32, host_ms: u64) -> Finding {
    bare::link([100, answered, damaged], 40_000, [1000, host_ms])
}

fn checked(mistake: &'static Mistake, names: &[&str], bad: &str) -> Finding {
    let all = names
        .iter()
        .map(|name| Checked::new(name, *name != bad, "1"));
    bare::checks(&all.collect::<Vec<_>>(), mistake)
}

const BOARD: [&str; 4] = ["frame", "cycles", "slot timer", "flash erase"];

fn readings(undriven: u16, counts: [[u16; 2]; 2]) -> ConverterSeen {
    ConverterSeen {
        read: 480,
        undriven,
        counts,
    }
}

fn converted(undriven: u16, counts: [[u16; 2]; 2]) -> Finding {
    bare::converter(&readings(undriven, counts))
}

fn turns(undriven: u16, low: u16, high: u16) -> Finding {
    let first = readings(0, [[low, low + 9], [4095; 2]]);
    bare::turned(&[first, readings(undriven, [[high - 9, high], [4095; 2]])])
}

fn of_parts(finger: FingerName, why: &str, error_frames: u32) -> Finding {
    sensor_but(|seen| {
        seen.finger = FingerCode::of(finger);
        seen.identity = Err(why.try_into().unwrap());
        seen.error_frames = error_frames;
    })
}

fn hand(display: bool, pressed: bool) -> HandSeen {
    HandSeen { display, pressed }
}

macro_rules! cases {
    ($($name:literal: $found:expr => $($key:literal $place:literal),*;)*) => {
        const CASES: &[Case] = &[$(($name, || $found, &[$(($key, $place)),*])),*];
    };
}

cases! {
    "supplies, low end": supplies(3.21, 11.41) => ;
    "supplies, high end": supplies(3.39, 12.59) => ;
    "3.3 V low": supplies(3.19, 12.0) => "supply" "3.3 V";
    "3.3 V high": supplies(3.41, 12.0) => "supply" "3.3 V";
    "12 V low": supplies(3.3, 11.39) => "supply" "12 V of the motors";
    "12 V high": supplies(3.3, 12.61) => "supply" "12 V of the motors";
    "a sound chip": reset_by(None) => ;
    "16 kHz off": chip_of(ChipSeen { khz: 168_016, ..CHIP }) => ;
    "17 kHz off": chip_of(ChipSeen { khz: 167_983, ..CHIP }) => "clock" "";
    "its own clock": chip_of(ChipSeen { external: false, ..CHIP }) => "clock" "";
    "no PLL": chip_of(ChipSeen { locked: false, ..CHIP }) => "clock" "";
    "last words": reset_by(Some("stack")) => "reset" "";
    "PA12 high": chip_of(ChipSeen { pa12: true, ..CHIP }) => "pa12" "";
    "as delivered": chip_of(ChipSeen { brown_out: 3, ..CHIP }) => "brown-out" "";
    "level 2": chip_of(ChipSeen { brown_out: 1, ..CHIP }) => "brown-out" "";
    "sound pins": pins_but(&[]) => ;
    "a stage on its switch": pins_but(&[(Pin::StageLeft, Tied::Floating)]) => ;
    "switches tied high":
        pins_but(&[Pin::LeverTop, Pin::StageLeft, Pin::StageRight, Pin::EStop].map(|pin| (pin, Tied::High)))
        => "tied-high" "the lever's switch PF12",
           "tied-high" "the left switch PF14",
           "tied-high" "the right switch PF15",
           "tied-high" "the emergency stop PF13";
    "no encoder": pins_but(&[(Pin::EncoderA, Tied::Floating), (Pin::EncoderB, Tied::Floating)])
        => "encoder-silent" "PD12 and PD13";
    "A open": pins_but(&[(Pin::EncoderA, Tied::Floating)]) => "encoder-line" "the encoder's A PD12";
    "B open": pins_but(&[(Pin::EncoderB, Tied::Floating)]) => "encoder-line" "the encoder's B PD13";
    "MISO and MOSI exchanged": pins_but(&[(Pin::Miso, Tied::Floating), (Pin::Mosi, Tied::High)])
        => "data-exchanged" "PA6 and PB5";
    "no sensor": pins_but(&[(Pin::Miso, Tied::Floating)]) => ;
    "no resistors":
        pins_but(&[(Pin::Select, Tied::Floating), (Pin::LeverEnable, Tied::Floating), (Pin::StageEnable, Tied::High)])
        => "pull-missing" "chip select PD14",
           "pull-missing" "the lever's EN PE13",
           "pull-missing" "the bridge's EN PC8";
    "a sound sensor": sensor_but(|_| ()) => ;
    "a garbled word": sensor_but(|seen| seen.garbled = 1) => "words" "";
    "an error frame": sensor_but(|seen| seen.error_frames = 1) => "words" "";
    "a late slot": sensor_but(|seen| seen.late = 1) => "words" "";
    "some silence": sensor_but(|seen| seen.silent = 2200) => "words" "";
    "no identity": sensor_but(|seen| seen.identity = Err("no answer".try_into().unwrap())) => "words" "";
    "silence of FF": sensor_but(|seen| (seen.silent, seen.last) = (2201, [0xFF; 2])) => "sensor-silent" "";
    "silence of 00": sensor_but(|seen| (seen.silent, seen.last) = (4400, [0; 2])) => "miso-stuck" "low";
    "quiet enough": noise_of(1.01, 2001.0) => ;
    "loud enough": noise_of(7.99, 3199.0) => ;
    "too quiet": noise_of(0.99, 2640.0) => "sensor-still" "";
    "too loud": noise_of(8.01, 2640.0) => "sensor-noisy" "";
    "leaked": noise_of(2.0, 1999.0) => "sensor-filling" "";
    "overfilled": noise_of(2.0, 3201.0) => "sensor-filling" "";
    "sound switches": right_switch(&[], &[Pin::StageRight]) => ;
    "a bridged switch": right_switch(&[], &[]) => "switch-closed" "the right switch PF15";
    "a switch of open wires": right_switch(&[Pin::StageRight], &[Pin::StageRight])
        => "switch-open" "the right switch PF15";
    "a switch that makes": right_switch(&[Pin::StageRight], &[]) => "switch-kind" "the right switch PF15";
    "the left one opens instead": right_switch(&[], &[Pin::StageLeft]) => "switches-exchanged" "the left switch PF14";
    "the left one opens with it": right_switch(&[], &[Pin::StageRight, Pin::StageLeft])
        => "switches-joined" "the left switch PF14";
    "both contacts": stop(true, true) => ;
    "no first contact": stop(false, true) => "switch-closed" "the emergency stop PF13";
    "no second contact": stop(true, false) => "stop-supply" "";
    "a short travel": sound_push(74.01) => ;
    "a long travel": sound_push(87.99) => ;
    "too short": sound_push(73.9) => "encoder-lines" "";
    "too long": sound_push(88.1) => "encoder-lines" "";
    "A and B exchanged": sound_push(-77.0) => "encoder-exchanged" "PD12 and PD13";
    "one line counts": sound_push(0.001) => "encoder-line" "A or B";
    "switches exchanged": pushed(77.0, &[Pin::StageRight], &[Pin::StageLeft])
        => "switches-exchanged" "left and right";
    "the left one is not reached": pushed(77.0, &[], &[Pin::StageRight]) => "switch-closed" "the left switch PF14";
    "the right one is not reached": pushed(77.0, &[Pin::StageLeft], &[]) => "switch-closed" "the right switch PF15";
    "an amplifier at rest": resting(Some([2107.0, 15.9])) => ;
    "below the middle": resting(Some([1987.0, 4.0])) => "current-offset" "";
    "above the middle": resting(Some([2109.0, 4.0])) => "current-offset" "";
    "noise": resting(Some([2048.0, 16.1])) => "current-noise" "";
    "at its end": resting(Some([4095.0, 0.0])) => "current-open" "PA3";
    "floating": resting(Some([372.0, 4.0])) => "current-open" "PA3";
    "no conversions": resting(None) => "current-open" "PA3";
    "squeezed": squeezed(Ok(())) => ;
    "not squeezed": squeezed(Err(Stopped::NobodySqueezed)) => "finger-dead" "";
    "no words meanwhile": squeezed(Err(Stopped::Silent)) => "sensor-silent" "";
    "up": lever_sense(&lever(-1600, false, Ok(())), Went::There) => ;
    "down": lever_sense(&lever(-1600, false, Ok(())), Went::Back) => "lever-dir" "";
    "nowhere": lever_sense(&lever(-1600, false, Ok(())), Went::Nowhere) => "lever-still" "";
    "stopped on its way": lever_sense(&lever(-400, false, Err(Stopped::EStop)), Went::There) => "stopped" "the lever";
    "0.1 mm of play": up_down_up(Ok(()), false, 3360) => ;
    "more up than down": up_down_up(Ok(()), false, 3361) => "lever-steps" "";
    "fewer up than down": up_down_up(Ok(()), false, 3039) => "lever-steps" "";
    "open 2 mm below": up_down_up(Ok(()), true, 3200) => "switch-open" "the lever's switch PF12";
    "never open": up_down_up(Err(Stopped::TopStaysClosed), false, 3200) => "switch-closed" "the lever's switch PF12";
    "pressed on its way": up_down_up(Err(Stopped::Pressed), false, 3200) => "stopped" "the lever";
    "3.81 mm": lever_scale(3.81) => ;
    "4.19 mm": lever_scale(4.19) => ;
    "3.7 mm": lever_scale(3.7) => "lever-steps" "";
    "2.9 mm": lever_scale(2.9) => "lever-steps" "";
    "4.3 mm": lever_scale(4.3) => "lever-steps" "";
    "2 mm": lever_scale(2.0) => "lever-scale" "";
    "8 mm": lever_scale(8.0) => "lever-scale" "";
    "foam within play": pressed_foam(6240, Ok(())) => ;
    "foam beyond play": pressed_foam(6239, Ok(())) => "lever-steps" "";
    "foam that stops it": pressed_foam(6400, Err(Stopped::EStop)) => "stopped" "the lever";
    "a sound stage": moved(Ok(()), Went::There) => ;
    "the stage at its switch": moved(Err(Stopped::Limit), Went::There) => "stopped" "the stage";
    "stopped on its way back": stage_sense(&RIGHT, &StageSeen { ended: Err(Stopped::EStop), ..LEFT }, Went::There)
        => "stopped" "the stage";
    "to the left": moved(Err(Stopped::Backwards), Went::Back) => "stage-reversed" "";
    "to the left, and not back": stage_sense(&RIGHT, &StageSeen { driven_ma: 20.0, moved_um: 0, ..LEFT }, Went::Back)
        => "bridge-exchanged" "PC6 and PC7";
    "no current":
        stage_sense(&StageSeen { driven_ma: 24.0, ended: Err(Stopped::NoCurrent), ..RIGHT }, &LEFT, Went::Nowhere)
        => "stage-still" "";
    "current, and it stands":
        stage_sense(&StageSeen { driven_ma: 26.0, ended: Err(Stopped::NoCount), ..RIGHT }, &LEFT, Went::Nowhere)
        => "stage-stuck" "";
    "counts down": moved(Err(Stopped::Backwards), Went::There) => "encoder-exchanged" "PD12 and PD13";
    "counts nothing": moved(Err(Stopped::NoCount), Went::There) => "encoder-line" "A or B";
    "current of the other sign": stage_sense(&StageSeen { driven_ma: -26.0, ..RIGHT }, &LEFT, Went::There)
        => "current-reversed" "";
    "current of the other sign back": stage_sense(&RIGHT, &StageSeen { driven_ma: 26.0, ..LEFT }, Went::There)
        => "current-reversed" "";
    "brakes": braked(-20.1, 20.1) => ;
    "coasts to the right": braked(-19.9, 60.0) => "bridge-decay" "";
    "coasts to the left": braked(-60.0, 19.9) => "bridge-decay" "";
    "stopped before it could brake": bridge(&StageSeen { ended: Err(Stopped::Limit), ..RIGHT }, &LEFT)
        => "stopped" "the stage";
    "stopped before it could brake back": bridge(&RIGHT, &StageSeen { ended: Err(Stopped::Limit), ..LEFT })
        => "stopped" "the stage";
    "a gain of 0.91": of_gain(0.91) => ;
    "a gain of 1.09": of_gain(1.09) => ;
    "a gain of 0.89": of_gain(0.89) => "current-gain" "";
    "a gain of 1.11": of_gain(1.11) => "current-gain" "";
    "no gain": of_gain(0.05) => "stage-still" "";
    "a negative gain": of_gain(-1.0) => "current-reversed" "";
    "a motor in the resistor's place": resistor(Err(Stopped::Moves), &[], 12.0, 22.0)
        => "motor-connected" "the stage";
    "an emergency stop in the ramp": resistor(Err(Stopped::EStop), &[], 12.0, 22.0) => "stopped" "the stage";
    "an empty ramp": resistor(Ok(()), &[], 12.0, 22.0) => "stopped" "the ramp";
    "a store that keeps": store(&Ok([7, 7])) => ;
    "a store that does not": store(&Ok([7, 0])) => "store" "";
    "a store that refuses": store(&Err("full".to_owned())) => "store" "";
    "a watchdog": watchdog(Some(Reset::Watchdog)) => ;
    "another start": watchdog(Some(Reset::Pin)) => "watchdog" "";
    "no start": watchdog(None) => "watchdog" "";
    "weights on a line": weighed(11.5, 0.09, 7.9) => ;
    "a hard finger": weighed(22.9, 0.0, 0.0) => ;
    "a soft finger": weighed(5.8, 0.0, 0.0) => ;
    "a weight that leans": weighed(11.5, 0.2, 0.0) => "scale-line" "";
    "weights that are heavier": weighed(23.1, 0.0, 0.0) => "scale-far" "";
    "weights that are lighter": weighed(5.7, 0.0, 0.0) => "scale-far" "";
    "P_DC that falls": weighed(-11.5, 0.0, 0.0) => "finger-dead" "";
    "P_DC that stands": weighed(1e4, 0.0, 0.0) => "finger-dead" "";
    "P_DC that falls under a weight": mounted::scale(&[[42.6, 490.0], [85.3, 981.0], [127.9, 1471.0]], -8.1, 0.0)
        => "finger-leaks" "";
    "less P_DC afterwards": weighed(11.5, 0.0, -8.1) => "finger-leaks" "";
    "more P_DC afterwards": weighed(11.5, 0.0, 8.1) => "finger-leaks" "";
    "the same air": zeroed(2647.9, Some(&Ok((11.2, true)))) => ;
    "another air": zeroed(2631.9, None) => "zero-drifts" "";
    "a scale that is not kept": zeroed(2640.0, Some(&Ok((11.2, false)))) => "store" "";
    "a scale that is refused": zeroed(2640.0, Some(&Err("busy".to_owned()))) => "store" "";
    "a rig that does not home": mounted::zero(&Err("stage".to_owned()), &Err("stage".to_owned()), None) => "fault" "";
    "even runs": runs([1.0; 4], 0.2) => ;
    "runs 1.9 % off": runs([1.019, 0.981, 1.0, 1.0], 0.0) => ;
    "a run 2.1 % too slow": runs([1.0, 1.0, 0.979, 1.0], 0.0) => "stage-speed" "";
    "a run 2.1 % too fast": runs([1.0, 1.0, 1.0, 1.021], 0.0) => "stage-speed" "";
    "a run that sticks": runs([1.0; 4], 0.4) => "stage-speed" "uneven";
    "no runs": mounted::speed(None, &[]) => "stage-speed" "runs";
    "a run with a fault": mounted::speed(Some("jammed"), &[]) => "fault" "";
    "a sound slide": slid(|_| ()) => ;
    "a late slot": slid(|seen| seen.counts.late_slots = 1) => "words" "";
    "bad parity": slid(|seen| seen.counts.parity_errors = 1) => "words" "";
    "an error frame": slid(|seen| seen.counts.error_frames = 1) => "words" "";
    "a lost sample": slid(|seen| seen.counts.lost_samples = 1) => "samples-lost" "";
    "a still slide": slid_with(|slide| slide.roughness_is_bound = true) => "slide-quiet" "";
    "no roughness": slid_with(|slide| slide.properties[1] = None) => "slide-quiet" "";
    "no traction": slid_with(|slide| slide.properties[0] = None) => "slide-traction" "";
    "traction that pushes": slid_with(|slide| slide.properties[0] = Some(-0.1)) => "slide-traction" "";
    "no slide": slid(|seen| seen.observed = None) => "fault" "";
    "a sound finger's pins": finger_pins(&PinsSeen { up: u16::MAX, down: u16::MAX }) => ;
    "a cut wire of the cell": of_parts(FingerName::Analog, "check its four wires", 2200) => "cell" "";
    "a part that is off": of_parts(FingerName::Mems, "the IIS3DWB is off", 2200) => "part" "";
    "a few damaged words": of_parts(FingerName::Mems, "the IIS3DWB is off", 220) => "words" "";
    "a still analog finger": noise(&SensorSeen { finger: FingerCode::of(FingerName::Analog), pac: [0.0, 0.5],
        pdc: [1000.0, 0.5], ..sensor_second() }) => ;
    "a display": bare::display(&hand(true, false), true) => ;
    "a display that is not there": bare::display(&hand(false, false), false) => "display-silent" "";
    "a dark display": bare::display(&hand(true, false), false) => "display-dark" "";
    "a button": bare::button(&hand(true, false), &hand(true, true)) => ;
    "a stuck button": bare::button(&hand(true, true), &hand(true, true)) => "button-stuck" "";
    "a dead button": bare::button(&hand(true, false), &hand(true, false)) => "button-dead" "";
    "a buzzer": bare::buzzer(true) => ;
    "no buzzer": bare::buzzer(false) => "buzzer" "";
    "a sound line": lines(100, 0, 1002) => ;
    "a lost answer": lines(99, 0, 1000) => "link" "";
    "a damaged frame": lines(100, 1, 1000) => "link" "";
    "a slow clock": lines(100, 0, 1004) => "clock" "by the PC's";
    "a fast clock": lines(100, 0, 996) => "clock" "by the PC's";
    "a bare chip": bare::clocks(&ChipSeen { brown_out: 3, ..CHIP }, Reset::Power, None) => ;
    "a bare chip by its own clock": bare::clocks(&ChipSeen { external: false, ..CHIP }, Reset::Power, None)
        => "clock" "";
    "sound checks": checked(&m::KERNEL, &BOARD, "") => ;
    "no checks": checked(&m::KERNEL, &[], "") => "kernel" "";
    "a wrong kernel": checked(&m::KERNEL, &BOARD, "frame") => "kernel" "";
    "a slow kernel": checked(&m::KERNEL, &BOARD, "cycles") => "cycles" "";
    "a wrong timer": checked(&m::TIMER, &BOARD, "slot timer") => "timer" "";
    "a wrong flash": checked(&m::FLASH, &BOARD, "flash erase") => "flash" "";
    "a converter": converted(0, [[0, 9], [4015, 4095]]) => ;
    "an undriven reading": converted(1, [[0, 4095], [4095; 2]]) => "sensor-silent" "the MCP3202";
    "no null bit": converted(480, [[u16::MAX; 2]; 2]) => "sensor-silent" "the MCP3202";
    "zeros": converted(0, [[0; 2]; 2]) => "miso-stuck" "low";
    "CH1 elsewhere": converted(0, [[0, 9], [4014, 4095]]) => "converter-input" "";
    "a whole turn": turns(0, 80, 4015) => ;
    "a turn with a silence": turns(1, 80, 4015) => "sensor-silent" "the MCP3202";
    "a turn from GND": turns(0, 80, 4014) => "potentiometer" "not to 3V3";
    "a turn from 3.3 V": turns(0, 81, 4015) => "potentiometer" "not to GND";
    "half a turn": turns(0, 81, 4014) => "potentiometer" "to neither end";
    "a slide that failed": slid(|seen| seen.failed = Some("force".to_owned())) => "fault" "";
}

/// Names of the cases that are judged otherwise than they should be.
fn failing() -> Vec<&'static str> {
    let wrong = CASES.iter().filter(|(_, measured, named)| {
        let found = measured().named;
        let found: Vec<_> = found
            .iter()
            .map(|one| (one.mistake.key, one.place))
            .collect();
        found != *named
    });
    wrong.map(|(name, ..)| *name).collect()
}

#[test]
fn mistakes_are_named_at_both_sides_of_their_limits() {
    assert_eq!(failing(), [""; 0]);
}

#[test]
fn no_check_could_be_left_out() {
    let mut checks = 0;
    for (file, source) in [
        ("bringup/judge.rs", include_str!("../judge.rs")),
        ("judge/mounted.rs", include_str!("mounted.rs")),
        ("judge/bare.rs", include_str!("bare.rs")),
    ] {
        for (text, line) in source.lines().zip(1..) {
            if !text.contains(".wrong(") {
                continue;
            }
            checks += 1;
            OFF.set(Some((file, line)));
            let failing = failing();
            OFF.set(None);
            assert!(!failing.is_empty(), "{file}:{line} could be left out");
        }
    }
    assert!(checks > 85, "{checks}");
}
