//! `cargo xtask bench`: what the kernels cost, counted on the emulated chip; with `--pc`, how long they take on this PC.
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context as _, Result, ensure};
use clap::{Args, ValueEnum};
use serde_json::Value;

use crate::shell::{cargo, run};
use crate::{emulate, firmware};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask bench                  the table for people
  cargo xtask bench --format json    a list of {kernel, unit, instructions, gate, ok}
  cargo xtask bench --finger mems    a slot of another finger, and how busy the core is with it
  cargo xtask bench --pc spectrum    times on this PC of benches with `spectrum` in their name";

/// The image that counts.
const IMAGE: &str = "tactus-bench";
/// The one whose load is measured.
const RIG: &str = "tactus-rig";

#[derive(Args)]
pub(crate) struct Options {
    /// For people, or JSON for programs
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    /// Measure the load of the rig's image for another finger alone: analog or mems
    #[arg(long, value_name = "NAME", conflicts_with_all = ["growth", "pc"])]
    finger: Option<String>,
    /// Measure times on this PC instead: good for comparing two versions on one PC
    #[arg(long)]
    pc: bool,
    /// Tell how table and decision grow with the number of textures instead
    #[arg(long, conflicts_with = "format")]
    growth: bool,
    /// With --growth, draw that as SVG, too
    #[arg(long, value_name = "FILE", requires = "growth")]
    plot: Option<PathBuf>,
    /// With --pc, filter and options for the benches (divan's)
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, requires = "pc")]
    options: Vec<OsString>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Text,
    Json,
}

pub(crate) fn bench(options: &Options) -> Result<()> {
    if options.pc {
        // by target: `cargo bench` alone would hand divan's options to every unit test binary too
        let mut cargo = cargo();
        cargo.args(["bench", "--package", "tactus-tests", "--bench", "*", "--"]);
        return run(cargo.args(&options.options));
    }
    let mut program = program(options.plot.is_some(), options.finger.as_deref())?;
    if options.format == Format::Json {
        program.args(["--format", "json"]);
    }
    if options.growth {
        program.arg("--growth");
    }
    if let Some(file) = &options.plot {
        program.arg("--plot").arg(file);
    }
    run(&mut program)
}

/// Gates that are not met yet, by kernel, and what was measured: it may become smaller, but not larger ([`LEEWAY`]). A gate
/// that is met is to be taken out of here.
const NOT_YET: [(&str, f64); 0] = [];
/// What a compiler's next version may do to a figure.
const LEEWAY: f64 = 1.01;
/// How the bench program ends when all results are the plain kernels', and gates are missed: its own `MISSED`.
const MISSED: i32 = 2;

/// An error if a gate is missed that was met, or one that is not met yet has become worse.
pub(crate) fn gates() -> Result<()> {
    let output = program(false, None)?.args(["--format", "json"]).output()?;
    eprint!("{}", String::from_utf8_lossy(&output.stderr));
    // a row that is not ok does not say whether its gate is missed or its result is wrong: that must not pass for the former
    ensure!(
        matches!(output.status.code(), Some(0 | MISSED)),
        "the bench program failed"
    );
    let rows: Vec<Value> =
        serde_json::from_slice(&output.stdout).context("the bench program told no figures")?;
    let wrong = wrong(&rows, &NOT_YET);
    ensure!(wrong.is_empty(), "{}", wrong.join("; "));
    Ok(())
}

/// Says how each figure stands, and what is wrong.
fn wrong(rows: &[Value], not_yet: &[(&str, f64)]) -> Vec<String> {
    let mut wrong = Vec::new();
    for row in rows {
        let kernel = row["kernel"].as_str().unwrap_or_default();
        let is = row["instructions"].as_f64().unwrap_or(f64::NAN);
        let known = not_yet.iter().find(|(name, _)| *name == kernel);
        let verdict = judge(is, row["ok"] == true, known.map(|(_, was)| *was));
        println!(
            "{kernel:48} {:16} {is:>12.1} {:>10}  {}",
            row["unit"].as_str().unwrap_or_default(),
            row["gate"].to_string(),
            verdict.as_deref().unwrap_or_else(|why| why),
        );
        wrong.extend(verdict.err().map(|why| format!("{kernel}: {is:.1}: {why}")));
    }
    if rows.is_empty() {
        wrong.push("there are no figures".into());
    }
    for (name, _) in not_yet {
        if !rows.iter().any(|row| row["kernel"] == *name) {
            wrong.push(format!("{name}: in NOT_YET, and not measured"));
        }
    }
    wrong
}

/// What a figure is worth, good or bad; `was` is that of a gate that is not met yet.
fn judge(is: f64, ok: bool, was: Option<f64>) -> Result<String, String> {
    match (ok, was) {
        (true, None) => Ok("ok".into()),
        (true, Some(_)) => Err("its gate is met: take it out of NOT_YET".into()),
        (false, None) => Err("its gate is missed".into()),
        (false, Some(was)) if is <= was * LEEWAY => Ok(format!("missed, was {was}")),
        (false, Some(was)) => Err(format!("was {was}, and has become worse")),
    }
}

/// Builds the bench image, the rig's, and what counts their instructions, and draws if need be.
fn program(draws: bool, finger: Option<&str>) -> Result<Command> {
    let rig = firmware::image_for(RIG, finger)?;
    let elves = firmware::compile(&[IMAGE, &rig])?;
    let mut build = emulate::build();
    if draws {
        build.args(["--features", "plot"]);
    }
    run(&mut build)?;
    let mut program = emulate::program("bench");
    program.arg("--elf").arg(firmware::image(&elves, IMAGE)?);
    program.arg("--rig").arg(firmware::image(&elves, &rig)?);
    if let Some(finger) = finger {
        program.args(["--finger", finger]);
    }
    Ok(program)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    const WAS: [(&str, f64); 1] = [("posterior", 19_000.0)];

    fn row(kernel: &str, instructions: f64, gate: f64) -> Value {
        json!({
            "kernel": kernel,
            "unit": "117 textures",
            "instructions": instructions,
            "gate": gate,
            "ok": instructions <= gate,
        })
    }

    #[test]
    fn a_gate_that_is_not_met_yet_may_not_become_worse() {
        let first = row("first choice", 1900.0, 2000.0);
        let with = |posterior: f64| {
            let rows = [first.clone(), row("posterior", posterior, 2500.0)];
            wrong(&rows, &WAS).join("; ")
        };
        assert_eq!(with(19_000.0), "");
        assert_eq!(with(12_000.0), "");
        assert!(with(19_200.0).contains("has become worse"));
        assert!(with(2400.0).contains("take it out of NOT_YET"));
        assert!(with(f64::NAN).contains("has become worse"));
    }

    #[test]
    fn a_gate_that_was_met_may_not_be_missed() {
        let missed = [row("first choice", 2001.0, 2000.0)];
        assert!(wrong(&missed, &[]).join("").contains("its gate is missed"));
        assert!(wrong(&[row("first choice", 2000.0, 2000.0)], &[]).is_empty());
    }

    #[test]
    fn what_is_not_measured_is_not_met() {
        assert!(!wrong(&[], &[]).is_empty());
        let other = [row("first choice", 1900.0, 2000.0)];
        assert!(wrong(&other, &WAS).join("").contains("not measured"));
    }
}
