//! `tactus device train` and `teach`: what the probe learns, and what that feels most like.

use std::io::Write;

use serde::Serialize;
use tactus_core::table::{Name, Table};
use tactus_lab::eval::alike::Alike;
use tactus_lab::remote::operations::{self, Learned};
use tactus_link::operations::Training;
use tactus_link::say::{name_of, not_noted};

use super::bench::Bench;
use super::line::{Sample, Where};
use crate::cmd::names;
use crate::cmd::output::{Format, print_json};
use crate::cmd::tell;

/// Have the probe learn the texture under its finger from new slides; an unfinished training goes on where it stood
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus device train burlap                five trials of each movement of the probe's table
  tactus device train burlap --pilot        every movement, to find out which ones tell textures apart
  tactus device train burlap --same-spot    without asking to move the sample

A slide on the same track again says little about a texture. So at a terminal the rig stops after each trial of all
movements, its finger lifted, and you are asked to move or turn the sample. What came of that stands in the probe's
table, for `tactus table` and `tactus report`.")]
pub(crate) struct Train {
    #[command(flatten)]
    at: Where,
    /// What lies under the finger
    name: String,
    /// Trials of each movement, those of an unfinished training included
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u8).range(1..))]
    trials: u8,
    /// Make all movements of the grid up to 1.26 N, or 2 N where that is set, instead of the table's, to find out which
    /// tell textures apart
    #[arg(long)]
    pilot: bool,
    /// Where on the sample slides begin; drawn anew unless given
    #[arg(long)]
    seed: Option<u32>,
    #[command(flatten)]
    sample: Sample,
    /// How to print what came of it
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// Tell the probe which texture it explored last; it learns from those slides
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus device teach burlap    after `tactus device identify`")]
pub(crate) struct Teach {
    #[command(flatten)]
    at: Where,
    /// What lies under the finger: a texture that it knows, or a new one
    name: String,
    /// How to print what came of it
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

#[derive(Serialize)]
struct Summary {
    #[serde(flatten)]
    learned: Learned,
    /// The texture that it feels most like; `null` where the probe knows no other, and after a pilot.
    nearest: Option<Alike>,
}

pub(crate) fn train(args: &Train, out: &mut impl Write) -> anyhow::Result<()> {
    let typed = name_of(&args.name)?;
    let (mut bench, _) = Bench::open(&args.at, args.format)?;
    let training = Training {
        name: known_as(typed, &bench.table()?)?.to_string(),
        trials: args.trials,
        pilot: args.pilot,
        seed: args.seed.unwrap_or_else(seed_of_now),
        sample: args.sample.known(),
    };
    let probe = bench.probe.clone();
    let learned = bench.done(operations::train(&probe, &training), out)?;
    print(learned, args.format, out)
}

pub(crate) fn teach(
    Teach { at, name, format }: &Teach,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    let typed = name_of(name)?;
    let (mut bench, _) = Bench::open(at, *format)?;
    let name = known_as(typed, &bench.table()?)?;
    let probe = bench.probe.clone();
    let learned = bench.done(operations::teach(&probe, &name), out)?;
    print(learned, *format, out)
}

fn print(
    (learned, nearest): (Learned, Option<Alike>),
    format: Format,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    if format == Format::Text {
        return Ok(());
    }
    if let Some(why) = &learned.not_noted {
        tell(&not_noted(why));
    }
    print_json(&Summary { learned, nearest }, out)
}

/// The probe's name for a texture whose capitals were typed otherwise; any other stays as it is.
fn known_as(typed: Name, table: &[u8]) -> anyhow::Result<Name> {
    let before: Vec<&str> = Table::read(table)?.names().collect();
    let known = names::find(&typed, &before).map(name_of);
    Ok(known.unwrap_or(Ok(typed))?)
}

pub(crate) fn seed_of_now() -> u32 {
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    now.map_or(1, |now| now.as_secs() as u32 ^ now.subsec_nanos())
}
