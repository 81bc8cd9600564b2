//! The texture table: what every known texture feels like at every movement, in fixed point.
//!
//! A [`Table`] borrows the binary form, from flash or a file, and copies nothing. There are two kinds of contents, for
//! the two ways of deciding: one Gaussian per (texture, movement, property), learned as [`Experience`] and written by
//! [`encode`]; or the mean of all features of a slide in whitened space, learned as [`Whitened`] and written by
//! [`encode_fused`]. [`amend`] learns, renames and deletes textures of either kind.
//!
//! # Binary form, version 1, little-endian
//!
//! | bytes | what |
//! |---|---|
//! | 4 | magic `TACT` |
//! | 2 | version, 1 |
//! | 1 | contents, 0: Gaussians, 1: fused |
//! | 1 | Gaussians: a bit a property, 1 traction, 2 roughness, 4 fineness; fused: place in `FeatureSet::ALL` |
//! | 4 | length of the whole table in bytes |
//! | 2 | number of textures T, [`MAX_TEXTURES`] at most |
//! | 1 | number of movements M |
//! | 1 | Gaussians: 0; fused: number of features d |
//! | 6 M | per movement: force in mN (2), speed in um/s (4) |
//! | M (3 d + 2 d d) | fused, per movement its [`Whitening`]: d means (i16, 1/1024), places of rows (u8), rows (i16) |
//! | 12 T M | Gaussians: per texture, movement, property: mean (i16, [`mean_step`]), deviation (u16, [`SD_STEP`]) |
//! | 2 d T M | fused: per texture and movement: mean of the d whitened features (i16, 1/256) |
//! | T M | per texture and movement: number of trials, 255 for more |
//! | 4 | CRC-32 of the table that this one was made from by learning, the first of all; 0 for none |
//! | 5 T | per texture: its lasting number (2); slides from the factory, the user and itself (1 each, 255 for more) |
//! | | per texture: length of its name (1), the name in UTF-8: see [`valid_name`] |
//! | | sections, each its kind (2), the length of its contents (2), and these; an unknown kind is skipped |
//! | 4 | CRC-32 (ISO-HDLC) of all before |
//!
//! The deviation is 0, as the mean, where a property was not measured.
//!
//! Sections of a fused table; numbers are f32. A tail is where the upper tenth of the scores begins, and its excess:
//!
//! | kind | bytes | what |
//! |---|---|---|
//! | 1 | 8 | the drift that is expected: [`Drift::bands`], [`Drift::traction`] |
//! | | 4 M d/2, rounded up | per movement: variance of the drift along each two of the whitened axes |
//! | 2 | 52 | [`Limits`]: false alarms; tails of scores after 1, 2, 3 slides, with drift, then without |
//! | | M (7 d + 2 d d) | per movement the [`Population`]: axes, a whitening of whitened features; d variances |
//! | 4 | M (6 + 2 d) | per movement its [`Pace`]: mean (i16, 1/1024), variance, slope of all textures (d i16, 1/256) |
//! | | 2 d T M | per texture and movement: its [`Slope`] |
//!
//! Section 3, of either kind of table, is for people: whether samples were moved between trials ([`Table::moved`]). Per
//! texture of which that is known: its number (2), the lower half of the CRC-32 of its name (2), and 1 for no or 2 for
//! yes (1).
//!
//! Section 5, of either kind of table: the finger that it was learned with (1: 0 `biotac`, 1 `analog`, 2 `mems`), and
//! the day on which that finger's force per count was measured (4, as 20261121). Without it a table is a BioTac's. A
//! probe of another finger refuses it.
//!
//! Section 6, of either kind of table, is what the first part of a slide says: one section for each length, the
//! shortest first ([`with_lengths`]). A table has slopes or lengths, never both. A texture that is learned or deleted
//! takes all lengths with it.
//!
//! | bytes | what |
//! |---|---|
//! | 2 | the length in ms at constant speed |
//! | | a table of slides of this length, header to trials; 0 trials where slides are not longer |
//! | | the contents of section 1 and of section 2, where the table has these |
//!
//! Section 7, of a fused table, is what it did on textures that were left out of it, and on slides that it was not
//! learned from (`OpenSet`): three shares, of known textures flagged, new ones noticed, and new ones told with a wrong
//! name; of each the share, and the ends of the interval in which it lies with a probability of 95 % (f32). Where the
//! last is above 0.1, no name is told as sure unless the user says that nothing new can come. Without the section a
//! table tells names as sure.
//!
//! Section 8, of either kind of table, is for a computer that tests the table with recordings, and leaves out the
//! slides that it was learned from: 1 if these are all, 0 if there are others (1); then of each the first bytes of the
//! SHA-256 of its P_AC, as little-endian numbers of 16 bits (6), in rising order. Hosts take the section out before
//! they send a table to a probe; without it, a table is the same to the byte as before it got one.

mod drift;
mod encode;
pub mod factory;
mod finger;
mod format;
mod gaussian;
mod learned;
mod lengths;
mod limits;
mod matrix;
mod name;
mod open_set;
mod patch;
mod population;
mod samples;
mod scatter;
mod sections;
mod slopes;
mod training_stats;
mod view;
mod whitening;

pub use drift::{Drift, Drifts, PAIRS};
pub use encode::{
    Change, EncodeError, TextureStats, amend, encode, encode_fused, encoded_len, with_sections,
};
pub use finger::{FINGER_LENGTH, with_finger};
pub(crate) use format::HEADER;
pub use format::{
    Action, Contents, MAX_ACTIONS, MAX_MOVEMENTS, MAX_TEXTURES, TableError, Tally, VERSION,
};
pub use gaussian::{Gaussian, Gaussians, SD_LEAST, SD_STEP, mean_step};
pub use learned::{LearnedSlides, MAX_LEARNED, SlideHash, with_learned};
pub use lengths::{MAX_LENGTHS, Shorter, with_lengths};
pub(crate) use limits::Numbers;
pub use limits::{Against, EPISODES, FALSE_ALARM, Limits, Tail, is_false_alarm};
pub use name::{MAX_NAME, Name, NameError, is_printable, valid_name};
pub use open_set::{MOST_NAMED, OpenSet, Share, with_open_set};
pub use patch::{recentre, retell};
pub use population::{POPULATION, Population};
pub use samples::with_moved;
pub(crate) use scatter::oas;
pub use scatter::{Scatter, WhitenError, whiten_drifting};
pub use sections::Sections;
pub use slopes::{Pace, Slopes};
pub(crate) use slopes::{SlopesView, moved};
pub use training_stats::{Experience, TrainingStats, Whitened};
pub use view::Table;
pub use whitening::{Slope, Whitening, white};

#[cfg(test)]
pub(crate) mod tests;
