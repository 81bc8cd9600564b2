//! `tactus device status`: how the probe is.

use std::io::Write;

use serde::Serialize;
use tactus::eval::show::count;
use tactus::link::Request;
use tactus_core::rig::{Fault, most_mn};
use tactus_core::wire::{Phase, Status};

use super::bench::Bench;
use super::calibrate::{CalibrationSummary, calibration_rows};
use super::line::Where;
use crate::cmd::output::{Format, percent, print_json, print_rows};

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
    let (mut bench, status) = Bench::open(&args.at)?;
    let calibration = bench.get(Request::read_calibration())?;
    let (damaged, missing) = bench.losses();
    let (joule, wear) = status.skin_mj;
    let [joule, wear] = [joule, wear].map(|mj| f64::from(mj) * 1e-3);
    if args.format == Format::Json {
        let summary = Summary {
            port: &bench.name,
            status: &status,
            table_checksum: format!("{:08x}", status.table_crc),
            recovery: status.fault.map(Fault::recovery),
            skin_j: joule,
            wear_j: wear,
            frames_damaged: damaged,
            reports_lost: missing,
            calibration: CalibrationSummary::new(&calibration),
        };
        return print_json(&summary, out);
    }
    let mut rows = vec![
        ("probe", format!("at {}", bench.name)),
        ("finger", status.finger.to_string()),
        ("rig", phase_name(status.phase).to_owned()),
    ];
    if let Some(fault) = &status.fault {
        let fault = format!("{fault}: {} (tactus device home)", fault.recovery());
        rows.push(("FAULT", fault));
    }
    let whose = if status.factory {
        ", the firmware's own"
    } else {
        ""
    };
    let counts = &status.counts;
    rows.extend([
        (
            "table",
            format!(
                "{}, {} bytes, checksum {:08x}{whose}",
                count(status.textures, "texture"),
                status.table_bytes,
                status.table_crc
            ),
        ),
        (
            "acquisition",
            format!(
                "{}; {} late, {}, {}, {} lost",
                count(counts.slots, "slot"),
                counts.late_slots,
                count(counts.parity_errors, "parity error"),
                count(counts.error_frames, "error frame"),
                count(counts.lost_samples, "sample")
            ),
        ),
        (
            "link",
            format!(
                "probe: {} dropped, {} damaged; PC: {} damaged, {} lost",
                count(counts.lost_reports, "report"),
                count(counts.damaged_frames, "request"),
                count(damaged, "frame"),
                count(missing, "report")
            ),
        ),
        (
            "skin",
            format!("{joule:.1} J of sliding, {wear:.1} J of it wear"),
        ),
    ]);
    rows.push(("limits", limits(status.false_alarm)));
    if status.high_force {
        rows.push(("HIGH FORCE", movements(true)));
    }
    rows.extend(calibration_rows(&calibration));
    print_rows(&rows, out)
}

/// For which false alarms the probe's limits are.
pub(crate) fn limits(false_alarm: Option<f32>) -> String {
    match false_alarm {
        Some(share) => format!(
            "for {} false alarms, as set (tactus device settings)",
            percent(share.into())
        ),
        None => "for the table's own false alarms".to_owned(),
    }
}

/// How hard movements may press.
pub(crate) fn movements(high_force: bool) -> String {
    let most_n = f32::from(most_mn(high_force)) * 1e-3;
    let set = if high_force {
        ", as set: keep the mount that yields, or the stop (tactus device settings)"
    } else {
        ""
    };
    format!("up to {most_n:.2} N{set}")
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
