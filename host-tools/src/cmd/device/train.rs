//! `tactus device train` and `teach`: what the probe learns, and what that feels most like.

use std::io::{self, Write};
use std::ops::ControlFlow;

use anyhow::ensure;
use serde::Serialize;
use tactus::eval::alike::{self, Alike};
use tactus::eval::show::count;
use tactus::link::Request;
use tactus_core::features::Property;
use tactus_core::probe::training::pilot_movements;
use tactus_core::rig::most_mn;
use tactus_core::table::{Name, Table};
use tactus_core::wire::{self, Event, Report};

use super::bench::{Bench, Prompts};
use super::line::Where;
use super::samples::{Sample, Trials, ask_to_move, note_in_table};
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
    let fewest = |texture| {
        (0..)
            .zip(table.movements())
            .map(move |(m, _)| table.trials(texture, m))
            .min()
    };
    let fewest = table.find(&name).and_then(fewest);
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
                show_slide(report, &mut prompts, out)?;
            }
            let Event::TrainingSlide { left, .. } = report.event else {
                return Ok(ControlFlow::Continue(()));
            };
            let left = usize::from(left);
            if slides == 0 && left + 1 < usize::from(args.trials) * movements {
                trials.before(noted.flatten());
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
            eprintln!("Whether the sample was moved is not noted in the table: {why}");
        }
    }
    let learned = Learned::new(&mut bench, &name, slides, &before)?;
    if text && slides > 0 && !args.pilot {
        writeln!(out, "{}", of_sample(learned.sample_moved))?;
    }
    learned.print(args.format, out)
}

/// What the table says of the sample of a texture.
fn of_sample(moved: Option<bool>) -> &'static str {
    match moved {
        Some(true) => "Its sample was moved between trials.",
        Some(false) => {
            "Its sample was not moved: slides on the same track say little about a texture. More trials elsewhere on it would help."
        }
        None => {
            "The table does not know whether its sample was moved between all trials (--moved and --same-spot say so)."
        }
    }
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
            (Format::Text, Some(nearest)) => self.compare(nearest, out)?,
        }
        Ok(())
    }

    fn compare(&self, nearest: &Alike, out: &mut impl Write) -> io::Result<()> {
        let (name, other) = (&self.name, &nearest.texture);
        let (force_n, speed_mm_s) = (nearest.force_n, nearest.speed_mm_s);
        let like = most_like(nearest);
        writeln!(
            out,
            "{like}, at {force_n:.2} N, {speed_mm_s:.1} mm/s, the movement that tells the two apart best."
        )?;
        if !nearest.feels_the_same {
            return Ok(());
        }
        write!(
            out,
            "WARNING: {name} feels the same as {other}: ten slides would not tell them apart. "
        )?;
        if self.is_new {
            writeln!(
                out,
                "If it is {other}: tactus device forget --name '{name}', then teach it as '{other}'. If not: consider more trials."
            )
        } else {
            writeln!(out, "Consider more trials.")
        }
    }
}

/// "Most like Canvas: 31 % of slides could be taken for it"
pub(super) fn most_like(nearest: &Alike) -> String {
    let other = &nearest.texture;
    match (nearest.taken_for * 100.0).round() {
        share if share < 1.0 => {
            format!("Most like {other}: less than 1 % of slides could be taken for it")
        }
        share => format!("Most like {other}: {share:.0} % of slides could be taken for it"),
    }
}

/// The probe's name for a texture whose capitals were typed otherwise; any other stays as it is.
fn known_as(typed: Name, before: &[String]) -> anyhow::Result<Name> {
    let before: Vec<&str> = before.iter().map(String::as_str).collect();
    names::find(&typed, &before).map_or(Ok(typed.clone()), name_of)
}

pub(super) fn name_of(name: &str) -> anyhow::Result<Name> {
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
fn show_slide(report: &Report, prompts: &mut Prompts, out: &mut impl Write) -> io::Result<()> {
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
        _ => prompts.show(report, out)?,
    }
    out.flush()
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
