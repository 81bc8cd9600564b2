//! The firmware onto a board, by probe-rs.
use std::ffi::OsString;
use std::io::ErrorKind;
use std::path::Path;
use std::process::Command;

use anyhow::{Context as _, Result, bail, ensure};
use clap::Args;

use crate::{firmware, run};

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
    if !options.dry_run {
        look_for_probe("probe-rs")?;
    }
    let wanted = if options.self_test {
        "tactus-selftest"
    } else {
        "tactus-rig"
    };
    let elves = firmware::elves()?;
    let elf = firmware::image(&elves, wanted)?;
    for mut command in commands(options.self_test, elf, &options.options) {
        println!("{}", line(&command));
        if !options.dry_run {
            run(&mut command).context(
                "is the board's USB plug at CN1, and no other program at its probe? LD4 must be lit",
            )?;
        }
    }
    if !options.self_test && !options.dry_run {
        println!(
            "The firmware runs. Its log: probe-rs attach --chip {CHIP} {}",
            firmware::shown(elf)
        );
    }
    Ok(())
}

/// What is run: the self-test stays attached for its report, the rig is left alone.
fn commands(self_test: bool, elf: &Path, options: &[OsString]) -> Vec<Command> {
    let probe_rs = |verb: &str| {
        let mut command = Command::new("probe-rs");
        command.args([verb, "--chip", CHIP]).args(options);
        command
    };
    if self_test {
        let mut test = probe_rs("run");
        test.arg(elf);
        vec![test]
    } else {
        let mut download = probe_rs("download");
        download.arg("--verify").arg(elf);
        vec![download, probe_rs("reset")]
    }
}

fn line(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    let words: Vec<_> = words.map(|word| word.to_string_lossy()).collect();
    words.join(" ")
}

/// That the program is here, and a probe.
fn look_for_probe(program: &str) -> Result<()> {
    let list = match Command::new(program).arg("list").output() {
        Err(e) if e.kind() == ErrorKind::NotFound => bail!(
            "probe-rs is not installed. Install it with
  cargo install probe-rs-tools --locked
or as https://probe.rs/docs/getting-started/installation says. Without it: cargo xtask bundle, and see FLASHING.md there"
        ),
        list => list.context("probe-rs does not start")?,
    };
    let said = String::from_utf8_lossy(&list.stdout);
    ensure!(
        list.status.success() && !said.contains("No debug probes"),
        "no debug probe found. Plug the board's USB socket CN1 into this PC. On Linux the user needs the right to use it:
https://probe.rs/docs/getting-started/probe-setup (udev rules)"
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rig_is_written_and_started_and_the_self_test_is_watched() {
        let lines = |self_test, options: &[OsString]| {
            let commands = commands(self_test, Path::new("t/elf"), options);
            commands.iter().map(line).collect::<Vec<_>>()
        };
        assert_eq!(
            lines(false, &[]),
            [
                "probe-rs download --chip STM32F429ZITx --verify t/elf",
                "probe-rs reset --chip STM32F429ZITx"
            ]
        );
        let probe = ["--probe".into(), "0483:374b".into()];
        assert_eq!(
            lines(true, &probe),
            ["probe-rs run --chip STM32F429ZITx --probe 0483:374b t/elf"]
        );
    }

    #[test]
    fn what_is_missing_is_said_with_what_to_do() {
        let error = |program| look_for_probe(program).unwrap_err().to_string();
        assert!(error("no-such-probe-rs").contains("cargo install probe-rs-tools"));
        // a program that lists nothing and fails
        assert!(error("false").contains("no debug probe found"));
        assert!(look_for_probe("true").is_ok());
    }

    #[test]
    fn the_chip_is_the_one_of_cargo_run() {
        let config = crate::root().join(".cargo/config.toml");
        let config = std::fs::read_to_string(config).unwrap();
        assert!(config.contains(&format!("probe-rs run --chip {CHIP}")));
    }
}
