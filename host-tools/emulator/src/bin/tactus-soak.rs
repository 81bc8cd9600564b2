//! `tactus-soak`: a day on the simulated rig and an hour on the emulated board, with random faults, against the bars.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use clap::{Parser, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;
use sha2::{Digest as _, Sha256};
use tactus_emulator::soak::{self, Day, Hour};

/// Has the probe work for long, taught and forgetting, while in every fourth visit something of its rig breaks.
///
/// First the core's sessions on the simulated rig of the PC, then the real firmware on the emulated board over one boot, which is
/// broken and reset four times in the end. A fault must end in a lifted finger and a rig that homes once it is repaired.
///
/// Bars: no drift of time, no slot late, missed or lost, no report lost, no growth of the stack from the first quarter to the end,
/// every reset on purpose and told with its reason, never more than 2.2 N on the finger, at least 30 visits an hour without a
/// fault on the board, and all that was stored still there after the power was off. Wrong answers are listed, and are no bar. The exit
/// code is 1 if a bar is missed.
///
/// A virtual hour takes minutes on the PC rig and half an hour on the board, on an idle core each; what is left is shown.
#[derive(Parser)]
#[command(name = "cargo xtask soak", version)]
#[command(after_help = "Examples:
  cargo xtask soak                                     24 hours and one
  cargo xtask soak --pc-hours 0 --board-hours 0.1      six minutes on the board only
  cargo xtask soak --seed 7 --format json --out soak.json")]
struct Cli {
    /// The firmware: what `cargo xtask build` names
    #[arg(long, value_name = "PATH")]
    elf: PathBuf,
    /// Virtual hours on the simulated rig of the PC; 0 leaves it out
    #[arg(long, value_name = "H", default_value_t = 24.0, value_parser = hours)]
    pc_hours: f64,
    /// Virtual hours on the emulated board; 0 leaves it out
    #[arg(long, value_name = "H", default_value_t = 1.0, value_parser = hours)]
    board_hours: f64,
    /// Another seed draws other textures, faults and lessons
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Lines for people, or one JSON object for programs
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    /// Where the result goes instead of the terminal
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Text,
    Json,
}

/// From 0 to a year.
fn hours(text: &str) -> Result<f64, String> {
    let hours: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (0.0..=8766.0).contains(&hours) {
        Ok(hours)
    } else {
        Err("0 to 8766 hours".into())
    }
}

fn main() -> ExitCode {
    match run(&Cli::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(why) => {
            eprintln!("error: {why:#}");
            ExitCode::FAILURE
        }
    }
}

/// A bar of virtual seconds, with what is left of the real ones.
fn progress(what: &'static str, virtual_s: f64) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} virtual s, {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(virtual_s as u64)
        .with_style(style)
        .with_message(what);
    bar.enable_steady_tick(Duration::from_millis(500));
    bar
}

/// Whether all bars are met.
fn run(cli: &Cli) -> anyhow::Result<bool> {
    let elf = std::fs::read(&cli.elf).with_context(|| {
        format!(
            "cannot read {}: build the firmware with `cargo xtask build`",
            cli.elf.display()
        )
    })?;
    let sha256: String = Sha256::digest(&elf)
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect();
    eprintln!("ELF {}\nSHA-256 {sha256}", cli.elf.display());
    let mut report = Report::default();
    if cli.pc_hours > 0.0 {
        let virtual_s = cli.pc_hours * 3600.0;
        let bar = progress("PC rig", virtual_s);
        let began = Instant::now();
        let day = soak::day(virtual_s, cli.seed, |now_s| bar.set_position(now_s as u64));
        bar.finish_and_clear();
        report.day = Some((day.context("PC rig")?, began.elapsed().as_secs_f64()));
    }
    if cli.board_hours > 0.0 {
        let virtual_s = cli.board_hours * 3600.0;
        let bar = progress("emulated board", virtual_s);
        let began = Instant::now();
        let hour = soak::hour(&cli.elf, virtual_s, cli.seed, &mut |now_s| {
            bar.set_position(now_s as u64);
        });
        bar.finish_and_clear();
        report.hour = Some((
            hour.context("emulated board")?,
            began.elapsed().as_secs_f64(),
        ));
    }
    let met = report.missed().next().is_none();
    let text = match cli.format {
        Format::Text => report.text(),
        Format::Json => format!("{}\n", report.json(cli.seed, &sha256)),
    };
    match &cli.out {
        Some(file) => std::fs::write(file, text)
            .with_context(|| format!("cannot write {}", file.display()))?,
        None => print!("{text}"),
    }
    Ok(met)
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

    fn json(&self, seed: u64, sha256: &str) -> serde_json::Value {
        let timed = |mut json: serde_json::Value, wall_s: f64| {
            json["wall_seconds"] = wall_s.into();
            json
        };
        json!({
            "elf_sha256": sha256,
            "seed": seed,
            "pc": self.day.as_ref().map(|(day, wall_s)| timed(day.json(), *wall_s)),
            "board": self.hour.as_ref().map(|(hour, wall_s)| timed(hour.json(), *wall_s)),
            "met": self.missed().next().is_none(),
        })
    }

    fn text(&self) -> String {
        let mut lines = Vec::new();
        let mut part = |text: String, wall_s: f64, wrong: &[String]| {
            lines.push(format!("{text} ({wall_s:.0} s)"));
            lines.extend(wrong.iter().map(|wrong| format!("  wrong: {wrong}")));
        };
        if let Some((day, wall_s)) = &self.day {
            part(day.text(), *wall_s, &day.visits.wrong);
        }
        if let Some((hour, wall_s)) = &self.hour {
            part(hour.text(), *wall_s, &hour.visits.wrong);
        }
        lines.extend(self.missed().map(|missed| format!("MISSED: {missed}")));
        lines.push(if self.missed().next().is_none() {
            "All bars are met.".into()
        } else {
            "A bar is missed.".into()
        });
        lines.join("\n") + "\n"
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
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
