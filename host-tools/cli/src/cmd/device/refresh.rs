//! `tactus device refresh`: after the skin or the finger was replaced, a slide of each texture moves what the probe has learned.

use std::io::{self, Write};

use anyhow::ensure;
use serde::Serialize;
use tactus_core::explorer::Strategy;
use tactus_core::table::{Contents, Table};
use tactus_core::wire::{Event, Identify};
use tactus_lab::eval::refresh::{Moved, NewSlide, Pair, Refreshed, refresh};
use tactus_lab::eval::show::count;
use tactus_link::{PushTable, Request};

use super::bench::{Bench, Prompts, read_answer};
use super::line::Where;
use super::loss::Consent;
use super::train::seed_of_now;
use crate::cmd::output::{Format, print_json};

/// Textures that are named as having moved most.
const NAMED: usize = 5;

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

/// What `device refresh --format json` prints.
#[derive(Serialize)]
struct Summary {
    /// Slides that it goes by.
    slides: usize,
    /// How far all textures moved together, standard deviations of a slide.
    together: f64,
    /// How far each moved beyond that.
    moved: Vec<Moved>,
    /// Textures without a new slide.
    left_out: Vec<String>,
    /// Pairs that cannot be told apart now.
    alike: Vec<Pair>,
    backup: String,
    /// Of the table that the probe uses now; CRC-32, hexadecimal.
    checksum: String,
}

/// Has the probe slide over every texture, and moves its table.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut bench, _) = Bench::open(&args.at)?;
    let bytes = bench.table()?;
    let table = Table::read(&bytes)?;
    ensure!(
        matches!(table.contents(), Contents::Fused(..)),
        "only tables with whitened features can be refreshed: learn this one again"
    );
    args.consent.can_be_given()?;
    let text = args.format == Format::Text;
    let (mut slides, mut left_out) = (Vec::new(), Vec::new());
    for (texture, name) in (0..).zip(table.names()) {
        let prompt = format!("Lay {name} under the finger and press Enter, or s to leave it out: ");
        if read_answer(bench.interrupt(), &prompt)?.trim() == "s" {
            left_out.push(name.to_owned());
            continue;
        }
        let made = feel(&mut bench, args, table, texture, out)?;
        if text {
            writeln!(out, "{name}: {}", count(made.len() as u64, "slide"))?;
        }
        slides.extend(made);
    }
    let Refreshed {
        bytes: new,
        together,
        mut moved,
        alike,
    } = refresh(table, &slides)?;
    if text {
        print(together, &moved, &left_out, &alike, out)?;
    }
    let lost = |_: &Table<'_>| "The probe is to use the table that has moved.".to_owned();
    let backup = args.consent.ask(&mut bench, lost, args.format, out)?;
    bench.get(PushTable::new(&new)?)?;
    let now = bench.get(Request::status())?.table_crc;
    let wanted = Table::read(&new)?.crc();
    ensure!(
        now == wanted,
        "the probe uses the table {now:08x} and not {wanted:08x}, the one pushed: refresh again"
    );
    if text {
        writeln!(out, "The probe uses it now: checksum {now:08x}")?;
        return Ok(());
    }
    for moved in &mut moved {
        moved.moved = (moved.moved * 1e3).round() / 1e3;
    }
    let summary = Summary {
        slides: slides.len(),
        together: (together * 1e3).round() / 1e3,
        moved,
        left_out,
        alike,
        backup,
        checksum: format!("{now:08x}"),
    };
    print_json(&summary, out)
}

/// One slide of a texture at each movement.
fn feel(
    bench: &mut Bench,
    args: &Args,
    table: Table<'_>,
    texture: u16,
    out: &mut impl Write,
) -> anyhow::Result<Vec<NewSlide>> {
    let Contents::Fused(set, length) = table.contents() else {
        return Ok(Vec::new());
    };
    // never sure: all slides are made
    let wanted = Identify {
        among: std::iter::once(texture).collect(),
        threshold: 1.0,
        max_slides: table.movements().len() as u8,
        strategy: Strategy::Cycling,
        open: false,
        seed: args.seed.unwrap_or_else(seed_of_now),
        ..Identify::default()
    };
    let (mut made, mut prompts) = (Vec::new(), Prompts::default());
    bench.run(Request::identify(wanted), |report| {
        match &report.event {
            Event::SlideReport {
                action, observed, ..
            } => {
                let features = observed.observation().vector(set, length.into());
                made.extend(features.map(|features| NewSlide {
                    texture,
                    movement: action.movement,
                    features: features.to_vec(),
                }));
            }
            Event::Rejected { why, .. } if args.format == Format::Text => {
                writeln!(out, "  rejected, and repeated: {why}")?;
            }
            _ if args.format == Format::Text => prompts.show(report, out)?,
            _ => {}
        }
        io::Result::Ok(())
    })?;
    Ok(made)
}

fn print(
    together: f64,
    moved: &[Moved],
    left_out: &[String],
    alike: &[Pair],
    out: &mut impl Write,
) -> anyhow::Result<()> {
    writeln!(
        out,
        "All textures moved together by {together:.1} standard deviations of a slide."
    )?;
    let most = moved.iter().take(NAMED);
    let most: Vec<String> = most
        .map(|m| format!("{} ({:.1})", m.texture, m.moved))
        .collect();
    writeln!(out, "Beyond that moved most: {}.", most.join(", "))?;
    if !left_out.is_empty() {
        let all = left_out.join(", ");
        writeln!(
            out,
            "Moved with the others only, as they were left out: {all}."
        )?;
    }
    for Pair {
        first,
        second,
        before,
    } in alike
    {
        let since = if *before { "as before" } else { "any more" };
        writeln!(out, "{first} and {second} cannot be told apart {since}.")?;
    }
    Ok(())
}
