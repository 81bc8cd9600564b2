//! `tactus device refresh`: after the skin or the finger was replaced, a slide of each texture moves what the probe has learned.

use std::io::Write;

use serde::Serialize;
use tactus_lab::remote::operations::{self, RefreshedProbe};

use super::bench::Bench;
use super::line::Where;
use super::loss::Consent;
use super::train::seed_of_now;
use crate::cmd::output::{Format, print_json};

/// After skin or finger was replaced, move what the probe has learned, by one slide of each texture at each movement
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus device refresh                      asks for one texture after the other; s leaves one out
  tactus device refresh --backup old.tact    keeps the table of before in this file

Calibrate first: the force has to be right. What all textures have in common moves all of them, also those that are left out; what
a texture has of its own moves it by as much as one slide is to be believed. The book says more: Learning and teaching.")]
pub(crate) struct Args {
    #[command(flatten)]
    at: Where,
    #[command(flatten)]
    consent: Consent,
    /// Where on the samples slides begin; drawn anew unless given
    #[arg(long)]
    seed: Option<u32>,
    /// How to print what moved
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// The object that `device refresh --format json` prints.
#[derive(Serialize)]
struct Summary {
    #[serde(flatten)]
    refreshed: RefreshedProbe,
    backup: Option<String>,
}

/// Has the probe slide over every texture, and moves its table.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut bench, _) = Bench::open(&args.at, args.format)?;
    args.consent.can_be_given()?;
    bench.consents(&args.consent);
    let probe = bench.probe();
    let seed = || args.seed.unwrap_or_else(seed_of_now);
    let mut refreshed = bench.done(operations::refresh(&probe, seed), out)?;
    if args.format == Format::Text {
        return Ok(());
    }
    let rounded = |number: f64| (number * 1e3).round() / 1e3;
    for moved in &mut refreshed.moved {
        moved.moved = rounded(moved.moved);
    }
    refreshed.together = rounded(refreshed.together);
    let backup = bench.backup();
    print_json(&Summary { refreshed, backup }, out)
}
