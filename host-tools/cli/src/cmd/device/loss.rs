//! Consent to a loss of what a probe has learned: the file that its table is kept in first, and the answer to the
//! question.

use std::io::IsTerminal as _;
use std::path::PathBuf;

use anyhow::Context as _;

use super::bench::BenchError;
use super::history;
use crate::cmd::table_file::write_table;

/// The consent that a command needs which takes something from the probe.
#[derive(clap::Args, Clone, Debug, Default)]
pub(crate) struct Consent {
    /// Do it without asking
    #[arg(long, short)]
    pub(crate) yes: bool,
    /// Keep the probe's table in this file first, and not in ~/.local/share/tactus/backups
    #[arg(long, value_name = "FILE")]
    backup: Option<PathBuf>,
}

impl Consent {
    /// A consent that was given on the command line, of a loss without a file.
    pub(crate) fn given(yes: bool) -> Self {
        Self { yes, backup: None }
    }

    /// Checks that there is somebody to ask, if that is needed: to be known before a person has worked for it.
    ///
    /// # Errors
    /// There is nobody.
    pub(crate) fn can_be_given(&self) -> Result<(), BenchError> {
        can_be_asked(self.yes)
    }

    /// Keeps a table of this name; the file.
    ///
    /// # Errors
    /// It cannot be kept, in a sentence.
    pub(super) fn keep(&self, name: &str, table: &[u8]) -> Result<String, String> {
        let file = match &self.backup {
            Some(file) => Ok(file.clone()),
            None => folder().map(|folder| folder.join(name)),
        };
        let kept = file.and_then(|file| {
            write_table(&file, table)?;
            Ok(file.display().to_string())
        });
        kept.map_err(|why| format!("{why:#}"))
    }
}

/// Checks that there is somebody to ask, unless the answer is yes already.
pub(super) fn can_be_asked(yes: bool) -> Result<(), BenchError> {
    match yes || std::io::stdin().is_terminal() {
        true => Ok(()),
        false => Err(BenchError::Nobody),
    }
}

/// The folder that tables are kept in.
fn folder() -> anyhow::Result<PathBuf> {
    let folder = history::folder()
        .context("there is no home folder to keep the probe's table in: name a file with --backup")?
        .join("backups");
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("{}: name another file with --backup", folder.display()))?;
    Ok(folder)
}
