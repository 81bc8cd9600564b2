//! Before the probe loses what it has learned: what that is, a copy of its table, and a question.

use std::io::{IsTerminal as _, Write};
use std::path::PathBuf;

use anyhow::{Context as _, bail};
use tactus_core::table::Table;

use super::bench::{Bench, read_answer};
use super::history;
use crate::cmd::output::Format;
use crate::cmd::table_file::write_table;

/// How a command that takes something from the probe is allowed to.
#[derive(clap::Args, Clone, Debug)]
pub(crate) struct Consent {
    /// Do it without asking
    #[arg(long, short)]
    yes: bool,
    /// Keep the probe's table in this file first, and not in ~/.local/share/tactus/backups
    #[arg(long, value_name = "FILE")]
    backup: Option<PathBuf>,
}

impl Consent {
    /// That there is somebody to ask, if that is needed: to be known before a person has worked for it.
    ///
    /// # Errors
    /// There is nobody.
    pub(crate) fn can_be_given(&self) -> anyhow::Result<()> {
        can_be_asked(self.yes)
    }

    /// Says what will be `lost`, keeps the table that the probe uses now, and asks. Nothing has happened to the probe yet.
    /// Where the output is for programs, that is said on standard error. The file that the table is kept in.
    ///
    /// # Errors
    /// The table cannot be read or kept, or the answer is no.
    pub(crate) fn ask(
        &self,
        bench: &mut Bench,
        lost: impl FnOnce(&Table<'_>) -> String,
        format: Format,
        out: &mut impl Write,
    ) -> anyhow::Result<String> {
        let bytes = bench.table()?;
        let table = Table::read(&bytes)?;
        let lost = lost(&table);
        let file = match &self.backup {
            Some(file) => file.clone(),
            None => {
                // one file for one table, however often it is kept
                folder()?.join(format!("table-{:08x}.tact", table.crc()))
            }
        };
        write_table(&file, &bytes)?;
        let file = file.display().to_string();
        let said = format!(
            "{lost}\nThe probe's table is kept: `tactus device table push {file}` brings it back."
        );
        confirm(&said, "Go on?", self.yes, bench, format, out)?;
        Ok(file)
    }
}

fn can_be_asked(yes: bool) -> anyhow::Result<()> {
    if !yes && !std::io::stdin().is_terminal() {
        bail!("nothing was changed: there is nobody to ask; add --yes to do it");
    }
    Ok(())
}

/// Says something, on standard error where the output is for programs, and asks, unless that was answered by `yes`.
///
/// # Errors
/// There is nobody to ask, or the answer is no.
pub(crate) fn confirm(
    said: &str,
    question: &str,
    yes: bool,
    bench: &Bench,
    format: Format,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    match format {
        Format::Text => writeln!(out, "{said}")?,
        Format::Json => eprintln!("{said}"),
    }
    out.flush()?;
    if yes {
        return Ok(());
    }
    can_be_asked(yes)?;
    let answer = read_answer(bench.interrupt(), &format!("{question} [y/N] "))?;
    if !matches!(answer.trim().to_lowercase().as_str(), "y" | "yes") {
        bail!("nothing was changed");
    }
    Ok(())
}

/// Where tables are kept.
fn folder() -> anyhow::Result<PathBuf> {
    let folder = history::folder()
        .context("there is no home folder to keep the probe's table in: name a file with --backup")?
        .join("backups");
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("{}: name another file with --backup", folder.display()))?;
    Ok(folder)
}
