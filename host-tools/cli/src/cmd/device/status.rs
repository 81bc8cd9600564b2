//! `tactus device status`: how the probe is.

use std::io::Write;

use serde::Serialize;
use tactus_core::rig::Fault;
use tactus_core::wire::Status;
use tactus_link::operations;

use super::bench::Bench;
use super::calibrate::CalibrationSummary;
use super::line::Where;
use crate::cmd::output::{Format, print_json};

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

/// What `device status --format json` prints.
#[derive(Serialize)]
struct Summary<'a> {
    port: &'a str,
    #[serde(flatten)]
    status: &'a Status,
    /// CRC-32, in hexadecimal digits.
    table_checksum: String,
    /// What to do about the fault.
    recovery: Option<&'static str>,
    /// Work of sliding, and that part of it that wears the skin.
    skin_j: f64,
    wear_j: f64,
    frames_damaged: u64,
    reports_lost: u64,
    calibration: CalibrationSummary,
}

/// Prints the probe's status.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut bench, _) = Bench::open(&args.at, args.format)?;
    let probe = bench.probe();
    let (status, calibration) = bench.done(operations::status(&probe), out)?;
    if args.format == Format::Text {
        return Ok(());
    }
    let (frames_damaged, reports_lost) = bench.losses();
    let (joule, wear) = status.skin_mj;
    let [skin_j, wear_j] = [joule, wear].map(|mj| f64::from(mj) * 1e-3);
    let summary = Summary {
        port: &bench.name,
        status: &status,
        table_checksum: format!("{:08x}", status.table_crc),
        recovery: status.fault.map(Fault::recovery),
        skin_j,
        wear_j,
        frames_damaged,
        reports_lost,
        calibration: CalibrationSummary::new(&calibration),
    };
    print_json(&summary, out)
}
