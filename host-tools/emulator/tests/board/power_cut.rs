//! The power is cut while the firmware stores something: the flash that is left, of which the last write is torn. The
//! firmware stores once without a cut, and [`Emulator::store_writes`] has every word that it programs and every sector
//! that it erases.
//!
//! [`Emulator::store_writes`]: tactus_emulator::board::Emulator::store_writes

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use tactus_emulator::board::{FlashWrite, places};

/// The torn state of a write.
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
    /// The torn state of that write.
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
            if let Some(sector) = store.get_mut(places(sector)) {
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
            let Some(sector) = store.get_mut(places(sector)) else {
                return;
            };
            let length = sector.len();
            let part = random.random_range(0..length / 4) * 4;
            match cut.torn {
                Torn::Nothing => {}
                Torn::Begin => sector[..part].fill(0xFF),
                Torn::End => sector[part..].fill(0xFF),
                Torn::Bits => {
                    for at in (0..length).step_by(4) {
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

    const CUT: Cut = Cut {
        at: 1,
        torn: Torn::Nothing,
        seed: 3,
    };

    #[test]
    fn a_torn_word_only_loses_bits_and_a_torn_erase_only_gains_them() {
        let before = vec![0xF0; 0x4_0000];
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
            FlashWrite::Erase { sector: 4 },
            FlashWrite::Erase { sector: 5 },
        ];
        for torn in Torn::ALL {
            let left = left_by(&before, &writes, Cut { torn, ..CUT });
            assert_eq!(left[4..8], [0x10; 4], "whole, before the cut");
            assert_eq!(left[8..12] == [0xF0; 4], torn == Torn::Nothing);
            assert!(left[8..12].iter().all(|byte| byte & !0xF0 == 0));
            assert_eq!(left[12..], before[12..]);
            for erased in 2..5 {
                let at = Cut {
                    at: erased,
                    torn,
                    ..CUT
                };
                let left = left_by(&before, &writes, at);
                assert_eq!(left[8..12], [0; 4]);
                let FlashWrite::Erase { sector } = writes[erased] else {
                    panic!("an erase")
                };
                let sector = &left[places(sector)];
                assert!(sector.iter().all(|byte| byte & 0xF0 == 0xF0));
                let is_as_before = sector.iter().all(|byte| *byte == 0xF0);
                assert_eq!(is_as_before, torn == Torn::Nothing);
                assert!(sector.contains(&0xF0), "not all of it");
            }
        }
        let whole = left_by(&before, &writes, Cut { at: 5, ..CUT });
        let (rest, erased) = whole.split_at(places(4).start);
        assert!(erased.iter().all(|byte| *byte == 0xFF));
        assert_eq!(rest[places(1)], before[places(1)]);
        assert!(rest[places(2)].iter().all(|byte| *byte == 0xFF));
    }
}
