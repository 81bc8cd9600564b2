//! Common code of all readers and writers of recordings: their errors, bounded reads, and hashes.

use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;
use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Component, Path, PathBuf};

use flate2::read::GzDecoder;
use sha2::{Digest as _, Sha256};
use tactus_core::sensor::FingerCode;

use crate::data::content::ContentError;
use crate::data::recording::Texture;
use crate::data::rows::RowError;

/// Name of the manifest of the project's own format.
pub const OWN_MANIFEST: &str = "manifest.csv";
/// Name of the manifest of folders like `data/biotac`.
pub const BIOTAC_MANIFEST: &str = "manifest.json";
/// Name of the mark in a folder that is not whole.
pub const INCOMPLETE: &str = "INCOMPLETE";
/// Largest manifest that is read, in bytes.
pub const MAX_MANIFEST: u64 = 64 << 20;

/// Reasons why recordings cannot be read or written. Every message names the file, the cause and a remedy.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum RecordingError {
    /// The folder does not exist.
    #[error(
        "{}: no such folder. `tactus unpack DIR` writes simulated ones; those of a real BioTac are at \
         https://github.com/dexrob/BioTac_slide_20_50, and `tactus import` reads them", .0.display()
    )]
    NoFolder(PathBuf),
    /// The folder has no manifest.
    #[error(
        "{}: neither manifest.csv nor manifest.json in this folder, so it holds no recordings; the publisher's CSV \
         files (mat1/mat1_1_bio.csv, ...) must pass through `tactus import` first", .0.display()
    )]
    NoManifest(PathBuf),
    /// The folder has nothing that can be imported.
    #[error(
        "{}: nothing to import: neither a manifest, nor raw_data/mat1/mat1_1_bio.csv and the like of \
         https://github.com/dexrob/BioTac_slide_20_50; give the folder that holds raw_data or mat1, mat2, \
         ...", .0.display()
    )]
    NothingToImport(PathBuf),
    /// The folder does not have the Cluster dataset's layout.
    #[error(
        "{}: no slide of the Cluster Haptic Texture Dataset here, such as sensor_data/accel/0/0_135_40_500_0.csv; give \
         the folder that holds sensor_data. The CSV files of https://doi.org/10.6084/m9.figshare.29438288 are read, \
         .parquet is not", .0.display()
    )]
    NoCluster(PathBuf),
    /// The system could not read or write.
    #[error("{}: {cause}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        cause: io::Error,
    },
    /// A row of a table makes no sense.
    #[error(transparent)]
    Row(#[from] RowError),
    /// An entry of a manifest makes no sense.
    #[error("{}: {place}: {cause}", path.display())]
    Entry {
        /// The manifest.
        path: PathBuf,
        /// Line, or the name of the field.
        place: String,
        /// The fault, and its remedy.
        cause: ContentError,
    },
    /// A file of samples differs from its manifest.
    #[error("{}: {cause}", path.display())]
    Samples {
        /// The file of samples.
        path: PathBuf,
        /// The fault, and its remedy.
        cause: ContentError,
    },
    /// A manifest names a file outside its folder.
    #[error("{}: names the file {name:?}, which is not inside this folder; it is not opened. Correct the \
         manifest", manifest.display())]
    Outside {
        /// The manifest.
        manifest: PathBuf,
        /// The name it gives.
        name: String,
    },
    /// A manifest names a file that did not come with it.
    #[error("{}: is in {manifest}, but not among the files that were given: give the whole folder", path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// The manifest.
        manifest: String,
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
    #[error("{}: {place}: slide {number} of texture {id} is listed twice; number the slides of a texture in the order \
         of time", manifest.display())]
    DuplicateSlide {
        /// The manifest.
        manifest: PathBuf,
        /// Place of the second one.
        place: String,
        /// Number of the texture.
        id: u32,
        /// Number of the slide.
        number: u32,
    },
    /// Asked for a texture that the set does not have.
    #[error("{}: there is no texture with index {index}, but {count} in all", folder.display())]
    NoTexture {
        /// The folder of the set.
        folder: PathBuf,
        /// The index that was asked for.
        index: usize,
        /// Number of textures.
        count: usize,
    },
    /// Recordings that were begun and are not whole.
    #[error("{}: recordings that are not whole, by: {}", .0.display(), .1.trim_end())]
    Unfinished(PathBuf, String),
    /// Other files would lie among the recordings.
    #[error("{}: is not empty; give a new folder, so that nothing is mixed up", .0.display())]
    NotEmpty(PathBuf),
    /// Slides of different fingers.
    #[error(
        "slides of two fingers, {0} and {1}, cannot be compared: keep them in folders of their own"
    )]
    TwoFingers(FingerCode, FingerCode),
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

/// Sorts the slides of a texture by number and refuses a number that comes twice.
pub(super) fn in_order_of_time<T>(
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
pub(super) fn distinct_textures(manifest: &Path, textures: &[Texture]) -> Result<()> {
    let mut seen = HashMap::new();
    for texture in textures {
        if let Some(other) = seen.insert(texture.id, &texture.name) {
            return Err(RecordingError::Entry {
                path: manifest.to_owned(),
                place: format!("texture {}", texture.id),
                cause: ContentError::TwoNames(other.clone(), texture.name.clone()),
            });
        }
    }
    Ok(())
}

/// The path of a file that a manifest names, if it is inside the manifest's folder.
pub fn inside(folder: &Path, manifest: &str, name: &str) -> Result<PathBuf> {
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

/// The place of a set's files.
#[derive(Debug)]
pub enum Place {
    /// In a folder of this machine.
    Folder(PathBuf),
    /// In memory, by their names in the folder of this name.
    Memory(PathBuf, BTreeMap<String, Vec<u8>>),
}

impl Place {
    /// Name of the folder.
    pub fn folder(&self) -> &Path {
        match self {
            Self::Folder(folder) | Self::Memory(folder, _) => folder,
        }
    }

    /// Returns true if there is a file of this name.
    pub(super) fn has(&self, name: &str) -> bool {
        match self {
            Self::Folder(folder) => folder.join(name).is_file(),
            Self::Memory(_, files) => files.contains_key(name),
        }
    }

    /// The bytes of a file that a manifest names, of at most `limit` bytes.
    pub(super) fn read(&self, manifest: &str, name: &str, limit: u64) -> Result<Vec<u8>> {
        let path = inside(self.folder(), manifest, name)?;
        let Self::Memory(_, files) = self else {
            return read_bounded(&path, limit);
        };
        let found = files.get(name).ok_or_else(|| RecordingError::Missing {
            path: path.clone(),
            manifest: manifest.to_owned(),
        })?;
        if found.len() as u64 > limit {
            let cause = ContentError::TooLong(limit);
            return Err(RecordingError::Samples { path, cause });
        }
        Ok(found.clone())
    }
}

/// The bytes of a file of at most `limit` bytes. Memory grows with the bytes that come, not with what a manifest
/// claims.
pub fn read_bounded(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let io_error = |source| RecordingError::Io {
        path: path.to_owned(),
        cause: source,
    };
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(io_error)?;
    file.take(limit.saturating_add(1))
        .read_to_end(&mut bytes)
        .map_err(io_error)?;
    if bytes.len() as u64 > limit {
        return Err(RecordingError::Samples {
            path: path.to_owned(),
            cause: ContentError::TooLong(limit),
        });
    }
    Ok(bytes)
}

/// SHA-256 in lower-case hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    let mut hex = String::new();
    for byte in Sha256::digest(bytes) {
        let _ = write!(hex, "{byte:02x}");
    }
    hex
}

/// Refuses bytes that the manifest's SHA-256 was not made of.
pub(super) fn check_hash(
    path: &Path,
    what: &'static str,
    bytes: &[u8],
    expected: &str,
) -> Result<()> {
    let found = sha256(bytes);
    if found.eq_ignore_ascii_case(expected.trim()) {
        return Ok(());
    }
    Err(RecordingError::Samples {
        path: path.to_owned(),
        cause: ContentError::Hash {
            what,
            found: found.into(),
            expected: expected.into(),
        },
    })
}

/// The `bytes` bytes that a gzip file holds, with both SHA-256 checked. Never unpacks more than one byte too many.
pub fn unpack(
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
        .map_err(|e| fault(ContentError::Gzip(e)))?;
    if raw.len() as u64 != bytes {
        return Err(fault(ContentError::Unpacked(raw.len() as u64, bytes)));
    }
    check_hash(path, "the unpacked samples", &raw, sha256_raw)?;
    Ok(raw)
}
