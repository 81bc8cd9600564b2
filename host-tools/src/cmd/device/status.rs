//! `tactus device status`: how the probe is.

use std::io::{self, Write};

use tactus::link::Question;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::wire::{Phase, Status};

use super::bench::Bench;
use super::calibrate::show_calibration;
use super::line::Where;
use crate::cmd::output::{Format, print_json};

/// Say how the probe is: rig, faults, table, counters
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    at: Where,
    /// How to print it
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// Prints the probe's status.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut bench, status) = Bench::open(&args.at)?;
    match args.format {
        Format::Json => print_json(&status, out),
        Format::Text => {
            let calibration = bench.run(Question::read_calibration(), |_| Ok(()))?;
            Ok(show_status(&bench, &status, &calibration, out)?)
        }
    }
}

fn show_status(
    bench: &Bench,
    status: &Status,
    calibration: &RigCalibration,
    out: &mut impl Write,
) -> io::Result<()> {
    writeln!(out, "probe           at {}", bench.name)?;
    writeln!(out, "rig             {}", phase_name(status.phase))?;
    if let Some(fault) = status.fault {
        let recovery = fault.row().map_or("reset", |row| row.recovery);
        writeln!(
            out,
            "FAULT           {fault}: {recovery} (tactus device home)"
        )?;
    }
    writeln!(
        out,
        "table           {} textures, {} bytes, checksum {:08x}{}",
        status.textures,
        status.table_bytes,
        status.table_crc,
        if status.factory {
            ", the firmware's own"
        } else {
            ""
        }
    )?;
    let counts = &status.counts;
    writeln!(
        out,
        "acquisition     {} slots; {} late, {} parity errors, {} error frames, {} samples lost",
        counts.slots,
        counts.late_slots,
        counts.parity_errors,
        counts.error_frames,
        counts.lost_samples
    )?;
    let (damaged, missing) = bench.losses();
    writeln!(
        out,
        "link            {} reports found no room, {} requests damaged; here {damaged} frames damaged, {missing} reports lost",
        counts.lost_reports, counts.damaged_frames
    )?;
    writeln!(
        out,
        "skin            {:.1} J of sliding, {:.1} J of it wear",
        f64::from(status.skin_mj.0) * 1e-3,
        f64::from(status.skin_mj.1) * 1e-3
    )?;
    show_calibration(calibration, out)
}

/// What the rig does, in a word.
pub(crate) fn phase_name(phase: Phase) -> &'static str {
    match phase {
        Phase::Parked => "parked: does not know where it is",
        Phase::Homing => "homing",
        Phase::Ready => "ready",
        Phase::Positioning => "positioning",
        Phase::Pressing => "pressing",
        Phase::Background => "background",
        Phase::Sliding => "sliding",
        Phase::Lifting => "lifting",
        Phase::Unloaded => "unloaded run",
        Phase::Faulted => "faulted",
    }
}
