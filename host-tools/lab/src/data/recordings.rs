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

use std::collections::BTreeMap;
use std::path::Path;

use tactus_core::features::Movement;
use tactus_core::sensor::FingerCode;

use crate::data::recording::{Labels, Recording, SlideKey, Texture};
use files::Place;
pub use files::{RecordingError, Result};
pub use writer::{RecordingWriter, files as files_of};

/// The recordings of one folder.
#[derive(Debug)]
pub struct RecordingSet {
    place: Place,
    textures: Vec<Texture>,
    /// per texture, in the order of numbers
    slides: Vec<Vec<SlideKey>>,
    source: Source,
}

#[derive(Debug)]
enum Source {
    Own(own::Manifest),
    Biotac(biotac::Manifest),
}

impl RecordingSet {
    /// Opens the recordings of `folder`: reads the manifest, not yet the samples. A `manifest.csv` goes before a
    /// `manifest.json`.
    ///
    /// # Errors
    /// If there is no such folder or manifest, or the manifest makes no sense.
    pub fn open(folder: &Path) -> Result<Self> {
        if !folder.is_dir() {
            return Err(RecordingError::NoFolder(folder.to_owned()));
        }
        Self::at(Place::Folder(folder.to_owned()))
    }

    /// The recordings of a folder that is in memory: its files by their names in it.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn in_memory(folder: &str, files: BTreeMap<String, Vec<u8>>) -> Result<Self> {
        Self::at(Place::Memory(folder.into(), files))
    }

    fn at(place: Place) -> Result<Self> {
        let folder = place.folder();
        let (source, textures, slides) = if place.has(files::OWN_MANIFEST) {
            let manifest = own::Manifest::read(&place)?;
            let (textures, slides) = manifest.contents();
            (Source::Own(manifest), textures, slides)
        } else if place.has(files::BIOTAC_MANIFEST) {
            let manifest = biotac::Manifest::read(&place)?;
            let (textures, slides) = manifest.contents();
            (Source::Biotac(manifest), textures, slides)
        } else if place.has(files::INCOMPLETE) {
            let by = place.read(files::INCOMPLETE, files::INCOMPLETE, files::MAX_MANIFEST)?;
            let by = String::from_utf8_lossy(&by).into_owned();
            return Err(RecordingError::Unfinished(folder.to_owned(), by));
        } else {
            return Err(RecordingError::NoManifest(folder.to_owned()));
        };
        let rows: usize = slides.iter().map(Vec::len).sum();
        tracing::info!(folder = %folder.display(), textures = textures.len(), slides = rows, "reads the manifest");
        Ok(Self {
            place,
            textures,
            slides,
            source,
        })
    }

    /// The folder that was opened.
    pub fn folder(&self) -> &Path {
        self.place.folder()
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

    /// The finger that the slides were made with, and the day of its calibration, where it is the same of all, else 0.
    ///
    /// # Errors
    /// They were made with two fingers.
    pub fn finger(&self) -> Result<(FingerCode, u32)> {
        let mut all = self.slides.iter().flatten();
        let first = all.next().map(|key| &key.labels);
        let (finger, mut calibrated) =
            first.map_or_else(Default::default, |l| (l.finger, l.calibrated));
        for Labels {
            finger: other,
            calibrated: date,
            ..
        } in all.map(|key| &key.labels)
        {
            if *other != finger {
                return Err(RecordingError::TwoFingers(finger, *other));
            }
            if *date != calibrated {
                calibrated = 0;
            }
        }
        Ok((finger, calibrated))
    }

    /// The movements of the set, in the order in which they are first seen.
    pub fn movements(&self) -> Vec<Movement> {
        let mut movements = Vec::new();
        for key in self.slides.iter().flatten() {
            if !movements.contains(&key.movement) {
                movements.push(key.movement);
            }
        }
        movements
    }

    /// Reads the samples of texture number `index` of [`textures`](Self::textures), slides in the order of time.
    ///
    /// # Errors
    /// If a file cannot be read, or its hash, size or format is wrong.
    pub fn load_texture(&self, index: usize) -> Result<Vec<Recording>> {
        if index >= self.textures.len() {
            return Err(RecordingError::NoTexture {
                folder: self.folder().to_owned(),
                index,
                count: self.textures.len(),
            });
        }
        let slides = match &self.source {
            Source::Own(manifest) => manifest.load(&self.place, index),
            Source::Biotac(manifest) => manifest.load(&self.place, index),
        }?;
        let texture = &self.textures[index].name;
        tracing::info!(texture, slides = slides.len(), "reads samples");
        Ok(slides)
    }
}

#[cfg(test)]
mod tests;
