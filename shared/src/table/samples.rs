//! Notes for people: were samples moved or turned between the trials that a table was learned from?
//!
//! A slide on the same track again says little about a texture. Nothing is decided by this: a probe carries the section
//! over as it is when it learns or deletes textures, and does not look into it.
//!
//! Section of kind 3, 5 bytes for each texture of which it is known:
//!
//! | bytes | what |
//! |---|---|
//! | 2 | the texture's number |
//! | 2 | the lower half of its name's CRC-32: a texture that got the number of a deleted one has another |
//! | 1 | 1: always at the same spot; 2: moved or turned between trials |

use super::encode::EncodeError;
use super::format::TableError;
use super::one_section::rewrite_section;
use super::sections::SAMPLES;
use super::view::Table;
use crate::CRC32;

/// Bytes of a texture in the section.
const ENTRY: usize = 5;
/// Always at the same spot.
const STAYED: u8 = 1;
/// Moved or turned between trials.
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
    ///
    /// # Errors
    /// [`TableError::Section`].
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

/// Most bytes that it takes to say of so many textures whether their samples were moved.
pub const fn samples_length(textures: usize) -> usize {
    4 + ENTRY * textures
}

/// Writes `old` into `out`, with whether the sample of each texture was moved in place of what it says of that; all
/// else stays as it is, and so does the table where nothing is known of any.
///
/// # Errors
/// As [`super::encode`].
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
    let known = entries().count();
    let length = u16::try_from(known * ENTRY).unwrap_or(u16::MAX);
    // as many as fit: no table has so many textures
    let known = usize::from(length) / ENTRY;
    rewrite_section(out, old, SAMPLES, (known * ENTRY) as u16, |put| {
        entries().take(known).for_each(|entry| put(&entry));
    })
}
