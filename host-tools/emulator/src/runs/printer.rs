//! An exploration by the firmware of an arm, whose finger hangs on a simulated 3D printer, through the command that a
//! person uses.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};

use anyhow::{Context as _, bail, ensure};
use clap::Args as Arguments;
use tactus_core::sensor::FingerName;
use tactus_lab::sim::collection::{Collection, texture_name};
use tactus_lab::sim::printer::{learn_on, measured};

use super::serve::{PrinterFirmware, Served, TcpLine};
use crate::board::Options;
use crate::host::args::{Firmware, Format};
use crate::host::under_finger::mounted;

/// The finger must never feel more, N.
const MOST_N: f64 = 2.2;
/// Trials of each texture and movement that the table is learned from, by the same machine.
const TRIALS: u32 = 5;
/// The board's time, in a file: the command goes by it, however slow this PC is.
const CLOCK: &str = "clock";
/// A command takes no longer, ns of the board's time.
const LONGEST_NS: u64 = 600_000_000_000;

/// What is identified, and by which machine.
#[derive(Arguments)]
pub(crate) struct Args {
    #[command(flatten)]
    firmware: Firmware,
    /// The command `tactus`
    #[arg(long, value_name = "PATH")]
    tactus: PathBuf,
    /// The finger: analog or mems
    #[arg(long, value_name = "NAME", default_value_t = FingerName::Mems)]
    finger: FingerName,
    /// Textures that the firmware is to know; the unknown one is among them
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u8).range(2..=117))]
    among: u8,
    /// Another seed is another machine, another texture, and another sample on its bed
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Firmware of the printer
    #[arg(long, value_enum, default_value_t = PrinterFirmware::Marlin)]
    printer_firmware: PrinterFirmware,
    /// For people, or a line of JSON at the end for programs
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// True if the verdict is right, or was printed for a program. Errors: something was not as it must be.
pub(crate) fn run(args: &Args) -> anyhow::Result<bool> {
    let text = args.format == Format::Text;
    args.firmware.show(text)?;
    let kind = args.printer_firmware.kind();
    let texture = 1 + (args.seed * 37 % 117) as u8;
    let truth = texture_name(texture);
    let world = Collection::new(args.seed, Collection::spread(texture, args.among), TRIALS)
        .touched_by(args.finger);
    eprintln!(
        "A printer ({kind:?}) with the finger {}: it learns {} textures by {TRIALS} slides of each movement ...",
        args.finger, args.among
    );
    let table = learn_on(&world, kind)?;
    let folder = tempfile::tempdir()?;
    let (table_file, setup_file) = (
        folder.path().join("printer.tact"),
        folder.path().join("printer.json"),
    );
    std::fs::write(&table_file, table)?;
    std::fs::write(&setup_file, measured(kind).write())?;
    let unknown = mounted(&world, texture, 7 + args.seed);
    let board = unknown.start(&args.firmware.elf, Options::default())?;
    let mut served = Served::new(board, TcpLine::bind(0)?, false);
    let seeds = (unknown.setup.world_seed, unknown.setup.trial_seed);
    served.print_on(TcpLine::bind(0)?, seeds, kind);
    served.clock = Some(File::create(folder.path().join(CLOCK))?);
    eprintln!("Under the finger: {truth} (seed {}).", args.seed);
    let port = served.serial.address()?.to_string();
    let printer = served.printer.as_ref().context("it was mounted")?;
    let printer = printer.address()?.to_string();
    let command = |words: &[&str]| {
        let mut command = Command::new(&args.tactus);
        command.arg("device").args(words).args(["--port", &port]);
        command
    };
    let mut push = command(&["table", "push", "--yes"]);
    push.arg(&table_file)
        .arg("--backup")
        .arg(folder.path().join("before.tact"));
    let pushed = attend(&mut served, push.stdout(Stdio::null()), folder.path())?;
    ensure!(
        pushed.success(),
        "`tactus device table push` ended with {pushed}"
    );
    let began_ns = served.board.now_ns();
    let seed = args.seed.to_string();
    let mut identify = command(&[
        "identify",
        "--format",
        "json",
        "--seed",
        &seed,
        "--printer",
        &printer,
    ]);
    identify.arg("--printer-setup").arg(&setup_file);
    let said = folder.path().join("said");
    identify.stdout(File::create(&said)?);
    let ended = attend(&mut served, &mut identify, folder.path())?;
    let said = std::fs::read_to_string(&said)?;
    let json: serde_json::Value = serde_json::from_str(&said).with_context(|| {
        format!("`tactus device identify` ended with {ended} and said {said:?}")
    })?;
    let force_max_n = served.board.rig().world().truth().force_max_n;
    let seconds = (served.board.now_ns() - began_ns) as f64 * 1e-9;
    let (resets, violations) = (served.board.resets()?, served.board.violations()?);
    let ending = tell(args, &json["verdict"], truth, (seconds, force_max_n));
    ensure!(resets.is_empty(), "the board has started anew: {resets:?}");
    ensure!(
        violations.is_empty(),
        "not as the vendor has it: {violations:?}"
    );
    ensure!(force_max_n < MOST_N, "{force_max_n:.2} N on the finger");
    Ok(ending == "Right" || !text)
}

/// Prints the verdict, and returns how the exploration ended.
fn tell(
    args: &Args,
    verdict: &serde_json::Value,
    truth: &str,
    (seconds, force_max_n): (f64, f64),
) -> &'static str {
    let says = verdict["texture"].as_str().unwrap_or_default();
    let ending = match (verdict["told"] == "sure", says == truth) {
        (true, true) => "Right",
        (true, false) => "Wrong",
        _ => "Undecided",
    };
    if args.format == Format::Text {
        println!(
            "{ending}: it says {verdict} after {} slides and {seconds:.0} s, it was {truth}; at most {force_max_n:.2} \
             N by the world.",
            verdict["slides"],
        );
    } else {
        let line = serde_json::json!({
            "verdict": ending,
            "says": says,
            "truth": truth,
            "seed": args.seed,
            "seconds": seconds,
            "force_max_n": force_max_n,
            "force_errors": [],
        });
        println!("{line}");
    }
    ending
}

/// Serves board and printer until a command ends.
fn attend(served: &mut Served, command: &mut Command, folder: &Path) -> anyhow::Result<ExitStatus> {
    let spawned = command
        .env("XDG_DATA_HOME", folder)
        .env("TACTUS_CLOCK", folder.join(CLOCK))
        .stdin(Stdio::null())
        .spawn();
    let mut child = spawned.context("--tactus: cannot be run")?;
    let ended = serve_until(served, &mut child);
    if ended.is_err() {
        // the reason is told
        let _ = child.kill();
    }
    ended
}

fn serve_until(served: &mut Served, child: &mut Child) -> anyhow::Result<ExitStatus> {
    let until = served.board.now_ns() + LONGEST_NS;
    while served.board.now_ns() < until {
        for _ in 0..10 {
            served.step()?;
        }
        if let Some(ended) = child.try_wait()? {
            return Ok(ended);
        }
    }
    bail!("the command does not end")
}
