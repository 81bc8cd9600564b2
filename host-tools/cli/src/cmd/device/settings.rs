//! `tactus device settings`: what the probe keeps besides its table and its calibration.

use std::io::Write;

use clap::{ArgGroup, ValueEnum};
use tactus_link::operations;

use super::bench::Bench;
use super::line::Where;
use super::loss::Consent;
use crate::cmd::args::false_alarm;
use crate::cmd::output::{Format, print_json};

/// Show or set for which share of false alarms the probe's limits are, and whether a rig may press with up to 2 N
#[derive(clap::Args)]
#[command(group(ArgGroup::new("wanted").args(["false_alarm", "as_table"])), after_help = "\
Examples:
  tactus device settings                        what is set
  tactus device settings --false-alarm 0.005    of known textures, one in 200 may be called new
  tactus device settings --as-table             what the table was learned for, 2 % unless `learn` was told otherwise
  tactus device settings --high-force on        a rig may press with 2 N, if its finger yields or its lever is stopped before 2.2 N
  tactus device settings --high-force off       1.26 N again

The probe keeps both without power. The share of false alarms holds for the person at a handheld and for `identify`, `monitor` and
`verify`, where these are not given a --false-alarm of their own. A handheld refuses --high-force: a person presses it.")]
pub(crate) struct Args {
    #[command(flatten)]
    at: Where,
    /// Share of the known textures that may be taken for new ones, such as 0.02
    #[arg(long, value_name = "SHARE", value_parser = false_alarm)]
    false_alarm: Option<f32>,
    /// The share that each table was learned for
    #[arg(long)]
    as_table: bool,
    /// Whether movements may press with up to 2 N, as the paper's do; on only with a mount that yields, or a hard stop
    #[arg(long, value_enum, value_name = "ON|OFF")]
    high_force: Option<Switch>,
    /// Turn high forces on without asking for mount or stop
    #[arg(long, short, requires = "high_force")]
    yes: bool,
    /// How to print what is set
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Switch {
    On,
    Off,
}

/// Shows the settings, and changes them first where that is asked for.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut bench, _) = Bench::open(&args.at, args.format)?;
    bench.consents(&Consent::given(args.yes));
    let probe = bench.probe();
    let set = async {
        if args.as_table || args.false_alarm.is_some() {
            operations::set_false_alarm(&probe, args.false_alarm).await?;
        }
        if let Some(switch) = args.high_force {
            operations::set_high_force(&probe, switch == Switch::On).await?;
        }
        operations::settings(&probe).await
    };
    let settings = bench.done(set, out)?;
    match args.format {
        Format::Json => print_json(&settings, out),
        Format::Text => Ok(()),
    }
}
