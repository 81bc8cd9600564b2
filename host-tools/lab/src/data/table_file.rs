//! Files of texture tables, checked when they are read.

use std::io::{self, Read};
use std::path::{Path, PathBuf};

use tactus_core::table::{Table, TableError};

/// Most bytes of a table that are read: more textures and movements than a table can have.
const MAX_BYTES: u64 = 64 << 20;

/// Reasons why a file is no table.
#[derive(Debug, thiserror::Error)]
pub enum TableFileError {
    /// It cannot be read.
    #[error("{}: no table here, `tactus learn --out FILE` writes one", path.display())]
    None {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A check of it fails.
    #[error("{}", path.display())]
    Table {
        /// The file.
        path: PathBuf,
        /// Which one.
        source: TableError,
    },
    /// There are bytes after the table.
    #[error("{}: other bytes follow the table; the file is not what `tactus learn` wrote", .0.display())]
    Behind(PathBuf),
}

/// The table in a file that was opened, with every check of it.
///
/// # Errors
/// See [`TableFileError`].
pub fn read_table<'b>(
    path: &Path,
    opened: io::Result<impl Read>,
    bytes: &'b mut Vec<u8>,
) -> Result<Table<'b>, TableFileError> {
    bytes.clear();
    let read = opened.and_then(|file| file.take(MAX_BYTES).read_to_end(bytes));
    read.map_err(|source| TableFileError::None {
        path: path.to_owned(),
        source,
    })?;
    let checked = Table::read(bytes).and_then(|table| table.check_samples().map(|()| table));
    let table = checked.map_err(|source| TableFileError::Table {
        path: path.to_owned(),
        source,
    })?;
    if bytes.len() > table.as_bytes().len() {
        return Err(TableFileError::Behind(path.to_owned()));
    }
    Ok(table)
}
