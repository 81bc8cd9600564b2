//! The texture under the finger, and the firmware's table.

use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::explorer::Method;
use tactus_core::sensor::FingerName;
use tactus_lab::sim::collection::Collection;
use tactus_lab::sim::recorded::RecordedTexture;

use super::args::World;
use super::progress;
use super::under_finger::{self, FirmwareData, TRIALS, Unknown};

enum Textures {
    Simulated(Collection),
    Recorded(RecordedTexture),
}

/// The draws of the seed.
pub struct Chosen {
    /// The texture under the finger.
    pub unknown: Unknown,
    /// For the firmware's own draws.
    pub seed: u32,
    textures: Textures,
}

impl Chosen {
    /// Draws the values that the arguments leave open.
    pub fn new(cli: &World) -> anyhow::Result<Self> {
        let mut random = ChaCha8Rng::seed_from_u64(cli.seed);
        if let Some(name) = &cli.recording {
            let recorded_texture = under_finger::recordings(cli.method.method(), cli.seed)?;
            let texture = under_finger::material(&recorded_texture, name)?;
            return Ok(Self {
                unknown: under_finger::played(&recorded_texture, texture, cli.seed),
                seed: random.next_u32(),
                textures: Textures::Recorded(recorded_texture),
            });
        }
        let texture = match &cli.texture {
            Some(name) => under_finger::number(name)?,
            None => random.random_range(1..=117),
        };
        let textures = Collection::spread(texture, cli.among);
        let collection = Collection::new(cli.seed, textures, TRIALS).touched_by(cli.finger);
        // trials that nothing was learned from
        let trial = 1 + u64::from(random.next_u32() % 1000);
        Ok(Self {
            unknown: under_finger::mounted(&collection, texture, trial),
            seed: random.next_u32(),
            textures: Textures::Simulated(collection),
        })
    }

    /// Calibration of the rig and table of the textures for a method.
    pub fn learn(&self, method: Method) -> anyhow::Result<FirmwareData> {
        let bar;
        let known = match &self.textures {
            Textures::Simulated(collection) => {
                let count = collection.textures.len() as u64;
                bar = progress::bar("learning textures", count, ", {eta} left");
                let done = || bar.inc(1);
                // the image of the other fingers ends no slide early, nor does the paper's method
                let lengths_ms = match (collection.finger, method) {
                    (FingerName::Biotac, Method::Fused) => &Collection::LENGTHS_MS[..],
                    _ => &[],
                };
                under_finger::simulated(collection, method, lengths_ms, done)?
            }
            Textures::Recorded(recorded_texture) => {
                bar = progress::spinner("learning materials");
                under_finger::recorded(recorded_texture, method)?
            }
        };
        bar.finish_and_clear();
        Ok(known)
    }
}
