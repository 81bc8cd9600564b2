//! The log of a session as the command reads it; who writes it is [`tactus::link::log`].

use std::path::Path;

use tactus::link::log;
pub(crate) use tactus::link::log::{Line, Log, LogError};

use crate::cmd::table_file::opened;

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
