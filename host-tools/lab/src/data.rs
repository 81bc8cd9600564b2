//! Recordings of slides, tables of properties, and what is read from other formats.

#[cfg(feature = "import")]
pub mod import;
pub mod json;
pub mod printable;
pub mod program;
pub mod properties;
pub mod quality;
pub mod recorder;
pub mod recording;
pub mod recordings;
pub mod replay;
pub mod rows;
pub mod table_file;

pub use tactus_link::whole;

/// The rows of a table in a test, their cells divided by `|`.
#[cfg(test)]
pub(crate) fn cells<const N: usize>(table: &str) -> impl Iterator<Item = [&str; N]> {
    let rows = table.lines().filter(|row| !row.is_empty());
    rows.map(|row| {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        cells.try_into().unwrap_or_else(|row| panic!("{row:?}"))
    })
}
