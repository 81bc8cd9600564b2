//! A store of which the last write is torn, and what the firmware may hold on it.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::wire::{Reset, Verdict};

use crate::board::{self, FlashWrite, SECTOR};
use crate::host::exploration::ExploreError;
use crate::host::talk::TalkError;
use crate::host::under_finger::KnownError;

/// Why there are no cuts to judge.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CutError {
    #[error(transparent)]
    Talk(#[from] TalkError),
    #[error(transparent)]
    Explore(#[from] ExploreError),
    #[error(transparent)]
    Known(#[from] KnownError),
    #[error("the firmware did not {0}: nothing to cut")]
    Nothing(&'static str),
    #[error("{0}: the noted writes do not give the flash that the firmware left")]
    Noted(&'static str),
    #[error("{0}: without a cut the firmware does not keep what it held: {1:?}, {2:?}")]
    Kept(&'static str, Box<Held>, Box<Held>),
    #[error("it says that it started by {0:?}")]
    Started(Reset),
    #[error("no table in {0} virtual s")]
    NoTable(f64),
    #[error("neither old nor new: {0:?}")]
    Neither(Box<Held>),
    #[error("it identifies {0:?}")]
    Identifies(Box<Verdict>),
}

impl From<board::Error> for CutError {
    fn from(why: board::Error) -> Self {
        Self::Talk(why.into())
    }
}

/// What the firmware holds, by its own account.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Held {
    /// Checksum and bytes of the table in force, with what the probe has learned by itself.
    pub(crate) table: (u32, u32),
    /// Its textures.
    pub(crate) textures: u16,
    /// It came with the firmware.
    pub(crate) factory: bool,
    /// Constants of the rig.
    pub(crate) calibration: [u8; RigCalibration::BYTES],
    /// Work that the skin has seen, mJ, and that part of it that wears.
    pub(crate) skin_mj: (u32, u32),
}

/// What is left by a cut.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Left {
    /// The state from before.
    Old,
    /// One of several records is stored.
    Between,
    /// The state from after.
    New,
}

/// Which of the states, the oldest first, was found; `None` is neither.
pub(crate) fn judge(states: &[Held], found: &Held) -> Option<Left> {
    let last = states.len().checked_sub(1)?;
    // where nothing changed, it is old and new
    match states.iter().rposition(|state| state == found)? {
        at if at == last => Some(Left::New),
        0 => Some(Left::Old),
        _ => Some(Left::Between),
    }
}

/// Something that the firmware stores.
#[derive(Clone, Debug)]
pub(crate) struct Operation {
    /// What it is.
    pub(crate) name: &'static str,
    /// The store before it.
    pub(crate) before: Vec<u8>,
    /// What the firmware does to it.
    pub(crate) writes: Vec<FlashWrite>,
    /// What may be held after a cut, the oldest first.
    pub(crate) states: Vec<Held>,
}

/// How a write is torn.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Torn {
    /// It had not begun.
    Nothing,
    /// The lower half of the word; the sector's first part is erased.
    Begin,
    /// The upper half; the sector's last part.
    End,
    /// Any bits of the word; any words of the sector, and any bits of others.
    Bits,
}

impl Torn {
    /// All ways.
    pub(crate) const ALL: [Self; 4] = [Self::Nothing, Self::Begin, Self::End, Self::Bits];
}

/// The power is off in this write of an operation.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Cut {
    /// Writes before it.
    pub(crate) at: usize,
    /// What is left of it.
    pub(crate) torn: Torn,
    /// For the bits.
    pub(crate) seed: u64,
}

fn word(store: &mut [u8], at: usize, change: impl FnOnce(u32) -> u32) {
    if let Some(bytes) = store.get_mut(at..).and_then(|rest| rest.first_chunk_mut()) {
        *bytes = change(u32::from_le_bytes(*bytes)).to_le_bytes();
    }
}

fn apply(store: &mut [u8], write: FlashWrite) {
    match write {
        FlashWrite::Program { at, word: new } => word(store, at, |_| new),
        FlashWrite::Erase { sector } => {
            if let Some(sector) = store.chunks_mut(SECTOR).nth(sector) {
                sector.fill(0xFF);
            }
        }
    }
}

fn tear(store: &mut [u8], write: FlashWrite, cut: Cut) {
    let mut random = ChaCha8Rng::seed_from_u64(cut.seed);
    match write {
        FlashWrite::Program { at, word: new } => {
            let kept: u32 = match cut.torn {
                Torn::Nothing => u32::MAX,
                Torn::Begin => 0xFFFF_0000,
                Torn::End => 0x0000_FFFF,
                Torn::Bits => random.random(),
            };
            // programming only clears bits
            word(store, at, |old| old & (new | kept));
        }
        FlashWrite::Erase { sector } => {
            let Some(sector) = store.chunks_mut(SECTOR).nth(sector) else {
                return;
            };
            let part = random.random_range(0..SECTOR / 4) * 4;
            match cut.torn {
                Torn::Nothing => {}
                Torn::Begin => sector[..part].fill(0xFF),
                Torn::End => sector[part..].fill(0xFF),
                Torn::Bits => {
                    for at in (0..SECTOR).step_by(4) {
                        let erased: u32 = match random.random_range(0..3) {
                            0 => 0,
                            1 => u32::MAX,
                            _ => random.random(),
                        };
                        word(sector, at, |old| old | erased);
                    }
                }
            }
        }
    }
}

/// The flash after some writes and a cut.
pub(crate) fn left_by(before: &[u8], writes: &[FlashWrite], cut: Cut) -> Vec<u8> {
    let mut store = before.to_vec();
    for write in writes.iter().take(cut.at) {
        apply(&mut store, *write);
    }
    if let Some(write) = writes.get(cut.at) {
        tear(&mut store, *write, cut);
    }
    store
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(table: u32, skin: u32) -> Held {
        Held {
            table: (table, 100),
            textures: 4,
            factory: false,
            calibration: [1; RigCalibration::BYTES],
            skin_mj: (skin, 0),
        }
    }

    const CUT: Cut = Cut {
        at: 1,
        torn: Torn::Nothing,
        seed: 3,
    };

    #[test]
    fn new_but_half_is_wrong() {
        let states = [held(1, 1), held(1, 2), held(2, 2)];
        assert_eq!(judge(&states, &held(1, 1)), Some(Left::Old));
        assert_eq!(judge(&states, &held(1, 2)), Some(Left::Between));
        assert_eq!(judge(&states, &held(2, 2)), Some(Left::New));
        // what is stored last is there, and what comes before is not
        assert_eq!(judge(&states, &held(2, 1)), None);
        let uncalibrated = Held {
            calibration: [0; RigCalibration::BYTES],
            ..held(2, 2)
        };
        assert_eq!(judge(&states, &uncalibrated), None);
        let factory = Held {
            factory: true,
            ..held(1, 1)
        };
        assert_eq!(judge(&states, &factory), None);
    }

    #[test]
    fn a_torn_word_only_loses_bits_and_a_torn_erase_only_gains_them() {
        let before = vec![0xF0; 4 * SECTOR];
        let writes = [
            FlashWrite::Program {
                at: 4,
                word: 0x1010_1010,
            },
            FlashWrite::Program {
                at: 8,
                word: 0x0000_0000,
            },
            FlashWrite::Erase { sector: 2 },
        ];
        for torn in Torn::ALL {
            let left = left_by(&before, &writes, Cut { torn, ..CUT });
            assert_eq!(left[4..8], [0x10; 4], "whole, before the cut");
            assert_eq!(left[8..12] == [0xF0; 4], torn == Torn::Nothing);
            assert!(left[8..12].iter().all(|byte| byte & !0xF0 == 0));
            assert_eq!(left[12..], before[12..]);
            let left = left_by(&before, &writes, Cut { at: 2, torn, ..CUT });
            assert_eq!(left[8..12], [0; 4]);
            let sector = &left[2 * SECTOR..3 * SECTOR];
            assert!(sector.iter().all(|byte| byte & 0xF0 == 0xF0));
            assert_eq!(sector == [0xF0; SECTOR], torn == Torn::Nothing);
            assert!(sector.contains(&0xF0), "not all of it");
        }
        let whole = left_by(&before, &writes, Cut { at: 3, ..CUT });
        assert_eq!(whole[2 * SECTOR..3 * SECTOR], [0xFF; SECTOR]);
    }
}
