//! The slides that a table was learned from: where the table is tested, none of them counts.

use serde::Serialize;
use tactus_core::table::{EncodeError, LearnedSlides, MAX_LEARNED, SlideHash, Table, with_learned};

use crate::data::quality::{SeenSlides, SlideMarks};
use crate::eval::show::count;

/// Slides that a test of a table left out.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
pub struct LeftOut {
    /// So many, which the table was learned from.
    #[serde(rename = "learned_left_out")]
    pub slides: usize,
    /// True if the table notes all slides that it was learned from, so that no other one is among those tested.
    #[serde(rename = "learned_all_known")]
    pub all_known: bool,
}

impl LeftOut {
    /// Leaves the slides out that the table was learned from, shifted or not.
    pub fn of<T>(table: Table<'_>, slides: &mut Vec<T>, marks: impl Fn(&T) -> SlideMarks) -> Self {
        let learned = table.learned_slides();
        let seen = SeenSlides::noted(learned.hashes);
        let before = slides.len();
        slides.retain(|slide| !seen.has(&marks(slide)));
        Self {
            slides: before - slides.len(),
            all_known: learned.all,
        }
    }

    /// A sentence for people; `None` where nothing was left out, and the table notes all.
    pub fn in_words(&self) -> Option<String> {
        let out = match self.slides {
            0 => None,
            1 => Some("1 slide is left out: the table was learned from it.".to_owned()),
            n => Some(format!(
                "{} are left out: the table was learned from them.",
                count(n as u64, "slide")
            )),
        };
        let unknown = (!self.all_known).then(|| {
            let others = if self.slides == 0 { "" } else { " other" };
            format!("The table does not say which{others} slides it was learned from: some of these may be among them.")
        });
        let said: Vec<String> = out.into_iter().chain(unknown).collect();
        (!said.is_empty()).then(|| said.join(" "))
    }
}

/// The table with these slides among those that it was learned from; `all`: it was learned from no others.
pub fn note_learned(
    bytes: &[u8],
    all: bool,
    slides: &[&SlideMarks],
) -> Result<Vec<u8>, EncodeError> {
    let table = Table::read(bytes).map_err(EncodeError::Invalid)?;
    let there = table.learned_slides().hashes;
    let mut hashes = SlideMarks::noted(slides, MAX_LEARNED.saturating_sub(there.len()));
    hashes.extend(there);
    hashes.sort_unstable();
    hashes.dedup();
    let all = all && hashes.len() <= MAX_LEARNED;
    hashes.truncate(MAX_LEARNED);
    write(
        bytes,
        LearnedSlides {
            all,
            hashes: &hashes,
        },
    )
}

/// The table with this note in place of its own.
pub(super) fn write(bytes: &[u8], learned: LearnedSlides<'_>) -> Result<Vec<u8>, EncodeError> {
    let table = Table::read(bytes).map_err(EncodeError::Invalid)?;
    let hashes: &[SlideHash] = learned.hashes;
    let mut noted = vec![0; bytes.len() + 8 + hashes.as_flattened().len()];
    let length = with_learned(&mut noted, &table, Some(learned))?
        .as_bytes()
        .len();
    noted.truncate(length);
    Ok(noted)
}
