//! `tactus table`: what a table file holds, and whether it is good.

use std::io::Write;
use std::path::PathBuf;

use tactus_lab::eval::show::show_table;
use tactus_lab::eval::table_summary::TableSummary;

use super::output::{Format, print_json};
use super::table_file::read_table;

/// Check a texture table and print what it holds
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus table factory.tact    textures, trials, and how far they are apart")]
pub(crate) struct Args {
    /// The table; "-" reads standard input
    file: PathBuf,
    /// How to print it
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let mut bytes = Vec::new();
    let table = read_table(&args.file, &mut bytes)?;
    match args.format {
        Format::Text => Ok(show_table(table, out)?),
        Format::Json => print_json(&TableSummary::new(table), out),
    }
}
