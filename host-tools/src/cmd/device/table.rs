//! `tactus device table`: the table that the probe uses.

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context as _, ensure};
use clap::Subcommand;
use tactus::link::{PushTable, Question};
use tactus::show::show_table;
use tactus_core::table::Table;
use tactus_core::wire::Ask;

use super::bench::Bench;
use super::line::Where;
use crate::cmd::table_file::{read_table, write_table};

/// Look at the probe's texture table, fetch it, give it another
#[derive(Subcommand)]
pub(crate) enum Command {
    /// Print what the probe's table holds
    Show {
        #[command(flatten)]
        at: Where,
    },
    /// Write the probe's table to a file
    Pull {
        #[command(flatten)]
        at: Where,
        /// The file to write
        file: PathBuf,
    },
    /// Check a table, give it to the probe, and compare what it holds then
    Push {
        #[command(flatten)]
        at: Where,
        /// The table, as `tactus learn` or `table pull` wrote it
        file: PathBuf,
    },
    /// Go back to the table that came with the firmware
    Factory {
        #[command(flatten)]
        at: Where,
    },
}

/// Shows, fetches or changes the probe's table.
pub(crate) fn run(command: &Command, out: &mut impl Write) -> anyhow::Result<()> {
    match command {
        Command::Show { at } => {
            let (mut bench, status) = Bench::open(at)?;
            let bytes = bench.table()?;
            let whose = if status.factory {
                "came with the firmware"
            } else {
                "was given to the probe or taught to it"
            };
            writeln!(out, "The table {whose}.")?;
            show_table(Table::read(&bytes)?, out)?;
        }
        Command::Pull { at, file } => {
            let (mut bench, _) = Bench::open(at)?;
            let bytes = bench.table()?;
            write_table(file, &bytes)?;
            let table = Table::read(&bytes)?;
            writeln!(
                out,
                "{}: {} textures, {} bytes, checksum {:08x}",
                file.display(),
                table.textures(),
                bytes.len(),
                table.crc()
            )?;
        }
        Command::Push { at, file } => {
            let mut bytes = Vec::new();
            let table = read_table(file, &mut bytes)?;
            let push =
                PushTable::new(table.as_bytes()).with_context(|| file.display().to_string())?;
            let (mut bench, _) = Bench::open(at)?;
            bench.run(push, |_| Ok(()))?;
            // not what was sent counts, but what the probe uses from now on
            let status = bench.run(Question::status(), |_| Ok(()))?;
            ensure!(
                status.table_crc == table.crc(),
                "the probe uses the table {:08x} and not {:08x}, the one pushed: push it again",
                status.table_crc,
                table.crc()
            );
            writeln!(
                out,
                "{}: the probe uses it now: {} textures, checksum {:08x}",
                file.display(),
                status.textures,
                status.table_crc
            )?;
        }
        Command::Factory { at } => {
            let (mut bench, _) = Bench::open(at)?;
            bench.run(Question::command(Ask::FactoryTable), |_| Ok(()))?;
            let status = bench.run(Question::status(), |_| Ok(()))?;
            writeln!(
                out,
                "The probe uses the firmware's own table: {} textures, checksum {:08x}",
                status.textures, status.table_crc
            )?;
        }
    }
    Ok(())
}
