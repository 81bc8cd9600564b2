//! The emulated board: a workspace of its own, since its crate wants a newer Rust than the others.
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::Command;

use anyhow::Result;

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
        Some(firmware::image(&firmware::build()?, "tactus-rig")?.to_owned())
    };
    crate::run(&mut build())?;
    let mut emulator = Command::new(folder().join("release").join(program));
    if let Some(elf) = elf {
        emulator.arg("--elf").arg(elf);
    }
    crate::run(emulator.args(options))
}

/// Where cargo puts the emulator.
pub(crate) fn folder() -> PathBuf {
    target().join("emulator")
}

/// Builds the emulator's programs.
pub(crate) fn build() -> Command {
    let mut build = cargo_there("build");
    build.arg("--release");
    build
}

/// Formatting and lints of the emulator.
pub(crate) fn lints() -> [Command; 2] {
    let mut format = cargo();
    format.current_dir(root().join("host-tools/emulator"));
    format.args(["fmt", "--check"]);
    let mut clippy = cargo_there("clippy");
    // in release, so that its build scripts and macros are those of the tests
    clippy.args(["--release", "--all-targets", "--", "-Dwarnings"]);
    [format, clippy]
}

/// The emulator's tests, with the images that would be flashed.
pub(crate) fn tests(elves: &[PathBuf]) -> Result<Command> {
    let mut tests = cargo_there("test");
    tests.args(["--release", "--no-fail-fast"]);
    tests.env("TACTUS_ELF", firmware::image(elves, "tactus-rig")?);
    let selftest = firmware::image(elves, "tactus-selftest")?;
    tests.env("TACTUS_SELFTEST_ELF", selftest);
    let handheld = firmware::image(elves, "tactus-handheld")?;
    tests.env("TACTUS_HANDHELD_ELF", handheld);
    tests.env("TACTUS_REQUIRE_ELF", "1");
    Ok(tests)
}

/// A cargo command in the emulator's workspace.
fn cargo_there(command: &str) -> Command {
    let mut cargo = cargo();
    // its own configuration is read from there
    cargo.current_dir(root().join("host-tools/emulator"));
    // the crate below says Rust 1.98 and builds on 1.95
    cargo.args([command, "--locked", "--ignore-rust-version"]);
    cargo.arg("--target-dir").arg(folder());
    cargo
}
