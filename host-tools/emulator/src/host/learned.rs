//! The texture under the finger, and the firmware's table: learned once for a world, then kept in a file.

use std::path::{Path, PathBuf};

use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::explorer::Method;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::sensor::FingerName;
use tactus_core::table::Table;
use tactus_lab::sim::collection::{Collection, texture_number};
use tactus_lab::sim::recorded::RecordedTexture;

use super::args::{World, hex_sha256};
use super::progress;
use super::under_finger::{self, FirmwareData, LearnError, TRIALS, Unknown};

/// The source of the textures.
enum Textures {
    Simulated(FingerName, Collection),
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
    pub fn new(cli: &World) -> Result<Self, LearnError> {
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
            Some(name) => {
                texture_number(name).ok_or_else(|| LearnError::NoTexture(name.clone()))?
            }
            None => random.random_range(1..=117),
        };
        let collection = Collection {
            seed: cli.seed,
            textures: Collection::spread(texture, cli.among),
            trials: TRIALS,
        };
        // trials that nothing was learned from
        let trial = 1 + u64::from(random.next_u32() % 1000);
        Ok(Self {
            unknown: under_finger::mounted_with(cli.finger, &collection, texture, trial),
            seed: random.next_u32(),
            textures: Textures::Simulated(cli.finger, collection),
        })
    }

    /// Calibration of the rig and table of the textures for a method, or the table of a file.
    pub fn learn(&self, method: Method, table: Option<&Path>) -> Result<FirmwareData, LearnError> {
        let kept = self.kept_in(method);
        let mut known = match kept.as_deref().and_then(read) {
            Some(known) => known,
            None => {
                let known = self.learn_anew(method)?;
                if let Some(file) = kept {
                    // another time it is learned anew then
                    let _ = write(&file, &known);
                }
                known
            }
        };
        if let Some(path) = table {
            known.table = std::fs::read(path).map_err(|source| LearnError::Table {
                path: path.into(),
                source,
            })?;
        }
        Ok(known)
    }

    fn learn_anew(&self, method: Method) -> Result<FirmwareData, LearnError> {
        let bar;
        let known = match &self.textures {
            Textures::Simulated(finger, collection) => {
                let count = collection.textures.len() as u64;
                bar = progress::bar("learning textures", count, ", {eta} left");
                let done = || bar.inc(1);
                // the image of the other fingers ends no slide early, nor does the paper's method
                match (finger, method) {
                    (FingerName::Biotac, Method::Fused) => {
                        under_finger::simulated_early(collection, method, done)?
                    }
                    _ => under_finger::simulated_with(*finger, collection, method, done)?,
                }
            }
            Textures::Recorded(recorded_texture) => {
                bar = progress::spinner("learning materials");
                under_finger::recorded(recorded_texture, method)?
            }
        };
        bar.finish_and_clear();
        Ok(known)
    }

    /// A file named for all that the table depends on: the world, and this program, which holds core and simulator.
    /// None for recordings: their contents are not in their name.
    fn kept_in(&self, method: Method) -> Option<PathBuf> {
        let Textures::Simulated(finger, collection) = &self.textures else {
            return None;
        };
        let program = std::env::current_exe().ok()?;
        let key = format!(
            "{} {finger} {method:?} {collection:?}",
            hex_sha256(&std::fs::read(&program).ok()?),
        );
        let name = &hex_sha256(key.as_bytes())[..16];
        // target/emulator/release/tactus-emulator
        let folder = program.parent()?.join("learned");
        Some(folder.join(format!("{name}.tact")))
    }
}

fn read(file: &Path) -> Option<FirmwareData> {
    let bytes = std::fs::read(file).ok()?;
    let (calibration, table) = bytes.split_at_checked(RigCalibration::BYTES)?;
    Table::read(table).ok()?;
    Some(FirmwareData {
        calibration: RigCalibration::from_bytes(calibration).ok()?,
        table: table.into(),
    })
}

fn write(file: &Path, known: &FirmwareData) -> std::io::Result<()> {
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder)?;
    }
    // whole or not at all
    let begun = file.with_extension("part");
    let bytes = [&known.calibration.to_bytes()[..], &known.table].concat();
    std::fs::write(&begun, bytes)?;
    std::fs::rename(begun, file)
}
