//! `tactus device rename` and `forget`: names of the probe's textures, and those that it is to know no longer.

use std::io::Write;

use serde::Serialize;
use tactus_core::table::{Name, Table};
use tactus_core::wire;
use tactus_link::operations;
use tactus_link::say::name_of;

use super::bench::Bench;
use super::line::Where;
use super::loss::Consent;
use crate::cmd::names;
use crate::cmd::output::{Format, print_json};

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
    /// How to print that it is done
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// The object that `device rename` prints with `--format json`.
#[derive(Serialize)]
struct Renamed<'n> {
    from: &'n str,
    to: &'n str,
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
    /// How to print that it is done
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// The object that `device forget` prints with `--format json`.
#[derive(Serialize)]
struct Forgotten {
    /// "texture", "training" or "self-learned".
    what: &'static str,
    /// Its name; `null` for what the probe learned by itself.
    name: Option<String>,
    /// Where the probe's table is kept as it was.
    backup: Option<String>,
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

/// Gives a texture another name.
pub(crate) fn rename(args: &Rename, out: &mut impl Write) -> anyhow::Result<()> {
    let to = name_of(&args.to)?;
    let (mut bench, _) = Bench::open(&args.at, args.format)?;
    let from = known(&bench.table()?, &args.from)?;
    let probe = bench.probe();
    bench.done(operations::rename(&probe, &from, &to), out)?;
    if args.format == Format::Json {
        let (from, to) = (&from[..], &to[..]);
        print_json(&Renamed { from, to }, out)?;
    }
    Ok(())
}

/// Has the probe forget something.
pub(crate) fn forget(args: &Forget, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut bench, _) = Bench::open(&args.at, args.format)?;
    let (wanted, what, name) = match (&args.what.name, &args.what.training) {
        (Some(name), _) => {
            let name = known(&bench.table()?, name)?;
            (wire::Forget::Texture(name.clone()), "texture", Some(name))
        }
        (None, Some(name)) => {
            let name = name_of(name)?;
            (wire::Forget::Training(name.clone()), "training", Some(name))
        }
        (None, None) => (wire::Forget::SelfLearned, "self-learned", None),
    };
    bench.consents(&args.consent);
    let probe = bench.probe();
    bench.done(operations::forget(&probe, wanted), out)?;
    if args.format == Format::Json {
        let forgotten = Forgotten {
            what,
            name: name.map(|name| name.to_string()),
            backup: bench.backup(),
        };
        print_json(&forgotten, out)?;
    }
    Ok(())
}

/// The texture that is meant, as a table has it.
pub(super) fn known(table: &[u8], typed: &str) -> anyhow::Result<Name> {
    let table = Table::read(table)?;
    let all: Vec<&str> = table.names().collect();
    let name = names::find(typed, &all).map_err(anyhow::Error::msg)?;
    Ok(name_of(name)?)
}
