//! What measurements of a new rig mean: limits, and which mistake shows like this. Pure functions of what the board and
//! the person at it said.

pub(crate) mod bare;
pub mod mounted;

use tactus_core::sensor::FingerName;
use tactus_core::wire::Reset;
use tactus_core::wire::bringup::limits::{
    BRAKING_A, CURRENT_RMS, CURRENT_ZERO, LEVER_PLAY, WEAK_A,
};
use tactus_core::wire::bringup::{
    ChipSeen, LeverSeen, Look, Pin, PinsSeen, SensorSeen, StageSeen, Stopped, Tied,
};

use super::mistakes::{self as m, Mistake, Named};

/// Supplies, V: from, to.
pub(crate) const LOGIC_V: (f64, f64) = (3.2, 3.4);
/// Of the motors, V.
pub(crate) const MOTOR_V: (f64, f64) = (11.4, 12.6);
/// Of the core, kHz, and how far it may be off by the clock of the same quartz.
pub(crate) const CORE_KHZ: (u32, u32) = (168_000, 16);
/// Beyond this from the middle the amplifier is not there, or at its end, counts: 1.1 A.
const NOT_THERE: f32 = 1400.0;
/// From one limit switch of the stage to the other, mm: 77, and as far as hands push on to the hard stops.
pub const TRAVEL_MM: (f64, f64) = (74.0, 88.0);
/// The encoder, counts a mm.
pub(super) const COUNTS_PER_MM: f64 = 1000.0;
/// Way down that is measured with a caliper, mm, and what it may be off.
pub(crate) const LEVER_MM: (f64, f64) = (4.0, 0.2);
/// A driver's other step settings are a factor of 2 off; beyond this a way is one of these and no lost steps.
const OTHER_SCALE: (f64, f64) = (0.7, 1.4);
/// See [`WEAK_A`] and [`BRAKING_A`], mA.
const WEAK_MA: f32 = 1e3 * WEAK_A;
pub(super) const BRAKING_MA: f32 = 1e3 * BRAKING_A;
/// Gain of the amplifier, V/A: from, to.
pub const GAIN: (f64, f64) = (0.9, 1.1);
/// Most damaged words in a second, of 4400.
const WORDS: u32 = 0;

/// The finding of a step.
#[derive(Clone, Debug, Default)]
pub struct Finding {
    /// In a sentence.
    pub saw: String,
    /// The mistakes; none where the step has passed.
    pub named: Vec<Named>,
    /// Counts of P_DC and weights, mN, of the force scale.
    pub points: Vec<[f64; 2]>,
}

impl Finding {
    fn new(saw: String) -> Self {
        Self {
            saw,
            ..Self::default()
        }
    }

    // for the test that switches each check off
    #[track_caller]
    fn wrong(mut self, is: bool, mistake: &'static Mistake, place: &'static str) -> Self {
        #[cfg(test)]
        let is = is && !tests::is_off(std::panic::Location::caller());
        if is {
            self.named.push(Named { mistake, place });
        }
        self
    }

    /// True if nothing is wrong.
    pub fn passed(&self) -> bool {
        self.named.is_empty()
    }
}

fn within<T: PartialOrd>(value: T, (low, high): (T, T)) -> bool {
    value >= low && value <= high
}

/// The supplies by a multimeter, V.
pub fn supplies(logic_v: f64, motor_v: f64) -> Finding {
    Finding::new(format!(
        "{logic_v:.2} V at the pin 3V3, {motor_v:.1} V at the motors' drivers"
    ))
    .wrong(!within(logic_v, LOGIC_V), &m::SUPPLY, "3.3 V")
    .wrong(!within(motor_v, MOTOR_V), &m::SUPPLY, "12 V of the motors")
}

/// Clocks, pins and option bytes.
pub fn chip(seen: &ChipSeen, reset: Reset, last_words: Option<&str>) -> Finding {
    let ChipSeen {
        khz,
        external,
        locked,
        pa12,
        brown_out,
    } = *seen;
    let said = last_words.map_or(String::new(), |words| format!(", last words: {words}"));
    let has = |is| if is { "there" } else { "missing" };
    let saw = format!(
        "{khz} kHz, 8 MHz {}, PLL {}, PA12 {}, started by {reset:?}{said}, brown-out level {}",
        has(external),
        has(locked),
        if pa12 { "high" } else { "low" },
        3_u8.saturating_sub(brown_out),
    );
    let clock = external && locked && khz.abs_diff(CORE_KHZ.0) <= CORE_KHZ.1;
    Finding::new(saw)
        .wrong(last_words.is_some(), &m::RESET, "")
        .wrong(!clock, &m::CLOCK, "")
        .wrong(pa12, &m::PA12, "")
        .wrong(brown_out != 0, &m::BROWN_OUT, "")
}

/// Judges the parts on the pins, the sensor selected and the stage anywhere.
pub fn pins(seen: &PinsSeen) -> Finding {
    let mut finding = finger_pins(seen);
    let tied = |pin| seen.tied(pin);
    for pin in [Pin::LeverTop, Pin::StageLeft, Pin::StageRight, Pin::EStop] {
        finding = finding.wrong(tied(pin) == Tied::High, &m::TIED_HIGH, place(pin));
    }
    let [a, b] = [Pin::EncoderA, Pin::EncoderB].map(|pin| tied(pin) == Tied::Floating);
    finding = finding
        .wrong(a && b, &m::ENCODER_SILENT, "PD12 and PD13")
        .wrong(a && !b, &m::ENCODER_LINE, place(Pin::EncoderA))
        .wrong(b && !a, &m::ENCODER_LINE, place(Pin::EncoderB));
    for pin in [Pin::LeverEnable, Pin::StageEnable] {
        finding = finding.wrong(tied(pin) != Tied::Low, &m::PULL_MISSING, place(pin));
    }
    finding
}

/// The same of a probe without motors.
pub(crate) fn finger_pins(seen: &PinsSeen) -> Finding {
    let tied = |pin| seen.tied(pin);
    let words = Pin::ALL.map(|pin| format!("{}: {}", place(pin), word(tied(pin))));
    let exchanged = tied(Pin::Miso) == Tied::Floating && tied(Pin::Mosi) != Tied::Floating;
    let open = tied(Pin::Select) != Tied::High;
    Finding::new(words.join(", "))
        .wrong(exchanged, &m::DATA_EXCHANGED, "PA6 and PB5")
        .wrong(open, &m::PULL_MISSING, place(Pin::Select))
}

fn word(tied: Tied) -> &'static str {
    match tied {
        Tied::Floating => "nothing",
        Tied::High => "high",
        Tied::Low => "low",
    }
}

/// A pin in words.
pub fn place(pin: Pin) -> &'static str {
    match pin {
        Pin::LeverTop => "the lever's switch PF12",
        Pin::StageLeft => "the left switch PF14",
        Pin::StageRight => "the right switch PF15",
        Pin::EStop => "the emergency stop PF13",
        Pin::EncoderA => "the encoder's A PD12",
        Pin::EncoderB => "the encoder's B PD13",
        Pin::Miso => "MISO PA6",
        Pin::Mosi => "MOSI PB5",
        Pin::Select => "chip select PD14",
        Pin::LeverEnable => "the lever's EN PE13",
        Pin::StageEnable => "the bridge's EN PC8",
    }
}

/// Who the sensor is, and whether its words come whole and in time.
pub fn sensor(seen: &SensorSeen) -> Finding {
    let who = match &seen.identity {
        Ok(who) | Err(who) => who.as_str(),
    };
    let saw = format!(
        "{who}; words: {}, {} garbled, {} error frames, {} silent, {} late; the last one {:02X} {:02X}",
        seen.words,
        seen.garbled,
        seen.error_frames,
        seen.silent,
        seen.late,
        seen.last[0],
        seen.last[1]
    );
    // a short reads the same for ever, and a pull-up reads FF as a short to 3.3 V does
    let silent = 2 * seen.silent > seen.words;
    let low = silent && seen.last == [0, 0];
    let damaged = seen.garbled + seen.error_frames + seen.silent + seen.late;
    // a part that fails costs a quarter of the words or more, a cable a few
    let fails = seen.identity.is_err() && 20 * damaged > seen.words;
    let cell = fails && who.contains("four wires");
    let part = fails && !cell && PARTS.iter().any(|part| who.contains(part));
    let other = cell || part;
    let words = damaged > WORDS || seen.identity.is_err();
    Finding::new(saw)
        .wrong(low, &m::MISO_STUCK, "low")
        .wrong(cell, &m::CELL, "")
        .wrong(part, &m::PART, "")
        .wrong(silent && !low && !other, &m::SENSOR_SILENT, "")
        .wrong(!silent && !other && words, &m::WORDS, "")
}

/// Parts that a `mems` has.
const PARTS: [&str; 2] = ["IIS3DWB", "ADS1220"];

fn finger(seen: &SensorSeen) -> FingerName {
    let number = usize::from(seen.finger.0);
    FingerName::ALL.get(number).copied().unwrap_or_default()
}

/// Judges the sensor's readings without finger on anything.
pub fn noise(seen: &SensorSeen) -> Finding {
    let ([_, pac], [pdc, pdc_rms]) = (seen.pac, seen.pdc);
    let at_rest = finger(seen).parts().model.at_rest;
    let ((still, noisy), (low, high)) = (at_rest.pac_noise_counts, at_rest.pdc_counts);
    Finding::new(format!(
        "P_AC {pac:.2} counts rms, P_DC {pdc:.0} counts, {pdc_rms:.2} rms"
    ))
    .wrong(pac < still, &m::SENSOR_STILL, "")
    .wrong(pac > noisy, &m::SENSOR_NOISY, "")
    .wrong(!(low..=high).contains(&pdc), &m::SENSOR_FILLING, "")
}

/// The switches in the order in which somebody presses them.
pub(crate) const SWITCHES: [Pin; 4] = [Pin::StageLeft, Pin::StageRight, Pin::LeverTop, Pin::EStop];

fn opens(look: &Look, pin: Pin) -> bool {
    match pin {
        Pin::StageLeft => look.stage_left,
        Pin::StageRight => look.stage_right,
        Pin::LeverTop => look.lever_top,
        _ => look.e_stop,
    }
}

/// Each switch before, while and after it was pressed by hand.
pub fn switches(looks: &[[Look; 2]; 4]) -> Finding {
    let mut saw = Vec::new();
    let mut finding = Finding::default();
    for (pin, [let_go, pressed]) in SWITCHES.into_iter().zip(looks) {
        let (before, now) = (opens(let_go, pin), opens(pressed, pin));
        let others = SWITCHES.into_iter().filter(|other| *other != pin);
        let changed = others.filter(|other| opens(let_go, *other) != opens(pressed, *other));
        let other = changed.clone().next();
        saw.push(format!(
            "{}: {}, pressed {}",
            place(pin),
            state(before),
            state(now)
        ));
        finding = match (before, now, other) {
            (false, true, None) => finding,
            (false, true, Some(other)) => finding.wrong(true, &m::SWITCHES_JOINED, place(other)),
            (_, _, Some(other)) => finding.wrong(true, &m::SWITCHES_EXCHANGED, place(other)),
            (false, false, None) => finding.wrong(true, &m::SWITCH_CLOSED, place(pin)),
            (true, true, None) => finding.wrong(true, &m::SWITCH_OPEN, place(pin)),
            (true, false, None) => finding.wrong(true, &m::SWITCH_KIND, place(pin)),
        };
    }
    finding.saw = saw.join("; ");
    finding
}

fn state(open: bool) -> &'static str {
    if open { "open" } else { "closed" }
}

/// True if the emergency stop takes the motors' supply, by a person's word.
pub fn stop(seen: bool, supply_gone: bool) -> Finding {
    let gone = if supply_gone { "gone" } else { "still there" };
    Finding::new(format!(
        "contact {}, the motors' supply {gone}",
        state(seen)
    ))
    .wrong(!seen, &m::SWITCH_CLOSED, place(Pin::EStop))
    .wrong(!supply_gone, &m::STOP_SUPPLY, "")
}

/// Encoder and switches of a stage that a hand has pushed from its left switch to its right one.
pub fn by_hand(left: &Look, right: &Look) -> Finding {
    let mm = f64::from(right.encoder.wrapping_sub(left.encoder)) / COUNTS_PER_MM;
    let saw = format!(
        "left {} and right {} at the left end, left {} and right {} at the right one, {mm:.2} mm by the encoder",
        state(left.stage_left),
        state(left.stage_right),
        state(right.stage_left),
        state(right.stage_right)
    );
    let exchanged = left.stage_right && right.stage_left && !left.stage_left;
    let counts = mm.abs() > 1.0;
    Finding::new(saw)
        .wrong(exchanged, &m::SWITCHES_EXCHANGED, "left and right")
        .wrong(
            !exchanged && !left.stage_left,
            &m::SWITCH_CLOSED,
            place(Pin::StageLeft),
        )
        .wrong(
            !exchanged && !right.stage_right,
            &m::SWITCH_CLOSED,
            place(Pin::StageRight),
        )
        .wrong(!counts, &m::ENCODER_LINE, "A or B")
        .wrong(counts && mm < 0.0, &m::ENCODER_EXCHANGED, "PD12 and PD13")
        .wrong(
            counts && !within(mm.abs(), TRAVEL_MM),
            &m::ENCODER_LINES,
            "",
        )
}

/// The motor's current at rest.
pub fn rest(look: &Look) -> Finding {
    let Some([mean, rms]) = look.current else {
        return Finding::new("nothing is converted".to_owned()).wrong(
            true,
            &m::CURRENT_OPEN,
            "PA3",
        );
    };
    let off = (mean - CURRENT_ZERO.0).abs();
    Finding::new(format!("{mean:.0} counts, noise {rms:.1} rms"))
        .wrong(off > NOT_THERE, &m::CURRENT_OPEN, "PA3")
        .wrong(
            within(off, (CURRENT_ZERO.1, NOT_THERE)),
            &m::CURRENT_OFFSET,
            "",
        )
        .wrong(rms > CURRENT_RMS, &m::CURRENT_NOISE, "")
}

/// True if the finger was squeezed in the hand.
pub fn squeezed(done: Result<(), Stopped>) -> Finding {
    let saw = match done {
        Ok(()) => "squeezed, and left alone".to_owned(),
        Err(why) => why.to_string(),
    };
    let finding = Finding::new(saw);
    match done {
        Ok(()) => finding,
        Err(Stopped::Silent) => finding.wrong(true, &m::SENSOR_SILENT, ""),
        Err(_) => finding.wrong(true, &m::FINGER_DEAD, ""),
    }
}

/// Where something went, as a person sees it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Went {
    /// Where it should.
    There,
    /// The other way.
    Back,
    /// Nowhere.
    Nowhere,
}

impl Went {
    /// In the order of the answers that a person chooses from.
    pub const ALL: [Self; 3] = [Self::There, Self::Back, Self::Nowhere];
}

fn ended(ended: Result<(), Stopped>) -> String {
    ended.map_or_else(|why| format!("; stopped: {why}"), |()| String::new())
}

pub(crate) fn lever_sense(seen: &LeverSeen, went: Went) -> Finding {
    let saw = format!(
        "{} steps down, seen: {went:?}{}",
        seen.steps,
        ended(seen.ended)
    );
    Finding::new(saw)
        .wrong(seen.ended.is_err(), &m::STOPPED, "the lever")
        .wrong(went == Went::Nowhere, &m::LEVER_STILL, "")
        .wrong(went == Went::Back, &m::LEVER_DIR, "")
}

/// The lever up to its switch, 2 mm down, and up again.
pub(crate) fn lever_switch(up: &LeverSeen, down: &LeverSeen, back: &LeverSeen) -> Finding {
    let play = (-back.steps - down.steps).abs();
    let saw = format!(
        "{} steps up to its switch, {} down, {} up again{}{}{}",
        -up.steps,
        down.steps,
        -back.steps,
        ended(up.ended),
        ended(down.ended),
        ended(back.ended)
    );
    let stuck = up.ended == Err(Stopped::TopStaysClosed);
    let other = [up, down, back].iter().any(|one| one.ended.is_err()) && !stuck;
    let moved = !stuck && !other;
    Finding::new(saw)
        .wrong(stuck, &m::SWITCH_CLOSED, place(Pin::LeverTop))
        .wrong(other, &m::STOPPED, "the lever")
        .wrong(moved && down.at_top, &m::SWITCH_OPEN, place(Pin::LeverTop))
        .wrong(
            moved && !down.at_top && play > LEVER_PLAY,
            &m::LEVER_STEPS,
            "",
        )
}

/// Judges the lever's way down by a caliper, mm, where it was asked for [`LEVER_MM`].
pub(crate) fn lever_scale(moved_mm: f64) -> Finding {
    let (asked, off) = LEVER_MM;
    let scale = moved_mm / asked;
    let good = (moved_mm - asked).abs() <= off;
    let other = !within(scale, OTHER_SCALE);
    Finding::new(format!(
        "{moved_mm:.2} mm by the caliper, {asked:.1} mm by its steps"
    ))
    .wrong(!good && other, &m::LEVER_SCALE, "")
    .wrong(!good && !other, &m::LEVER_STEPS, "")
}

/// The lever against a block of foam, again and again: steps down and up.
pub fn foam(ways: &[[LeverSeen; 2]]) -> Finding {
    let plays: Vec<i32> = ways
        .iter()
        .map(|[down, up]| (down.steps + up.steps).abs())
        .collect();
    let most = plays.iter().copied().max().unwrap_or(0);
    let stopped = ways.iter().flatten().find_map(|seen| seen.ended.err());
    let saw = format!(
        "{} times down and up again within {most} steps{}",
        plays.len(),
        ended(stopped.map_or(Ok(()), Err))
    );
    Finding::new(saw)
        .wrong(stopped.is_some(), &m::STOPPED, "the lever")
        .wrong(stopped.is_none() && most > LEVER_PLAY, &m::LEVER_STEPS, "")
}

pub(crate) fn stage_sense(right: &StageSeen, left: &StageSeen, went: Went) -> Finding {
    let way = |seen: &StageSeen| {
        format!(
            "{:.2} mm with {:.0} mA at a duty of {:.2}{}",
            f64::from(seen.moved_um) * 1e-3,
            seen.driven_ma,
            seen.duty,
            ended(seen.ended)
        )
    };
    let saw = format!("right: {}; left: {}; seen: {went:?}", way(right), way(left));
    let finding = Finding::new(saw);
    let stopped = |seen: &StageSeen| match seen.ended {
        Ok(()) | Err(Stopped::Backwards | Stopped::NoCount | Stopped::NoCurrent) => false,
        Err(_) => true,
    };
    if stopped(right) || stopped(left) {
        return finding.wrong(true, &m::STOPPED, "the stage");
    }
    let weak = |seen: &StageSeen| seen.driven_ma.abs() < WEAK_MA;
    match went {
        // DIR low keeps a bridge off whose DIR is its PWM
        Went::Back if weak(left) && left.moved_um.abs() < 500 => {
            finding.wrong(true, &m::BRIDGE_EXCHANGED, "PC6 and PC7")
        }
        Went::Back => finding.wrong(true, &m::STAGE_REVERSED, ""),
        Went::Nowhere if weak(right) => finding.wrong(true, &m::STAGE_STILL, ""),
        Went::Nowhere => finding.wrong(true, &m::STAGE_STUCK, ""),
        Went::There => finding
            .wrong(
                right.ended == Err(Stopped::Backwards),
                &m::ENCODER_EXCHANGED,
                "PD12 and PD13",
            )
            .wrong(
                right.ended == Err(Stopped::NoCount),
                &m::ENCODER_LINE,
                "A or B",
            )
            .wrong(
                right.ended.is_ok() && (right.driven_ma < -WEAK_MA || left.driven_ma > WEAK_MA),
                &m::CURRENT_REVERSED,
                "",
            ),
    }
}

/// True if the bridge brakes, a move to each side.
pub fn bridge(right: &StageSeen, left: &StageSeen) -> Finding {
    let saw = format!(
        "{:.0} and {:.0} mA without duty, the stage still moving{}{}",
        right.braking_ma,
        left.braking_ma,
        ended(right.ended),
        ended(left.ended)
    );
    let stopped = right.ended.is_err() || left.ended.is_err();
    let brakes = right.braking_ma < -BRAKING_MA && left.braking_ma > BRAKING_MA;
    Finding::new(saw)
        .wrong(stopped, &m::STOPPED, "the stage")
        .wrong(!stopped && !brakes, &m::BRIDGE_DECAY, "")
}

/// Currents, mA, of a resistor at duties, thousandths: slope, and where it crosses no duty, by least squares.
pub fn line(points: &[[f64; 2]]) -> Option<(f64, f64)> {
    let n = points.len() as f64;
    let mean = |of: fn(&[f64; 2]) -> f64| points.iter().map(of).sum::<f64>() / n;
    let (x, y) = (mean(|p| p[0]), mean(|p| p[1]));
    let square: f64 = points.iter().map(|p| (p[0] - x) * (p[0] - x)).sum();
    let both: f64 = points.iter().map(|p| (p[0] - x) * (p[1] - y)).sum();
    (square > 0.0).then(|| (both / square, y - both / square * x))
}

/// The amplifier's gain by a resistor of so many ohm at so many V in the place of the stage's motor: duties,
/// thousandths, and currents, mA.
pub fn resistor(
    done: Result<(), Stopped>,
    points: &[[f64; 2]],
    supply_v: f64,
    ohm: f64,
) -> Finding {
    if let Err(why) = done {
        let mistake = match why {
            Stopped::Moves => &m::MOTOR_CONNECTED,
            _ => &m::STOPPED,
        };
        return Finding::new(why.to_string()).wrong(true, mistake, "the stage");
    }
    let Some((slope, zero_ma)) = line(points) else {
        return Finding::new("no points".to_owned()).wrong(true, &m::STOPPED, "the ramp");
    };
    let gain = slope * ohm / supply_v;
    Finding::new(format!(
        "{gain:.3} V/A by {ohm:.1} ohm at {supply_v:.1} V, {zero_ma:.1} mA without duty"
    ))
    .wrong(gain.abs() < 0.1, &m::STAGE_STILL, "")
    .wrong(gain <= -0.1, &m::CURRENT_REVERSED, "")
    .wrong(gain >= 0.1 && !within(gain, GAIN), &m::CURRENT_GAIN, "")
}

/// A record of the store, written and read.
pub fn store(done: &Result<[u32; 2], String>) -> Finding {
    match done {
        Ok([before, after]) => Finding::new(format!(
            "the skin's record, {before} mJ, is {after} mJ after writing it"
        ))
        .wrong(before != after, &m::STORE, ""),
        Err(why) => Finding::new(why.clone()).wrong(true, &m::STORE, ""),
    }
}

/// Judges the reset that started the board after the firmware hung.
pub fn watchdog(reset: Option<Reset>) -> Finding {
    let saw = match reset {
        Some(reset) => format!("started again by {reset:?}"),
        None => "no start in 10 s".to_owned(),
    };
    Finding::new(saw).wrong(reset != Some(Reset::Watchdog), &m::WATCHDOG, "")
}

#[cfg(test)]
mod tests;
