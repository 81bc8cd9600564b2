//! `tactus device table`: the table that the probe uses.

use std::io::Write;
use std::path::PathBuf;

use clap::Subcommand;
use tactus_core::table::Table;
use tactus_lab::eval::show::{count, show_table};
use tactus_lab::eval::table_summary::TableSummary;
use tactus_link::operations;

use super::bench::Bench;
use super::line::{Consent, Where};
use crate::cmd::output::{Format, print_json};
use crate::cmd::table_file::{Force, beside, read_table, spare_input, write_file};

/// Show, fetch or replace the probe's texture table
#[derive(Subcommand)]
#[command(after_help = "\
Examples:
  tactus device table show
  tactus device table pull table      a copy of it
  tactus device table push table      the probe uses it from now on
  tactus device table factory         back to the firmware's own
Before a table that the probe was given or has learned is replaced, it is kept in a file, and you are asked.")]
pub(crate) enum Command {
    /// Print what the probe's table holds
    Show {
        #[command(flatten)]
        at: Where,
        /// How to print it
        #[arg(long, value_enum, default_value_t = Format::Text)]
        format: Format,
    },
    /// Write the probe's table to a file
    Pull {
        #[command(flatten)]
        at: Where,
        /// The file to write; "-": standard output
        file: PathBuf,
        #[command(flatten)]
        force: Force,
    },
    /// Check a table, send it to the probe, and compare what the probe uses then
    Push {
        #[command(flatten)]
        at: Where,
        /// The table, as `tactus learn` or `table pull` wrote it; "-" reads standard input
        file: PathBuf,
        #[command(flatten)]
        consent: Consent,
    },
    /// Go back to the table that came with the firmware
    Factory {
        #[command(flatten)]
        at: Where,
        #[command(flatten)]
        consent: Consent,
    },
}

pub(crate) fn run(command: &Command, out: &mut impl Write) -> anyhow::Result<()> {
    match command {
        Command::Show { at, format } => {
            let (mut bench, status) = Bench::open(at, *format)?;
            let bytes = bench.table()?;
            if *format == Format::Json {
                return print_json(&TableSummary::new(Table::read(&bytes)?), out);
            }
            let whose = if status.factory {
                "came with the firmware"
            } else {
                "was pushed to the probe, or has learned since"
            };
            writeln!(out, "The table {whose}.")?;
            show_table(Table::read(&bytes)?, out)?;
        }
        Command::Pull { at, file, force } => {
            let bytes = Bench::open(at, Format::Text)?.0.table()?;
            write_file(file, &bytes, *force)?;
            let table = Table::read(&bytes)?;
            let textures = count(table.textures(), "texture");
            let (name, length, crc) = (file.display(), bytes.len(), table.crc());
            writeln!(
                beside(file, out),
                "{name}: {textures}, {length} bytes, checksum {crc:08x}"
            )?;
        }
        Command::Push { at, file, consent } => {
            let mut bytes = Vec::new();
            let table = read_table(file, &mut bytes)?;
            let kept = consent.backup.iter();
            kept.into_iter()
                .try_for_each(|kept| spare_input(kept, file))?;
            let file = file.display().to_string();
            let (mut bench, _) = Bench::open(at, Format::Text)?;
            bench.consent = consent.clone();
            let probe = bench.probe.clone();
            bench.done(operations::push(&probe, &file, table.as_bytes()), out)?;
        }
        Command::Factory { at, consent } => {
            let (mut bench, _) = Bench::open(at, Format::Text)?;
            bench.consent = consent.clone();
            let probe = bench.probe.clone();
            bench.done(operations::factory(&probe), out)?;
        }
    }
    Ok(())
}
