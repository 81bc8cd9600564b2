//! `tactus device train` and `teach`: what the probe learns, and what that feels most like.

use std::io::Write;
use std::ops::ControlFlow;

use serde::Serialize;
use tactus_core::probe::training::pilot_movements;
use tactus_core::rig::most_mn;
use tactus_core::table::{Name, Table};
use tactus_core::wire::{self, Event};
use tactus_lab::eval::alike::{self, Alike};
use tactus_lab::eval::samples::{Trials, fewest};
use tactus_lab::eval::show::count;
use tactus_lab::remote::say::{compare, name_of, not_noted, of_sample, show_training};
use tactus_link::Request;

use super::bench::{Bench, Prompts};
use super::line::Where;
use super::samples::{Sample, ask_to_move, note_in_table};
use crate::cmd::names;
use crate::cmd::output::{Format, print_json};

/// Have the probe learn the texture under its finger from new slides; an unfinished training goes on where it stood
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus device train burlap                five trials of each movement of the probe's table
  tactus device train burlap --pilot        every movement, to find out which ones tell textures apart
  tactus device train burlap --same-spot    without asking to move the sample

A slide on the same track again says little about a texture. So at a terminal the rig stops after each trial of all
movements, its finger lifted, and you are asked to move or turn the sample. What came of that stands in the probe's table,
for `tactus table show` and `tactus report`.")]
pub(crate) struct Train {
    #[command(flatten)]
    at: Where,
    /// What lies under the finger
    name: String,
    /// Trials of each movement, those of an unfinished training included
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u8).range(1..))]
    trials: u8,
    /// Make all movements of the grid up to 1.26 N, or 2 N where that is set, instead of the table's, to find out which tell textures apart
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

/// What `device train` and `device teach` print with `--format json`.
#[derive(Serialize)]
struct Learned {
    name: String,
    /// Whether the probe did not know it before.
    is_new: bool,
    /// Slides that were made for it, or that it was taught from.
    slides: u32,
    /// Whether its sample was moved or turned between trials, as the table says it.
    sample_moved: Option<bool>,
    /// What it feels most like; `null` where the probe knows no other, and after a pilot.
    nearest: Option<Alike>,
}

/// Has the probe make slides of a texture and learn it.
pub(crate) fn train(args: &Train, out: &mut impl Write) -> anyhow::Result<()> {
    let typed = name_of(&args.name)?;
    let (mut bench, status) = Bench::open(&args.at)?;
    let bytes = bench.table()?;
    let table = Table::read(&bytes)?;
    let before: Vec<String> = table.names().map(str::to_owned).collect();
    let name = known_as(typed, &before)?;
    let movements = match args.pilot {
        true => pilot_movements(most_mn(status.high_force)).count(),
        false => table.movements().len(),
    };
    let noted = table.find(&name).map(|texture| table.moved(texture));
    let seed = args.seed.unwrap_or_else(seed_of_now);
    let text = args.format == Format::Text;
    let (mut prompts, mut slides) = (Prompts::default(), 0);
    let mut trials = Trials::default();
    let fewest = fewest(table, &name);
    // trials of before, and somebody who knows whether the sample lies as it did
    if args.sample.asks() && !args.pilot && fewest.is_some_and(|there| there < args.trials) {
        trials.said(Some(ask_to_move(&bench, &name)?));
    }
    for part in 0.. {
        let wanted = wire::Train {
            name: name.clone(),
            trials: args.trials,
            pilot: args.pilot,
            // slides of the next part begin elsewhere, too
            seed: seed.wrapping_add(part),
        };
        let done = bench.run_until(Request::train(wanted), |report| {
            if text {
                show_training(report, &mut prompts, out)?;
            }
            let Event::TrainingSlide { left, .. } = report.event else {
                return Ok(ControlFlow::Continue(()));
            };
            let left = usize::from(left);
            if slides == 0 && left + 1 < usize::from(args.trials) * movements {
                trials.said(noted.flatten());
            }
            slides += 1;
            let ends_trial = left > 0 && left.is_multiple_of(movements);
            Ok(match ends_trial && args.sample.asks() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            })
        })?;
        if done.is_some() {
            break;
        }
        trials.said(Some(ask_to_move(&bench, &name)?));
    }
    if text {
        writeln!(out, "{name}: {} made.", count(slides, "slide"))?;
    }
    if slides > 0 {
        if !args.sample.asks() {
            trials.said(args.sample.said());
        }
        // one trial is moved from nowhere
        let moved = trials.moved().filter(|_| args.trials > 1);
        if let Some(why) = note_in_table(&mut bench, &name, moved)? {
            eprintln!("{}", not_noted(&why));
        }
    }
    let learned = Learned::new(&mut bench, &name, slides, &before)?;
    if text && slides > 0 && !args.pilot {
        writeln!(out, "{}", of_sample(learned.sample_moved))?;
    }
    learned.print(args.format, out)
}

/// Names the texture of the last exploration.
pub(crate) fn teach(
    Teach { at, name, format }: &Teach,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    let typed = name_of(name)?;
    let (mut bench, _) = Bench::open(at)?;
    let before = bench.names()?;
    let taught = bench.get(Request::label(known_as(typed, &before)?))?;
    let (name, slides) = (&taught.name, u32::from(taught.slides));
    if *format == Format::Text {
        let slides = count(slides, "slide");
        writeln!(out, "The probe has learned {name} from {slides}.")?;
    }
    let learned = Learned::new(&mut bench, name, slides, &before)?;
    learned.print(*format, out)
}

impl Learned {
    /// Compares what was learned with the rest of the probe's table.
    fn new(bench: &mut Bench, name: &str, slides: u32, before: &[String]) -> anyhow::Result<Self> {
        let bytes = bench.table()?;
        let table = Table::read(&bytes)?;
        let texture = table.find(name);
        Ok(Self {
            name: name.to_owned(),
            is_new: !before.iter().any(|known| known == name),
            slides,
            sample_moved: texture.and_then(|texture| table.moved(texture)),
            nearest: texture.and_then(|texture| alike::nearest(table, texture)),
        })
    }

    fn print(&self, format: Format, out: &mut impl Write) -> anyhow::Result<()> {
        match (format, &self.nearest) {
            (Format::Json, _) => return print_json(self, out),
            (Format::Text, None) => {}
            (Format::Text, Some(nearest)) => compare(&self.name, self.is_new, nearest, out)?,
        }
        Ok(())
    }
}

/// The probe's name for a texture whose capitals were typed otherwise; any other stays as it is.
fn known_as(typed: Name, before: &[String]) -> anyhow::Result<Name> {
    let before: Vec<&str> = before.iter().map(String::as_str).collect();
    let known = names::find(&typed, &before).map(name_of);
    Ok(known.unwrap_or(Ok(typed))?)
}

/// Another number every time.
pub(crate) fn seed_of_now() -> u32 {
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    now.map_or(1, |now| now.as_secs() as u32 ^ now.subsec_nanos())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_texture_that_feels_like_another_is_warned_of() {
        let said = |is_new, feels_the_same| {
            let learned = Learned {
                name: "velvet".into(),
                is_new,
                slides: 6,
                sample_moved: None,
                nearest: Some(Alike {
                    texture: "felt".into(),
                    taken_for: 0.31,
                    force_n: 0.5,
                    speed_mm_s: 25.0,
                    slides: None,
                    feels_the_same,
                }),
            };
            let mut out = Vec::new();
            learned.print(Format::Text, &mut out).unwrap();
            String::from_utf8(out).unwrap()
        };
        let one = said(true, true);
        assert!(one.starts_with("Most like felt: 31 % of slides"), "{one}");
        for part in [
            "WARNING: velvet feels the same as felt",
            "forget --name 'velvet'",
            "consider more trials",
        ] {
            assert!(one.contains(part), "{one}");
        }
        assert!(said(false, true).ends_with("apart. Consider more trials.\n"));
        assert!(!said(true, false).contains("WARNING"));
    }
}
