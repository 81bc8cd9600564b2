//! The emulated board: a workspace of its own, since its crate wants a newer Rust than the others.
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context as _, Result};

use crate::{cargo, firmware, root, target};

/// Builds firmware and emulator and starts a program of the emulator's with them.
pub(crate) fn start(program: &str, options: &[OsString]) -> Result<()> {
    let help = options.iter().any(|o| o == "--help" || o == "-h");
    // an ELF that is named is the one to run
    let named = options
        .iter()
        .any(|o| o == "--elf" || o.to_string_lossy().starts_with("--elf="));
    let elf = if help || named {
        None
    } else {
        let elves = firmware::build()?;
        let rig = |elf: &&PathBuf| elf.file_name() == Some("tactus-rig".as_ref());
        let elf = elves.iter().find(rig);
        Some(elf.context("the firmware has no tactus-rig")?.clone())
    };
    crate::run(&mut build())?;
    let mut emulator = Command::new(folder().join("release").join(program));
    if let Some(elf) = elf {
        emulator.arg("--elf").arg(elf);
    }
    crate::run(emulator.args(options))
}

/// Where cargo puts the emulator.
fn folder() -> PathBuf {
    target().join("emulator")
}

fn build() -> Command {
    let mut cargo = cargo();
    // its own configuration is read from there
    cargo.current_dir(root().join("host-tools/emulator"));
    // the crate below says Rust 1.98 and builds on 1.95
    cargo.args(["build", "--release", "--locked", "--ignore-rust-version"]);
    cargo.arg("--target-dir").arg(folder());
    cargo
}
