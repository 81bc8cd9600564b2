//! Tables out and in, in parts.

use embedded_storage_async::nor_flash::NorFlash;
use heapless::Vec;

use crate::store::{Store, StoreError};
use crate::wire::{Event, PART};

/// The part of `table` that begins at `offset`, as the event that the host receives; `None` if the table ends before.
pub(super) fn read(table: &[u8], offset: u32) -> Option<Event> {
    let rest = table.get(offset as usize..)?;
    let part = rest.get(..rest.len().min(PART)).unwrap_or_default();
    Some(Event::TablePart {
        offset,
        length: table.len() as u32,
        bytes: Vec::from_slice(part).unwrap_or_default(),
    })
}

/// Takes a part of a new table in. A host that did not hear the answer sends the part again, which is no error: the
/// checksum of the table is looked at in the end.
pub(super) async fn write<F: NorFlash>(
    store: &mut Store<F>,
    offset: u32,
    bytes: &[u8],
) -> Result<(), StoreError> {
    match store.write_table(offset as usize, bytes).await {
        Err(StoreError::Part { offset, wanted })
            if offset.checked_add(bytes.len()) == Some(wanted) =>
        {
            Ok(())
        }
        written => written,
    }
}
