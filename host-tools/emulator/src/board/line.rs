//! A disturbance on the serial line between the board and its host.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// Bytes are damaged or lost, either way, until a time.
#[derive(Debug)]
pub(super) struct LineNoise {
    share: f64,
    until_ns: u64,
    random: ChaCha8Rng,
}

impl LineNoise {
    /// This share of the bytes, 0 to 1, has a wrong bit or is lost.
    pub(super) fn new(share: f64, until_ns: u64, seed: u64) -> Self {
        Self {
            share,
            until_ns,
            random: ChaCha8Rng::seed_from_u64(seed),
        }
    }

    /// The byte after the noise; `None` if it is lost.
    pub(super) fn pass(&mut self, now_ns: u64, byte: u8) -> Option<u8> {
        if now_ns >= self.until_ns || self.random.random::<f64>() >= self.share {
            return Some(byte);
        }
        let bit: Option<u8> = self.random.random::<bool>().then_some(1);
        bit.map(|bit| byte ^ bit << self.random.random_range(0..8))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_the_disturbed_bytes_are_lost_and_the_others_have_a_wrong_bit() {
        let mut noise = LineNoise::new(0.5, 1_000, 1);
        let passed: Vec<Option<u8>> = (0..1_000).map(|now_ns| noise.pass(now_ns, 0x55)).collect();
        let lost = passed.iter().filter(|byte| byte.is_none()).count();
        let wrong = passed.iter().flatten().filter(|byte| **byte != 0x55);
        let wrong: Vec<u32> = wrong.map(|byte| (byte ^ 0x55).count_ones()).collect();
        assert!(wrong.iter().all(|bits| *bits == 1));
        assert!((200..300).contains(&lost) && (200..300).contains(&wrong.len()));
        assert!((1_000..2_000).all(|now_ns| noise.pass(now_ns, 0x55) == Some(0x55)));
    }
}
