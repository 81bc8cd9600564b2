//! Logs of sessions, which `tactus device --log` writes: a line of JSON for every command and every report.
//!
//! The first line says who wrote it: `{"session":{"tactus":"0.1.0","protocol":1,"port":"/dev/ttyACM0"}}`. Each other is
//! `{"command":...}` or `{"report":...}` with a message of [`tactus_core::wire`]. What a replay needs is in the log:
//! the table in use (the parts that were read), the raw samples (blocks), what was measured, chosen and answered.

use std::borrow::Cow;
use std::io::{self, BufRead as _, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use tactus_core::wire::{Command, PROTOCOL, Report};

use super::sound::impossible;
use super::whole::WholeFile;

/// One line.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Line<'a> {
    /// The first one: who wrote it.
    Session {
        /// The version of the command.
        tactus: Cow<'a, str>,
        /// The version of the messages.
        protocol: u8,
        /// The probe's port.
        port: Cow<'a, str>,
    },
    /// The probe's request.
    Command(Box<Cow<'a, Command>>),
    /// Its report.
    Report(Box<Cow<'a, Report>>),
}

impl<'a> Line<'a> {
    /// The first line of a log of what is said at a port.
    pub fn first(port: &'a str) -> Self {
        Self::Session {
            tactus: env!("CARGO_PKG_VERSION").into(),
            protocol: PROTOCOL,
            port: port.into(),
        }
    }

    /// Writes it, with its end.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        serde_json::to_writer(&mut *out, self)?;
        out.write_all(b"\n")
    }
}

/// Writes the log, which gets its name when it ends. A failure is kept until the caller asks for it, and removes the
/// log.
#[derive(Debug)]
pub struct Log {
    path: PathBuf,
    file: Option<WholeFile>,
    failed: io::Result<()>,
}

impl Log {
    /// Begins a log of what is said at a port; a file that is there already is left alone.
    pub fn create(path: &Path, port: &str) -> io::Result<Self> {
        let file = WholeFile::create(path, false).map_err(|why| named(path, &why))?;
        let mut log = Self {
            path: path.to_owned(),
            file: Some(file),
            failed: Ok(()),
        };
        log.line(&Line::first(port));
        log.flush()?;
        Ok(log)
    }

    /// Writes a line.
    pub fn line(&mut self, line: &Line<'_>) {
        if let (Some(file), Ok(())) = (&mut self.file, &self.failed) {
            self.failed = line.write(file);
        }
    }

    /// Everything so far is in the file.
    pub fn flush(&mut self) -> io::Result<()> {
        let written = std::mem::replace(&mut self.failed, Ok(()));
        let flushed = written.and_then(|()| self.file.as_mut().map_or(Ok(()), Write::flush));
        flushed.map_err(|why| {
            self.file = None;
            named(&self.path, &why)
        })
    }

    /// Ends the log, and gives it its name.
    pub fn finish(&mut self) -> io::Result<()> {
        self.flush()?;
        let finished = self.file.take().map_or(Ok(()), WholeFile::finish);
        finished.map_err(|why| named(&self.path, &why))
    }
}

impl Drop for Log {
    fn drop(&mut self) {
        // a caller that wants to know has finished it
        let _ = self.finish();
    }
}

fn named(path: &Path, why: &io::Error) -> io::Error {
    io::Error::new(why.kind(), format!("{}: {why}", path.display()))
}

/// The reason why a log cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct LogError(String);

impl From<io::Error> for LogError {
    fn from(why: io::Error) -> Self {
        Self(why.to_string())
    }
}

/// Most bytes of a line: the longest reports, many times over.
const MAX_LINE: u64 = 1 << 20;

/// Reads a log line by line.
pub fn read(log: impl Read, mut each: impl FnMut(Line<'static>)) -> Result<(), LogError> {
    let (mut lines, mut line) = (BufReader::new(log), Vec::new());
    for number in 1.. {
        line.clear();
        if lines.by_ref().take(MAX_LINE).read_until(b'\n', &mut line)? == 0 {
            break;
        }
        let read = serde_json::from_slice(&line);
        let none = |why: serde_json::Error| {
            LogError(format!(
                "line {number} is no line of a session's log ({why}); `tactus device identify --log FILE` writes one"
            ))
        };
        match read.map_err(none)? {
            Line::Session { protocol, .. } if protocol != PROTOCOL => {
                return Err(LogError(format!(
                    "written with version {protocol} of the messages, this program reads version {PROTOCOL}: replay it \
                     with the tactus that wrote it"
                )));
            }
            line => {
                if let Line::Report(report) = &line
                    && let Some(what) = impossible(&report.event)
                {
                    return Err(LogError(format!(
                        "line {number} has a report that cannot be, with {what}: the log was changed"
                    )));
                }
                each(line);
            }
        }
    }
    Ok(())
}

/// A table, as its parts come.
#[derive(Debug, Default)]
pub struct TableParts(Vec<u8>);

impl TableParts {
    /// Takes a part; the table, when it is whole.
    pub fn take(&mut self, offset: u32, length: u32, bytes: &[u8]) -> Option<Vec<u8>> {
        if offset == 0 {
            self.0.clear();
        }
        if offset as usize == self.0.len() {
            self.0.extend_from_slice(bytes);
        }
        (self.0.len() == length as usize).then(|| std::mem::take(&mut self.0))
    }
}
