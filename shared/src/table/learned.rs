//! Notes for a computer that tests a table: the slides that it was learned from, by the hash of their samples.
//!
//! A probe has no use for them: hosts take the section out before they send a table. A probe that gets it nevertheless
//! carries it over as it is, and does not look into it.

use super::encode::{EncodeError, Row, rewrite};
use super::format::{TableError, array, each};
use super::sections::LEARNED;
use super::view::Table;

/// First bytes of the SHA-256 of a slide's P_AC, little-endian numbers of 16 bits: those of two slides among ten
/// thousand agree once in five million tables.
pub type SlideHash = [u8; 6];

/// Most slides that a table notes: the length of a section is a number of 16 bits.
pub const MAX_LEARNED: usize = (u16::MAX as usize - 1) / size_of::<SlideHash>();

/// The slides that a table was learned from.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct LearnedSlides<'a> {
    /// True if there were no others.
    pub all: bool,
    /// Their hashes, each once, in rising order.
    pub hashes: &'a [SlideHash],
}

impl<'a> LearnedSlides<'a> {
    /// Returns whether this slide is one of them.
    pub fn has(&self, slide: &SlideHash) -> bool {
        self.hashes.binary_search(slide).is_ok()
    }

    fn read(section: &'a [u8]) -> Option<Self> {
        let (&all, rest) = section.split_first()?;
        let (hashes, []) = rest.as_chunks() else {
            return None;
        };
        let all = match all {
            0 => false,
            1 => true,
            _ => return None,
        };
        hashes
            .is_sorted_by(|a, b| a < b)
            .then_some(Self { all, hashes })
    }
}

impl<'a> Table<'a> {
    /// The slides that it notes as those that it was learned from. None, and not all, where there is no such note, and
    /// where a note is damaged: see [`Table::check_learned`].
    pub fn learned_slides(&self) -> LearnedSlides<'a> {
        let noted = self.section(LEARNED).and_then(LearnedSlides::read);
        let noted = noted.unwrap_or_default();
        // what a probe has learned since is not in it
        let since = (0..self.textures()).map(|texture| self.tally(texture));
        let all = noted.all && since.map(|t| (t.user, t.itself)).all(|t| t == (0, 0));
        LearnedSlides { all, ..noted }
    }

    /// That what it says of slides is whole, and there once: [`Table::read`] does not look.
    pub fn check_learned(&self) -> Result<(), TableError> {
        let sections = each(self.sections).flatten();
        let mut noted = sections.filter(|(kind, _)| *kind == LEARNED);
        let whole = match (noted.next(), noted.next()) {
            (None, _) => true,
            (Some((_, section)), None) => LearnedSlides::read(section).is_some(),
            _ => false,
        };
        whole.then_some(()).ok_or(TableError::Section(LEARNED))
    }
}

/// Writes `old` into `out`, with this note of the slides that it was learned from in place of its own, or without any.
/// Without it a table is to the byte what it was before it got one. Hashes are each there once, in rising order.
pub fn with_learned<'o>(
    out: &'o mut [u8],
    old: &Table<'_>,
    learned: Option<LearnedSlides<'_>>,
) -> Result<Table<'o>, EncodeError> {
    // a note makes no other table of it: its ancestor stays as it is
    let lineage = array(old.bytes, old.layout().lineage).map_or(0, u32::from_le_bytes);
    let others = |kind| kind != LEARNED;
    let rows = Row::all(old);
    rewrite(out, old, lineage, rows, others, |writer| match learned {
        Some(LearnedSlides { all, hashes }) => writer.section(LEARNED, |writer| {
            writer.put(&[all.into()]);
            writer.put(hashes.as_flattened());
        }),
        None => Ok(()),
    })
}
