//! `tactus device rename` and `forget`: names of the probe's textures, and those that it is to know no longer.

use std::io::Write;

use tactus::link::Request;
use tactus_core::table::{Name, Table};
use tactus_core::wire;

use super::bench::Bench;
use super::line::Where;
use super::loss::Consent;
use super::train::name_of;
use crate::cmd::names;

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
    // its name before the field's words came
    #[arg(long, alias = "self-taught")]
    self_learned: bool,
}

/// Gives a texture another name.
pub(crate) fn rename(Rename { at, from, to }: &Rename, out: &mut impl Write) -> anyhow::Result<()> {
    let to = name_of(to)?;
    let (mut bench, _) = Bench::open(at)?;
    let from = known(&bench.table()?, from)?;
    bench.get(Request::rename(from.clone(), to.clone()))?;
    writeln!(out, "{from} is {to} now.")?;
    Ok(())
}

/// Has the probe forget something.
pub(crate) fn forget(args: &Forget, out: &mut impl Write) -> anyhow::Result<()> {
    let Forget { at, what, consent } = args;
    let (mut bench, _) = Bench::open(at)?;
    let (what, said) = match (&what.name, &what.training) {
        (Some(name), _) => {
            let name = known(&bench.table()?, name)?;
            let said = name.to_string();
            (wire::Forget::Texture(name), said)
        }
        (None, Some(name)) => {
            let said = format!("the training of {name}");
            (wire::Forget::Training(name_of(name)?), said)
        }
        (None, None) => {
            let said = "what it learned by itself".to_owned();
            (wire::Forget::SelfLearned, said)
        }
    };
    let lost = |_: &Table<'_>| Some(format!("The probe is to forget {said}."));
    consent.ask(&mut bench, lost, out)?;
    bench.get(Request::forget(what))?;
    writeln!(out, "The probe has forgotten {said}.")?;
    Ok(())
}

/// The texture that is meant, as a table has it.
fn known(table: &[u8], typed: &str) -> anyhow::Result<Name> {
    let table = Table::read(table)?;
    let all: Vec<&str> = table.names().collect();
    name_of(names::find(typed, &all).map_err(anyhow::Error::msg)?)
}
