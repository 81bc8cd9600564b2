//! What the firmware may hold after a cut, and what it does hold.

use tactus_core::wire::{Reset, Verdict};

use crate::board::{self, FlashWrite};
use crate::host::exploration::ExploreError;
use crate::host::talk::TalkError;
use crate::host::under_finger::LearnError;

/// Why there are no cuts to judge.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CutError {
    #[error(transparent)]
    Talk(#[from] TalkError),
    #[error(transparent)]
    Explore(#[from] ExploreError),
    #[error(transparent)]
    Learn(#[from] LearnError),
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
    pub(crate) calibration: Vec<u8>,
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

#[cfg(test)]
mod tests {
    use super::*;

    fn held(table: u32, skin: u32) -> Held {
        Held {
            table: (table, 100),
            textures: 4,
            factory: false,
            calibration: vec![1],
            skin_mj: (skin, 0),
        }
    }

    #[test]
    fn new_but_half_is_wrong() {
        let states = [held(1, 1), held(1, 2), held(2, 2)];
        assert_eq!(judge(&states, &held(1, 1)), Some(Left::Old));
        assert_eq!(judge(&states, &held(1, 2)), Some(Left::Between));
        assert_eq!(judge(&states, &held(2, 2)), Some(Left::New));
        // what is stored last is there, and what comes before is not
        assert_eq!(judge(&states, &held(2, 1)), None);
        let uncalibrated = Held {
            calibration: vec![0],
            ..held(2, 2)
        };
        assert_eq!(judge(&states, &uncalibrated), None);
        let factory = Held {
            factory: true,
            ..held(1, 1)
        };
        assert_eq!(judge(&states, &factory), None);
    }
}
