//! The one unit in which the samples of a slide travel: from the servo to its features, on the link, in a recording.

use core::ops::Range;

use heapless::Vec;
use serde::{Deserialize, Serialize};

/// P_AC samples in one block.
pub const BLOCK: usize = 64;

/// The part of a slide to which the samples of a tick belong.
#[derive(Clone, PartialEq, Debug, Default)]
pub enum SamplePhase {
    /// Nothing.
    #[default]
    Nothing,
    /// The background: the finger is pressed and still.
    Still,
    /// The slide begins; these of its P_AC samples will be at constant speed.
    Begin(Range<u32>),
    /// The slide goes on.
    Slide,
}

/// Raw samples of the still finger or of a slide, gap-free: `number` says the order.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Block {
    /// One more than the last block's of the same movement, from 0.
    pub number: u16,
    /// The still finger: the background. Otherwise the slide.
    pub still: bool,
    /// With the first block of a slide: which of its P_AC samples are at constant speed, from and to.
    pub steady: Option<(u32, u32)>,
    /// P_AC, counts about the still finger's baseline.
    pub pac: Vec<i16, BLOCK>,
    /// Shear at constant speed, mN.
    pub shear_mn: Vec<i16, BLOCK>,
    /// Samples that were lost, so that the slide does not count.
    pub lost: u32,
}

impl Block {
    /// The blocks of a movement that is over, from all its samples: P_AC of the still finger, if it was measured, and
    /// of the slide, and shear at constant speed, in mN.
    pub fn cut<'s>(
        still: &'s [i16],
        steady: Range<u32>,
        pac: &'s [i16],
        shear_mn: &'s [i16],
    ) -> impl Iterator<Item = Self> + 's {
        let part = |samples: &[i16], n| {
            let part = samples.chunks(BLOCK).nth(n).unwrap_or_default();
            // a part is no longer than a block
            Vec::from_slice(part).unwrap_or_default()
        };
        let background = still.chunks(BLOCK).map(move |pac| Self {
            still: true,
            pac: part(pac, 0),
            ..Self::default()
        });
        let most = pac.len().max(shear_mn.len()).max(1);
        let slide = (0..most.div_ceil(BLOCK)).map(move |n| Self {
            steady: (n == 0).then_some((steady.start, steady.end)),
            pac: part(pac, n),
            shear_mn: part(shear_mn, n),
            ..Self::default()
        });
        let numbers = (0..=u16::MAX).cycle();
        let blocks = background.chain(slide).zip(numbers);
        blocks.map(|(block, number)| Self { number, ..block })
    }
}

/// The samples of one movement as they come, gathered into blocks.
#[derive(Clone, Debug)]
pub struct Blocks {
    block: Block,
}

impl Default for Blocks {
    fn default() -> Self {
        Self {
            block: Block {
                still: true,
                ..Block::default()
            },
        }
    }
}

impl Blocks {
    fn take(&mut self, still: bool) -> Option<Block> {
        if self.block.pac.is_empty() && self.block.shear_mn.is_empty() {
            self.block.still = still;
            return None;
        }
        let next = Block {
            number: self.block.number.wrapping_add(1),
            still,
            ..Block::default()
        };
        Some(core::mem::replace(&mut self.block, next))
    }

    /// Takes in the samples of a tick: at most [`BLOCK`] samples. Gives the block before it, if it is full
    /// or of another kind.
    pub fn put(
        &mut self,
        phase: &SamplePhase,
        pac: &[i16],
        shear_mn: Option<i16>,
    ) -> Option<Block> {
        let still = match phase {
            SamplePhase::Nothing => return None,
            SamplePhase::Still => true,
            SamplePhase::Begin(_) | SamplePhase::Slide => false,
        };
        let full = self.block.pac.len() + pac.len() > self.block.pac.capacity()
            || self.block.shear_mn.is_full();
        let done = if full || still != self.block.still || matches!(phase, SamplePhase::Begin(_)) {
            self.take(still)
        } else {
            None
        };
        if let SamplePhase::Begin(steady) = phase {
            self.block.steady = Some((steady.start, steady.end));
        }
        // the block has space for the samples: it is empty, or not full
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
mod tests {
    use super::*;
    use std::vec::Vec as List;

    #[test]
    fn blocks_hold_every_sample_in_its_order() {
        let mut blocks = Blocks::default();
        let mut sent = List::new();
        let mut next = 0_i16;
        let mut samples = |n: usize| -> List<i16> {
            let from = next;
            next += n as i16;
            (from..next).collect()
        };
        for _ in 0..70 {
            sent.extend(blocks.put(&SamplePhase::Still, &samples(3), None));
        }
        sent.extend(blocks.put(&SamplePhase::Nothing, &[], None));
        sent.extend(blocks.put(&SamplePhase::Begin(440..900), &samples(2), None));
        for ms in 0..200 {
            sent.extend(blocks.put(&SamplePhase::Slide, &samples(2), Some(ms)));
        }
        sent.extend(blocks.put(&SamplePhase::Slide, &samples(BLOCK), Some(200)));
        sent.push(blocks.end(5));
        assert!(
            sent.iter()
                .enumerate()
                .all(|(n, b)| usize::from(b.number) == n)
        );
        let pac: List<i16> = sent.iter().flat_map(|b| b.pac.iter().copied()).collect();
        assert_eq!(pac, (0..next).collect::<List<_>>());
        let shear: List<i16> = sent
            .iter()
            .flat_map(|b| b.shear_mn.iter().copied())
            .collect();
        assert_eq!(shear, (0..=200).collect::<List<_>>());
        let still: usize = sent.iter().filter(|b| b.still).map(|b| b.pac.len()).sum();
        assert_eq!(still, 210);
        let steady: List<_> = sent.iter().filter_map(|b| b.steady).collect();
        assert_eq!(steady, [(440, 900)]);
        assert!(
            sent.iter()
                .find(|b| !b.still)
                .is_some_and(|b| b.steady.is_some())
        );
        assert_eq!(sent.iter().map(|b| b.lost).sum::<u32>(), 5);
    }
}
