//! `tactus table`: what a table file holds, and whether it is good.

use std::io::Write;
use std::path::PathBuf;

use tactus_lab::eval::show::show_table;
use tactus_lab::eval::table_summary::TableSummary;
use tactus_study::pictures::map;

use super::output::{Format, print_json};
use super::plot::Plot;
use super::table_file::read_table;

/// Check a texture table and print what it holds
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus table factory.tact                   textures, trials, and how far they are apart
  tactus table factory.tact --plot pictures    and a map of them")]
pub(crate) struct Args {
    /// The table; "-" reads standard input
    file: PathBuf,
    /// How to print it
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    plot: Plot,
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let canvas = args.plot.open()?;
    let mut bytes = Vec::new();
    let table = read_table(&args.file, &mut bytes)?;
    match args.format {
        Format::Text => show_table(table, out)?,
        Format::Json => print_json(&TableSummary::new(table), out)?,
    }
    if let Some(canvas) = canvas {
        canvas.write(&[map::figure(table, None)?], out)?;
    }
    Ok(())
}
