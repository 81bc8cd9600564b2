//! `tactus device rename`, `forget`, `refresh` and `settings`: what the probe keeps, changed.

use std::io::Write;

use clap::{ArgGroup, ValueEnum};
use tactus_core::table::{Name, Table};
use tactus_core::wire;
use tactus_lab::remote::operations as refreshing;
use tactus_link::operations;
use tactus_link::say::name_of;

use super::bench::Bench;
use super::line::{Consent, Where};
use super::train::seed_of_now;
use crate::cmd::args::false_alarm;
use crate::cmd::names;
use crate::cmd::output::Format;

/// Give a texture of the probe another name
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus device rename burlap 'coarse burlap'")]
pub(crate) struct Rename {
    #[command(flatten)]
    at: Where,
    /// Its name
    from: String,
    /// Its new name
    to: String,
}

/// Have the probe forget a texture, an unfinished training, or all that it learned by itself
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus device forget --name burlap
  tactus device forget --training burlap    the slides of an unfinished training
  tactus device forget --self-learned      only what nobody confirmed")]
pub(crate) struct Forget {
    #[command(flatten)]
    at: Where,
    #[command(flatten)]
    what: What,
    #[command(flatten)]
    consent: Consent,
}

#[derive(clap::Args)]
#[group(required = true, multiple = false)]
struct What {
    /// A texture, whether the factory, you or the probe itself added it
    #[arg(long, value_name = "NAME", id = "forgotten")]
    name: Option<String>,
    /// An unfinished training
    #[arg(long, value_name = "NAME")]
    training: Option<String>,
    /// All that the probe has learned by itself; what it learned from you stays
    #[arg(long)]
    self_learned: bool,
}

/// After skin or finger was replaced, move what the probe has learned, by one slide of each texture at each movement
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus device refresh                      asks for one texture after the other; s leaves one out
  tactus device refresh --backup old.tact    keeps the table of before in this file

Calibrate first: the force has to be right. What all textures have in common moves all of them, also those that are
left out; what a texture has of its own moves it by as much as one slide is to be believed. The book says more:
Learning and teaching.")]
pub(crate) struct Refresh {
    #[command(flatten)]
    at: Where,
    #[command(flatten)]
    consent: Consent,
    /// Where on the samples slides begin; drawn anew unless given
    #[arg(long)]
    seed: Option<u32>,
}

/// Show or set for which share of false alarms the probe's limits are, and whether a rig may press with up to 2 N
#[derive(clap::Args)]
#[command(group(ArgGroup::new("wanted").args(["false_alarm", "as_table"])), after_help = "\
Examples:
  tactus device settings                        what is set
  tactus device settings --false-alarm 0.005    of known textures, one in 200 may be called new
  tactus device settings --as-table             what the table was learned for, 2 % unless `learn` was told otherwise
  tactus device settings --high-force on         2 N, if the finger yields or the lever is stopped before 2.2 N
  tactus device settings --high-force off        1.26 N again

The probe keeps both without power. The share of false alarms holds for the person at a handheld and for `identify`,
`monitor` and `verify`, where these are not given a --false-alarm of their own. A handheld refuses --high-force: a
person presses it.")]
pub(crate) struct Settings {
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
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Switch {
    On,
    Off,
}

pub(crate) fn rename(args: &Rename, out: &mut impl Write) -> anyhow::Result<()> {
    let to = name_of(&args.to)?;
    let (mut bench, _) = Bench::open(&args.at, Format::Text)?;
    let from = known(&bench.table()?, &args.from)?;
    let probe = bench.probe.clone();
    Ok(bench.done(operations::rename(&probe, &from, &to), out)?)
}

pub(crate) fn forget(args: &Forget, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut bench, _) = Bench::open(&args.at, Format::Text)?;
    let wanted = match (&args.what.name, &args.what.training) {
        (Some(name), _) => wire::Forget::Texture(known(&bench.table()?, name)?),
        (None, Some(name)) => wire::Forget::Training(name_of(name)?),
        (None, None) => wire::Forget::SelfLearned,
    };
    bench.consent = args.consent.clone();
    let probe = bench.probe.clone();
    Ok(bench.done(operations::forget(&probe, wanted), out)?)
}

pub(crate) fn refresh(args: &Refresh, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut bench, _) = Bench::open(&args.at, Format::Text)?;
    args.consent.can_be_given()?;
    args.consent.has_place()?;
    bench.consent = args.consent.clone();
    let probe = bench.probe.clone();
    let seed = || args.seed.unwrap_or_else(seed_of_now);
    bench.done(refreshing::refresh(&probe, seed), out)?;
    Ok(())
}

pub(crate) fn settings(args: &Settings, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut bench, _) = Bench::open(&args.at, Format::Text)?;
    bench.consent.yes = args.yes;
    let probe = bench.probe.clone();
    let set = async {
        if args.as_table || args.false_alarm.is_some() {
            operations::set_false_alarm(&probe, args.false_alarm).await?;
        }
        if let Some(switch) = args.high_force {
            operations::set_high_force(&probe, switch == Switch::On).await?;
        }
        operations::settings(&probe).await
    };
    bench.done(set, out)?;
    Ok(())
}

/// The texture that is meant, as a table has it.
pub(super) fn known(table: &[u8], typed: &str) -> anyhow::Result<Name> {
    let table = Table::read(table)?;
    let all: Vec<&str> = table.names().collect();
    let name = names::find(typed, &all).map_err(anyhow::Error::msg)?;
    Ok(name_of(name)?)
}
