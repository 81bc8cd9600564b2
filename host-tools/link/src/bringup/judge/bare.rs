//! Measurements of bare boards and handhelds: the line, the chip by itself, a converter with a potentiometer, display,
//! button, buzzer.

use tactus_core::wire::Reset;
use tactus_core::wire::bringup::{Checked, ChipSeen, ConverterSeen, HandSeen};

use super::{Finding, Mistake, chip, m};

/// Counts near 0 V and near 3.3 V, of 4095: a potentiometer's last 2 %, and a converter's errors.
pub(crate) const LOW: u16 = 80;
/// See [`LOW`].
pub(crate) const HIGH: u16 = 4015;
/// Share that the board's seconds may be off by the PC's: what USB delays a frame by, and not the chip's own clock,
/// which is off by up to 1 %.
const SECONDS_OFF: f64 = 0.003;

pub(crate) fn seconds() -> String {
    format!("seconds within {:.1} %", 100.0 * SECONDS_OFF)
}

/// Questions, their answers and damaged frames; bytes of series; how long it took by the board and by the PC, ms.
pub(crate) fn link(traffic: [u32; 3], bytes: usize, [board_ms, host_ms]: [u64; 2]) -> Finding {
    let [asked, answered, damaged] = traffic;
    let off = board_ms as f64 / (host_ms as f64).max(1.0) - 1.0;
    let lost = answered < asked || damaged > 0;
    Finding::new(format!(
        "{answered} of {asked} answers, {damaged} damaged frames, {bytes} bytes of readings in {:.1} s; the board's \
         seconds {:+.2} % off the PC's",
        host_ms as f64 * 1e-3,
        100.0 * off
    ))
    .wrong(lost, &m::LINK, "")
    .wrong(off.abs() > SECONDS_OFF, &m::CLOCK, "by the PC's")
}

/// The chip as [`chip`] judges it, and its brown-out level at most shown: a board without a rig may have any.
pub(crate) fn clocks(seen: &ChipSeen, reset: Reset, last_words: Option<&str>) -> Finding {
    let mut finding = chip(seen, reset, last_words);
    finding
        .named
        .retain(|named| named.mistake.key != m::BROWN_OUT.key);
    finding
}

/// Checks that the board has judged: this mistake, or that a kernel is slow.
pub(crate) fn checks(all: &[Checked], mistake: &'static Mistake) -> Finding {
    let said = all
        .iter()
        .map(|one| format!("{}: {}", one.name, one.measured));
    let failed = |slow| {
        let mut bad = all.iter().filter(|one| !one.good);
        bad.any(|one| (one.name == "cycles") == slow)
    };
    Finding::new(said.collect::<Vec<_>>().join("; "))
        .wrong(all.is_empty() || failed(false), mistake, "")
        .wrong(failed(true), &m::CYCLES, "")
}

/// A converter whose CH1 is at its supply.
pub(crate) fn converter(seen: &ConverterSeen) -> Finding {
    let [[low, high], [low_1, high_1]] = seen.counts;
    let saw = format!(
        "{} of {} readings not driven; CH0 {low} to {high}, CH1 {low_1} to {high_1} counts",
        seen.undriven, seen.read
    );
    let silent = seen.undriven > 0;
    let stuck = high.max(high_1) == 0;
    Finding::new(saw)
        .wrong(silent, &m::SENSOR_SILENT, "the MCP3202")
        .wrong(stuck, &m::MISO_STUCK, "low")
        .wrong(!silent && !stuck && low_1 < HIGH, &m::CONVERTER_INPUT, "")
}

/// A potentiometer at CH0 that somebody turns from one end to the other.
pub(crate) fn turned(all: &[ConverterSeen]) -> Finding {
    let silent = all.iter().any(|seen| seen.undriven > 0);
    let counts = || all.iter().map(|seen| seen.counts[0]);
    let low = counts().map(|[low, _]| low).min().unwrap_or(u16::MAX);
    let high = counts().map(|[_, high]| high).max().unwrap_or(0);
    let (down, up) = (low <= LOW, high >= HIGH);
    Finding::new(format!("CH0 from {low} to {high} counts"))
        .wrong(silent, &m::SENSOR_SILENT, "the MCP3202")
        .wrong(!silent && down && !up, &m::POTENTIOMETER, "not to 3V3")
        .wrong(!silent && up && !down, &m::POTENTIOMETER, "not to GND")
        .wrong(!silent && !up && !down, &m::POTENTIOMETER, "to neither end")
}

/// A handheld's display, which a person sees.
pub(crate) fn display(seen: &HandSeen, lit: bool) -> Finding {
    let answers = seen.display;
    let answer = if answers {
        "answers"
    } else {
        "does not answer"
    };
    let light = if lit { "lit" } else { "dark" };
    Finding::new(format!("it {answer}, and is {light}"))
        .wrong(!answers, &m::DISPLAY_SILENT, "")
        .wrong(answers && !lit, &m::DISPLAY_DARK, "")
}

/// A handheld's button, let go and pressed.
pub(crate) fn button(let_go: &HandSeen, pressed: &HandSeen) -> Finding {
    let level = |seen: &HandSeen| if seen.pressed { "high" } else { "low" };
    let saw = format!(
        "PC13 is {} let go, {} pressed",
        level(let_go),
        level(pressed)
    );
    Finding::new(saw)
        .wrong(let_go.pressed, &m::BUTTON_STUCK, "")
        .wrong(!pressed.pressed, &m::BUTTON_DEAD, "")
}

/// A handheld's buzzer, by a person's ear.
pub(crate) fn buzzer(heard: bool) -> Finding {
    let saw = if heard { "heard" } else { "not heard" };
    Finding::new(saw.to_owned()).wrong(!heard, &m::BUZZER, "")
}
