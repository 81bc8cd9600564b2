//! Bits that a flash has lost: a checksum that no longer fits says which ones they were.

/// A checksum, least significant bit first, as its polynomial in that order and its highest bit.
#[derive(Clone, Copy)]
pub(super) struct Checksum {
    pub(super) polynomial: u32,
    pub(super) highest: u32,
}

impl Checksum {
    /// The change of the checksum by the bit before the one that changes it by `by`.
    fn before(self, by: u32) -> u32 {
        by >> 1 ^ if by & 1 == 1 { self.polynomial } else { 0 }
    }

    /// Flips the fewest bits, at most `most` of them, that make `word` whole: its bytes, and their checksum behind
    /// them. `syndrome` is the checksum as computed, exclusive-or the one that is there. Whether there are such bits;
    /// the answer is right if fewer bits are wrong than the code's distance less `most`.
    pub(super) fn correct(self, word: &mut [u8], syndrome: u32, most: u8) -> bool {
        (1..=most).any(|bits| self.find(word, 8 * word.len(), self.highest, syndrome, bits))
    }

    /// Flips `wrong` of the first `bits` of the word, the last of which changes the checksum by `by`.
    fn find(self, word: &mut [u8], bits: usize, mut by: u32, syndrome: u32, wrong: u8) -> bool {
        for bit in (0..bits).rev() {
            let rest = syndrome ^ by;
            by = self.before(by);
            if rest == 0 || (wrong > 1 && self.find(word, bit, by, rest, wrong - 1)) {
                if let Some(byte) = word.get_mut(bit / 8) {
                    *byte ^= 1 << (bit % 8);
                }
                return true;
            }
        }
        false
    }

    /// The remainder of `bytes` after `first`.
    pub(super) fn remainder(self, bytes: &[u8], first: u32) -> u32 {
        bytes.iter().fold(first, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |crc, _| self.before(crc))
        })
    }
}
