//! `cargo xtask campaign`: long checks, and how each of them ended in one sentence.
mod factory;
mod fuzz;
mod seeds;

use std::ffi::OsString;
use std::ops::RangeInclusive;
use std::process::Command;
use std::time::Instant;

use anyhow::{Result, ensure};
use clap::{Args, ValueEnum};

use crate::shell::{cargo, hear, root, run};
use crate::{emulate, firmware};
pub(crate) use factory::{FOLDER, TABLES};
pub(crate) use fuzz::limits;

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask campaign all                          everything, a day or two; the rows are those of docs/src/tests.md
  cargo xtask campaign rig --finger mems            seeds 1 to 20 on the emulated board, with another finger
  cargo xtask campaign rig --seeds 1-20 -- --recording 3   slides of a real BioTac under the finger
  cargo xtask campaign faults --seeds 1-2000
  cargo xtask campaign factory -- --write           makes the tables that come with the firmware, shared/tables/*.tact
  cargo xtask campaign fuzz -- table --seconds 60   one target";

#[derive(Args)]
pub(crate) struct Options {
    /// Part to run
    #[arg(value_enum, default_value_t = Part::All)]
    part: Part,
    /// Seeds of a part that takes them; each has its own default
    #[arg(long, value_name = "A-B", value_parser = range)]
    seeds: Option<RangeInclusive<u64>>,
    /// Finger of the emulated board in rig, handheld and printer: biotac, analog or mems; each has its own default
    #[arg(long, value_name = "NAME")]
    finger: Option<String>,
    /// Options of the part
    #[arg(last = true)]
    options: Vec<OsString>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Part {
    /// Every other part, the short ones first
    All,
    /// The factory tables, made again from the simulated world and compared
    Factory,
    /// Tests that `cargo xtask test` leaves out, and all seeds of the others, in the workspace and on emulated boards
    Tests,
    /// Explorations on the emulated board
    Rig,
    /// Explorations by the handheld on the emulated board, in a hand that differs from seed to seed
    Handheld,
    /// Explorations by the image of an arm, whose finger mems or analog hangs on a 3D printer, through the command
    Printer,
    /// The PC's simulated rig, which breaks at any moment of whatever its probe does
    Faults,
    /// All presses of a world, with P_DC sound, dead, dying and leaking; every n-th rig with TACTUS_PRESSES_EVERY
    Press,
    /// libFuzzer against frames, tables, the store's flash, recordings, samples, logs and the page's probe, on stable
    /// Rust; wants a C++ compiler
    Fuzz,
}

impl Part {
    fn name(self) -> String {
        let value = self.to_possible_value();
        value.map_or_else(String::new, |value| value.get_name().to_owned())
    }

    fn seeds(self, options: &Options) -> Option<RangeInclusive<u64>> {
        let usual = match self {
            Self::Press => 1..=100,
            Self::Rig | Self::Handheld | Self::Printer => 1..=20,
            Self::Faults => 1..=300,
            _ => return None,
        };
        Some(options.seeds.clone().unwrap_or(usual))
    }
}

fn range(text: &str) -> Result<RangeInclusive<u64>, String> {
    let (from, to) = text.split_once('-').unwrap_or((text, text));
    match (from.parse(), to.parse()) {
        (Ok(from), Ok(to)) if from <= to => Ok(from..=to),
        _ => Err("two numbers are wanted, the lower first: 1-50".into()),
    }
}

pub(crate) fn campaign(options: &Options) -> Result<()> {
    let parts = match options.part {
        Part::All => &Part::value_variants()[1..],
        _ => &[options.part],
    };
    ensure!(
        parts.len() == 1 || (options.seeds.is_none() && options.options.is_empty()),
        "`all` runs every part as usual: it takes no seeds and no options of a part"
    );
    let (mut rows, mut failed) = (Vec::new(), 0);
    for part in parts {
        let began = Instant::now();
        let done = perform(*part, options);
        failed += usize::from(done.is_err());
        let result = done.unwrap_or_else(|why| format!("FAILED: {why:#}"));
        rows.push(row(
            &part.name(),
            &result,
            began.elapsed().as_secs().div_ceil(60),
        )?);
    }
    println!("\n{}", rows.join("\n"));
    ensure!(failed == 0, "failed parts: {failed} of {}", parts.len());
    Ok(())
}

/// A row of the book's table: the part, its result, the commit and the minutes.
fn row(part: &str, result: &str, minutes: u64) -> Result<String> {
    let mut git = Command::new("git");
    let commit = git
        .args(["describe", "--always", "--dirty"])
        .current_dir(root())
        .output()?;
    let commit = String::from_utf8_lossy(&commit.stdout);
    let result = result.replace(['\n', '|'], " ");
    Ok(format!(
        "| `{part}` | {result} | {} | {minutes} min |",
        commit.trim()
    ))
}

fn perform(part: Part, options: &Options) -> Result<String> {
    println!("== campaign {}", part.name());
    let seeds = part.seeds(options);
    ensure!(
        seeds.is_some() || options.seeds.is_none(),
        "{} takes no --seeds",
        part.name()
    );
    let board = [Part::Rig, Part::Handheld, Part::Printer].contains(&part);
    ensure!(
        board || options.finger.is_none(),
        "--finger is for rig, handheld and printer"
    );
    match (part, seeds) {
        (Part::Factory, _) => factory::factory(options.options == ["--write"]),
        (Part::Tests, _) => left_out(),
        (Part::Faults, Some(seeds)) => faults(&seeds, options),
        (Part::Fuzz, _) => fuzz::fuzz(&options.options),
        (Part::Press, Some(seeds)) => seeds::presses(&seeds),
        (Part::Handheld, Some(seeds)) => seeds::run("handheld", &seeds, options),
        (Part::Printer, Some(seeds)) => seeds::run("printer", &seeds, options),
        (_, Some(seeds)) => seeds::run("identify", &seeds, options),
        (_, None) => Ok(String::new()),
    }
}

/// Of a report's lines, those with verdicts, and the last one that is a sentence and no row, path or list.
fn sentence(lines: &[String]) -> String {
    let is_sentence = |line: &&String| line.contains(' ') && !line.starts_with(' ');
    let verdicts = lines.iter().filter(|line| line.contains(" right, "));
    let all: Vec<&str> = verdicts
        .chain(lines.iter().rfind(is_sentence))
        .map(|line| line.as_str())
        .collect();
    all.join(" ")
}

fn faults(seeds: &RangeInclusive<u64>, options: &Options) -> Result<String> {
    let count = seeds.end() - seeds.start() + 1;
    run(&mut emulate::build())?;
    let mut cases = emulate::program("faults");
    cases.args(["--faults", &count.to_string(), "--seed"]);
    cases.arg(seeds.start().to_string()).args(&options.options);
    let mut lines = Vec::new();
    hear(&mut cases, |line| lines.push(line.to_owned()))?;
    Ok(sentence(&lines))
}

/// Runs every test with every seed, the ignored ones too, but for those that are a part of their own.
fn left_out() -> Result<String> {
    let mut passed = 0;
    let mut board = cargo();
    board.args(["test", "--package", "tactus-emulator"]);
    board.args(["--locked", "--ignore-rust-version"]);
    emulate::with_images(&mut board, &firmware::elves()?)?;
    for mut tests in [emulate::workspace("test"), board] {
        tests.args(["--no-fail-fast", "--", "--include-ignored"]);
        tests.env("TACTUS_ALL_SEEDS", "1");
        hear(tests.args(["--skip", "the_whole_campaign"]), |line| {
            let result = line.strip_prefix("test result: ok. ");
            let count = result.and_then(|rest| rest.split(' ').next()?.parse::<u64>().ok());
            passed += count.unwrap_or_default();
        })?;
    }
    Ok(format!("{passed} tests passed."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_of_seeds_is_two_numbers_or_one() {
        assert_eq!(range("3-7"), Ok(3..=7));
        assert_eq!(range("5"), Ok(5..=5));
        for wrong in ["7-3", "", "a", "1-", "-1"] {
            assert!(range(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn every_part_has_a_row_in_the_book() {
        let page = std::fs::read_to_string(root().join("docs/src/tests.md")).unwrap();
        for part in &Part::value_variants()[1..] {
            let begin = format!("| `{}` |", part.name());
            assert!(page.contains(&begin), "{begin}");
        }
    }

    #[test]
    fn a_report_is_its_verdicts_and_its_last_sentence() {
        let lines = [
            "19 of 20 right, 1 slide.",
            "a table",
            "All limits are met. (3 s)",
            "",
        ];
        let lines = lines.map(str::to_owned);
        assert_eq!(
            sentence(&lines),
            "19 of 20 right, 1 slide. All limits are met. (3 s)"
        );
        let lines = ["2 cases, 0 failed", "  1 named", "target/x.jsonl"].map(str::to_owned);
        assert_eq!(sentence(&lines), "2 cases, 0 failed");
    }
}
