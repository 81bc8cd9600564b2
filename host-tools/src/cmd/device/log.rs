//! The log of a session: a line of JSON for every command and every report.
//!
//! The first line says who wrote it: `{"session":{"tactus":"0.1.0","protocol":7,"port":"/dev/ttyACM0"}}`. Each other one is
//! `{"command":...}` or `{"report":...}` with a message of [`tactus_core::wire`]. What a replay needs is in the log itself:
//! the table in use (the parts that were read), the raw samples (blocks), what was measured, chosen and answered.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};

use tactus::link::log;
pub(crate) use tactus::link::log::{Line, LogError};
use tactus_core::wire::{Command, PROTOCOL, Report};

use crate::cmd::table_file::opened;

/// Writes the log. A failure is kept until the caller asks for it.
#[derive(Debug)]
pub(crate) struct Log {
    path: PathBuf,
    file: BufWriter<File>,
    failed: io::Result<()>,
}

impl Log {
    /// Begins a log; a file that is there already is left alone.
    pub(crate) fn create(path: &Path, port: &str) -> io::Result<Self> {
        let file = File::create_new(path).map_err(|why| match why.kind() {
            io::ErrorKind::AlreadyExists => {
                io::Error::new(why.kind(), "is there already: give the log another name")
            }
            _ => why,
        });
        let mut log = Self {
            path: path.to_owned(),
            file: BufWriter::new(file.map_err(|why| named(path, &why))?),
            failed: Ok(()),
        };
        log.line(&Line::Session {
            tactus: env!("CARGO_PKG_VERSION").into(),
            protocol: PROTOCOL,
            port: port.into(),
        });
        log.flush()?;
        Ok(log)
    }

    pub(crate) fn asked(&mut self, command: &Command) {
        self.line(&Line::Command(Box::new(Cow::Borrowed(command))));
    }

    pub(crate) fn told(&mut self, report: &Report) {
        self.line(&Line::Report(Box::new(Cow::Borrowed(report))));
    }

    fn line(&mut self, line: &Line<'_>) {
        if self.failed.is_ok() {
            let written = serde_json::to_writer(&mut self.file, line).map_err(io::Error::from);
            self.failed = written.and_then(|()| self.file.write_all(b"\n"));
        }
    }

    /// Everything so far is in the file.
    pub(crate) fn flush(&mut self) -> io::Result<()> {
        let written = std::mem::replace(&mut self.failed, Ok(()));
        let flushed = written.and_then(|()| self.file.flush());
        flushed.map_err(|why| named(&self.path, &why))
    }
}

fn named(path: &Path, why: &io::Error) -> io::Error {
    io::Error::new(why.kind(), format!("{}: {why}", path.display()))
}

/// Reads a log line by line; "-" is standard input.
pub(crate) fn read(path: &Path, each: impl FnMut(Line<'static>)) -> Result<(), LogError> {
    log::read(opened(path)?, each)
}

/// A table, as its parts come.
#[derive(Default)]
pub(crate) struct TableParts(Vec<u8>);

impl TableParts {
    /// Takes a part; the table, when it is whole.
    pub(crate) fn take(&mut self, offset: u32, length: u32, bytes: &[u8]) -> Option<Vec<u8>> {
        if offset == 0 {
            self.0.clear();
        }
        if offset as usize == self.0.len() {
            self.0.extend_from_slice(bytes);
        }
        (self.0.len() == length as usize).then(|| std::mem::take(&mut self.0))
    }
}
