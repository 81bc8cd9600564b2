//! `tactus device status`: how the probe is.

use std::io::Write;

use tactus::link::Request;
use tactus_core::wire::Phase;

use super::bench::{Bench, recovery};
use super::calibrate::calibration_rows;
use super::line::Where;
use crate::cmd::output::{Format, print_json, print_rows};

/// Show the state of the probe: rig, faults, table, counters
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus device status
  tactus device status --port /dev/ttyACM1 --format json")]
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
    if args.format == Format::Json {
        return print_json(&status, out);
    }
    let calibration = bench.get(Request::read_calibration())?;
    let mut rows = vec![
        ("probe", format!("at {}", bench.name)),
        ("rig", phase_name(status.phase).to_owned()),
    ];
    if let Some(fault) = &status.fault {
        let fault = format!("{fault}: {} (tactus device home)", recovery(fault));
        rows.push(("FAULT", fault));
    }
    let whose = if status.factory {
        ", the firmware's own"
    } else {
        ""
    };
    let counts = &status.counts;
    let (damaged, missing) = bench.losses();
    let (joule, wear) = (
        f64::from(status.skin_mj.0) * 1e-3,
        f64::from(status.skin_mj.1) * 1e-3,
    );
    rows.extend([
        ("table", format!(
            "{} textures, {} bytes, checksum {:08x}{whose}",
            status.textures, status.table_bytes, status.table_crc
        )),
        ("acquisition", format!(
            "{} slots; {} late, {} parity errors, {} error frames, {} samples lost",
            counts.slots, counts.late_slots, counts.parity_errors, counts.error_frames, counts.lost_samples
        )),
        ("link", format!(
            "probe: {} reports dropped, {} requests damaged; PC: {damaged} frames damaged, {missing} reports lost",
            counts.lost_reports, counts.damaged_frames
        )),
        ("skin", format!("{joule:.1} J of sliding, {wear:.1} J of it wear")),
    ]);
    rows.extend(calibration_rows(&calibration));
    print_rows(&rows, out)
}

/// What the rig does, in a word.
pub(crate) fn phase_name(phase: Phase) -> &'static str {
    match phase {
        Phase::Parked => "parked: position not known, home it first",
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
