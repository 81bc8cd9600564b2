//! The texture under the finger, and the data for the firmware.

use std::path::PathBuf;

use anyhow::{Context as _, bail};
use tactus_core::explorer::Method;
use tactus_core::rig::calibration::RigCalibration;
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::sim::collection::{Collection, calibrated, texture_name, texture_number};
use tactus_lab::sim::recorded::RecordedTexture;
use tactus_world::played::Played;
use tactus_world::world::Setup;

use crate::board::{Emulator, Error, Options};

/// Trials of each texture and movement (PAPER: five).
pub const TRIALS: u32 = 5;
/// Limits of recordings.
pub(crate) const RECORDED_LIMITS: &str = "Recordings: one movement, 3 of their 5 s are played, and what 12 bits do not \
     hold is clipped; learned and explored slides are of one session (interleaved).";

/// The firmware's calibration and table.
#[derive(Clone, PartialEq, Debug)]
pub struct FirmwareData {
    /// Constants of the rig.
    pub calibration: RigCalibration,
    /// The texture table.
    pub table: Vec<u8>,
}

/// The texture under the finger.
#[derive(Clone, Debug)]
pub struct Unknown {
    /// Its name in the table.
    pub name: String,
    /// The rig.
    pub setup: Setup,
    /// Recorded slides that the finger feels instead of the simulated sample, in an order that the seed gives.
    pub recorded: Option<(Vec<Played>, u64)>,
}

impl Unknown {
    /// Powers up a board with it under the finger.
    pub fn start(&self, elf: &std::path::Path, options: Options) -> Result<Emulator, Error> {
        let emulator = Emulator::start(elf, self.setup, options)?;
        if let Some((slides, seed)) = &self.recorded {
            emulator.rig().world().play(slides.clone(), *seed);
        }
        Ok(emulator)
    }
}

/// Number of a texture of Table 1 by its name or its number.
pub(crate) fn number(name: &str) -> anyhow::Result<u8> {
    texture_number(name).with_context(|| {
        format!("no texture {name} in Table 1: `tactus textures` lists them, or give a number from 1 to 117")
    })
}

/// Learns the textures of a simulated world for a method, with statistics of slides after these lengths, ms; `done` is
/// called after each.
pub fn simulated(
    collection: &Collection,
    method: Method,
    lengths_ms: &[u16],
    done: impl Fn() + Sync,
) -> anyhow::Result<FirmwareData> {
    let first = collection.textures.first().copied().unwrap_or(1);
    let calibration = calibrated(collection.setup(first, 0))?;
    let (movements, how) = (&Collection::MOVEMENTS, (method, None));
    let table = collection.learn_at(movements, how, lengths_ms, calibration, done)?;
    Ok(FirmwareData { calibration, table })
}

/// A texture of a simulated world in a trial that nothing was learned from: those from 1 on.
pub fn mounted(collection: &Collection, texture: u8, trial: u64) -> Unknown {
    Unknown {
        name: texture_name(texture).to_owned(),
        setup: collection.setup(texture, trial),
        recorded: None,
    }
}

/// Number of recorded slides of each material that the table is learned from; the unknown texture plays the others. The
/// paper's method takes the standard deviation of a few trials for the truth: with five it is wrong too often.
fn recorded_trials(method: Method) -> usize {
    match method {
        Method::Paper => 15,
        Method::Student | Method::StudentAll | Method::Fused => TRIALS as usize,
    }
}

/// The recordings of a real finger, to be learned from and played: in `biotac` below `TACTUS_DATA`, or else below
/// `shared/data` beside the repository.
pub fn recordings(method: Method, seed: u64) -> anyhow::Result<RecordedTexture> {
    let root = std::env::var_os("TACTUS_DATA").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data")),
        PathBuf::from,
    );
    let folder = root.join("biotac");
    if !folder.is_dir() {
        bail!(
            "no recordings in {}: make them from github.com/dexrob/BioTac_slide_20_50 in the layout of data/biotac, \
             and set TACTUS_DATA to the folder that holds biotac/",
            folder.display()
        );
    }
    let set = RecordingSet::open(&folder)?;
    Ok(RecordedTexture::interleaved(
        &set,
        recorded_trials(method),
        seed,
    )?)
}

/// Learns the recorded textures for a method.
pub fn recorded(
    recorded_texture: &RecordedTexture,
    method: Method,
) -> anyhow::Result<FirmwareData> {
    let calibration = calibrated(RecordedTexture::setup(0))?;
    let table = recorded_texture.learn(method, calibration)?;
    Ok(FirmwareData { calibration, table })
}

/// Number of a material by its name, in any case, or by its number from 1.
pub fn material(recorded_texture: &RecordedTexture, name: &str) -> anyhow::Result<usize> {
    let number = name.parse().ok().map(|n: usize| n.wrapping_sub(1));
    let mut names = recorded_texture.names.iter();
    names
        .position(|known| known.eq_ignore_ascii_case(name))
        .or(number.filter(|n| *n < recorded_texture.names.len()))
        .with_context(|| {
            let known = recorded_texture.names.join(", ");
            format!("no material {name}; there are {known}, or give a number from 1")
        })
}

/// A recorded texture: its slides that nothing was learned from.
pub fn played(recorded_texture: &RecordedTexture, texture: usize, seed: u64) -> Unknown {
    Unknown {
        name: recorded_texture
            .names
            .get(texture)
            .cloned()
            .unwrap_or_default(),
        // other trials of the rig than those that were learned, whose seeds are the textures'
        setup: RecordedTexture::setup(1000 * (seed + 1) + texture as u64),
        recorded: Some((
            recorded_texture
                .test
                .get(texture)
                .cloned()
                .unwrap_or_default(),
            seed,
        )),
    }
}
