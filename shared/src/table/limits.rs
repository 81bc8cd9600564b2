//! From which score on a texture is new, or no longer as it was learned: the tail of the scores that a table's own
//! slides have, kept so that the share of false alarms can be chosen later.

use crate::features::MAX_FEATURES;

/// Episodes of one slide, of two, and of three or more have limits of their own.
pub const EPISODES: usize = 3;
/// Largest variance along an axis: the product of seven is finite.
pub(super) const MOST_VARIANCE: f32 = 262_144.0;
/// Share of scores above the beginning of the tail.
const TAIL: f32 = 0.1;
/// False alarms that come for each that the tail promises: drawn slides are more alike than those of another day. Twice
/// as many came on slides kept aside, of one rig, whatever the promise.
const REAL: f32 = 2.0;
/// Share of false alarms that people are content with, unless they say otherwise.
pub const FALSE_ALARM: f32 = 0.02;

/// Returns whether this share is allowed: a limit for less would be a guess, and for more none is needed.
pub fn is_false_alarm(share: f32) -> bool {
    (0.0005..=0.2).contains(&share)
}

/// The upper tail of the scores of known textures, which falls exponentially.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Tail {
    /// The begin of the tail.
    pub begin: f32,
    /// Mean excess over that.
    pub excess: f32,
}

/// The limit for a score: with an expected drift, or without.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Against {
    /// Over this limit, a texture is new.
    Drifted,
    /// Over this one, it has changed, if it is not new.
    Same,
}

/// The limits of a table.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Limits {
    /// Share of false alarms that the table is for, unless somebody says otherwise.
    pub false_alarm: f32,
    /// See [`Against::Drifted`]; after one slide, two, three or more.
    pub drifted: [Tail; EPISODES],
    /// See [`Against::Same`].
    pub same: [Tail; EPISODES],
}

impl Limits {
    pub(super) const BYTES: usize = 4 + 2 * EPISODES * 8;

    /// The limit after so many slides, for this share of real false alarms, or the table's own.
    pub fn limit(&self, against: Against, slides: u8, false_alarm: Option<f32>) -> f32 {
        let false_alarm = false_alarm.unwrap_or(self.false_alarm);
        let tails = match against {
            Against::Drifted => &self.drifted,
            Against::Same => &self.same,
        };
        let farther = libm::logf(TAIL * REAL / false_alarm);
        let tails = tails.iter().take(usize::from(slides.max(1)));
        tails.fold(f32::INFINITY, |least, tail| {
            least.min(tail.begin + tail.excess * farther)
        })
    }

    fn tails(&self) -> impl Iterator<Item = Tail> {
        self.drifted.into_iter().chain(self.same)
    }

    pub(super) fn numbers(&self) -> impl Iterator<Item = f32> {
        let tails = self.tails().flat_map(|tail| [tail.begin, tail.excess]);
        core::iter::once(self.false_alarm).chain(tails)
    }

    /// Returns whether these are possible limits: finite, as scores are, for an allowed share.
    pub(super) fn are_possible(&self) -> bool {
        // scores are below 1e4: logarithms of likelihoods of a few slides
        let fits = |t: Tail| t.begin.abs() < 1e4 && t.excess > 0.0 && t.excess < 1e4;
        is_false_alarm(self.false_alarm) && self.tails().all(fits)
    }

    /// `None` if these are not so many bytes as limits have.
    pub(super) fn read(bytes: &[u8]) -> Option<Self> {
        let (share, bytes) = bytes.split_first_chunk()?;
        let (pairs, rest) = bytes.as_chunks::<8>();
        let mut limits = Self {
            false_alarm: f32::from_le_bytes(*share),
            ..Self::default()
        };
        if pairs.len() != 2 * EPISODES || !rest.is_empty() {
            return None;
        }
        let tails = limits.drifted.iter_mut().chain(&mut limits.same);
        for (tail, pair) in tails.zip(pairs) {
            let mut numbers = Numbers::new(pair);
            *tail = Tail {
                begin: numbers.next()?,
                excess: numbers.next()?,
            };
        }
        Some(limits)
    }
}

/// Numbers of 32 bits where a table has them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Numbers<'b>(&'b [[u8; 4]]);

impl<'b> Numbers<'b> {
    pub(super) fn new(bytes: &'b [u8]) -> Self {
        Self(bytes.as_chunks().0)
    }

    /// Returns whether all are variances of which sums of [`MAX_FEATURES`], and products of seven, stay finite.
    pub(super) fn are_variances(self, least: f32) -> bool {
        self.0.len() <= MAX_FEATURES
            && self
                .into_iter()
                .all(|v| (least..=MOST_VARIANCE).contains(&v))
    }
}

impl Iterator for Numbers<'_> {
    type Item = f32;

    #[inline]
    fn next(&mut self) -> Option<f32> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(f32::from_le_bytes(*first))
    }
}
