//! What is under the finger, and what the firmware is told beforehand: learned once for a world, then kept in a file.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context as _;
use indicatif::{ProgressBar, ProgressStyle};
use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use sha2::{Digest as _, Sha256};
use tactus::collection::{Collection, texture_number};
use tactus::played::Lesson;
use tactus_core::explorer::Method;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::table::Table;
use tactus_emulator::lessons::{self, Known, TRIALS, Unknown};

use crate::Cli;

pub(crate) fn hex_sha256(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// A bar on stderr.
pub(crate) fn progress(length: u64, what: &'static str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len}, {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(length)
        .with_style(style)
        .with_message(what);
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// Where the textures come from.
enum World {
    Simulated(Collection),
    Recorded(Lesson),
}

/// What the seed draws.
pub(crate) struct Chosen {
    pub(crate) unknown: Unknown,
    /// For the firmware's own draws.
    pub(crate) seed: u32,
    world: World,
}

impl Chosen {
    pub(crate) fn new(cli: &Cli) -> anyhow::Result<Self> {
        let mut random = ChaCha8Rng::seed_from_u64(cli.seed);
        if let Some(name) = &cli.recording {
            let lesson = lessons::recordings(cli.method.method(), cli.seed)?;
            let texture = lessons::material(&lesson, name)?;
            return Ok(Self {
                unknown: lessons::played(&lesson, texture, cli.seed),
                seed: random.next_u32(),
                world: World::Recorded(lesson),
            });
        }
        let texture = match &cli.texture {
            Some(name) => texture_number(name).with_context(|| {
                format!("no texture {name} in Table 1: `tactus textures` lists them, or give a number from 1 to 117")
            })?,
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
            unknown: lessons::mounted(&collection, texture, trial),
            seed: random.next_u32(),
            world: World::Simulated(collection),
        })
    }

    /// Calibration of the rig and table of the textures.
    pub(crate) fn learn(&self, cli: &Cli) -> anyhow::Result<Known> {
        let method = cli.method.method();
        let kept = self.kept_in(method);
        let mut known = match kept.as_deref().map(read) {
            Some(Some(known)) => known,
            _ => {
                let known = self.learn_anew(method)?;
                if let Some(file) = kept {
                    // another time it is learned anew then
                    let _ = write(&file, &known);
                }
                known
            }
        };
        if let Some(file) = &cli.table {
            known.table =
                std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
        }
        Ok(known)
    }

    fn learn_anew(&self, method: Method) -> anyhow::Result<Known> {
        match &self.world {
            World::Simulated(collection) => {
                let bar = progress(collection.textures.len() as u64, "learning textures");
                let known = lessons::simulated(collection, method, || bar.inc(1))?;
                bar.finish_and_clear();
                Ok(known)
            }
            World::Recorded(lesson) => {
                let bar = ProgressBar::new_spinner().with_message("learning materials");
                bar.enable_steady_tick(Duration::from_millis(200));
                let known = lessons::recorded(lesson, method)?;
                bar.finish_and_clear();
                Ok(known)
            }
        }
    }

    /// A file named for all that the table depends on: the world, and this program, which holds core and simulator. None
    /// for recordings: what they hold is not in their name.
    fn kept_in(&self, method: Method) -> Option<PathBuf> {
        let World::Simulated(collection) = &self.world else {
            return None;
        };
        let program = std::env::current_exe().ok()?;
        let key = format!(
            "{} {method:?} {collection:?}",
            hex_sha256(&std::fs::read(&program).ok()?),
        );
        let name = &hex_sha256(key.as_bytes())[..16];
        // target/emulator/release/tactus-emulator
        let folder = program.parent()?.join("learned");
        Some(folder.join(format!("{name}.tact")))
    }
}

fn read(file: &Path) -> Option<Known> {
    let bytes = std::fs::read(file).ok()?;
    let (calibration, table) = bytes.split_first_chunk::<{ RigCalibration::BYTES }>()?;
    Table::read(table).ok()?;
    Some(Known {
        calibration: RigCalibration::from_bytes(calibration).ok()?,
        table: table.into(),
    })
}

fn write(file: &Path, known: &Known) -> std::io::Result<()> {
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder)?;
    }
    // whole or not at all
    let begun = file.with_extension("part");
    let bytes = [&known.calibration.to_bytes()[..], &known.table].concat();
    std::fs::write(&begun, bytes)?;
    std::fs::rename(begun, file)
}
