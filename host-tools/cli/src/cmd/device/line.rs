//! The port of a probe, and the questions that a command asks of somebody beside it.

use std::io::IsTerminal as _;
use std::path::PathBuf;

use anyhow::{Context as _, bail, ensure};
use clap::Args;
use tactus_lab::data::recordings::files::sha256;
use tactus_link::PushTable;
use tactus_link::line::{Line, LineError, found, only_nucleo, open};
use tactus_link::lock::PortLock;
use tactus_link::operations;

use super::bench::BenchError;
use crate::cmd::args::named;
use crate::cmd::table_file::{Force, is_pipe, write_file};

/// Which probe.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct Where {
    /// Its serial port, or HOST:PORT; that of TACTUS_PORT, or the only NUCLEO that is plugged in, unless given
    #[arg(long, value_name = "PORT")]
    pub(crate) port: Option<String>,
    /// A 3D printer moves the finger: its serial port, or HOST:PORT; that of its set-up unless given. For the firmware
    /// `tactus-arm`; see `tactus device printer --help`
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "")]
    pub(crate) printer: Option<String>,
    /// File of the printer's set-up, and not ~/.local/share/tactus/printer.json
    #[arg(long, value_name = "FILE", requires = "printer")]
    pub(crate) printer_setup: Option<PathBuf>,
    /// Write all requests and reports to this file, for `tactus device log`
    #[arg(long, value_name = "FILE")]
    pub(crate) log: Option<PathBuf>,
}

pub(crate) struct Open {
    pub(crate) line: Box<dyn Line>,
    pub(crate) name: String,
    pub(crate) lock: PortLock,
}

impl Where {
    pub(crate) fn open(&self) -> Result<Open, LineError> {
        let given = || named("TACTUS_PORT").and_then(|port| port.into_string().ok());
        let name = match self.port.clone().or_else(given) {
            Some(port) => port,
            None => only_nucleo(found())?,
        };
        let (line, lock) = open(&name)?;
        Ok(Open { line, name, lock })
    }
}

/// The consent that a command needs which takes something from the probe.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct Consent {
    /// Do it without asking
    #[arg(long, short)]
    pub(crate) yes: bool,
    /// Keep the probe's table in this file first, and not in ~/.local/share/tactus/backups
    #[arg(long, value_name = "FILE")]
    pub(crate) backup: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
}

impl Consent {
    /// Checks that there is somebody to ask, if that is needed: to be known before a person has worked for it.
    pub(crate) fn can_be_given(&self) -> Result<(), BenchError> {
        match self.yes || std::io::stdin().is_terminal() {
            true => Ok(()),
            false => Err(BenchError::Nobody),
        }
    }

    /// Checks that nothing is in the place of the copy: to be known before a person has worked for it.
    pub(crate) fn has_place(&self) -> Result<(), BenchError> {
        match &self.backup {
            Some(file) if !self.force.force && file.exists() => {
                Err(BenchError::Taken(file.clone()))
            }
            _ => Ok(()),
        }
    }

    /// Keeps a table in a file that `table push` takes; one of this name that holds something else stays as it is.
    pub(super) fn keep(&self, table: &[u8]) -> anyhow::Result<String> {
        let (file, force) = match &self.backup {
            Some(file) => (file.clone(), self.force),
            // one file for one table, however often it is kept
            None => {
                let name = format!("table-{}.tact", sha256(table));
                (folder()?.join(name), Force::default())
            }
        };
        let name = file.display().to_string();
        ensure!(
            !is_pipe(&file),
            "--backup: name a file, which can be read again"
        );
        let written = write_file(&file, table, force);
        if self.backup.is_none() && written.is_err() && file.exists() {
            bail!(
                "{name}: is not the table that it is named for; move it away, or name a file with --backup"
            );
        }
        written?;
        let kept = std::fs::metadata(&file).is_ok_and(|kept| kept.is_file());
        let kept = if kept {
            std::fs::read(&file)
        } else {
            Ok(Vec::new())
        };
        let kept = kept.with_context(|| name.clone())?;
        ensure!(
            kept == table,
            "{name}: does not hold what was written; name another file with --backup"
        );
        PushTable::new(&kept).with_context(|| name.clone())?;
        Ok(name)
    }
}

fn folder() -> anyhow::Result<PathBuf> {
    in_data_home("backups", "name a file with --backup")
}

/// A folder of the user's data.
pub(super) fn in_data_home(name: &str, otherwise: &str) -> anyhow::Result<PathBuf> {
    let data = named("XDG_DATA_HOME").map(PathBuf::from);
    let data = data.or_else(|| Some(PathBuf::from(named("HOME")?).join(".local/share")));
    let data = data.with_context(|| format!("there is no home folder to write to: {otherwise}"))?;
    let folder = data.join("tactus").join(name);
    std::fs::create_dir_all(&folder)
        .with_context(|| format!("{}: {otherwise}", folder.display()))?;
    Ok(folder)
}

/// A person's statement about the sample between the trials of a training or a recording.
#[derive(Args, Clone, Copy, Debug)]
pub(crate) struct Sample {
    /// Note that the sample was moved or turned from slide to slide, and do not ask for it
    #[arg(long, conflicts_with = "same_spot")]
    moved: bool,
    /// Note that the sample stayed where it was, and do not ask to move it
    #[arg(long)]
    same_spot: bool,
}

impl Sample {
    pub(crate) fn said(self) -> Option<bool> {
        (self.moved || self.same_spot).then_some(self.moved)
    }

    /// The same, or that whoever sits at the terminal is asked between trials.
    pub(crate) fn known(self) -> operations::Sample {
        match self.said() {
            None if std::io::stdin().is_terminal() => operations::Sample::Asked,
            said => operations::Sample::Noted(said),
        }
    }
}
