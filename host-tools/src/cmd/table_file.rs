//! Table files: written whole, and checked when read.

use std::path::Path;

use anyhow::{Context as _, bail};
use tactus_core::table::Table;

/// An old table is replaced whole or not at all.
pub(crate) fn write_table(file: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let mut part = file.as_os_str().to_owned();
    part.push(".part");
    std::fs::write(&part, bytes)
        .and_then(|()| std::fs::rename(&part, file))
        .with_context(|| file.display().to_string())
}

pub(crate) fn read_table<'b>(file: &Path, bytes: &'b mut Vec<u8>) -> anyhow::Result<Table<'b>> {
    *bytes = std::fs::read(file).with_context(|| file.display().to_string())?;
    let table = Table::read(bytes).with_context(|| file.display().to_string())?;
    let behind = bytes.len() - table.as_bytes().len();
    if behind > 0 {
        bail!(
            "{}: {behind} bytes follow the table; the file is not what `tactus learn` wrote",
            file.display()
        );
    }
    Ok(table)
}
