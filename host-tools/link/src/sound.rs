//! Reports that no probe makes: they pass the checksum, and nothing of them is believed or shown.

use tactus_core::sensor::pressure::RATE_HZ;
use tactus_core::table::{self, MAX_MOVEMENTS, MAX_TEXTURES, Table, is_false_alarm, valid_name};
use tactus_core::wire::{Event, ExpectedOutcome, PART, SlideReport, Status, Verdict};

/// Longest table, bytes: more than any chip has flash for.
const MAX_TABLE: u32 = 1 << 20;
/// Most samples of a slide: the firmware gives a movement 135 s.
const MAX_SAMPLES: u32 = 135 * RATE_HZ;
/// Rounding of probabilities and of what is computed from them.
const ROUNDING: f32 = 1e-3;

/// Finds what cannot be in a report; `None`: all can.
pub(crate) fn impossible(event: &Event) -> Option<&'static str> {
    let all = |good: bool, what: &'static str| (!good).then_some(what);
    match event {
        Event::Booted {
            version,
            last_words,
            ..
        } => {
            let words = last_words.as_ref().map_or("", |words| words.as_str());
            all(is_printable(version) && is_printable(words), TEXT)
        }
        Event::Status(status) => of_status(status),
        Event::Refused { why, .. } | Event::Rejected { why, .. } | Event::Trouble(why) => {
            all(is_printable(&why.to_string()), TEXT)
        }
        Event::Chosen {
            slide,
            action,
            expected,
            ..
        } => {
            let can_be = |o: &ExpectedOutcome| is_share(o.uncertainty) && o.benefit.is_finite();
            let is_movement = usize::from(action.movement) < MAX_MOVEMENTS;
            all(*slide > 0 && is_movement, COUNT)
                .or_else(|| all(expected.iter().all(can_be), NUMBER))
        }
        Event::SlideReport {
            slide,
            observed,
            posterior,
            ..
        } => {
            let shares = posterior.iter().all(|p| is_share(*p));
            all(shares && is_share(posterior.iter().sum()), PROBABILITY)
                .or_else(|| all(*slide > 0, COUNT))
                .or_else(|| all(is_measured(observed), NUMBER))
        }
        Event::Verdict(verdict) => of_verdict(verdict),
        Event::TextureLearned(learned) => all(valid_name(&learned.name).is_ok(), TEXT),
        Event::TrainingSlide {
            trial, observed, ..
        } => all(*trial > 0, COUNT).or_else(|| all(is_measured(observed), NUMBER)),
        Event::Block(block) => {
            let can_be = |(from, to)| from <= to && to <= MAX_SAMPLES;
            all(block.steady.is_none_or(can_be), COUNT)
        }
        Event::TablePart {
            offset,
            length,
            bytes,
        } => {
            let end = u64::from(*offset) + bytes.len() as u64;
            let is_part = bytes.len() == PART || end == u64::from(*length);
            let is_table = *length <= MAX_TABLE && end <= u64::from(*length);
            all(is_part && is_table, "a part of no table")
        }
        Event::Weighed { counts, .. } => all(counts.is_finite(), NUMBER),
        Event::Verified { now, .. } => all(!now.score.is_nan() && !now.limit.is_nan(), NUMBER),
        Event::Turned {
            g_counts,
            offset_counts,
        } => all(g_counts.is_normal() && offset_counts.is_finite(), NUMBER),
        _ => None,
    }
}

const TEXT: &str = "a text with characters that do not print";
const COUNT: &str = "a count out of its range";
const DAY: &str = "a day of no calendar";
const NUMBER: &str = "a number out of its range";
const PROBABILITY: &str = "a probability outside 0 to 1";

fn of_status(status: &Status) -> Option<&'static str> {
    let (year, month, day) = (
        status.calibrated / 10_000,
        status.calibrated / 100 % 100,
        status.calibrated % 100,
    );
    // no century that is none of 400 years is among these, but 2100
    let february = 28 + u32::from(year.is_multiple_of(4) && year != 2100);
    let longest = match month {
        2 => february,
        4 | 6 | 9 | 11 => 30,
        1..=12 => 31,
        _ => 0,
    };
    let is_day = (2000..2200).contains(&year) && (1..=longest).contains(&day);
    let fits = usize::from(status.textures) <= MAX_TEXTURES && status.table_bytes <= MAX_TABLE;
    if !fits {
        Some(COUNT)
    } else if status.calibrated > 1 && !is_day {
        Some(DAY)
    } else {
        let good = status.false_alarm.is_none_or(is_false_alarm);
        (!good).then_some(PROBABILITY)
    }
}

fn of_verdict(verdict: &Verdict) -> Option<&'static str> {
    if !is_share(verdict.probability) {
        Some(PROBABILITY)
    } else if valid_name(&verdict.name).is_err() {
        Some(TEXT)
    } else if usize::from(verdict.texture) >= MAX_TEXTURES {
        Some(COUNT)
    } else {
        let good = verdict.log_odds.is_none_or(f32::is_finite);
        (!good).then_some(NUMBER)
    }
}

/// Finds what cannot be in a report of an exploration by a table, of so many slides; `None`: all can.
pub fn foreign(event: &Event, table: Table<'_>, slides: u8) -> Option<&'static str> {
    let movements = table.movements().len();
    let fits = match event {
        Event::Chosen { action, .. } => usize::from(action.movement) < movements,
        Event::SlideReport {
            slide, posterior, ..
        } => *slide <= slides && posterior.len() <= usize::from(table.textures()),
        Event::Verdict(verdict) => {
            verdict.slides <= slides && table.name(verdict.texture) == Some(verdict.name.as_str())
        }
        Event::Verified { slides: made, .. } => *made <= slides,
        _ => true,
    };
    (!fits).then_some("something that is not in its table, or that it was not asked for")
}

fn is_share(share: f32) -> bool {
    (-ROUNDING..=1.0 + ROUNDING).contains(&share)
}

fn is_measured(observed: &SlideReport) -> bool {
    let properties = observed.properties.iter().flatten();
    properties.copied().all(f32::is_finite)
        && observed.background.is_finite()
        && observed.background >= 0.0
}

/// Returns true if no character of a text controls a terminal, or the order of those around it.
fn is_printable(text: &str) -> bool {
    text.chars().all(table::is_printable)
}
