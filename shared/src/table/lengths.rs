//! The tables for the first part of a slide: one for each of a few lengths.
//!
//! The beginning of a slide is not like its whole, and short windows scatter more: a slide that is to end early is
//! compared with the first parts of the slides that were learned from. In a table of M movements those of the n-th
//! length of movement m are the movement n M + m of whoever asks for cells, trials, drift or population; the whole
//! slides are length 0.

use super::encode::{EncodeError, Row, Writer, rewrite};
use super::format::{CRC_BYTES, DRIFT, HEAD, HEADER, LENGTH, MAX_MOVEMENTS, MS, TWO, array, each};
use super::limits::Limits;
use super::sections::{NOVELTY, are_drifts, are_limits, of_drift, of_population};
use super::view::Table;

/// Most lengths of a table.
pub const MAX_LENGTHS: usize = 6;
const _: () = assert!((MAX_LENGTHS + 1) * MAX_MOVEMENTS <= u8::MAX as usize);
/// Where the header has the length of the table, and where the number of textures behind it.
const LENGTH_FIELD: usize = 8;
const COUNT: usize = 12;

/// The table of slides of one length, for [`with_lengths`].
#[derive(Clone, Copy, Debug)]
pub struct Shorter<'t> {
    /// Their length in ms at constant speed.
    pub ms: u16,
    /// The same textures at the same movements, learned from the first parts of the same slides.
    pub table: Table<'t>,
    /// The movements whose slides are longer than that, a bit each; nothing is known of the others.
    pub movements: u64,
}

impl Shorter<'_> {
    fn is_longer(&self, movement: usize) -> bool {
        movement < u64::BITS as usize && self.movements >> movement & 1 == 1
    }

    fn write(&self, writer: &mut Writer<'_>) {
        let (table, layout) = (&self.table, self.table.layout());
        writer.put(&self.ms.to_le_bytes());
        writer.put(table.bytes.get(..layout.trials).unwrap_or_default());
        let trials = table.bytes.get(layout.trials..layout.lineage);
        for (&trials, at) in trials.unwrap_or_default().iter().zip(0_usize..) {
            let longer = self.is_longer(at % usize::from(table.movements).max(1));
            writer.put(&[if longer { trials } else { 0 }]);
        }
        for kind in [DRIFT, NOVELTY] {
            writer.put(table.section(kind).unwrap_or_default());
        }
    }
}

/// Writes `old` into `out` with these lengths, the shortest first, in place of those it has.
/// Errors: as [`super::encode`]; [`EncodeError::Contents`] for a table that is not of the same textures and movements,
/// and [`EncodeError::NoSpace`] for one of more bytes than a section can have.
pub fn with_lengths<'o>(
    out: &'o mut [u8],
    old: &Table<'_>,
    shorter: &[Shorter<'_>],
) -> Result<Table<'o>, EncodeError> {
    for s in shorter {
        let same = s.table.textures == old.textures
            && s.table.contents == old.contents
            && s.table.movements().eq(old.movements())
            && s.table.names().eq(old.names());
        if !same {
            return Err(EncodeError::Contents);
        }
    }
    // it is part of making the table, not learned later
    let lineage = array(old.bytes, old.layout().lineage).map_or(0, u32::from_le_bytes);
    let others = |kind| kind != LENGTH;
    rewrite(out, old, lineage, Row::all(old), others, |writer| {
        let mut each = shorter.iter();
        each.try_for_each(|s| writer.section(LENGTH, |writer| s.write(writer)))
    })
}

impl<'a> Table<'a> {
    /// Number of shorter lengths that it knows, and what each is, in ms at constant speed.
    pub fn lengths_ms(&self) -> impl Iterator<Item = u16> + use<'a> {
        self.lengths().map(|length| length.ms)
    }

    /// The number that stands for a movement whose slide has had the `n`th length, from 1; `None` if there is no such
    /// length.
    pub(crate) fn at_length(&self, movement: u8, n: u8) -> Option<u8> {
        let at = n.checked_mul(self.movements)?.checked_add(movement)?;
        let known = n > 0 && movement < self.movements && self.at(at).is_some();
        known.then_some(at)
    }

    /// Returns whether this is a movement's own number, not that of a shorter slide of it.
    pub(crate) fn is_whole(&self, movement: u8) -> bool {
        movement < self.movements
    }

    /// As [`Table::limits`], of slides of the length that a movement stands for.
    pub(crate) fn limits_at(&self, movement: u8) -> Option<Limits> {
        match self.at(movement) {
            Some((table, _)) => table.limits(),
            None => self.limits(),
        }
    }

    /// The number of lengths; `None` where one contradicts its section, or is not longer than the one before.
    pub(super) fn count_lengths(&self) -> Option<usize> {
        let (features, movements) = (self.features(), usize::from(self.movements));
        let drift = self
            .section(DRIFT)
            .map(|_| TWO + movements * of_drift(features));
        let novelty = Limits::BYTES + movements * of_population(features);
        let novelty = self.section(NOVELTY).map(|_| novelty);
        let behind = drift.unwrap_or(0) + novelty.unwrap_or(0);
        let mut longest = 0;
        let mut count = 0;
        for (kind, contents) in each(self.sections).flatten() {
            if kind != LENGTH {
                continue;
            }
            if count == MAX_LENGTHS {
                return None;
            }
            let length = self.length_of(contents)?;
            let same = |from, to| length.table.bytes.get(from..to) == self.bytes.get(from..to);
            let (cut, _) = length
                .rest
                .split_at_checked(drift.unwrap_or(0))
                .unwrap_or_default();
            let fits = same(0, LENGTH_FIELD)
                && same(COUNT, HEADER)
                && same(HEADER, self.layout().whitenings)
                && length.ms > longest
                && length.rest.len() == behind
                && length.table.check_cells().is_ok()
                && (drift.is_none() || are_drifts(cut, features, movements))
                && (novelty.is_none() || are_limits(length.table.novelty, features, movements));
            if !fits {
                return None;
            }
            longest = length.ms;
            count += 1;
        }
        Some(count)
    }

    /// The offsets of the trials of each length among the bytes of the table.
    pub(super) fn trials_of_lengths(&self) -> impl Iterator<Item = usize> + use<'a> {
        let trials = self.layout().trials;
        let sections = self.sections;
        let mut at = self.bytes.len() - CRC_BYTES - self.sections.len();
        each(sections)
            .flatten()
            .filter_map(move |(kind, contents)| {
                let begin = at + HEAD;
                at = begin + contents.len();
                (kind == LENGTH).then_some(begin + MS + trials)
            })
    }
}
