//! `tactus device settings`: what the probe keeps besides its table and its calibration.

use std::io::Write;

use clap::ArgGroup;
use serde::Serialize;
use tactus::link::Request;
use tactus_core::table::Table;
use tactus_core::wire::Command;

use super::bench::Bench;
use super::line::Where;
use super::status::limits;
use crate::cmd::args::false_alarm;
use crate::cmd::output::{Format, percent, print_json};

/// Show or set for which share of false alarms the probe's limits are
#[derive(clap::Args)]
#[command(group(ArgGroup::new("wanted").args(["false_alarm", "as_table"])), after_help = "\
Examples:
  tactus device settings                        what is set
  tactus device settings --false-alarm 0.005    of known textures, one in 200 may be called new
  tactus device settings --as-table             what the table was learned for, 2 % unless `learn` was told otherwise

The probe keeps it without power. It holds for the person at a handheld and for `identify`, `monitor` and `verify`, where these
are not given a --false-alarm of their own.")]
pub(crate) struct Args {
    #[command(flatten)]
    at: Where,
    /// Share of the known textures that may be taken for new ones, such as 0.02
    #[arg(long, value_name = "SHARE", value_parser = false_alarm)]
    false_alarm: Option<f32>,
    /// The share that each table was learned for
    #[arg(long)]
    as_table: bool,
    /// How to print what is set
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// What `device settings --format json` prints.
#[derive(Serialize)]
struct Settings {
    /// What was set; `null`: nothing, the table's own holds.
    false_alarm: Option<f32>,
    /// What the table in use was learned for; `null`: it has no limits.
    table_false_alarm: Option<f32>,
}

/// Shows the settings, and changes them first where that is asked for.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut bench, mut status) = Bench::open(&args.at)?;
    if args.as_table || args.false_alarm.is_some() {
        let set = Command::SetFalseAlarm(args.false_alarm);
        bench.get(Request::command(set))?;
        status = bench.get(Request::status())?;
    }
    let bytes = bench.table()?;
    let of_table = Table::read(&bytes)?.limits();
    let settings = Settings {
        false_alarm: status.false_alarm,
        table_false_alarm: of_table.map(|limits| limits.false_alarm),
    };
    if args.format == Format::Json {
        return print_json(&settings, out);
    }
    writeln!(
        out,
        "The probe's limits are {}.",
        limits(status.false_alarm)
    )?;
    match settings.table_false_alarm {
        Some(share) => writeln!(out, "Its table was learned for {}.", percent(share.into()))?,
        None => writeln!(
            out,
            "Its table has no limits: learn it again, with --method fused."
        )?,
    }
    Ok(())
}
