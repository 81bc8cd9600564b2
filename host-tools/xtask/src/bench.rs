//! `cargo xtask bench`: what the kernels cost, counted on the emulated chip.
use std::process::Command;

use anyhow::Result;
use clap::Args;

use crate::shell::run;
use crate::{emulate, firmware};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask bench                  the table
  cargo xtask bench --finger mems    a slot of another finger, and how busy the core is with it";

const IMAGE: &str = "tactus-silicon";
const RIG: &str = "tactus-rig";

#[derive(Args)]
pub(crate) struct Options {
    /// Measure the load of the rig's image with another finger alone: analog or mems
    #[arg(long, value_name = "NAME")]
    finger: Option<String>,
}

pub(crate) fn bench(options: &Options) -> Result<()> {
    run(&mut program(options.finger.as_deref())?)
}

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
