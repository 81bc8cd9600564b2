//! `tactus device table`: the table that the probe uses.

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context as _, ensure};
use clap::Subcommand;
use tactus::eval::show::{count, show_table};
use tactus::eval::table_summary::TableSummary;
use tactus::link::{PushTable, Request};
use tactus_core::table::Table;
use tactus_core::wire;

use super::bench::Bench;
use super::line::Where;
use super::loss::{Consent, replaced};
use crate::cmd::output::{Format, print_json};
use crate::cmd::table_file::{read_table, write_table};

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
        /// The file to write
        file: PathBuf,
    },
    /// Check a table, send it to the probe, and compare what the probe uses then
    Push {
        #[command(flatten)]
        at: Where,
        /// The table, as `tactus learn` or `table pull` wrote it
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

/// Shows, fetches or changes the probe's table.
pub(crate) fn run(command: &Command, out: &mut impl Write) -> anyhow::Result<()> {
    match command {
        Command::Show { at, format } => {
            let (mut bench, status) = Bench::open(at)?;
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
        Command::Pull { at, file } => {
            let bytes = Bench::open(at)?.0.table()?;
            write_table(file, &bytes)?;
            let table = Table::read(&bytes)?;
            let textures = count(table.textures(), "texture");
            let (file, length, crc) = (file.display(), bytes.len(), table.crc());
            writeln!(
                out,
                "{file}: {textures}, {length} bytes, checksum {crc:08x}"
            )?;
        }
        Command::Push { at, file, consent } => {
            let mut bytes = Vec::new();
            let table = read_table(file, &mut bytes)?;
            let file = file.display();
            let push = PushTable::new(table.as_bytes()).with_context(|| file.to_string())?;
            let (mut bench, status) = Bench::open(at)?;
            // the firmware's own table is never lost
            if !status.factory && status.table_crc != table.crc() {
                consent.ask(&mut bench, |old| Some(replaced(old, Some(&table))), out)?;
            }
            bench.get(push)?;
            // not what was sent counts, but what the probe uses from now on
            let status = bench.get(Request::status())?;
            let textures = count(status.textures, "texture");
            let (now, pushed) = (status.table_crc, table.crc());
            ensure!(
                now == pushed,
                "the probe uses the table {now:08x} and not {pushed:08x}, the one pushed: push it again"
            );
            writeln!(
                out,
                "{file}: the probe uses it now: {textures}, checksum {now:08x}"
            )?;
        }
        Command::Factory { at, consent } => {
            let (mut bench, status) = Bench::open(at)?;
            if !status.factory {
                consent.ask(&mut bench, |old| Some(replaced(old, None)), out)?;
            }
            bench.get(Request::command(wire::Command::FactoryTable))?;
            let status = bench.get(Request::status())?;
            let (textures, crc) = (count(status.textures, "texture"), status.table_crc);
            writeln!(
                out,
                "The probe uses the firmware's own table: {textures}, checksum {crc:08x}"
            )?;
        }
    }
    Ok(())
}
