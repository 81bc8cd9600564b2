//! Recorded slides: the model in memory, and the folders it is read from.
//!
//! A folder holds either
//! - `manifest.csv`: the project's own format, see [`own`];
//! - `manifest.json`: the layout of `data/biotac`, see [`biotac`].
//!
//! Opening a folder reads its manifest only; the samples of one texture are read when they are asked for, and every file is
//! checked against the SHA-256 that the manifest gives.
pub mod biotac;
pub mod npy;
pub mod own;

use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Read as _};
use std::ops::Range;
use std::path::{Component, Path, PathBuf};

use flate2::read::GzDecoder;
use sha2::{Digest as _, Sha256};
use tactus_core::movement::Movement;

pub use own::RecordingWriter;

/// Rate of P_AC in every recording: the BioTac's 2200 Hz.
pub const PAC_RATE_HZ: u32 = 2200;
/// Longest stream that is read, in samples: half an hour of P_AC. A slide lasts 15 s at most.
pub const MAX_SAMPLES: usize = 1 << 22;
/// Largest manifest that is read, in bytes.
pub(crate) const MAX_MANIFEST: u64 = 64 << 20;

/// One slide over one texture.
#[derive(Clone, PartialEq, Debug)]
pub struct Slide {
    /// Index of the texture in [`RecordingSet::textures`].
    pub texture: usize,
    /// Number of the slide; slides of a texture were made in the order of their numbers.
    pub number: u32,
    /// The movement that made it.
    pub movement: Movement,
    /// P_AC at [`PAC_RATE_HZ`] in counts about the still baseline, from the start of the record.
    pub pac: Vec<i16>,
    /// P_DC in counts about the still baseline.
    pub pdc: Vec<i16>,
    /// Rate of [`pdc`](Self::pdc) in Hz.
    pub pdc_rate_hz: u32,
    /// Tangential force in mN, positive against the motion; `None` if the rig could not measure it.
    pub shear_mn: Option<Vec<i16>>,
    /// Rate of [`shear_mn`](Self::shear_mn) in Hz, also where there is none.
    pub shear_rate_hz: u32,
    /// Start and end of the steady part, in seconds from the start of the record.
    pub window: (f32, f32),
    /// What P_AC shows without any texture.
    pub background: Background,
}

/// P_AC of a still finger: what is subtracted from the power of a slide.
#[derive(Clone, PartialEq, Debug)]
pub enum Background {
    /// Its power in counts^2 after the band-pass, measured elsewhere.
    Power(f32),
    /// P_AC of the finger at rest before this slide, like [`Slide::pac`].
    Still(Vec<i16>),
}

/// One texture of a set.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Texture {
    /// The number that the recordings give it.
    pub id: u32,
    /// Its name.
    pub name: String,
}

/// What is known of a slide before its samples are read.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SlideKey {
    /// As [`Slide::number`].
    pub number: u32,
    /// As [`Slide::movement`].
    pub movement: Movement,
}

/// Why recordings cannot be read or written. Every message names the file, the cause and what to do.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum RecordingError {
    /// The folder does not exist.
    #[error(
        "{}: no such folder. No recordings are shipped with Tactus; the BioTac's publisher has them at \
         https://github.com/dexrob/BioTac_slide_20_50, and `tactus import` reads them", .0.display()
    )]
    NoFolder(PathBuf),
    /// The folder has no manifest.
    #[error(
        "{}: neither manifest.csv nor manifest.json in this folder, so it holds no recordings; the publisher's CSV files \
         (mat1/mat1_1_bio.csv, ...) must pass through `tactus import` first", .0.display()
    )]
    NoManifest(PathBuf),
    /// The folder has nothing that can be imported.
    #[error(
        "{}: nothing to import: neither a manifest, nor raw_data/mat1/mat1_1_bio.csv and the like of \
         https://github.com/dexrob/BioTac_slide_20_50; give the folder that holds raw_data or mat1, mat2, ...", .0.display()
    )]
    NothingToImport(PathBuf),
    /// The system could not read or write.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A row of a table makes no sense.
    #[error(transparent)]
    Row(#[from] crate::rows::RowError),
    /// An entry of a manifest makes no sense.
    #[error("{}: {place}: {cause}", path.display())]
    Entry {
        /// The manifest.
        path: PathBuf,
        /// Line, or the name of the field.
        place: String,
        /// What is wrong with it, and what to do.
        cause: String,
    },
    /// A file of samples is not what its manifest says.
    #[error("{}: {cause}", path.display())]
    Samples {
        /// The file of samples.
        path: PathBuf,
        /// What is wrong with it, and what to do.
        cause: String,
    },
    /// A manifest names a file outside its folder.
    #[error("{}: names the file {name:?}, which is not inside this folder; it is not opened. Correct the manifest", manifest.display())]
    Outside {
        /// The manifest.
        manifest: PathBuf,
        /// The name it gives.
        name: String,
    },
    /// A texture without a slide cannot be learned or tested.
    #[error("{}: texture {id} ({name}) has no slide; record some or remove the texture", manifest.display())]
    EmptyTexture {
        /// The manifest.
        manifest: PathBuf,
        /// Number of the texture.
        id: u32,
        /// Name of the texture.
        name: String,
    },
    /// Two slides have one number, so their order in time is unknown.
    #[error("{}: {place}: slide {number} of texture {id} is listed twice; number the slides of a texture in the order of time", manifest.display())]
    DuplicateSlide {
        /// The manifest.
        manifest: PathBuf,
        /// Where the second one is.
        place: String,
        /// Number of the texture.
        id: u32,
        /// Number of the slide.
        number: u32,
    },
    /// Asked for a texture that the set does not have.
    #[error("{}: has {count} textures, there is none with index {index}", folder.display())]
    NoTexture {
        /// The folder of the set.
        folder: PathBuf,
        /// The index that was asked for.
        index: usize,
        /// How many textures there are.
        count: usize,
    },
    /// The folder to write to is taken.
    #[error("{}: already holds recordings ({manifest}); give a new folder, or remove these first", folder.display())]
    Taken {
        /// The folder.
        folder: PathBuf,
        /// The manifest that is there.
        manifest: &'static str,
    },
}

/// Result of reading or writing recordings.
pub type Result<T> = std::result::Result<T, RecordingError>;

/// The recordings of one folder.
#[derive(Debug)]
pub struct RecordingSet {
    folder: PathBuf,
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
        let (own, biotac) = (folder.join(own::MANIFEST), folder.join(biotac::MANIFEST));
        let (source, textures, slides) = if own.is_file() {
            let manifest = own::Manifest::read(&own)?;
            let (textures, slides) = manifest.contents();
            (Source::Own(manifest), textures, slides)
        } else if biotac.is_file() {
            let manifest = biotac::Manifest::read(&biotac)?;
            let (textures, slides) = manifest.contents();
            (Source::Biotac(manifest), textures, slides)
        } else {
            return Err(RecordingError::NoManifest(folder.to_owned()));
        };
        Ok(Self {
            folder: folder.to_owned(),
            textures,
            slides,
            source,
        })
    }

    /// The folder that was opened.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The textures; each has at least one slide.
    pub fn textures(&self) -> &[Texture] {
        &self.textures
    }

    /// The slides of texture number `index` of [`textures`](Self::textures) in the order of time; none if there is no such
    /// texture.
    pub fn slides(&self, index: usize) -> &[SlideKey] {
        self.slides.get(index).map_or(&[], Vec::as_slice)
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
    pub fn load_texture(&self, index: usize) -> Result<Vec<Slide>> {
        if index >= self.textures.len() {
            return Err(RecordingError::NoTexture {
                folder: self.folder.clone(),
                index,
                count: self.textures.len(),
            });
        }
        match &self.source {
            Source::Own(manifest) => manifest.load(&self.folder, index),
            Source::Biotac(manifest) => manifest.load(&self.folder, index),
        }
    }
}

impl Slide {
    /// The steady window as sample numbers of a stream with `rate_hz`.
    pub fn steady(&self, rate_hz: u32) -> Range<usize> {
        // `as` saturates and turns not-a-number into 0
        let sample = |s: f32| (f64::from(s) * f64::from(rate_hz)).round() as usize;
        sample(self.window.0)..sample(self.window.1)
    }

    /// Says what makes this slide unusable, if anything: every reader and writer asks.
    pub(crate) fn fault(&self) -> Option<String> {
        let (start, end) = self.window;
        if !(start.is_finite() && end.is_finite() && 0.0 <= start && start < end) {
            return Some(format!(
                "the steady window {start} s to {end} s is not a stretch of time"
            ));
        }
        let streams = [
            ("P_AC", PAC_RATE_HZ, Some(&self.pac)),
            ("P_DC", self.pdc_rate_hz, Some(&self.pdc)),
            ("shear", self.shear_rate_hz, self.shear_mn.as_ref()),
        ];
        for (name, rate, samples) in streams {
            let Some(samples) = samples else { continue };
            if rate == 0 || rate > 100_000 {
                return Some(format!("a rate of {rate} Hz for {name} is impossible"));
            }
            if samples.len() > MAX_SAMPLES {
                return Some(format!(
                    "{} samples of {name} are more than a slide can have ({MAX_SAMPLES})",
                    samples.len()
                ));
            }
            if samples.len() < self.steady(rate).end {
                return Some(format!(
                    "{name} has {} samples at {rate} Hz and ends before the steady window does ({end} s)",
                    samples.len()
                ));
            }
        }
        match &self.background {
            Background::Power(power) if !power.is_finite() || *power < 0.0 => {
                Some(format!("a background power of {power} is impossible"))
            }
            Background::Still(still) if still.is_empty() => {
                Some("the record of the still finger is empty".to_owned())
            }
            _ => None,
        }
    }
}

/// Sorts the slides of a texture by number and refuses a number that comes twice.
fn in_order_of_time<T>(
    manifest: &Path,
    id: u32,
    slides: &mut [T],
    number: impl Fn(&T) -> u32,
    place: impl Fn(&T) -> String,
) -> Result<()> {
    slides.sort_by_key(&number);
    match slides.windows(2).find(|w| number(&w[0]) == number(&w[1])) {
        Some(twins) => Err(RecordingError::DuplicateSlide {
            manifest: manifest.to_owned(),
            place: place(&twins[1]),
            id,
            number: number(&twins[1]),
        }),
        None => Ok(()),
    }
}

/// Refuses two textures with one number.
fn distinct_textures(manifest: &Path, textures: &[Texture]) -> Result<()> {
    let mut seen = HashMap::new();
    for texture in textures {
        if let Some(other) = seen.insert(texture.id, &texture.name) {
            return Err(RecordingError::Entry {
                path: manifest.to_owned(),
                place: format!("texture {}", texture.id),
                cause: format!(
                    "is both {other:?} and {:?}; give each texture one number and one name",
                    texture.name
                ),
            });
        }
    }
    Ok(())
}

/// The path of a file that a manifest names, if it is inside the manifest's folder.
pub(crate) fn inside(folder: &Path, manifest: &str, name: &str) -> Result<PathBuf> {
    let relative = Path::new(name);
    let plain = |c: Component<'_>| matches!(c, Component::Normal(_));
    if name.is_empty() || !relative.components().all(plain) {
        return Err(RecordingError::Outside {
            manifest: folder.join(manifest),
            name: name.to_owned(),
        });
    }
    Ok(folder.join(relative))
}

/// The bytes of a file of at most `limit` bytes. Memory grows with the bytes that come, not with what a manifest claims.
pub(crate) fn read_bounded(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let io_error = |source| RecordingError::Io {
        path: path.to_owned(),
        source,
    };
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(io_error)?;
    file.take(limit.saturating_add(1))
        .read_to_end(&mut bytes)
        .map_err(io_error)?;
    if bytes.len() as u64 > limit {
        return Err(RecordingError::Samples {
            path: path.to_owned(),
            cause: format!("longer than the {limit} bytes it can have; fetch or record it again"),
        });
    }
    Ok(bytes)
}

/// SHA-256 in lower-case hexadecimal.
pub(crate) fn sha256(bytes: &[u8]) -> String {
    let mut hex = String::new();
    for byte in Sha256::digest(bytes) {
        let _ = write!(hex, "{byte:02x}");
    }
    hex
}

/// Refuses bytes that the manifest's SHA-256 was not made of.
fn check_hash(path: &Path, what: &str, bytes: &[u8], expected: &str) -> Result<()> {
    let found = sha256(bytes);
    if found.eq_ignore_ascii_case(expected.trim()) {
        return Ok(());
    }
    Err(RecordingError::Samples {
        path: path.to_owned(),
        cause: format!(
            "SHA-256 of {what} is {found}, the manifest says {expected}: the file was damaged or changed; fetch or record it \
             again"
        ),
    })
}

/// The `bytes` bytes that a gzip file holds, with both SHA-256 checked. Never unpacks more than one byte too many.
pub(crate) fn unpack(
    path: &Path,
    packed: &[u8],
    sha256_gz: &str,
    bytes: u64,
    sha256_raw: &str,
) -> Result<Vec<u8>> {
    let fault = |cause| RecordingError::Samples {
        path: path.to_owned(),
        cause,
    };
    check_hash(path, "the gzip file", packed, sha256_gz)?;
    let mut raw = Vec::new();
    GzDecoder::new(packed)
        .take(bytes.saturating_add(1))
        .read_to_end(&mut raw)
        .map_err(|e| fault(format!("no whole gzip stream ({e}); fetch it again")))?;
    if raw.len() as u64 != bytes {
        let more = if raw.len() as u64 > bytes {
            "or more "
        } else {
            ""
        };
        let odd = if raw.len().is_multiple_of(2) {
            ""
        } else {
            ", an odd number for 16-bit values"
        };
        return Err(fault(format!(
            "unpacks to {} {more}bytes{odd}; the manifest says {bytes}",
            raw.len()
        )));
    }
    check_hash(path, "the unpacked samples", &raw, sha256_raw)?;
    Ok(raw)
}

#[cfg(test)]
mod tests;
