//! The emulated board.
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::Command;

use anyhow::Result;

use crate::firmware;
use crate::shell::{self, cargo, target};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask emulate --texture 10 --log     with the firmware's own log
  cargo xtask emulate --finger mems          with another finger: analog or mems
  cargo xtask emulate --handheld             a hand that explores with the handheld
  cargo xtask emulate --printer              a 3D printer that moves the finger mems, by `tactus device identify`
  cargo xtask emulate --handheld --motion    with a sensor of motion, too
  cargo xtask emulate --port 7429            serves its serial port at tcp:127.0.0.1:7429 instead
  cargo xtask emulate --help                 all options";

pub(crate) const RIG: &str = "tactus-rig";
pub(crate) const HANDHELD: &str = "tactus-handheld";
/// The image of a probe on somebody else's arm.
pub(crate) const ARM: &str = "tactus-arm";

/// Has the firmware identify a texture, the rig's or with `--handheld` the handheld's, or serves its serial port where
/// a TCP port for it is given.
pub(crate) fn emulate(options: &[OsString]) -> Result<()> {
    let (others, mut options): (Vec<_>, Vec<_>) = options
        .iter()
        .cloned()
        .partition(|o| o == "--handheld" || o == "--printer");
    let run = match (others.first(), value(&options, "--port")) {
        (Some(other), _) if other == "--printer" => {
            shell::run(&mut command_line())?;
            options.push("--tactus".into());
            options.push(tactus().into());
            "printer"
        }
        (Some(_), _) => "handheld",
        (None, Some(_)) => "serve",
        (None, None) => "identify",
    };
    shell::run(&mut command(run, &options)?)
}

/// The value of an option, `--name value` or `--name=value`.
fn value(options: &[OsString], name: &str) -> Option<String> {
    let options: Vec<_> = options.iter().map(|o| o.to_string_lossy()).collect();
    options.iter().enumerate().find_map(|(at, option)| {
        match option.strip_prefix(name)?.strip_prefix('=') {
            Some(value) => Some(value.to_owned()),
            None if option == name => Some(options.get(at + 1)?.clone().into_owned()),
            None => None,
        }
    })
}

pub(crate) fn command(run: &str, options: &[OsString]) -> Result<Command> {
    let help = options.iter().any(|o| o == "--help" || o == "-h");
    // an ELF that is named is the one to run
    let named = value(options, "--elf").is_some();
    // each of the builds has a long tail of a single thread
    let elf = std::thread::scope(|scope| {
        let emulator = scope.spawn(|| shell::run(&mut build()));
        let elf = if help || named {
            None
        } else {
            let image = match value(options, "--printer-port") {
                Some(_) => ARM,
                None => image_of(run),
            };
            Some(firmware::compile(&[image])?.remove(0))
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
    emulator.args(options);
    Ok(emulator)
}

/// The image that a run is of.
pub(crate) fn image_of(run: &str) -> &'static str {
    match run {
        "handheld" => HANDHELD,
        "printer" => ARM,
        _ => RIG,
    }
}

/// Builds the command that a person uses.
pub(crate) fn command_line() -> Command {
    let mut build = workspace("build");
    build.args(["-p", "tactus-probe"]);
    build
}

pub(crate) fn tactus() -> PathBuf {
    target().join("debug/tactus")
}

pub(crate) fn program(run: &str) -> Command {
    let mut emulator = Command::new(target().join("debug/tactus-emulator"));
    emulator.arg(run);
    emulator
}

/// Builds the emulator as the board's tests do, by [`everything`]: its own features would compile all below it again.
pub(crate) fn build() -> Command {
    let mut build = everything("test");
    build.args(["--test", "board", "--no-run"]);
    build
}

/// A cargo command on the whole workspace. rigless declares Rust 1.98, and cranelift below it 1.96: they build with
/// 1.95, which the README names, and these tests are run with that.
pub(crate) fn everything(command: &str) -> Command {
    let mut cargo = cargo();
    cargo.args([command, "--workspace", "--locked", "--ignore-rust-version"]);
    cargo
}

/// A cargo command on the whole workspace but the emulator: a decoder in it has serde_json keep all digits of numbers,
/// and tagged messages with numbers can't be read then.
pub(crate) fn workspace(command: &str) -> Command {
    let mut cargo = cargo();
    cargo.args([
        command,
        "--workspace",
        "--exclude",
        "tactus-emulator",
        "--locked",
    ]);
    cargo
}

pub(crate) fn with_images<'t>(
    tests: &'t mut Command,
    elves: &[PathBuf],
) -> Result<&'t mut Command> {
    let images = [
        ("TACTUS_ELF", RIG),
        ("TACTUS_SELFTEST_ELF", "tactus-selftest"),
        ("TACTUS_SILICON_ELF", "tactus-silicon"),
        ("TACTUS_HANDHELD_ELF", HANDHELD),
        ("TACTUS_ARM_ELF", ARM),
    ];
    for (variable, name) in images {
        tests.env(variable, firmware::image(elves, name)?);
    }
    Ok(tests.env("TACTUS_REQUIRE_ELF", "1"))
}
