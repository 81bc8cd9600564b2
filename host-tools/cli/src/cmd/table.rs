//! `tactus table`: what a table file holds, and whether it is good.

use std::io::Write;
use std::path::PathBuf;

use clap::Subcommand;
use tactus_lab::eval::show::{count, show_table};
use tactus_lab::eval::table_summary::TableSummary;
use tactus_study::pictures::map;

use super::output::{Format, print_json};
use super::plot::Plot;
use super::table_file::{TableFile, read_table};

/// Look into a texture table
#[derive(Subcommand)]
#[command(after_help = "\
Examples:
  tactus table show table                   textures, trials, and how far they are apart
  tactus table show table --plot map.svg    and a map of them
  tactus table check table                  whether every check of it passes")]
pub(crate) enum Command {
    /// Print what the table holds; --plot draws a map of its textures
    Show {
        /// The table
        file: PathBuf,
        /// How to print it
        #[arg(long, value_enum, default_value_t = Format::Text)]
        format: Format,
        #[command(flatten)]
        plot: Plot,
    },
    /// Check the table, and say which check fails
    Check {
        /// The table
        file: PathBuf,
        /// How to print that it is good
        #[arg(long, value_enum, default_value_t = Format::Text)]
        format: Format,
    },
}

/// Shows or checks a table file.
pub(crate) fn run(command: &Command, out: &mut impl Write) -> anyhow::Result<()> {
    let mut bytes = Vec::new();
    match command {
        Command::Show { file, format, plot } => {
            let canvas = plot.open()?;
            let table = read_table(file, &mut bytes)?;
            match format {
                Format::Text => show_table(table, out)?,
                Format::Json => print_json(&TableSummary::new(table), out)?,
            }
            if let Some(canvas) = canvas {
                canvas.write("tactus table show", &[map::figure(table)?], out)?;
            }
        }
        Command::Check { file, format } => {
            let table = read_table(file, &mut bytes)?;
            match format {
                Format::Text => writeln!(
                    out,
                    "{}: good; {}, {}, {} bytes, checksum {:08x}",
                    file.display(),
                    count(table.textures(), "texture"),
                    count(table.movements().len() as u64, "movement"),
                    table.as_bytes().len(),
                    table.crc()
                )?,
                Format::Json => print_json(&TableFile::new(file, table), out)?,
            }
        }
    }
    Ok(())
}
