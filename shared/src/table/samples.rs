//! Notes for people: were samples moved or turned between the trials that a table was learned from?
//!
//! A slide on the same track again says little about a texture. Nothing is decided by this: a probe carries the section
//! over as it is when it learns or deletes textures, and does not look into it.

use super::encode::{EncodeError, with_section};
use super::format::TableError;
use super::sections::SAMPLES;
use super::view::Table;
use crate::CRC32;

const ENTRY: usize = 5;
const STAYED: u8 = 1;
const MOVED: u8 = 2;

/// The bytes that distinguish a texture's name from another.
fn of_name(name: &str) -> [u8; 2] {
    let [low, high, ..] = CRC32.checksum(name.as_bytes()).to_le_bytes();
    [low, high]
}

impl Table<'_> {
    /// Returns whether a texture's sample was moved or turned between trials; `None` where it was not noted, and for
    /// one that has got another name since.
    pub fn moved(&self, texture: u16) -> Option<bool> {
        let key = self.sample_key(texture)?;
        let (entries, _) = self.section(SAMPLES)?.as_chunks::<ENTRY>();
        entries.iter().find_map(|entry| match entry {
            [k0, k1, k2, k3, STAYED] if [*k0, *k1, *k2, *k3] == key => Some(false),
            [k0, k1, k2, k3, MOVED] if [*k0, *k1, *k2, *k3] == key => Some(true),
            _ => None,
        })
    }

    /// That what it says of samples is whole: [`Table::read`] does not look.
    pub fn check_samples(&self) -> Result<(), TableError> {
        let Some(section) = self.section(SAMPLES) else {
            return Ok(());
        };
        let (entries, rest) = section.as_chunks::<ENTRY>();
        let known = |entry: &[u8; ENTRY]| matches!(entry, [.., STAYED | MOVED]);
        let whole = rest.is_empty() && entries.iter().all(known);
        whole.then_some(()).ok_or(TableError::Section(SAMPLES))
    }

    fn sample_key(&self, texture: u16) -> Option<[u8; 4]> {
        let [n0, n1] = self.number(texture).to_le_bytes();
        let [low, high] = of_name(self.name(texture)?);
        Some([n0, n1, low, high])
    }
}

/// Writes `old` into `out`, with whether the sample of each texture was moved in place of what it says of that; all
/// else stays as it is, and so does the table where nothing is known of any.
pub fn with_moved<'o>(
    out: &'o mut [u8],
    old: &Table<'_>,
    moved: impl Fn(u16) -> Option<bool>,
) -> Result<Table<'o>, EncodeError> {
    let entries = || {
        (0..old.textures()).filter_map(|texture| {
            let [k0, k1, k2, k3] = old.sample_key(texture)?;
            let said = if moved(texture)? { MOVED } else { STAYED };
            Some([k0, k1, k2, k3, said])
        })
    };
    let is_there = entries().next().is_some();
    with_section(out, old, SAMPLES, is_there, |writer| {
        entries().for_each(|entry| writer.put(&entry));
    })
}
