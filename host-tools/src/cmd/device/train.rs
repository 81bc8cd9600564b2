//! `tactus device train`, `teach`, `rename` and `forget`: what the probe learns and forgets.

use std::io::{self, Write};

use anyhow::ensure;
use tactus::link::Request;
use tactus_core::features::Property;
use tactus_core::table::{Name, Table};
use tactus_core::wire::{self, Event, Report};

use super::bench::{Bench, show_fault};
use super::line::Where;
use super::loss::Consent;

/// Have the probe learn the texture under its finger from new slides; an unfinished training goes on where it stood
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus device train burlap                five trials of each movement of the probe's table
  tactus device train burlap --pilot        every movement, to find out which ones tell textures apart")]
pub(crate) struct Train {
    #[command(flatten)]
    at: Where,
    /// What lies under the finger
    name: String,
    /// Trials of each movement, those of an unfinished training included
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u8).range(1..))]
    trials: u8,
    /// Make all movements of the grid up to 1.26 N instead of the table's, to find out which tell textures apart
    #[arg(long)]
    pilot: bool,
    /// Where on the sample slides begin; drawn anew unless given
    #[arg(long)]
    seed: Option<u32>,
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
}

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

/// Has the probe make slides of a texture and learn it.
pub(crate) fn train(args: &Train, out: &mut impl Write) -> anyhow::Result<()> {
    let wanted = wire::Train {
        name: name_of(&args.name)?,
        trials: args.trials,
        pilot: args.pilot,
        seed: args.seed.unwrap_or_else(seed_of_now),
    };
    let (mut bench, _) = Bench::open(&args.at)?;
    let slides = bench.run(Request::train(wanted), |report| show_slide(report, out))?;
    writeln!(out, "{}: {slides} slides made.", args.name)?;
    Ok(())
}

/// Names the texture of the last exploration.
pub(crate) fn teach(Teach { at, name }: &Teach, out: &mut impl Write) -> anyhow::Result<()> {
    let request = Request::label(name_of(name)?);
    let learned = Bench::open(at)?.0.get(request)?;
    let (name, slides) = (learned.name, learned.slides);
    writeln!(out, "The probe has learned {name} from {slides} slides.")?;
    Ok(())
}

/// Gives a texture another name.
pub(crate) fn rename(Rename { at, from, to }: &Rename, out: &mut impl Write) -> anyhow::Result<()> {
    let request = Request::rename(name_of(from)?, name_of(to)?);
    Bench::open(at)?.0.get(request)?;
    writeln!(out, "{from} is {to} now.")?;
    Ok(())
}

/// Has the probe forget something.
pub(crate) fn forget(args: &Forget, out: &mut impl Write) -> anyhow::Result<()> {
    let Forget { at, what, consent } = args;
    let (what, said) = match (&what.name, &what.training) {
        (Some(name), _) => (wire::Forget::Texture(name_of(name)?), name.clone()),
        (None, Some(name)) => {
            let said = format!("the training of {name}");
            (wire::Forget::Training(name_of(name)?), said)
        }
        (None, None) => {
            let said = "what it learned by itself".to_owned();
            (wire::Forget::SelfLearned, said)
        }
    };
    let (mut bench, _) = Bench::open(at)?;
    let known = |table: &Table<'_>| match &what {
        wire::Forget::Texture(name) => table.find(name).is_some(),
        _ => true,
    };
    let lost = |table: &Table<'_>| known(table).then(|| format!("The probe is to forget {said}."));
    consent.ask(&mut bench, lost, out)?;
    bench.get(Request::forget(what))?;
    writeln!(out, "The probe has forgotten {said}.")?;
    Ok(())
}

fn name_of(name: &str) -> anyhow::Result<Name> {
    let name = name.trim();
    ensure!(
        !name.is_empty(),
        "the name of the texture is empty: give one"
    );
    Name::try_from(name).map_err(|_| {
        anyhow::anyhow!("{name:?} is longer than the 40 bytes that the probe keeps: shorten it")
    })
}

/// Another number every time.
pub(crate) fn seed_of_now() -> u32 {
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    now.map_or(1, |now| now.as_secs() as u32 ^ now.subsec_nanos())
}

/// What a training shows of a report.
fn show_slide(report: &Report, out: &mut impl Write) -> io::Result<()> {
    match &report.event {
        Event::TrainingSlide {
            movement,
            trial,
            left,
            observed,
        } => {
            let value = |p: Property| Some(format!("{p} {:.3}", observed.properties().get(p)?));
            let properties: Vec<String> = Property::ALL.into_iter().filter_map(value).collect();
            let properties = properties.join(", ");
            writeln!(
                out,
                "trial {trial} of {movement}: {properties}; {left} to go"
            )?;
        }
        Event::Rejected { why, .. } => writeln!(out, "rejected, and repeated: {why}")?,
        _ => show_fault(report, out)?,
    }
    out.flush()
}
