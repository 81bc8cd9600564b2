//! What explorations and trainings have in common.

use heapless::Vec;

use crate::fused::Vector;
use crate::rig::pins::Felt;
use crate::table::MAX_MOVEMENTS;
use crate::wire::Block;

pub use crate::probe::explore::Random;
pub use crate::probe::{identify, train};

pub use crate::wire::text;

/// What an exploration can teach, until the next one begins.
#[derive(Clone, Debug)]
pub struct Visited {
    /// Checksum of the table that was explored with.
    pub table: u32,
    /// The most probable texture.
    pub texture: u16,
    /// Whether the probe may learn from it by itself.
    pub certain: bool,
    /// The movements made, with the number of slides and their whitened mean; none with a table of Gaussians.
    pub felt: Vec<(u8, u8, Vector), MAX_MOVEMENTS>,
}

/// The raw samples of one movement on their way to the host, in blocks.
#[derive(Clone, Debug)]
pub struct Blocks {
    block: Block,
}

impl Default for Blocks {
    fn default() -> Self {
        Self {
            block: Self::empty(0, true),
        }
    }
}

impl Blocks {
    const fn empty(number: u16, still: bool) -> Block {
        Block {
            number,
            still,
            steady: None,
            pac: Vec::new(),
            shear_mn: Vec::new(),
            lost: 0,
        }
    }

    /// The block so far, and an empty one in its place.
    fn take(&mut self, still: bool) -> Option<Block> {
        if self.block.pac.is_empty() && self.block.shear_mn.is_empty() {
            self.block.still = still;
            return None;
        }
        let next = Self::empty(self.block.number.wrapping_add(1), still);
        Some(core::mem::replace(&mut self.block, next))
    }

    /// Takes in what a tick felt: at most [`crate::rig::pins::MAX_WORDS`] samples. Gives the block before it, if it is full
    /// or of another kind.
    pub fn put(&mut self, felt: &Felt, pac: &[i16], shear_mn: Option<i16>) -> Option<Block> {
        let still = match felt {
            Felt::Nothing => return None,
            Felt::Still => true,
            Felt::Begin(_) | Felt::Slide => false,
        };
        let full = self.block.pac.len() + pac.len() > self.block.pac.capacity()
            || self.block.shear_mn.is_full();
        let done = if full || still != self.block.still || matches!(felt, Felt::Begin(_)) {
            self.take(still)
        } else {
            None
        };
        if let Felt::Begin(steady) = felt {
            self.block.steady = Some((steady.start, steady.end));
        }
        // there is room for it: the block is empty, or not full
        let _ = self.block.pac.extend_from_slice(pac);
        if let Some(shear_mn) = shear_mn {
            let _ = self.block.shear_mn.push(shear_mn);
        }
        done
    }

    /// The last block; so many samples of the movement were lost.
    pub fn end(mut self, lost: u32) -> Block {
        self.block.lost = lost;
        self.block
    }
}

#[cfg(test)]
mod tests;
