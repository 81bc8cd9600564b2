//! `tactus-campaign`: many explorations on emulated boards, in a table, against the bars.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use clap::{Parser, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use tactus::evaluate::Method;
use tactus_emulator::campaign::{self, Bars, Group, Results};
use tactus_emulator::cuts::{self, Outcome};
use tactus_emulator::exploration::{Exploration, FORCE_N, FORCE_SHARE, JITTER_US, SPEED_SHARE};
use tactus_emulator::lessons::{self, RECORDED_LIMITS};

/// Has the firmware identify many textures on emulated boards, several at once, and holds the results against the bars.
///
/// One half feels the textures of a simulated world, the other recordings of a real BioTac; each knows 20 textures. Every
/// exploration is followed by the PC from the raw samples.
///
/// Then the power is cut: at every word that the firmware programs when it is taught and when it learns by itself, and at seeded
/// moments of an update that turns a page of its settings. It boots on what is left of the flash, in which the last word or erase is torn,
/// and must hold the old or the new; where it repairs the flash first, the power is cut in that too. The exit code is 1 if a bar is
/// missed.
#[derive(Parser)]
#[command(name = "cargo xtask campaign", version)]
struct Cli {
    /// The firmware: what `cargo xtask build` names
    #[arg(long, value_name = "PATH")]
    elf: PathBuf,
    /// Explorations in the simulated world
    #[arg(long, value_name = "N", default_value_t = 20)]
    simulated: usize,
    /// Explorations on recordings
    #[arg(long, value_name = "N", default_value_t = 20)]
    recordings: usize,
    /// Power cuts of the sector change; 0 leaves all power cuts out
    #[arg(long, value_name = "N", default_value_t = 100)]
    cuts: usize,
    /// How the firmware decides, and what its table is learned for
    #[arg(long, value_enum, default_value_t = Method::Fused)]
    method: Method,
    /// Another seed is another world, other slides to learn from, and other trials
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// A table for people, or one JSON object for programs
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

/// A group with its results.
struct Part {
    name: &'static str,
    results: Results,
}

/// What became of the power cuts.
struct Cuts {
    outcomes: Vec<Outcome>,
    /// A firmware that erases before it has copied is told from this one.
    planted_seen: bool,
}

impl Cuts {
    fn make(cli: &Cli) -> anyhow::Result<Self> {
        let bar = ProgressBar::new_spinner();
        bar.enable_steady_tick(Duration::from_millis(200));
        let prepared = cuts::prepare(&cli.elf, cli.seed, |what| bar.set_message(what.to_owned()))
            .context("what is to be cut")?;
        bar.finish_and_clear();
        let style = ProgressStyle::with_template("cutting {wide_bar} {pos}/{len}, {eta} left")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        let count = cuts::count(&prepared, cli.cuts);
        let bar = ProgressBar::new(count as u64).with_style(style);
        bar.enable_steady_tick(Duration::from_millis(200));
        let outcomes = cuts::run(&cli.elf, &prepared, cli.cuts, cli.seed, || bar.inc(1))?;
        let planted_seen = cuts::planted_is_seen(&cli.elf, &prepared);
        bar.finish_and_clear();
        Ok(Self {
            outcomes,
            planted_seen,
        })
    }

    fn missed(&self) -> Vec<String> {
        let wrong = self.outcomes.iter().flat_map(|outcome| {
            let named = |wrong| format!("{}: {wrong}", outcome.name);
            outcome.wrong.iter().map(named)
        });
        let planted = (!self.planted_seen)
            .then(|| "a flash that was erased before it was copied is taken for a good one".into());
        wrong.chain(planted).collect()
    }

    fn json(&self) -> Value {
        json!({
            "operations": self.outcomes.iter().map(Outcome::json).collect::<Vec<_>>(),
            "planted_error_seen": self.planted_seen,
            "missed": self.missed(),
        })
    }

    fn text(&self) -> String {
        let mut lines = vec![format!(
            "\npower cuts\n{:14} {:>6} {:>6} {:>5} {:>5} {:>8} {:>5} {:>12} {:>7} {:>6}",
            "stored",
            "words",
            "erases",
            "cuts",
            "old",
            "between",
            "new",
            "in recovery",
            "probed",
            "WRONG"
        )];
        lines.extend(self.outcomes.iter().map(|o| {
            format!(
                "{:14} {:6} {:6} {:5} {:5} {:8} {:5} {:12} {:7} {:6}",
                o.name,
                o.writes - o.erases,
                o.erases,
                o.cuts(),
                o.old,
                o.between,
                o.new,
                o.in_recovery,
                o.probed,
                o.wrong.len()
            )
        }));
        lines.extend(
            self.missed()
                .iter()
                .map(|missed| format!("MISSED: {missed}")),
        );
        lines.join("\n") + "\n"
    }
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
    let began = Instant::now();
    let mut groups: Vec<(&'static str, Group)> = Vec::new();
    let bar = ProgressBar::new_spinner();
    bar.enable_steady_tick(Duration::from_millis(200));
    if cli.recordings > 0 {
        bar.set_message("learning the recorded materials");
        // first, since it may be that there are none
        let lesson = lessons::recordings(cli.method.method(), cli.seed)?;
        let group = campaign::recorded(&lesson, cli.recordings, cli.method, cli.seed)?;
        groups.push(("recordings", group));
    }
    if cli.simulated > 0 {
        bar.set_message("learning the simulated textures");
        let group = campaign::simulated(cli.simulated, cli.method, cli.seed, || ())?;
        groups.insert(0, ("simulated", group));
    }
    bar.finish_and_clear();
    let all: Vec<&Group> = groups.iter().map(|(_, group)| group).collect();
    let count = all.iter().map(|group| group.unknown.len()).sum::<usize>();
    let style = ProgressStyle::with_template("exploring {wide_bar} {pos}/{len}, {elapsed}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(count as u64).with_style(style);
    bar.enable_steady_tick(Duration::from_millis(200));
    let results = campaign::run(&cli.elf, &all, || bar.inc(1));
    bar.finish_and_clear();
    let parts: Vec<Part> = groups
        .iter()
        .zip(results)
        .map(|((name, _), results)| Part { name, results })
        .collect();
    let cuts = (cli.cuts > 0).then(|| Cuts::make(cli)).transpose()?;
    let bars = Bars::of(cli.method);
    let met = parts
        .iter()
        .all(|part| campaign::missed(&part.results, bars).is_empty())
        && cuts.as_ref().is_none_or(|cuts| cuts.missed().is_empty());
    let wall_s = began.elapsed().as_secs_f64();
    let report = match cli.format {
        Format::Text => text(&parts, cuts.as_ref(), bars, met, wall_s)?,
        Format::Json => format!(
            "{}\n",
            object(cli, &sha256, &parts, cuts.as_ref(), met, wall_s)
        ),
    };
    match &cli.out {
        Some(file) => std::fs::write(file, report)
            .with_context(|| format!("cannot write {}", file.display()))?,
        None => print!("{report}"),
    }
    Ok(met)
}

fn object(
    cli: &Cli,
    sha256: &str,
    parts: &[Part],
    cuts: Option<&Cuts>,
    met: bool,
    wall_s: f64,
) -> Value {
    let bars = Bars::of(cli.method);
    let mut object = json!({
        "elf_sha256": sha256,
        "seed": cli.seed,
        "method": cli.method,
        "wall_seconds": wall_s,
        "bars": {
            "right_share": bars.right_share,
            "median_slides": bars.median_slides,
            "force_error": FORCE_SHARE,
            "force_error_or_n": FORCE_N,
            "speed_error": SPEED_SHARE,
            "slot_jitter_us": JITTER_US,
            "lost_samples": 0,
            "late_slots": 0,
            "parity_errors": 0,
            "resets": 0,
        },
        "met": met,
    });
    for part in parts {
        let explorations = part.results.iter().map(|result| match result {
            Ok(exploration) => exploration.json(),
            Err(why) => json!({ "crashed": why.to_string() }),
        });
        object[part.name] = json!({
            "explorations": explorations.collect::<Vec<_>>(),
            "right": campaign::right(&part.results),
            "of": part.results.len(),
            "median_slides": campaign::median_slides(&part.results),
            "missed": campaign::missed(&part.results, bars),
        });
        if part.name == "recordings" {
            object[part.name]["limits"] = RECORDED_LIMITS.into();
        }
    }
    if let Some(cuts) = cuts {
        object["power_cuts"] = cuts.json();
    }
    object
}

fn text(
    parts: &[Part],
    cuts: Option<&Cuts>,
    bars: Bars,
    met: bool,
    wall_s: f64,
) -> Result<String, std::fmt::Error> {
    let mut out = String::new();
    for part in parts {
        writeln!(
            out,
            "\n{}\n{:22} {:22} {:5} {:>6} {:>6} {:>7} {:>12} {:>7} {:>6} {:>14} {:>9}",
            part.name,
            "under the finger",
            "identified",
            "right",
            "p",
            "slides",
            "time",
            "force off",
            "speed",
            "slots",
            "lost/late/bad",
            "PC"
        )?;
        for result in &part.results {
            let e = match result {
                Ok(e) => e,
                Err(why) => {
                    writeln!(out, "CRASHED: {why}")?;
                    continue;
                }
            };
            let (newtons, share) = e.force_error();
            writeln!(
                out,
                "{:22} {:22} {:5} {:6.4} {:6} {:5.1} s {:4.1} mN {:3.1} % {:5.2} % {:3.1} us {:>14} {:>9}",
                short(&e.truth),
                if e.found.unknown {
                    "(unknown)".into()
                } else {
                    short(&e.found.name)
                },
                if e.right() { "yes" } else { "NO" },
                e.found.probability,
                e.found.slides,
                e.virtual_s,
                newtons * 1e3,
                share * 100.0,
                e.speed_error() * 100.0,
                e.jitter_us(),
                format!(
                    "{}/{}/{}",
                    e.counts.lost_samples, e.counts.late_slots, e.counts.parity_errors
                ),
                if e.agreement.agrees() && e.not_followed.is_empty() {
                    "agrees"
                } else {
                    "DIFFERS"
                }
            )?;
        }
        let explorations = || part.results.iter().flatten();
        for wrong in explorations().filter(|e| !e.right()) {
            writeln!(
                out,
                "\nWhy {} was taken for {}:",
                wrong.truth,
                if wrong.found.unknown {
                    "unknown"
                } else {
                    wrong.found.name.as_str()
                }
            )?;
            for line in wrong.log() {
                writeln!(out, "  {line}")?;
            }
        }
        let largest = |of: fn(&Exploration) -> f64| explorations().map(of).fold(0.0, f64::max);
        writeln!(
            out,
            "\n{} of {} right, {} slides at the median. Off at most: force {:.1} %, speed {:.2} %, slots {:.2} us; PC: features {:.1e}, posterior {:.1e}.",
            campaign::right(&part.results),
            part.results.len(),
            campaign::median_slides(&part.results).unwrap_or_default(),
            largest(|e| e.force_error().1) * 100.0,
            largest(|e| e.speed_error()) * 100.0,
            largest(|e| e.jitter_us()),
            largest(|e| e.features_difference().into()),
            largest(|e| e.agreement.posterior.into()),
        )?;
        if part.name == "recordings" {
            let clipped: u32 = explorations().map(|e| e.played.clipped).sum();
            writeln!(out, "{RECORDED_LIMITS} {clipped} samples were clipped.")?;
        }
        for missed in campaign::missed(&part.results, bars) {
            writeln!(out, "MISSED: {missed}")?;
        }
    }
    if let Some(cuts) = cuts {
        out += &cuts.text();
    }
    writeln!(
        out,
        "\n{} ({wall_s:.0} s)",
        if met {
            "All bars are met."
        } else {
            "A bar is missed."
        }
    )?;
    Ok(out)
}

fn short(name: &str) -> String {
    name.chars().take(22).collect()
}
