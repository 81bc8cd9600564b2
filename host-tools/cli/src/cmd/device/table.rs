//! `tactus device table`: the table that the probe uses.

use std::io::Write;
use std::path::PathBuf;

use clap::Subcommand;
use serde::Serialize;
use tactus_core::table::Table;
use tactus_core::wire::Status;
use tactus_lab::eval::show::{count, show_table};
use tactus_lab::eval::table_summary::TableSummary;
use tactus_link::operations;

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

/// The object that `device table push` and `factory` prints with `--format json`.
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
    /// Prints what the probe uses now, for programs.
    fn print(
        (bench, now): (&Bench, &Status),
        file: Option<String>,
        format: Format,
        out: &mut impl Write,
    ) -> anyhow::Result<()> {
        if format == Format::Text {
            return Ok(());
        }
        let in_use = Self {
            file,
            textures: now.textures,
            bytes: now.table_bytes,
            checksum: format!("{:08x}", now.table_crc),
            backup: bench.backup(),
        };
        print_json(&in_use, out)
    }
}

/// Shows, fetches or changes the probe's table.
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
        Command::Pull { at, file, format } => {
            let bytes = Bench::open(at, *format)?.0.table()?;
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
            let (mut bench, _) = Bench::open(at, *format)?;
            bench.consents(consent);
            let probe = bench.probe();
            let pushed = operations::push(&probe, &file, table.as_bytes());
            let now = bench.done(pushed, out)?;
            InUse::print((&bench, &now), Some(file), *format, out)?;
        }
        Command::Factory {
            at,
            consent,
            format,
        } => {
            let (mut bench, _) = Bench::open(at, *format)?;
            bench.consents(consent);
            let probe = bench.probe();
            let now = bench.done(operations::factory(&probe), out)?;
            InUse::print((&bench, &now), None, *format, out)?;
        }
    }
    Ok(())
}
