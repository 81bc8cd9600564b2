//! The emulated board: a workspace of its own, since its crate wants a newer Rust than the others.
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::Command;

use anyhow::Result;

use crate::firmware;
use crate::shell::{self, cargo, root, target};

/// The image that every run is of.
pub(crate) const RIG: &str = "tactus-rig";
/// The image that a hand holds.
pub(crate) const HANDHELD: &str = "tactus-handheld";
/// The same with a sensor of motion.
pub(crate) const MOTION: &str = "tactus-handheld-motion";
/// The image of a probe on somebody else's arm.
pub(crate) const ARM: &str = "tactus-arm";

/// Has the firmware identify a texture, the rig's or with `--handheld` the handheld's, or serves its serial port where a TCP port
/// for it is given.
pub(crate) fn emulate(options: &[OsString]) -> Result<()> {
    let (by_hand, options): (Vec<_>, Vec<_>) =
        options.iter().cloned().partition(|o| o == "--handheld");
    let run = match (by_hand.is_empty(), value(&options, "--port")) {
        (false, _) => "handheld",
        (true, Some(_)) => "serve",
        (true, None) => "identify",
    };
    start(run, &options)
}

/// The value of an option, `--name value` or `--name=value`.
pub(crate) fn value(options: &[OsString], name: &str) -> Option<String> {
    let options: Vec<_> = options.iter().map(|o| o.to_string_lossy()).collect();
    options.iter().enumerate().find_map(|(at, option)| {
        match option.strip_prefix(name)?.strip_prefix('=') {
            Some(value) => Some(value.to_owned()),
            None if option == name => Some(options.get(at + 1)?.clone().into_owned()),
            None => None,
        }
    })
}

/// Builds firmware and emulator and starts a run of it.
pub(crate) fn start(run: &str, options: &[OsString]) -> Result<()> {
    let help = options.iter().any(|o| o == "--help" || o == "-h");
    // an ELF that is named is the one to run
    let named = value(options, "--elf").is_some();
    // each of the builds has a long tail of a single thread
    let elf = std::thread::scope(|scope| {
        let emulator = scope.spawn(|| shell::run(&mut build()));
        let elf = if help || named {
            None
        } else {
            let kind = match run {
                "handheld" if options.iter().any(|o| o == "--motion") => MOTION,
                "handheld" => HANDHELD,
                _ if value(options, "--arm-port").is_some() => ARM,
                _ => RIG,
            };
            let image = firmware::image_for(kind, value(options, "--finger").as_deref())?;
            let elf = firmware::compile(&[&image])?.remove(0);
            Some(elf)
        };
        emulator.join().expect("a build does not panic")?;
        anyhow::Ok(elf)
    })?;
    let mut emulator = program(run);
    if let Some(elf) = elf {
        // stdout is the run's where a program reads it
        if value(options, "--format").as_deref() != Some("json") {
            firmware::describe(&elf)?;
        }
        emulator.arg("--elf").arg(elf);
    }
    shell::run(emulator.args(options))
}

/// What of a release is to be built twice: all where `--builds` stands alone, and nothing without it.
pub(crate) fn builds(options: &[OsString]) -> Option<Vec<String>> {
    options.iter().find(|o| {
        let option = o.to_string_lossy();
        option == "--builds" || option.starts_with("--builds=")
    })?;
    let only = value(options, "--builds").unwrap_or_default();
    Some(only.split_terminator(',').map(str::to_owned).collect())
}

/// The campaign on emulated boards, or of faults where so many of them are asked for.
pub(crate) fn campaign(options: &[OsString]) -> Result<()> {
    let given = |name: &str| {
        options.iter().any(|option| {
            let option = option.to_string_lossy();
            option
                .strip_prefix(name)
                .is_some_and(|rest| rest.is_empty() || rest.starts_with('='))
        })
    };
    if !given("--faults") {
        return start("campaign", options);
    }
    let board = given("--board");
    let mut options = options.to_vec();
    if !given("--out") {
        let file = if board { "board.jsonl" } else { "cases.jsonl" };
        options.extend(["--out".into(), target().join("faults").join(file).into()]);
    }
    if board {
        return start("faults", &options);
    }
    shell::run(&mut build())?;
    shell::run(program("faults").args(options))
}

/// A run of the emulator, which is built.
pub(crate) fn program(run: &str) -> Command {
    let mut emulator = Command::new(folder().join("release/tactus-emulator"));
    emulator.arg(run);
    emulator
}

/// Where cargo puts the emulator.
fn folder() -> PathBuf {
    target().join("emulator")
}

/// Builds the emulator.
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

/// The emulator's tests.
pub(crate) fn tests() -> Command {
    let mut tests = cargo_there("test");
    tests.args(["--release", "--no-fail-fast"]);
    tests
}

/// Tests with the images that would be flashed.
pub(crate) fn with_images<'t>(
    tests: &'t mut Command,
    elves: &[PathBuf],
) -> Result<&'t mut Command> {
    let images = [
        ("TACTUS_ELF", RIG),
        ("TACTUS_SELFTEST_ELF", "tactus-selftest"),
        ("TACTUS_SILICON_ELF", "tactus-silicon"),
        ("TACTUS_HANDHELD_ELF", HANDHELD),
        ("TACTUS_MOTION_ELF", MOTION),
        ("TACTUS_ARM_ELF", ARM),
        ("TACTUS_ANALOG_ELF", "tactus-rig-analog"),
        ("TACTUS_MEMS_ELF", "tactus-rig-mems"),
        ("TACTUS_HANDHELD_MEMS_ELF", "tactus-handheld-mems"),
    ];
    for (variable, name) in images {
        tests.env(variable, firmware::image(elves, name)?);
    }
    Ok(tests.env("TACTUS_REQUIRE_ELF", "1"))
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
