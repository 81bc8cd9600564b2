//! `tactus device status`: how the probe is.

use std::io::Write;

use serde::Serialize;
use tactus_core::rig::Fault;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::wire::Status;
use tactus_link::operations;
use tactus_link::say::{date, sensor, turned};

use super::bench::Bench;
use super::line::Where;
use crate::cmd::output::{Format, print_json};

/// Show the state of the probe: rig, faults, table, counters, constants, settings
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

#[derive(Serialize)]
struct Summary<'a> {
    port: &'a str,
    #[serde(flatten)]
    status: &'a Status,
    /// CRC-32, in hexadecimal digits.
    table_checksum: String,
    /// The remedy of the fault.
    recovery: Option<&'static str>,
    /// Work of sliding, and that part of it that wears the skin.
    skin_j: f64,
    wear_j: f64,
    frames_damaged: u64,
    reports_lost: u64,
    calibration: CalibrationSummary,
}

#[derive(Serialize)]
struct CalibrationSummary {
    /// The day on which the force per count was measured, as "2026-11-21"; `null`: it was not, and is the paper's.
    force_scale_date: Option<String>,
    sensor: Option<String>,
    pdc_in_the_air_counts: f32,
    /// True if that was measured.
    air_known: bool,
    force_mn_per_count: f32,
    /// Motor current without load at standstill, and more of it for each mm/s.
    unloaded_ma: f32,
    unloaded_ma_per_mm_s: f32,
    shear_n_per_a: f32,
    /// The day on which an accelerometer was turned over, as `force_scale_date`.
    turned_over: Option<String>,
    /// What that said of a count of P_AC, mg; `null`: it was not.
    mg_per_count: Option<f32>,
}

impl CalibrationSummary {
    fn new(c: &RigCalibration) -> Self {
        let (unloaded_a, a_per_mm_s) = c.unloaded_a;
        Self {
            force_scale_date: date(c),
            sensor: sensor(c),
            pdc_in_the_air_counts: c.pressure.pdc_no_contact,
            air_known: c.air_known,
            force_mn_per_count: c.pressure.force_mn_per_count,
            unloaded_ma: unloaded_a * 1e3,
            unloaded_ma_per_mm_s: a_per_mm_s * 1e3,
            shear_n_per_a: c.newton_per_ampere,
            turned_over: turned(c),
            mg_per_count: turned(c).map(|_| c.pressure.pac_pa_per_count),
        }
    }
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut bench, _) = Bench::open(&args.at, args.format)?;
    let probe = bench.probe.clone();
    let (status, calibration) = bench.done(operations::status(&probe), out)?;
    if args.format == Format::Text {
        return Ok(());
    }
    let (frames_damaged, reports_lost) = probe.losses();
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
