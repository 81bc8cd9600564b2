//! The firmware onto a board, by probe-rs.
use std::ffi::OsString;
use std::path::Path;
use std::process::Command;

use anyhow::Result;
use clap::Args;

use crate::firmware;
use crate::shell::{cargo, run};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask flash                            the rig's firmware
  cargo xtask flash --self-test                test board and rig instead, with a report; take the finger off before
  cargo xtask flash -- --probe 0483:374b:SER   if there are several probes: `probe-rs list` names them";

/// The chip's name in probe-rs; .cargo/config.toml has it too.
pub(crate) const CHIP: &str = "STM32F429ZITx";

#[derive(Args)]
pub(crate) struct Options {
    /// Flash the self-test and show its report until it is stopped with Ctrl-C
    #[arg(long)]
    self_test: bool,
    /// Build, and print what would be run
    #[arg(long)]
    dry_run: bool,
    /// Options for probe-rs
    #[arg(last = true)]
    options: Vec<OsString>,
}

pub(crate) fn flash(options: &Options) -> Result<()> {
    let wanted = if options.self_test {
        "tactus-selftest"
    } else {
        "tactus-rig"
    };
    let elves = firmware::elves()?;
    let elf = firmware::image(&elves, wanted)?;
    run(&mut command(options, elf))?;
    if !options.self_test && !options.dry_run {
        println!(
            "The firmware runs. Its log: probe-rs attach --chip {CHIP} {}",
            firmware::shown(elf)
        );
    }
    Ok(())
}

/// `tactus device flash` does it: the self-test stays attached for its report, the rig is left alone.
fn command(options: &Options, elf: &Path) -> Command {
    let mut tactus = cargo();
    tactus.args(["run", "--quiet", "--release", "--package", "tactus", "--"]);
    tactus.args(["device", "flash"]).arg(elf);
    for (flag, wanted) in [
        ("--attach", options.self_test),
        ("--dry-run", options.dry_run),
    ] {
        if wanted {
            tactus.arg(flag);
        }
    }
    if !options.options.is_empty() {
        tactus.arg("--").args(&options.options);
    }
    tactus
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rig_is_left_alone_and_the_self_test_is_watched() {
        let line = |self_test, options: &[&str]| {
            let options = Options {
                self_test,
                dry_run: false,
                options: options.iter().map(OsString::from).collect(),
            };
            let command = command(&options, Path::new("t/elf"));
            let words: Vec<_> = command.get_args().map(|w| w.to_string_lossy()).collect();
            words.join(" ")
        };
        let run = "run --quiet --release --package tactus -- device flash t/elf";
        assert_eq!(line(false, &[]), run);
        assert_eq!(
            line(true, &["--probe", "0483:374b"]),
            format!("{run} --attach -- --probe 0483:374b")
        );
    }

    #[test]
    fn the_chip_is_the_one_of_cargo_run() {
        let config = crate::shell::root().join(".cargo/config.toml");
        let config = std::fs::read_to_string(config).unwrap();
        assert!(config.contains(&format!("probe-rs run --chip {CHIP}")));
    }
}
