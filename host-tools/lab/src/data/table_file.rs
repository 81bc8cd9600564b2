//! Files of texture tables, checked when they are read.

use std::io::{self, Read};
use std::path::Path;

use tactus_core::table::Table;

const MAX_BYTES: u64 = 64 << 20;

/// A reason why a file is no table.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct TableFileError(String);

/// The table in a file that was opened, with every check of it.
pub fn read_table<'b>(
    path: &Path,
    opened: io::Result<impl Read>,
    bytes: &'b mut Vec<u8>,
) -> Result<Table<'b>, TableFileError> {
    bytes.clear();
    let read = opened.and_then(|file| file.take(MAX_BYTES).read_to_end(bytes));
    let error = |why: String| TableFileError(format!("{}{why}", path.display()));
    read.map_err(|why| {
        error(format!(
            ": no table here, `tactus learn --out FILE` writes one: {why}"
        ))
    })?;
    let checked = Table::read(bytes).and_then(|table| {
        table.check_samples()?;
        table.check_learned()?;
        Ok(table)
    });
    let table = checked.map_err(|why| error(format!(": {why}")))?;
    if bytes.len() > table.as_bytes().len() {
        let why = ": other bytes follow the table; the file is not what `tactus learn` wrote";
        return Err(error(why.to_owned()));
    }
    Ok(table)
}
