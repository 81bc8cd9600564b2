//! `tactus device printer`: a 3D printer that moves the finger, its set-up and the file of that.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::{Args, Subcommand};
use tactus_link::printer::{OpenPrinter, Setup, set_up};

use super::bench::{Bench, BenchError};
use super::line::{Where, in_data_home};
use crate::cmd::output::Format;

/// A 3D printer that presses and slides the finger: Marlin, or Klipper's pseudo-terminal
#[derive(Subcommand)]
#[command(after_help = "\
Examples:
  tactus device printer setup --printer /dev/ttyUSB0     once, with the finger on its holder and a sample on the bed
  tactus device printer show                             what was measured
  tactus device identify --printer                       by the printer of the set-up
  tactus device record oak cork --printer --out mine     slides for a table of this machine

The probe runs the firmware `tactus-arm`. Heaters stay cold, fans are switched off, nothing is homed. The page \"A 3D
printer as the rig\" of the book says how it is built.")]
pub(crate) enum Command {
    Setup(SetUp),
    Show(Show),
}

/// Measure a printer with a person beside it: where the sample lies, how deep the finger may go, how it answers
#[derive(Args)]
#[command(after_help = "\
Examples:
  tactus device printer setup --printer /dev/ttyUSB0
  tactus device printer setup --printer ~/printer_data/comms/klippy.serial     Klipper
  tactus device printer setup --printer COM5 --baud 250000

Each step says what it does next, and waits for a line: y or n. Nothing moves before you have said that the way is free;
the first approach is at 0.5 mm/s. Ctrl-C lifts the finger; the same command goes on if nothing was moved.")]
pub(crate) struct SetUp {
    #[command(flatten)]
    at: Where,
    /// Its baud rate
    #[arg(long, value_name = "N", default_value_t = 115_200)]
    #[arg(value_parser = clap::value_parser!(u32).range(9600..=2_000_000))]
    baud: u32,
}

/// Show the set-up of the printer
#[derive(Args)]
pub(crate) struct Show {
    /// Its file, and not ~/.local/share/tactus/printer.json
    #[arg(long, value_name = "FILE")]
    printer_setup: Option<PathBuf>,
    /// The file itself, for programs
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(command: &Command, out: &mut impl Write) -> anyhow::Result<()> {
    match command {
        Command::Setup(args) => set_up_one(args, out),
        Command::Show(args) => show(args, out),
    }
}

/// The printer of a set-up, at this port or, where that is empty, at its own.
pub(super) fn open(port: &str, file: Option<&Path>) -> Result<OpenPrinter, BenchError> {
    let opened = file_of(file).and_then(|file| Ok(OpenPrinter::of_file(port, &file)?));
    opened.map_err(|why| BenchError::Printer(format!("{why:#}")))
}

fn file_of(given: Option<&Path>) -> anyhow::Result<PathBuf> {
    match given {
        Some(file) => Ok(file.to_owned()),
        None => Ok(in_data_home("", "name a file with --printer-setup")?.join("printer.json")),
    }
}

fn set_up_one(args: &SetUp, out: &mut impl Write) -> anyhow::Result<()> {
    let port = args.at.printer.clone().filter(|port| !port.is_empty());
    let port = port.ok_or_else(|| {
        anyhow!("say which port the printer has: --printer /dev/ttyUSB0, COM5 or HOST:PORT")
    })?;
    let file = file_of(args.at.printer_setup.as_deref())?;
    // the printer is not set up: it is not the one of a file
    let place = Where {
        printer: None,
        ..args.at.clone()
    };
    let (mut bench, _) = Bench::open(&place, Format::Text)?;
    // what a set-up before has left, once
    let mut part = file.clone().into_os_string();
    part.push(".part");
    let left = Setup::read_file(Path::new(&part)).ok();
    let left = left.filter(|left| left.port == port && left.baud == args.baud);
    let _ = std::fs::remove_file(&part);
    let open = OpenPrinter::bare(&port, args.baud, left)?;
    let printer = open.printer.clone();
    bench.move_by(open);
    bench.takes_lines = true;
    let probe = bench.probe.clone();
    let done = bench.done(set_up(&probe, &printer, &port, args.baud), out);
    if done.is_err()
        && let Some(left) = printer.setup().filter(|left| left.parked.is_some())
    {
        left.write_file(Path::new(&part))?;
    }
    let setup = done?;
    setup.write_file(&file)?;
    writeln!(
        out,
        "Kept in {}. Next: tactus device identify --printer; the factory table is of a simulated machine, so record \
         and learn one of this: tactus device record NAME NAME --printer --out mine",
        file.display()
    )?;
    Ok(())
}

fn show(args: &Show, out: &mut impl Write) -> anyhow::Result<()> {
    let file = file_of(args.printer_setup.as_deref())?;
    let setup = Setup::read_file(&file)?;
    if args.json {
        out.write_all(setup.write().as_bytes())?;
        return Ok(());
    }
    let or_none =
        |mm: Option<f64>, unit| mm.map_or("not measured".into(), |mm| format!("{mm:.2} {unit}"));
    let parked = setup.parked.map_or_else(
        || "not known: it moves, or was cut off while it moved".to_owned(),
        |[along, z]| format!("{} {along:.2}, Z {z:.2} mm", setup.axis.letter()),
    );
    let [begin, end] = setup.sample_mm;
    let [soonest, latest] = setup.start_s.map(|s| s * 1e3);
    let rows = [
        ("file", file.display().to_string()),
        ("port", format!("{} at {} baud", setup.port, setup.baud)),
        ("firmware", format!("{:?}", setup.dialect)),
        (
            "slides along",
            format!("{}, {begin:.1} to {end:.1} mm", setup.axis.letter()),
        ),
        ("finger lifted", format!("Z {:.2} mm", setup.lifted_mm)),
        ("never below", format!("Z {:.2} mm", setup.floor_mm)),
        (
            "acceleration",
            format!("{:.0} mm/s^2", setup.acceleration_mm_s2),
        ),
        ("line to motion", format!("{soonest:.0} to {latest:.0} ms")),
        ("stiffness", or_none(setup.stiffness_n_mm, "N/mm")),
        ("play of Z", or_none(setup.backlash_mm, "mm")),
        ("parked at", parked),
    ];
    for (name, value) in rows {
        writeln!(out, "{name:<15} {value}")?;
    }
    Ok(())
}
