//! A table with one of its sections changed, and the others as they are.

use super::encode::{EncodeError, rewrite_with};
use super::view::Table;

/// Writes `old` with one section in place of that of the same kind, or without it if it would have no bytes.
pub(super) fn rewrite_section<'o>(
    out: &'o mut [u8],
    old: &Table<'_>,
    kind: u16,
    length: u16,
    contents: impl FnOnce(&mut dyn FnMut(&[u8])),
) -> Result<Table<'o>, EncodeError> {
    let others = || old.other_sections(kind);
    let of_others: usize = others()
        .map(|(head, contents)| head.len() + contents.len())
        .sum();
    let own = if length > 0 {
        4 + usize::from(length)
    } else {
        0
    };
    rewrite_with(out, old, old.lineage(), of_others + own, |put| {
        for (head, contents) in others() {
            put(&head);
            put(contents);
        }
        if length > 0 {
            put(&kind.to_le_bytes());
            put(&length.to_le_bytes());
            contents(put);
        }
    })
}
