//! `tactus device verify`: whether what lies under the probe's finger is one of its textures.

use std::io::Write;

use anyhow::Context as _;
use tactus_core::table::Table;
use tactus_core::wire::Identify;
use tactus_lab::remote::operations;

use super::bench::Bench;
use super::line::Where;
use super::rename::known;
use super::train::seed_of_now;
use crate::cmd::args::Stop;
use crate::cmd::output::{Done, Format, print_json};

/// Have the probe say whether what lies under its finger is this texture
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus device verify cork                        the same, different, or not sure yet
  tactus device verify cork --false-alarm 0.005    of its own slides, one in 200 may be called different

The probe slides until it is sure, --max-slides at most. Its go / no-go output is high from the answer \"the same\"
until the next `verify` begins. Exit code: 0 the same, 3 different, 4 not sure.")]
pub(crate) struct Args {
    #[command(flatten)]
    at: Where,
    /// The texture of the probe's table that it may be
    name: String,
    #[command(flatten)]
    stop: Stop,
    /// Where on the sample slides begin; drawn anew unless given
    #[arg(long)]
    seed: Option<u32>,
    /// How to print the answer
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<Done> {
    let (mut bench, status) = Bench::open(&args.at, args.format)?;
    let bytes = bench.table()?;
    let reference = known(&bytes, &args.name)?;
    let texture = Table::read(&bytes)?
        .find(&reference)
        .context("a name of the table is in the table")?;
    let wanted = Identify {
        threshold: args.stop.threshold,
        max_slides: args.stop.max_slides,
        seed: args.seed.unwrap_or_else(seed_of_now),
        false_alarm: args.stop.false_alarm.or(status.false_alarm),
        ..Identify::default()
    };
    let probe = bench.probe.clone();
    let verified = bench.done(operations::verify(&probe, texture, wanted), out)?;
    if args.format == Format::Json {
        print_json(&verified, out)?;
    }
    Ok(Done::of(verified.answer))
}
