//! Table files: written whole, and checked when read.

use std::io::{self, Read, Write};
use std::path::Path;

use anyhow::Context as _;
use tactus_core::table::Table;
use tactus_lab::data::printable::Printable;
use tactus_lab::data::recordings::files::open;
use tactus_lab::data::table_file::{self, TableFileError};
use tactus_lab::data::whole::write_whole;

use super::progress::is_quiet;

/// An old table is replaced whole or not at all; "-" is standard output.
pub(crate) fn write_table(file: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    if is_pipe(file) {
        // whoever has it locked is this thread
        let mut to = io::stdout();
        return Ok(to.write_all(bytes).and_then(|()| to.flush())?);
    }
    write_whole(file, bytes).with_context(|| file.display().to_string())
}

pub(crate) fn is_pipe(file: &Path) -> bool {
    file == Path::new("-")
}

/// Where to say what was written: not into the file, where that is standard output.
pub(crate) fn beside<'o>(file: &Path, out: &'o mut impl Write) -> Box<dyn Write + 'o> {
    match (is_pipe(file), is_quiet()) {
        (false, _) => Box::new(out),
        (true, false) => Box::new(Printable::new(io::stderr())),
        (true, true) => Box::new(io::sink()),
    }
}

/// A file to read; "-" is standard input.
pub(crate) fn opened(file: &Path) -> io::Result<Box<dyn Read>> {
    Ok(if is_pipe(file) {
        Box::new(io::stdin().lock())
    } else {
        Box::new(open(file)?)
    })
}

pub(crate) fn read_table<'b>(
    file: &Path,
    bytes: &'b mut Vec<u8>,
) -> Result<Table<'b>, TableFileError> {
    table_file::read_table(file, opened(file), bytes)
}
