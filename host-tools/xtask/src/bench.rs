//! `cargo xtask bench`: what the kernels cost, counted on the emulated chip; with `--pc`, how long they take on this PC.
use std::ffi::OsString;
use std::process::Command;

use anyhow::{Context as _, Result, bail};
use clap::{Args, ValueEnum};
use serde_json::Value;

use crate::{cargo, emulate, firmware, run};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask bench                  the table for people
  cargo xtask bench --format json    a list of {kernel, unit, instructions, gate, ok}
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
    /// Measure times on this PC instead: good for comparing two versions on one PC
    #[arg(long)]
    pc: bool,
    /// Tell how table and decision grow with the number of textures instead
    #[arg(long, conflicts_with = "format")]
    growth: bool,
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
    let mut program = program()?;
    if options.format == Format::Json {
        program.args(["--format", "json"]);
    }
    if options.growth {
        program.arg("--growth");
    }
    run(&mut program)
}

/// Gates that are not met yet, by kernel, and what its figure is now: it may only become smaller, give or take what another
/// compiler does ([`COMPILERS`]). A gate that is met is to be taken out of here.
const NOT_YET: [(&str, f64); 0] = [];
/// How much compilers differ.
const COMPILERS: f64 = 1.05;

/// An error if a gate is missed that was met, or one that is not met yet has become worse.
pub(crate) fn gates() -> Result<()> {
    let output = program()?.args(["--format", "json"]).output()?;
    eprint!("{}", String::from_utf8_lossy(&output.stderr));
    let rows: Vec<Value> =
        serde_json::from_slice(&output.stdout).context("the bench program told no figures")?;
    let mut wrong = Vec::new();
    for row in &rows {
        let kernel = row["kernel"].as_str().unwrap_or_default();
        let is = row["instructions"].as_f64().unwrap_or(f64::NAN);
        let verdict = judge(kernel, is, row["ok"] == true);
        println!(
            "{kernel:48} {:16} {is:>12.1} {:>10}  {}",
            row["unit"].as_str().unwrap_or_default(),
            row["gate"].to_string(),
            verdict
                .as_ref()
                .map_or_else(|why| why.as_str(), |said| said),
        );
        wrong.extend(verdict.err().map(|why| format!("{kernel}: {is:.1}: {why}")));
    }
    if rows.is_empty() || !wrong.is_empty() {
        bail!("{} figures; {}", rows.len(), wrong.join("; "));
    }
    Ok(())
}

/// What a figure is worth, good or bad.
fn judge(kernel: &str, is: f64, ok: bool) -> Result<&'static str, String> {
    let not_yet = NOT_YET.iter().find(|(name, _)| *name == kernel);
    match (ok, not_yet) {
        (true, None) => Ok("ok"),
        (true, Some(_)) => Err("its gate is met: take it out of NOT_YET".into()),
        (false, None) => Err("its gate is missed, or its result is not the plain kernels'".into()),
        (false, Some((_, was))) if is <= was * COMPILERS => Ok("not met yet"),
        (false, Some((_, was))) => Err(format!("was {was}, and has become worse")),
    }
}

/// Builds the bench image, the rig's, and what counts their instructions.
fn program() -> Result<Command> {
    let elves = firmware::compile(&[IMAGE, RIG])?;
    run(emulate::build().args(["--bin", IMAGE]))?;
    let mut program = Command::new(emulate::folder().join("release").join(IMAGE));
    program.arg(firmware::image(&elves, IMAGE)?);
    program.arg("--rig").arg(firmware::image(&elves, RIG)?);
    Ok(program)
}
