//! The sections of a table with shorter lengths, when textures of it are deleted or learned anew.

use super::format::{HEAD, LENGTH, MS};
use super::view::{Length, Table};

/// Where the header has the number of textures.
const COUNT: usize = 12;

/// Bytes of all sections when these textures are kept, `None` for one that is new or learned anew.
///
/// # Errors
/// Bytes of a section that would be too long.
pub(super) fn amended_length(
    old: &Table<'_>,
    kept: impl Iterator<Item = Option<u16>>,
) -> Result<usize, usize> {
    let others = old.other_sections(LENGTH);
    let others: usize = others
        .map(|(head, contents)| head.len() + contents.len())
        .sum();
    let (count, lengths) = (kept.count(), old.lengths().count());
    let own = old.lengths().map(|shorter| bytes_of(&shorter, count));
    let most = own.clone().max().unwrap_or(0);
    u16::try_from(most).map_err(|_| most)?;
    Ok(others + lengths * HEAD + own.sum::<usize>())
}

/// Gives their bytes, piece by piece.
pub(super) fn write_amended(
    old: &Table<'_>,
    kept: impl Iterator<Item = Option<u16>> + Clone,
    mut put: impl FnMut(&[u8]),
) {
    for (head, contents) in old.other_sections(LENGTH) {
        put(&head);
        put(contents);
    }
    let count = kept.clone().count();
    for length in old.lengths() {
        put(&LENGTH.to_le_bytes());
        put(&(bytes_of(&length, count) as u16).to_le_bytes());
        put(&length.ms.to_le_bytes());
        let (table, layout) = (&length.table, length.table.layout());
        put(table.bytes.get(..COUNT).unwrap_or_default());
        put(&(count as u16).to_le_bytes());
        let (_, cell) = table.contents.sizes();
        put(table.bytes.get(COUNT + 2..layout.cells).unwrap_or_default());
        for texture in kept.clone() {
            for movement in 0..table.movements {
                match texture.and_then(|texture| table.cell_bytes(texture, movement)) {
                    Some(bytes) => put(bytes),
                    None => (0..cell).for_each(|_| put(&[0])),
                }
            }
        }
        for texture in kept.clone() {
            for movement in 0..table.movements {
                put(&[texture.map_or(0, |texture| table.trials(texture, movement))]);
            }
        }
        put(length.rest);
    }
}

/// Bytes of the contents of a length's section, had it so many textures.
fn bytes_of(length: &Length<'_>, textures: usize) -> usize {
    let movements = usize::from(length.table.movements);
    MS + length.table.contents.layout(textures, movements).lineage + length.rest.len()
}
