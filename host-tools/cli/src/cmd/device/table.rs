//! `tactus device table`: the table that the probe uses.

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context as _, ensure};
use clap::Subcommand;
use serde::Serialize;
use tactus_core::table::Table;
use tactus_core::wire;
use tactus_lab::eval::show::{count, show_table};
use tactus_lab::eval::table_summary::TableSummary;
use tactus_lab::remote::say::{replaced, uses_factory};
use tactus_link::{PushTable, Request};

use super::bench::Bench;
use super::line::Where;
use super::loss::Consent;
use crate::cmd::output::{Format, print_json};
use crate::cmd::table_file::{TableFile, beside, read_table, write_table};

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
        /// How to print what was written
        #[arg(long, value_enum, default_value_t = Format::Text)]
        format: Format,
    },
    /// Check a table, send it to the probe, and compare what the probe uses then
    Push {
        #[command(flatten)]
        at: Where,
        /// The table, as `tactus learn` or `table pull` wrote it; "-" reads standard input
        file: PathBuf,
        #[command(flatten)]
        consent: Consent,
        /// How to print what the probe uses then
        #[arg(long, value_enum, default_value_t = Format::Text)]
        format: Format,
    },
    /// Go back to the table that came with the firmware
    Factory {
        #[command(flatten)]
        at: Where,
        #[command(flatten)]
        consent: Consent,
        /// How to print what the probe uses then
        #[arg(long, value_enum, default_value_t = Format::Text)]
        format: Format,
    },
}

/// What `device table push` and `factory` print with `--format json`.
#[derive(Serialize)]
struct InUse {
    /// The table that was pushed; `null`: the firmware's own.
    file: Option<String>,
    textures: u16,
    bytes: u32,
    /// CRC-32, in hexadecimal digits.
    checksum: String,
    /// Where the table is kept that the probe used before; `null`: nothing was lost.
    backup: Option<String>,
}

impl InUse {
    fn print(&self, format: Format, out: &mut impl Write) -> anyhow::Result<()> {
        let (textures, checksum) = (count(self.textures, "texture"), &self.checksum);
        match (format, &self.file) {
            (Format::Json, _) => print_json(self, out)?,
            (Format::Text, Some(file)) => writeln!(
                out,
                "{file}: the probe uses it now: {textures}, checksum {checksum}"
            )?,
            (Format::Text, None) => writeln!(out, "{}", uses_factory(self.textures, checksum))?,
        }
        Ok(())
    }

    /// As the probe says it now.
    fn new(
        bench: &mut Bench,
        file: Option<String>,
        backup: Option<String>,
    ) -> anyhow::Result<Self> {
        let status = bench.get(Request::status())?;
        Ok(Self {
            file,
            textures: status.textures,
            bytes: status.table_bytes,
            checksum: format!("{:08x}", status.table_crc),
            backup,
        })
    }
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
        Command::Pull { at, file, format } => {
            let bytes = Bench::open(at)?.0.table()?;
            write_table(file, &bytes)?;
            let out = &mut beside(file, out);
            let table = Table::read(&bytes)?;
            if *format == Format::Json {
                return print_json(&TableFile::new(file, table), out);
            }
            let textures = count(table.textures(), "texture");
            let (file, length, crc) = (file.display(), bytes.len(), table.crc());
            writeln!(
                out,
                "{file}: {textures}, {length} bytes, checksum {crc:08x}"
            )?;
        }
        Command::Push {
            at,
            file,
            consent,
            format,
        } => {
            let mut bytes = Vec::new();
            let table = read_table(file, &mut bytes)?;
            let file = file.display().to_string();
            let push = PushTable::new(table.as_bytes()).with_context(|| file.clone())?;
            let (mut bench, status) = Bench::open(at)?;
            table
                .of_finger(status.finger)
                .with_context(|| file.clone())?;
            // the firmware's own table is never lost
            let loses = !status.factory && status.table_crc != table.crc();
            let lost = |old: &Table<'_>| replaced(old, Some(&table));
            let backup = loses.then(|| consent.ask(&mut bench, lost, *format, out));
            let backup = backup.transpose()?;
            bench.get(push)?;
            // not what was sent counts, but what the probe uses from now on
            let now = InUse::new(&mut bench, Some(file), backup)?;
            let pushed = format!("{:08x}", table.crc());
            ensure!(
                now.checksum == pushed,
                "the probe uses the table {} and not {pushed}, the one pushed: push it again",
                now.checksum
            );
            now.print(*format, out)?;
        }
        Command::Factory {
            at,
            consent,
            format,
        } => {
            let (mut bench, status) = Bench::open(at)?;
            let lost = |old: &Table<'_>| replaced(old, None);
            let backup = (!status.factory).then(|| consent.ask(&mut bench, lost, *format, out));
            let backup = backup.transpose()?;
            bench.get(Request::command(wire::Command::FactoryTable))?;
            InUse::new(&mut bench, None, backup)?.print(*format, out)?;
        }
    }
    Ok(())
}
