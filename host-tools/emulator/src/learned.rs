//! What is under the finger, and what the firmware is told beforehand: learned once for a world, then kept in a file.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context as _, bail};
use indicatif::{ProgressBar, ProgressStyle};
use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use sha2::{Digest as _, Sha256};
use tactus::collection::{Collection, calibrated, texture_number};
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::table::Table;
use tactus_emulator::Setup;

use crate::Cli;

/// Trials of each texture and movement (PAPER: five).
const TRIALS: u32 = 5;

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

/// What the seed draws.
pub(crate) struct Chosen {
    /// Number of the texture under the finger.
    pub(crate) texture: u8,
    pub(crate) setup: Setup,
    /// For the firmware's own draws.
    pub(crate) seed: u32,
    collection: Collection,
}

impl Chosen {
    pub(crate) fn new(cli: &Cli) -> anyhow::Result<Self> {
        let mut random = ChaCha8Rng::seed_from_u64(cli.seed);
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
            texture,
            setup: collection.setup(texture, trial),
            seed: random.next_u32(),
            collection,
        })
    }

    /// Calibration of the rig and table of the textures.
    pub(crate) fn learn(&self, cli: &Cli) -> anyhow::Result<(RigCalibration, Vec<u8>)> {
        let kept = self.kept_in();
        let both = match kept.as_deref().map(read) {
            Some(Some(both)) => both,
            _ => {
                let both = self.learn_anew()?;
                if let Some(file) = kept {
                    // another time it is learned anew then
                    let _ = write(&file, &both);
                }
                both
            }
        };
        let (calibration, mut table) = both;
        if let Some(file) = &cli.table {
            table =
                std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
        }
        let read = Table::read(&table).context("the table is damaged: learn it anew")?;
        if usize::from(read.textures()) > tactus_core::wire::MAX_TEXTURES {
            bail!(
                "the table has {} textures, the firmware holds 128",
                read.textures()
            );
        }
        Ok((calibration, table))
    }

    fn learn_anew(&self) -> anyhow::Result<(RigCalibration, Vec<u8>)> {
        let bar = progress(self.collection.textures.len() as u64, "learning textures");
        let calibration = calibrated(self.collection.setup(self.texture, 0))?;
        let table = self.collection.learn(calibration, || bar.inc(1))?;
        bar.finish_and_clear();
        Ok((calibration, table))
    }

    /// A file named for all that the table depends on: the world, and this program, which holds core and simulator.
    fn kept_in(&self) -> Option<PathBuf> {
        let program = std::env::current_exe().ok()?;
        let key = format!(
            "{} {:?}",
            hex_sha256(&std::fs::read(&program).ok()?),
            self.collection
        );
        let name = &hex_sha256(key.as_bytes())[..16];
        // target/emulator/release/tactus-emulator
        let folder = program.parent()?.join("learned");
        Some(folder.join(format!("{name}.tact")))
    }
}

fn read(file: &Path) -> Option<(RigCalibration, Vec<u8>)> {
    let bytes = std::fs::read(file).ok()?;
    let (calibration, table) = bytes.split_first_chunk::<{ RigCalibration::BYTES }>()?;
    Table::read(table).ok()?;
    Some((RigCalibration::from_bytes(calibration).ok()?, table.into()))
}

fn write(file: &Path, (calibration, table): &(RigCalibration, Vec<u8>)) -> std::io::Result<()> {
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder)?;
    }
    // whole or not at all
    let begun = file.with_extension("part");
    std::fs::write(&begun, [&calibration.to_bytes()[..], table].concat())?;
    std::fs::rename(begun, file)
}
