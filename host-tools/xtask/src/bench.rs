//! `cargo xtask bench`: what the kernels cost, counted on the emulated chip.
use std::process::Command;

use anyhow::Result;
use clap::{Args, ValueEnum};

use crate::shell::run;
use crate::{emulate, firmware};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask bench                  the table for people
  cargo xtask bench --format json    a list of {kernel, unit, instructions, gate, ok}
  cargo xtask bench --finger mems    a slot of another finger, and how busy the core is with it";

/// The image that counts.
const IMAGE: &str = "tactus-silicon";
/// The one whose load is measured.
const RIG: &str = "tactus-rig";

#[derive(Args)]
pub(crate) struct Options {
    /// For people, or JSON for programs
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    /// Measure the load of the rig's image with another finger alone: analog or mems
    #[arg(long, value_name = "NAME")]
    finger: Option<String>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Text,
    Json,
}

pub(crate) fn bench(options: &Options) -> Result<()> {
    let mut program = program(options.finger.as_deref())?;
    if options.format == Format::Json {
        program.args(["--format", "json"]);
    }
    run(&mut program)
}

/// Measures; an error if a gate is missed or a result is not the plain kernels'.
pub(crate) fn gates() -> Result<()> {
    run(&mut program(None)?)
}

/// Builds the image with the bench, the rig's, and what counts their instructions.
fn program(finger: Option<&str>) -> Result<Command> {
    let elves = firmware::compile(&[IMAGE, RIG])?;
    run(&mut emulate::build())?;
    let mut program = emulate::program("bench");
    program.arg("--elf").arg(firmware::image(&elves, IMAGE)?);
    program.arg("--rig").arg(firmware::image(&elves, RIG)?);
    if let Some(finger) = finger {
        program.args(["--finger", finger]);
    }
    Ok(program)
}
