//! `tactus growth`: how identification grows with the number of textures.

use std::io::Write;

use serde::Serialize;
use tactus_study::growth::{Pool, Row, STRANGERS, explorations, figures};

use super::output::{Format, print_json};
use super::plot::Plot;
use super::progress::with_progress;

/// Tell how right, how sure and how fast it is among more and more simulated textures
#[derive(clap::Args)]
#[command(after_help = "\
Records textures of this world and of those after it under one simulated finger, with five slides
of each movement to learn from and three to show. Tables of textures drawn from them are explored
at each number of textures, and textures that no table has are shown to each. 500 textures take
four minutes of a core.

Examples:
  tactus growth --plot growth.svg
  tactus growth --textures 10,50 --format json")]
pub(crate) struct Args {
    /// How many textures a table has
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', default_value = "10,20,50,100,200,350,500", value_parser = clap::value_parser!(u16).range(2..=1000))]
    textures: Vec<u16>,
    /// Another seed is another world, and another finger and rig
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// How to print the figures
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    plot: Plot,
}

/// What `growth --format json` prints.
#[derive(Serialize)]
struct Growth {
    seed: u64,
    /// Textures of which the rig could not make all slides.
    left_out: usize,
    rows: Vec<Row>,
}

/// Records, explores and tells.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let canvas = args.plot.open()?;
    let mut counts: Vec<usize> = args.textures.iter().map(|&n| n.into()).collect();
    counts.sort_unstable();
    counts.dedup();
    let recorded = counts.last().copied().unwrap_or(0) + STRANGERS;
    let pool = with_progress(recorded as u64, "recording textures", |done| {
        Pool::record(args.seed, recorded, done)
    })?;
    let played: usize = counts.iter().map(|&n| explorations(n)).sum();
    let rows = with_progress(played as u64, "exploring", |done| {
        let rows = counts.iter().map(|&n| pool.explore(n, done));
        rows.collect::<Result<Vec<Row>, _>>()
    })?;
    let growth = Growth {
        seed: args.seed,
        left_out: pool.left_out,
        rows,
    };
    match args.format {
        Format::Json => print_json(&growth, out)?,
        Format::Text => print(&growth, out)?,
    }
    if let Some(canvas) = canvas {
        canvas.write("tactus growth", &figures(&growth.rows)?, out)?;
    }
    Ok(())
}

fn print(growth: &Growth, out: &mut impl Write) -> std::io::Result<()> {
    writeln!(
        out,
        "textures  tables  explorations  slides  seconds    right  wrong of the sure  false alarms  new noticed  live"
    )?;
    let share = |share: f64| format!("{:.1} %", 100.0 * share);
    for row in &growth.rows {
        writeln!(
            out,
            "{:8}  {:6}  {:12}  {:6.2}  {:7.1}  {:>7}  {:>17}  {:>12}  {:>11}  {:4.1}",
            row.textures,
            row.tables,
            row.explorations,
            row.slides,
            row.seconds,
            share(row.right),
            share(row.wrong_when_sure),
            share(row.false_alarms),
            share(row.new_noticed),
            row.live,
        )?;
    }
    let left_out = growth.left_out;
    writeln!(
        out,
        "seed {}; left out, since the rig could not make all slides of them: {left_out} of the textures",
        growth.seed
    )
}
