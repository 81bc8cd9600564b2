//! The log of a session as the command reads it; who writes it is [`tactus_link::log`].

use std::path::Path;

use tactus_link::log;
pub(crate) use tactus_link::log::{Line, Log, LogError, TableParts};

use crate::cmd::table_file::opened;

/// Reads a log line by line; "-" is standard input.
pub(crate) fn read(path: &Path, each: impl FnMut(Line<'static>)) -> Result<(), LogError> {
    log::read(opened(path)?, each)
}
