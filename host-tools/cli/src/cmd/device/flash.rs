//! `tactus device flash`: an image into the chip, by probe-rs.

use std::ffi::OsString;
use std::io::{self, Write};
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context as _, bail, ensure};

/// Flash a firmware image with probe-rs
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus device flash target/debian/thumbv7em-none-eabihf/firmware/tactus-rig
  tactus device flash ELF -- --probe 0483:374b:SER   if there are several: `probe-rs list` names them
`cargo xtask flash` builds the firmware and flashes it.")]
pub(crate) struct Args {
    /// The image: what `cargo xtask size` names
    elf: PathBuf,
    /// Stay attached and show the image's log until Ctrl-C
    #[arg(long)]
    attach: bool,
    /// Print what would be run
    #[arg(long)]
    dry_run: bool,
    /// Options for probe-rs
    #[arg(last = true)]
    options: Vec<OsString>,
}

const CHIP: &str = "STM32F429ZITx";

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    ensure!(
        args.elf.is_file(),
        "{}: no such file; `cargo xtask size` builds the firmware and names it",
        args.elf.display()
    );
    if !args.dry_run {
        look_for_probe("probe-rs")?;
    }
    // an image to attach to is watched, others are left alone
    let verbs: &[(&str, &[&str])] = match args.attach {
        true => &[("run", &[])],
        false => &[("download", &["--verify"]), ("reset", &[])],
    };
    for (verb, switches) in verbs {
        let mut command = Command::new("probe-rs");
        command
            .args([verb, "--chip", CHIP])
            .args(&args.options)
            .args(*switches);
        if *verb != "reset" {
            command.arg(&args.elf);
        }
        let words = std::iter::once(command.get_program()).chain(command.get_args());
        let words: Vec<_> = words.map(|word| word.to_string_lossy()).collect();
        writeln!(out, "{}", words.join(" "))?;
        out.flush()?;
        if !args.dry_run {
            let status = command.status().context("probe-rs does not start")?;
            ensure!(
                status.success(),
                "probe-rs ended with {status}: is the board's USB plug at CN1, and no other program at its probe? LD4 \
                 must be lit"
            );
        }
    }
    Ok(())
}

fn look_for_probe(program: &str) -> anyhow::Result<()> {
    let list = match Command::new(program).arg("list").output() {
        Err(e) if e.kind() == io::ErrorKind::NotFound => bail!(
            "probe-rs is not installed. Install it with
  cargo install probe-rs-tools --locked
or as https://probe.rs/docs/getting-started/installation says.
Without it: cargo xtask bundle, and see FLASHING.md there"
        ),
        list => list.context("probe-rs does not start")?,
    };
    let said = String::from_utf8_lossy(&list.stdout);
    ensure!(
        list.status.success() && !said.contains("No debug probes"),
        "no debug probe found. Plug the board's USB socket CN1 into this PC.
On Linux the user needs the right to use it:
https://probe.rs/docs/getting-started/probe-setup (udev rules)"
    );
    Ok(())
}
