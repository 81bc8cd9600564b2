//! Texture tables on their way to the probe, and from it.

use tactus_core::table::{Table, TableError, with_learned};
use tactus_core::wire::{Command, Event, PART};

use super::session::{LinkError, MAX_TRIES};
use super::transaction::Transaction;

/// The table without its note of the slides that it was learned from, which a probe has no use for.
pub fn for_probe(table: &Table<'_>) -> Vec<u8> {
    let mut bytes = table.as_bytes().to_vec();
    // what is shorter has space there
    let length = with_learned(&mut bytes, table, None).map_or(0, |bare| bare.as_bytes().len());
    match length {
        0 => table.as_bytes().to_vec(),
        length => {
            bytes.truncate(length);
            bytes
        }
    }
}

/// CRC-32 of the table as a probe has it: see [`for_probe`].
pub fn checksum(table: &Table<'_>) -> u32 {
    Table::read(&for_probe(table)).map_or(table.crc(), |bare| bare.crc())
}

/// Gives the probe another table: begins, writes it in parts of [`PART`] bytes, each when the one before is done, and
/// has it taken into use.
#[derive(Clone, Debug)]
pub struct PushTable {
    bytes: Vec<u8>,
    /// the next request: begin, then parts, then commit
    next: usize,
}

impl PushTable {
    /// The table in `bytes`, checked, as [`for_probe`] makes it.
    pub fn new(bytes: &[u8]) -> Result<Self, LinkError> {
        Ok(Self {
            bytes: for_probe(&Table::read(bytes)?),
            next: 0,
        })
    }

    /// Requests that are done or under way, and all there are.
    pub fn progress(&self) -> (usize, usize) {
        (self.next, self.bytes.len().div_ceil(PART) + 2)
    }
}

impl Transaction for PushTable {
    type Outcome = ();

    fn next(&mut self) -> Result<Option<Command>, LinkError> {
        let parts = self.bytes.len().div_ceil(PART);
        let next = self.next;
        self.next += 1;
        Ok(match next {
            0 => Some(Command::BeginTable(self.bytes.len() as u32)),
            n if n <= parts => {
                let offset = (n - 1) * PART;
                let rest = self.bytes.get(offset..).unwrap_or_default();
                Some(Command::WriteTable {
                    offset: offset as u32,
                    bytes: rest.iter().copied().take(PART).collect(),
                })
            }
            n if n == parts + 1 => Some(Command::CommitTable),
            _ => None,
        })
    }

    fn hear(&mut self, _: &Event) -> Result<(), LinkError> {
        Ok(())
    }

    fn outcome(&mut self) -> Result<(), LinkError> {
        Ok(())
    }
}

/// Reads the table that the probe uses; its bytes, checked. The probe decides whether it sends one part per request or
/// all.
#[derive(Clone, Debug, Default)]
pub struct ReadTable {
    bytes: Vec<u8>,
    /// of the whole table, once reported
    length: Option<u32>,
    /// bytes there were when the request under way was made, and how often it was made
    asked: (usize, u8),
}

impl Transaction for ReadTable {
    type Outcome = Vec<u8>;

    fn next(&mut self) -> Result<Option<Command>, LinkError> {
        let got = self.bytes.len();
        if self.length.is_some_and(|length| got as u32 >= length) {
            return Ok(None);
        }
        // done, and not a byte came: it was damaged
        let tries = if self.asked.0 == got { self.asked.1 } else { 0 };
        if tries == MAX_TRIES {
            return Err(LinkError::Disturbed);
        }
        self.asked = (got, tries + 1);
        Ok(Some(Command::ReadTable(got as u32)))
    }

    fn hear(&mut self, event: &Event) -> Result<(), LinkError> {
        if let Event::TablePart {
            offset,
            length,
            bytes,
        } = event
        {
            if *self.length.get_or_insert(*length) != *length {
                return Err(LinkError::Changed);
            }
            // another is one that came twice, or comes behind a lost one and will be asked for again
            if *offset as usize == self.bytes.len() {
                self.bytes.extend_from_slice(bytes);
            }
        }
        Ok(())
    }

    fn outcome(&mut self) -> Result<Vec<u8>, LinkError> {
        // two tables of one length, half of each: the checksum says so
        match Table::read(&self.bytes) {
            Err(TableError::Crc { .. }) => Err(LinkError::Changed),
            Err(why) => Err(why.into()),
            // what the probe says of its length, or of a name, is not what is in it
            Ok(table) if table.as_bytes().len() != self.bytes.len() => {
                Err(LinkError::Impossible("bytes behind its table"))
            }
            Ok(_) => Ok(std::mem::take(&mut self.bytes)),
        }
    }
}
