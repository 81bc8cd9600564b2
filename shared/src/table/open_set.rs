//! A table's own figures: how it did on textures that were left out of it, and on slides that it was not learned from.

use super::encode::{EncodeError, Row, rewrite};
use super::format::array;
use super::sections::OPEN_SET;
use super::view::Table;

/// Share of new textures up to which a name may be told as sure: with a table that is sure of a wrong name for more,
/// a texture is "most like" the named one.
pub const MOST_NAMED: f32 = 0.1;
/// Where the share is greater, no more may be possible: a half.
const MOST_POSSIBLE: f32 = 0.5;

/// A share, and where it lies with a probability of 95 %.
#[derive(Clone, Copy, PartialEq, Debug, Default, serde::Serialize)]
pub struct Share {
    /// The share, 0 to 1.
    pub share: f32,
    /// The least that it may be.
    pub low: f32,
    /// The most that it may be.
    pub high: f32,
}

/// The figures of a table at the end of an exploration that may answer "none of these".
#[derive(Clone, Copy, PartialEq, Debug, Default, serde::Serialize)]
pub struct OpenSet {
    /// Known textures that are called new, or that no name is told of as sure.
    pub known_flagged: Share,
    /// New textures that are called new.
    pub new_noticed: Share,
    /// New textures of which a wrong name is told as sure.
    pub new_named: Share,
}

impl OpenSet {
    /// Bytes that the section takes, kind and length included.
    pub const LENGTH: usize = 4 + 3 * 12;

    /// True if the probe may learn by itself: as far as is known at all, a new texture seldom gets a name, which the
    /// probe would learn it under.
    pub fn may_learn(&self) -> bool {
        self.new_named.share <= MOST_NAMED
    }

    /// Returns whether a name may be told as sure: too few new textures get one, or it is not certain that too many do,
    /// and textures are enough to say that most do not. Of twenty, four may be chance; of five, one says nothing.
    pub fn may_name(&self) -> bool {
        let Share { share, low, high } = self.new_named;
        share <= MOST_NAMED || low <= MOST_NAMED && high <= MOST_POSSIBLE
    }

    fn shares(&self) -> [Share; 3] {
        [self.known_flagged, self.new_noticed, self.new_named]
    }

    /// `None` if these are no shares, each within its interval.
    pub(super) fn read(section: &[u8]) -> Option<Self> {
        let (thrice, []) = section.as_chunks::<12>() else {
            return None;
        };
        let share = |of: &[u8; 12]| {
            let number = |at| array(of, at).map_or(f32::NAN, f32::from_le_bytes);
            let [share, low, high] = [0, 4, 8].map(number);
            let is_one = 0.0 <= low && low <= share && share <= high && high <= 1.0;
            is_one.then_some(Share { share, low, high })
        };
        let [flagged, noticed, named] = thrice else {
            return None;
        };
        Some(Self {
            known_flagged: share(flagged)?,
            new_noticed: share(noticed)?,
            new_named: share(named)?,
        })
    }
}

impl Table<'_> {
    /// Its figures; `None` where nobody measured them.
    pub fn open_set(&self) -> Option<OpenSet> {
        OpenSet::read(self.section(OPEN_SET)?)
    }
}

/// Writes `old`, a fused table, into `out` with these figures in place of its own.
pub fn with_open_set<'o>(
    out: &'o mut [u8],
    old: &Table<'_>,
    figures: &OpenSet,
) -> Result<Table<'o>, EncodeError> {
    // a note makes no other table of it: its ancestor stays as it is
    let lineage = array(old.bytes, old.layout().lineage).map_or(0, u32::from_le_bytes);
    let others = |kind| kind != OPEN_SET;
    rewrite(out, old, lineage, Row::all(old), others, |writer| {
        writer.section(OPEN_SET, |writer| {
            let numbers = figures.shares().map(|of| [of.share, of.low, of.high]);
            writer.put_floats(numbers.into_iter().flatten());
        })
    })
}
