//! Recorded slides: the model in memory, and the folders it is read from.
//!
//! A folder holds either
//! - `manifest.csv`: the project's own format, see [`own`];
//! - `manifest.json`: the layout of `data/biotac`, see [`biotac`].
//!
//! Opening a folder reads its manifest only; the samples of one texture are read when they are asked for, and every
//! file is checked against the SHA-256 that the manifest gives.
pub mod biotac;
pub mod files;
pub mod npy;
pub mod own;
mod writer;

use std::collections::{BTreeSet, HashSet};
use std::fmt;
use std::path::{Path, PathBuf};

use tactus_core::features::Movement;
use tactus_core::sensor::{FingerCode, FingerName};
use tactus_core::table::{Table, valid_name};

use crate::data::recording::{Labels, Recording, SlideKey, Texture};
pub use files::{RecordingError, Result, read_bounded};
pub use writer::{RecordingWriter, files as files_of};

/// The beginning of names that are kept for this project's fingers.
const OURS: &str = "tactus-";

/// The sensor of recordings or of a table.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Sensor {
    /// The finger.
    pub finger: FingerCode,
    /// Its name, where that is [`FingerCode::OTHER`].
    pub name: String,
    /// Day of its calibration where it is the same of all, else 0.
    pub calibrated: u32,
}

impl Sensor {
    fn of(labels: &Labels) -> Self {
        Self {
            finger: labels.finger,
            name: labels.sensor.clone(),
            calibrated: labels.calibrated,
        }
    }

    /// The finger of this name, and the name where it is the sensor of somebody else; an empty one is a BioTac.
    /// Errors: it is no name, or one that is kept for this project's fingers.
    pub fn named(name: &str) -> std::result::Result<(FingerCode, String), String> {
        if name.is_empty() {
            return Ok((FingerCode::BIOTAC, String::new()));
        }
        match name.parse() {
            Ok(FingerCode::OTHER) | Err(_) => {}
            Ok(finger) => return Ok((finger, String::new())),
        }
        let begins = name.get(..OURS.len());
        if begins.is_some_and(|begin| begin.eq_ignore_ascii_case(OURS)) {
            let ours = FingerName::ALL.map(FingerName::as_str).join(", ");
            return Err(format!(
                "{name:?} is no finger of this project, whose names begin with {OURS}: give one of {ours}, or another \
                 name"
            ));
        }
        valid_name(name).map_err(|why| format!("{name:?} {why}"))?;
        Ok((FingerCode::OTHER, name.to_owned()))
    }

    /// That slides of this sensor can be compared with a table.
    /// Errors: the table was learned with another.
    pub fn suits(&self, table: &Table<'_>) -> Result<()> {
        let of_table = Self {
            finger: table.finger(),
            name: table.sensor().to_owned(),
            calibrated: table.calibrated(),
        };
        if (of_table.finger, &of_table.name) == (self.finger, &self.name) {
            return Ok(());
        }
        Err(RecordingError::said(format!(
            "the table was learned with the sensor {of_table}, and the slides are of {self}: they cannot be compared; \
             learn a table from slides of {self}"
        )))
    }
}

impl fmt::Display for Sensor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.finger {
            FingerCode::OTHER => f.write_str(&self.name),
            finger => finger.fmt(f),
        }
    }
}
/// Longest note that a writer leaves in a folder that is not whole, bytes.
const MAX_NOTE: u64 = 1 << 16;

/// The recordings of one folder.
#[derive(Debug)]
pub struct RecordingSet {
    folder: PathBuf,
    textures: Vec<Texture>,
    /// per texture, in the order of numbers
    slides: Vec<Vec<SlideKey>>,
    source: Source,
}

/// Textures, each with its slides in the order of time.
pub type Held = Vec<(Texture, Vec<(Recording, Labels)>)>;

#[derive(Debug)]
enum Source {
    Own(own::Manifest),
    Biotac(biotac::Manifest),
    Memory(Vec<Vec<Recording>>),
}

impl RecordingSet {
    /// Recordings in memory; `name` stands for their folder.
    pub fn in_memory(name: &Path, all: Held) -> Self {
        let (mut textures, mut keys, mut recordings) = (Vec::new(), Vec::new(), Vec::new());
        for (texture, slides) in all {
            let key = |(slide, labels): &(Recording, Labels)| SlideKey {
                number: slide.number,
                movement: slide.movement,
                labels: labels.clone(),
            };
            textures.push(texture);
            keys.push(slides.iter().map(key).collect());
            recordings.push(slides.into_iter().map(|(slide, _)| slide).collect());
        }
        Self {
            folder: name.to_owned(),
            textures,
            slides: keys,
            source: Source::Memory(recordings),
        }
    }

    /// All that recordings in memory hold; `None` where they lie in a folder.
    pub fn held(&self) -> Option<Held> {
        let Source::Memory(recordings) = &self.source else {
            return None;
        };
        let labelled = |(slides, keys): (&Vec<Recording>, &Vec<SlideKey>)| {
            let labels = keys.iter().map(|key| key.labels.clone());
            slides.iter().cloned().zip(labels).collect()
        };
        let all = recordings.iter().zip(&self.slides).map(labelled);
        Some(self.textures.iter().cloned().zip(all).collect())
    }

    /// Opens the recordings of `folder`: reads the manifest, not yet the samples. A `manifest.csv` goes before a
    /// `manifest.json`.
    /// Errors: if there is no such folder or manifest, or the manifest makes no sense.
    pub fn open(folder: &Path) -> Result<Self> {
        if !folder.is_dir() {
            let cause = "no such folder. `tactus unpack DIR` writes simulated ones; those of a real BioTac are at \
                         https://github.com/dexrob/BioTac_slide_20_50, and `tactus import` reads them";
            return Err(RecordingError::at(folder, cause));
        }
        let has = |name| has(folder, name);
        let (source, textures, slides) = if has(files::OWN_MANIFEST) {
            let manifest = own::Manifest::read(folder)?;
            let (textures, slides) = manifest.contents();
            (Source::Own(manifest), textures, slides)
        } else if has(files::BIOTAC_MANIFEST) {
            let manifest = biotac::Manifest::read(folder)?;
            let (textures, slides) = manifest.contents();
            (Source::Biotac(manifest), textures, slides)
        } else if has(files::INCOMPLETE) {
            let by = files::read_named(folder, files::INCOMPLETE, files::INCOMPLETE, MAX_NOTE)?;
            let by = String::from_utf8_lossy(&by).into_owned();
            return Err(RecordingError::unfinished(folder, &by));
        } else {
            let cause = "neither manifest.csv nor manifest.json in this folder, so it holds no recordings; the \
                         publisher's CSV files (mat1/mat1_1_bio.csv, ...) must pass through `tactus import` first";
            return Err(RecordingError::at(folder, cause));
        };
        Ok(Self {
            folder: folder.to_owned(),
            textures,
            slides,
            source,
        })
    }

    /// Leaves out the slides of a folder that do not have these labels, each a column and its value.
    /// Errors: no slide has them.
    pub fn select(&mut self, labels: &[(String, String)]) -> Result<()> {
        let has = |of: &Labels, (column, value): &(String, String)| of.get(column) == value;
        let is_one = |of: &Labels| labels.iter().all(|label| has(of, label));
        if !self.slides.iter().flatten().any(|key| is_one(&key.labels)) {
            let of = |(column, value): &(String, String)| {
                let there = self
                    .slides
                    .iter()
                    .flatten()
                    .map(|key| key.labels.get(column));
                let there: BTreeSet<&str> = there.filter(|value| !value.is_empty()).collect();
                let there = there.into_iter().collect::<Vec<_>>().join(", ");
                let there = if there.is_empty() {
                    "none is named"
                } else {
                    &there
                };
                format!("{column}={value} ({there})")
            };
            let of: Vec<String> = labels.iter().map(of).collect();
            let cause = format!(
                "no slide has {}; in brackets is what there is",
                of.join(" and ")
            );
            return Err(RecordingError::at(&self.folder, cause));
        }
        if let Source::Own(manifest) = &mut self.source {
            manifest.retain(is_one);
            (self.textures, self.slides) = manifest.contents();
        }
        Ok(())
    }

    /// The folder that was opened.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The textures; each has at least one slide.
    pub fn textures(&self) -> &[Texture] {
        &self.textures
    }

    /// The slides of texture number `index` of [`textures`](Self::textures) in the order of time; none if there is no
    /// such texture.
    pub fn slides(&self, index: usize) -> &[SlideKey] {
        self.slides.get(index).map_or(&[], Vec::as_slice)
    }

    /// Names of the textures.
    pub fn names(&self) -> Vec<String> {
        self.textures.iter().map(|t| t.name.clone()).collect()
    }

    /// The sensor that the slides were made with.
    /// Errors: they were made with two.
    pub fn sensor(&self) -> Result<Sensor> {
        let mut all = self
            .slides
            .iter()
            .flatten()
            .map(|key| Sensor::of(&key.labels));
        let mut sensor = all.next().unwrap_or_default();
        for other in all {
            if (other.finger, &other.name) != (sensor.finger, &sensor.name) {
                return Err(RecordingError::two_fingers(&sensor, &other));
            }
            if other.calibrated != sensor.calibrated {
                sensor.calibrated = 0;
            }
        }
        Ok(sensor)
    }

    /// The movements of the set, in the order in which they are first seen.
    pub fn movements(&self) -> Vec<Movement> {
        let mut seen = HashSet::new();
        let movements = self.slides.iter().flatten().map(|key| key.movement);
        movements
            .filter(|movement| seen.insert(*movement))
            .collect()
    }

    /// Reads the samples of texture number `index` of [`textures`](Self::textures), slides in the order of time.
    /// Errors: if a file cannot be read, its hash, size or format is wrong, or the samples take too much memory.
    pub fn load_texture(&self, index: usize) -> Result<Vec<Recording>> {
        let (mut slides, mut bytes) = (Vec::new(), 0);
        self.each_slide(index, &mut |slide| {
            bytes += slide.bytes();
            if bytes > files::IN_FLIGHT {
                let name = &self.textures[index].name;
                let cause = format!("{name} has more samples than fit into memory; split it");
                return Err(RecordingError::at(&self.folder, cause));
            }
            slides.push(slide);
            Ok(())
        })?;
        Ok(slides)
    }

    /// Reads the slides of a texture in the order of time, and gives each away before the next is read.
    pub(crate) fn each_slide(
        &self,
        index: usize,
        take: &mut dyn FnMut(Recording) -> Result<()>,
    ) -> Result<()> {
        match &self.source {
            Source::Own(manifest) => manifest.each_slide(&self.folder, index, take),
            Source::Biotac(manifest) => manifest.each_slide(&self.folder, index, take),
            Source::Memory(all) => all
                .get(index)
                .into_iter()
                .flatten()
                .cloned()
                .try_for_each(take),
        }
    }

    /// Most memory that [`each_slide`](Self::each_slide) takes for a texture, bytes.
    pub(crate) fn memory(&self, index: usize) -> u64 {
        match &self.source {
            // its files as they are, as samples and as blocks
            Source::Own(_) => 16 * npy::MAX_BYTES,
            Source::Biotac(manifest) => manifest.memory(index),
            Source::Memory(all) => all
                .get(index)
                .into_iter()
                .flatten()
                .map(Recording::bytes)
                .sum(),
        }
    }
}

/// True if a folder has a manifest, or recordings that are not whole.
#[cfg(feature = "import")]
pub(crate) fn is_there(folder: &Path) -> bool {
    let manifests = [
        files::OWN_MANIFEST,
        files::BIOTAC_MANIFEST,
        files::INCOMPLETE,
    ];
    manifests.iter().any(|name| has(folder, name))
}

/// True if there is something of this name; that it is a file in this folder is seen when it is opened.
fn has(folder: &Path, name: &str) -> bool {
    folder.join(name).symlink_metadata().is_ok()
}

#[cfg(test)]
mod tests;
