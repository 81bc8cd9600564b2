//! Common code of all readers and writers of recordings: their errors, bounded reads, and hashes.

use std::collections::HashMap;
use std::fmt::Display;
use std::fs::{self, File};
use std::io::{self, Read as _};
use std::path::{Component, Path, PathBuf};

use flate2::read::GzDecoder;
use rayon::prelude::*;
use sha2::{Digest as _, Sha256};
use tactus_core::table::{NameError, is_printable};

use super::Sensor;
use crate::data::printable::printable;
use crate::data::recording::Texture;

/// Name of the manifest of the project's own format.
pub(crate) const OWN_MANIFEST: &str = "manifest.csv";
pub(crate) const BIOTAC_MANIFEST: &str = "manifest.json";
/// Name of the mark in a folder that is not whole.
pub const INCOMPLETE: &str = "INCOMPLETE";
/// Largest manifest that is read, in bytes.
pub const MAX_MANIFEST: u64 = 64 << 20;
/// Bytes of samples that are in memory at once, on all cores together.
pub const IN_FLIGHT: u64 = 256 << 20;

/// A reason why recordings or a table of properties cannot be read or written: the file, the cause and a remedy.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{0}")]
pub struct RecordingError(String);

impl RecordingError {
    /// A fault of a file or folder.
    pub fn at(path: &Path, cause: impl Display) -> Self {
        Self::said(format!("{}: {cause}", path.display()))
    }

    pub(super) fn empty_texture(manifest: &Path, texture: &Texture) -> Self {
        let Texture { id, name } = texture;
        let cause =
            format!("texture {id} ({name}) has no slide; record some or remove the texture");
        Self::at(manifest, cause)
    }

    pub(super) fn twice(manifest: &Path, place: &str, id: u32, number: u32) -> Self {
        let cause = format!(
            "{place}: slide {number} of texture {id} is listed twice; number the slides of a texture in the order of \
             time"
        );
        Self::at(manifest, cause)
    }

    pub(super) fn unfinished(folder: &Path, by: &str) -> Self {
        let cause = format!("recordings that are not whole, by: {}", by.trim_end());
        Self::at(folder, cause)
    }

    pub(crate) fn said(sentence: String) -> Self {
        // names and values of files are in it
        Self(printable(&sentence).into_owned())
    }

    pub(super) fn two_fingers(one: &Sensor, other: &Sensor) -> Self {
        Self(format!(
            "slides of two sensors, {one} and {other}, cannot be compared: keep them in folders of their own"
        ))
    }
}

/// Result of reading or writing recordings.
pub type Result<T> = std::result::Result<T, RecordingError>;

pub(super) fn in_order_of_time<T>(
    manifest: &Path,
    id: u32,
    slides: &mut [T],
    number: impl Fn(&T) -> u32,
    place: impl Fn(&T) -> String,
) -> Result<()> {
    slides.sort_by_key(&number);
    match slides.windows(2).find(|w| number(&w[0]) == number(&w[1])) {
        Some(twins) => {
            let twin = &twins[1];
            let (place, number) = (place(twin), number(twin));
            Err(RecordingError::twice(manifest, &place, id, number))
        }
        None => Ok(()),
    }
}

pub(super) fn distinct_textures(manifest: &Path, textures: &[Texture]) -> Result<()> {
    let mut seen = HashMap::new();
    for texture in textures {
        if let Some(other) = seen.insert(texture.id, &texture.name) {
            let (id, name) = (texture.id, &texture.name);
            let cause = format!(
                "texture {id}: is both {other:?} and {name:?}; give each texture one number and one name"
            );
            return Err(RecordingError::at(manifest, cause));
        }
    }
    Ok(())
}

/// The path of a file that a manifest names, if it is inside the manifest's folder.
pub fn inside(folder: &Path, manifest: &str, name: &str) -> Result<PathBuf> {
    let relative = Path::new(name);
    let plain = |c: Component<'_>| matches!(c, Component::Normal(_));
    if name.is_empty() || !relative.components().all(plain) {
        let cause = format!(
            "names the file {name:?}, which is not inside this folder; it is not opened. Correct the manifest"
        );
        return Err(RecordingError::at(&folder.join(manifest), cause));
    }
    let path = folder.join(relative);
    confined(folder, &path)?;
    Ok(path)
}

/// Refuses a file or folder that symbolic links lead out of the folder that it is in.
pub fn confined(folder: &Path, path: &Path) -> Result<()> {
    // what is not there is said when it is opened
    let (Ok(root), Ok(target)) = (fs::canonicalize(folder), fs::canonicalize(path)) else {
        return Ok(());
    };
    if target.starts_with(root) {
        return Ok(());
    }
    let cause = "leads out of this folder by a symbolic link, so it is not opened; put the file itself here";
    Err(RecordingError::at(path, cause))
}

/// Opens a file, and nothing else: a pipe would wait, and a device may do something.
pub fn open(path: &Path) -> io::Result<File> {
    if fs::metadata(path)?.is_file() {
        return File::open(path);
    }
    let why = "is no file but a folder, pipe, socket or device, so it is not opened; give a file";
    Err(io::Error::new(io::ErrorKind::InvalidInput, why))
}

/// Checks a text of a manifest that is shown to people.
pub fn check_text(manifest: &Path, place: &str, text: &str) -> Result<()> {
    let Some(hidden) = text.chars().find(|c| !is_printable(*c)) else {
        return Ok(());
    };
    let why = NameError::Unprintable(hidden.into());
    Err(RecordingError::at(
        manifest,
        format!("{place}: {text:?} {why}"),
    ))
}

/// Does work on all cores, on so many items at once as take at most [`IN_FLIGHT`] bytes of memory together.
/// Errors: that of an item.
pub fn each_in_flight<I: Sync, T: Send, E: Send>(
    items: &[I],
    bytes: impl Fn(&I) -> u64,
    work: impl Fn(&I) -> std::result::Result<T, E> + Sync,
) -> std::result::Result<Vec<T>, E> {
    let mut done = Vec::with_capacity(items.len());
    let mut rest = items;
    while !rest.is_empty() {
        let mut sum = 0;
        let fitting = rest.iter().take_while(|item| {
            sum += bytes(item);
            sum <= IN_FLIGHT
        });
        let (now, later) = rest.split_at(fitting.count().max(1));
        let now = now.par_iter().panic_fuse().map(&work);
        done.extend(now.collect::<std::result::Result<Vec<T>, E>>()?);
        rest = later;
    }
    Ok(done)
}

/// The bytes of a file that a manifest names, of at most `limit` bytes.
pub(super) fn read_named(folder: &Path, manifest: &str, name: &str, limit: u64) -> Result<Vec<u8>> {
    read_bounded(&inside(folder, manifest, name)?, limit)
}

/// The bytes of a file of at most `limit` bytes. Memory grows with the bytes that come, not with what a manifest
/// claims.
pub fn read_bounded(path: &Path, limit: u64) -> Result<Vec<u8>> {
    let io_error = |why: io::Error| RecordingError::at(path, why);
    let mut bytes = Vec::new();
    let file = open(path).map_err(io_error)?;
    file.take(limit.saturating_add(1))
        .read_to_end(&mut bytes)
        .map_err(io_error)?;
    if bytes.len() as u64 > limit {
        let cause = format!("longer than the {limit} bytes it can have; fetch or record it again");
        return Err(RecordingError::at(path, cause));
    }
    Ok(bytes)
}

/// SHA-256 in lower-case hexadecimal.
pub fn sha256(bytes: &[u8]) -> String {
    let mut hex = String::new();
    for byte in Sha256::digest(bytes) {
        hex += &format!("{byte:02x}");
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
    if sha256(bytes).eq_ignore_ascii_case(expected.trim()) {
        return Ok(());
    }
    let cause = format!(
        "SHA-256 of {what} is not the manifest's: the file was damaged or changed; fetch or record it again"
    );
    Err(RecordingError::at(path, cause))
}

/// The `bytes` bytes that a gzip file holds, with both SHA-256 checked. Never unpacks more than one byte too many.
pub fn unpack(
    path: &Path,
    packed: &[u8],
    sha256_gz: &str,
    bytes: u64,
    sha256_raw: &str,
) -> Result<Vec<u8>> {
    let fault = |cause: String| RecordingError::at(path, cause);
    check_hash(path, "the gzip file", packed, sha256_gz)?;
    let mut raw = Vec::new();
    GzDecoder::new(packed)
        .take(bytes.saturating_add(1))
        .read_to_end(&mut raw)
        .map_err(|e| fault(format!("no whole gzip stream ({e}); fetch it again")))?;
    if raw.len() as u64 != bytes {
        let length = raw.len() as u64;
        let more = if length > bytes { "or more " } else { "" };
        let odd = match length.is_multiple_of(2) {
            true => "",
            false => ", an odd number for 16-bit values",
        };
        return Err(fault(format!(
            "unpacks to {length} {more}bytes{odd}; the manifest says {bytes}"
        )));
    }
    check_hash(path, "the unpacked samples", &raw, sha256_raw)?;
    Ok(raw)
}
