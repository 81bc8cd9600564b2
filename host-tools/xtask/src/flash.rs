//! The firmware onto a board, by probe-rs.
use std::ffi::OsString;
use std::path::Path;
use std::process::Command;

use anyhow::Result;
use clap::Args;

use crate::firmware;
use crate::shell::{self, run};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask flash                            the rig's firmware
  cargo xtask flash --self-test                the image that measures for `tactus device bringup`
  cargo xtask flash --test                     what only the chip can answer: kernels, cycles, flash, DMA; needs no rig
  cargo xtask flash -- --probe 0483:374b:SER   if there are several probes: `probe-rs list` names them";

/// The chip's name in probe-rs; .cargo/config.toml has it too.
pub(crate) const CHIP: &str = "STM32F429ZITx";

#[derive(Args)]
pub(crate) struct Options {
    /// Flash the image that measures for `tactus device bringup`
    #[arg(long)]
    self_test: bool,
    /// Flash the tests of the chip alone, show their results, and fail if one of them does
    #[arg(long, conflicts_with = "self_test")]
    test: bool,
    /// Build, and print what would be run
    #[arg(long)]
    dry_run: bool,
    /// Options for probe-rs
    #[arg(last = true)]
    options: Vec<OsString>,
}

pub(crate) fn flash(options: &Options) -> Result<()> {
    let wanted = match options {
        Options {
            self_test: true, ..
        } => "tactus-selftest",
        Options { test: true, .. } => "tactus-silicon",
        _ => "tactus-rig",
    };
    let elf = firmware::compile(&[wanted])?.remove(0);
    run(&mut command(options, &elf))?;
    if !options.test && !options.dry_run {
        println!(
            "The firmware runs. Its log: probe-rs attach --chip {CHIP} {}",
            firmware::shown(&elf)
        );
    }
    Ok(())
}

/// `tactus device flash` does it: it stays attached for a report, and ends as the image ends; the rig is left alone.
fn command(options: &Options, elf: &Path) -> Command {
    let mut tactus = shell::tactus();
    tactus.args(["device", "flash"]).arg(elf);
    for (flag, wanted) in [("--attach", options.test), ("--dry-run", options.dry_run)] {
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
    fn the_rig_is_left_alone_and_what_reports_is_watched() {
        let line = |watched, options: &[&str]| {
            let [self_test, test] = watched;
            let options = Options {
                self_test,
                test,
                dry_run: false,
                options: options.iter().map(OsString::from).collect(),
            };
            let command = command(&options, Path::new("t/elf"));
            let words: Vec<_> = command.get_args().map(|w| w.to_string_lossy()).collect();
            words.join(" ")
        };
        let run = "run --quiet --release --package tactus-probe -- device flash t/elf";
        assert_eq!(line([false, false], &[]), run);
        assert_eq!(
            line([true, false], &["--probe", "0483:374b"]),
            format!("{run} -- --probe 0483:374b")
        );
        assert_eq!(line([false, true], &[]), format!("{run} --attach"));
    }

    #[test]
    fn the_chip_is_the_one_of_cargo_run() {
        let config = crate::shell::root().join(".cargo/config.toml");
        let config = std::fs::read_to_string(config).unwrap();
        assert!(config.contains(&format!("probe-rs run --chip {CHIP}")));
    }
}
