//! A day on the simulated rig and an hour on the emulated board, with random faults, against the bars.

pub(crate) mod day;
mod episodes;
mod hour;
pub(crate) mod hour_report;

use std::time::Instant;

use clap::Args as Arguments;
use serde_json::{Value, json};

use self::day::Day;
use self::hour_report::Hour;
use super::error::RunError;
use crate::host::args::{Firmware, Output};
use crate::host::progress;

/// Has the probe work for long: it learns and deletes textures, and in every fourth episode something of its rig breaks.
///
/// First the core's sessions on the simulated rig of the PC, then the real firmware on the emulated board over one boot,
/// which is broken and reset four times in the end. A fault must end in a lifted finger and a rig that homes once it is
/// repaired.
///
/// Bars: no drift of time, no slot late, missed or lost, no report lost, no growth of the stack from the first quarter to
/// the end, every reset on purpose and told with its reason, never more than 2.2 N on the finger, at least 30 episodes an
/// hour without a fault on the board, and all that was stored still there after the power was off. Wrong answers are
/// listed, and are no bar. The exit code is 1 if a bar is missed.
///
/// A virtual hour takes minutes on the PC rig and half an hour on the board, on an idle core each; what is left is shown.
#[derive(Arguments)]
#[command(after_help = "Examples:
  cargo xtask campaign soak                                       24 hours and one
  cargo xtask campaign soak -- --pc-hours 0 --board-hours 0.1     six minutes on the board only
  cargo xtask campaign soak -- --seed 7 --format json --out soak.json")]
pub(crate) struct Args {
    #[command(flatten)]
    firmware: Firmware,
    /// Virtual hours on the simulated rig of the PC; 0 leaves it out
    #[arg(long, value_name = "H", default_value_t = 24.0, value_parser = hours)]
    pc_hours: f64,
    /// Virtual hours on the emulated board; 0 leaves it out
    #[arg(long, value_name = "H", default_value_t = 1.0, value_parser = hours)]
    board_hours: f64,
    /// Another seed draws other textures, faults and trainings
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    output: Output,
}

/// From 0 to a year.
fn hours(text: &str) -> Result<f64, &'static str> {
    let hours: Option<f64> = text.parse().ok();
    hours
        .filter(|hours| (0.0..=8766.0).contains(hours))
        .ok_or("0 to 8766 hours")
}

/// Whether all bars are met.
pub(crate) fn run(args: &Args) -> Result<bool, RunError> {
    let sha256 = args.firmware.show(false)?;
    let mut report = Report::default();
    let left = " virtual s, {eta} left";
    if args.pc_hours > 0.0 {
        let virtual_s = args.pc_hours * 3600.0;
        let bar = progress::bar("PC rig", virtual_s as u64, left);
        let began = Instant::now();
        let day = day::day(virtual_s, args.seed, |now_s| bar.set_position(now_s as u64))?;
        bar.finish_and_clear();
        report.day = Some((day, began.elapsed().as_secs_f64()));
    }
    if args.board_hours > 0.0 {
        let virtual_s = args.board_hours * 3600.0;
        let bar = progress::bar("emulated board", virtual_s as u64, left);
        let began = Instant::now();
        let elf = &args.firmware.elf;
        let hour = hour::hour(elf, virtual_s, args.seed, &mut |now_s| {
            bar.set_position(now_s as u64);
        })?;
        bar.finish_and_clear();
        report.hour = Some((hour, began.elapsed().as_secs_f64()));
    }
    args.output
        .write(|| report.text(), || report.json(args.seed, &sha256))?;
    Ok(report.met())
}

/// What was run, with the seconds that it took.
#[derive(Default)]
struct Report {
    day: Option<(Day, f64)>,
    hour: Option<(Hour, f64)>,
}

impl Report {
    fn missed(&self) -> impl Iterator<Item = &String> {
        let day = self.day.iter().flat_map(|(day, _)| &day.missed);
        day.chain(self.hour.iter().flat_map(|(hour, _)| &hour.missed))
    }

    fn met(&self) -> bool {
        self.missed().next().is_none()
    }

    fn json(&self, seed: u64, sha256: &str) -> Value {
        let timed = |mut json: Value, wall_s: f64| {
            json["wall_seconds"] = wall_s.into();
            json
        };
        json!({
            "elf_sha256": sha256,
            "seed": seed,
            "pc": self.day.as_ref().map(|(day, wall_s)| timed(day.json(), *wall_s)),
            "board": self.hour.as_ref().map(|(hour, wall_s)| timed(hour.json(), *wall_s)),
            "met": self.met(),
        })
    }

    fn text(&self) -> String {
        let mut lines = Vec::new();
        let mut part = |text: String, wall_s: f64, wrong: &[String]| {
            lines.push(format!("{text} ({wall_s:.0} s)"));
            lines.extend(wrong.iter().map(|wrong| format!("  wrong: {wrong}")));
        };
        if let Some((day, wall_s)) = &self.day {
            part(day.text(), *wall_s, &day.episodes.wrong);
        }
        if let Some((hour, wall_s)) = &self.hour {
            part(hour.text(), *wall_s, &hour.episodes.wrong);
        }
        lines.extend(self.missed().map(|missed| format!("MISSED: {missed}")));
        lines.push(if self.met() {
            "All bars are met.".into()
        } else {
            "A bar is missed.".into()
        });
        lines.join("\n") + "\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hours_are_a_number_that_ends() {
        assert!(hours("-1").is_err() && hours("nan").is_err() && hours("0.1").is_ok());
    }

    #[test]
    fn a_missed_bar_is_said_and_counts() {
        let mut report = Report::default();
        assert!(report.text().contains("All bars are met."));
        let day = Day {
            missed: vec!["2.3 N".into()],
            ..Day::default()
        };
        report.day = Some((day, 1.0));
        assert!(report.text().contains("MISSED: 2.3 N"));
        assert_eq!(report.json(1, "")["met"], false);
    }
}
