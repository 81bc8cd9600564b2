//! `tactus table`: what a table file holds, and whether it is good.

use std::io::Write;
use std::path::PathBuf;

use clap::Subcommand;
use tactus::eval::show::show_table;

use super::table_file::read_table;

/// Look into a texture table
#[derive(Subcommand)]
#[command(after_help = "\
Examples:
  tactus table show table      textures, trials, and how far they are apart
  tactus table check table     whether every check of it passes")]
pub(crate) enum Command {
    /// Print what the table holds
    Show {
        /// The table
        file: PathBuf,
    },
    /// Check the table, and say which check fails
    Check {
        /// The table
        file: PathBuf,
    },
}

/// Shows or checks a table file.
pub(crate) fn run(command: &Command, out: &mut impl Write) -> anyhow::Result<()> {
    let mut bytes = Vec::new();
    match command {
        Command::Show { file } => show_table(read_table(file, &mut bytes)?, out)?,
        Command::Check { file } => {
            let table = read_table(file, &mut bytes)?;
            writeln!(
                out,
                "{}: good; {} textures, {} movements, {} bytes, checksum {:08x}",
                file.display(),
                table.textures(),
                table.movements().len(),
                table.as_bytes().len(),
                table.crc()
            )?;
        }
    }
    Ok(())
}
