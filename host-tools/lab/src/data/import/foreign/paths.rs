//! The files below a folder, and what their paths say.

use std::ffi::OsStr;
use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use super::columns::{no_channel, time};
use crate::data::import::on_line;
use crate::data::import::settings::{Named, Pattern, Settings, guessed};
use crate::data::import::signals::{Signals, not_read};
use crate::data::recordings::files::{OWN_MANIFEST, confined, open};
use crate::data::recordings::{RecordingError, Result};

const NOT_TEXT: &str = "a name that is not UTF-8; rename it";

/// Deepest folder below the one that is imported.
const DEPTH: usize = 8;
/// Longest header of a manifest that is looked at, bytes.
const MAX_HEADER: u64 = 4096;
/// Most that an error names of what is left out.
const NAMED: usize = 8;
/// Most files of one import.
const MOST_FILES: usize = 100_000;
/// Endings of files that are read. Those of data that is not read are named; all others are left alone.
const ENDINGS: [&str; 11] = [
    "wav", "wave", "csv", "tsv", "txt", "dat", "log", "lvm", "npy", "npz", "mcap",
];

/// Paths of files, and what these say.
pub(super) type Paths = Vec<(String, Named)>;

/// What is found below a folder.
#[derive(Default)]
struct Below {
    /// paths of files
    paths: Vec<String>,
    /// what is not read, and why
    skipped: Vec<String>,
}

/// The files to import, by their paths below the folder, and what these say, in their natural order; and what is not
/// read there, and why.
pub(super) fn files(from: &Path, settings: &Settings) -> Result<(Paths, Vec<String>)> {
    let mut below = Below::default();
    if from.is_dir() {
        walk(from, "", 0, &mut below)?;
    }
    let Below {
        mut paths,
        mut skipped,
    } = below;
    skipped.sort();
    if !from.is_dir() {
        match from.file_name().and_then(OsStr::to_str) {
            Some(name) => paths.push(name.to_owned()),
            None => skipped.push(NOT_TEXT.to_owned()),
        }
    }
    let (named, pattern) = (paths_named(paths, settings), settings.pattern());
    if named.is_empty() {
        let mut why = match pattern {
            Some(pattern) => format!("no path in it is like {pattern:?}"),
            None => format!("no file in it ends with {}", ENDINGS.join(", ")),
        };
        let more = skipped.len().saturating_sub(NAMED);
        skipped.truncate(NAMED);
        skipped.extend((more > 0).then(|| format!("{more} more")));
        for skipped in skipped {
            why += &format!("; left out: {skipped}");
        }
        return Err(RecordingError::at(from, why));
    }
    Ok((named, skipped))
}

/// What these paths say, in their natural order; those that are not like the settings' pattern are left out.
pub(super) fn paths_named(mut paths: Vec<String>, settings: &Settings) -> Paths {
    paths.sort_by_cached_key(|path| natural(path));
    let pattern = settings.pattern();
    let like = pattern.map(Pattern::new);
    // without a folder it is one of names
    let of_names = pattern.is_some_and(|pattern| !pattern.contains('/'));
    let named = paths.into_iter().filter_map(|path| {
        let name = path.rsplit('/').next().filter(|_| of_names);
        let named = match &like {
            Some(like) => like.named(name.unwrap_or(&path))?,
            None => guessed(&path),
        };
        Some((path, named))
    });
    named.collect()
}

/// The folder of accelerations in the Cluster Haptic Texture Dataset (Eguchi et al., arXiv 2407.16206), as CSV:
/// `sensor_data/accel/TEXTURE_DIRECTION_SPEED_FORCE_REPEAT.csv`, with the same names below `sensor_data/force`.
fn cluster(from: &Path) -> Option<PathBuf> {
    let is_one = |name: &str| {
        let parts = name.strip_suffix(".csv").map(|stem| stem.split('_'));
        parts.is_some_and(|mut parts| {
            parts.clone().count() == 5 && parts.all(|part| part.parse::<u32>().is_ok())
        })
    };
    let folders = ["sensor_data/accel", "accel"].map(|below| from.join(below));
    folders.into_iter().find(|folder| {
        let mut names = fs::read_dir(folder).into_iter().flatten().flatten();
        names.any(|entry| is_one(&entry.file_name().to_string_lossy()))
    })
}

/// The folder of what is imported.
pub(super) fn folder_of(from: &Path) -> &Path {
    match from.is_dir() {
        true => from,
        // of a name alone it is the folder that one is in
        false => from
            .parent()
            .filter(|parent| !parent.as_os_str().is_empty())
            .unwrap_or(Path::new(".")),
    }
}

/// The settings of a published data set that is known, and the folder of its files.
pub(super) fn known_layout(from: &Path, mut settings: Settings) -> (PathBuf, Settings) {
    let Some(folder) = cluster(from) else {
        return (from.to_owned(), settings);
    };
    let set = |setting: &mut Option<String>, to: &str| {
        setting.get_or_insert_with(|| to.to_owned());
    };
    set(
        &mut settings.texture,
        "{texture}_*_{speed}_{force_mn}_*.csv",
    );
    set(&mut settings.finger, "cluster-haptic-texture");
    set(&mut settings.unit, "g");
    set(&mut settings.pressure, BESIDE);
    (folder, settings)
}

/// The folder beside that of a file, and the column of a file of the same name in it, that are read with it.
pub(super) const BESIDE: &str = "force";

/// Adds the column of the file beside one that belongs to it, at its times.
pub(super) fn add(signals: &mut Signals, beside: &Path, settings: &Settings) -> Result<()> {
    if signals.channel(BESIDE).is_some() || beside.symlink_metadata().is_err() {
        return Ok(());
    }
    if let Some(folder) = beside.parent() {
        confined(folder, beside)?;
    }
    let other = Signals::read(beside)?;
    let at = |why: String| RecordingError::at(beside, why);
    let own = time(signals, settings).map_err(at)?;
    let times = time(&other, settings).map_err(at)?;
    let (Some(own), Some(times)) = (own, times) else {
        return Err(at(
            "no column of time in it, or in the file beside it".to_owned()
        ));
    };
    let force = other
        .channel(BESIDE)
        .ok_or_else(|| at(no_channel(&other, BESIDE)))?;
    let force = times.times.into_iter().zip(force.1.iter().copied());
    let force: Vec<(f64, f64)> = force.collect();
    let values = on_line(&force, &own.times).collect();
    signals.channels.push((BESIDE.to_owned(), values));
    Ok(())
}

/// True if a folder holds recordings in the project's own format: another manifest is a file as others.
fn is_ours(folder: &Path) -> bool {
    let mut begin = Vec::new();
    let manifest = open(&folder.join(OWN_MANIFEST));
    let read = manifest.and_then(|file| file.take(MAX_HEADER).read_to_end(&mut begin));
    let header = begin
        .split(|byte| *byte == b'\n')
        .next()
        .unwrap_or_default();
    read.is_ok()
        && header
            .split(|byte| *byte == b',')
            .any(|name| name.trim_ascii() == b"pac_file")
}

fn walk(folder: &Path, above: &str, depth: usize, below: &mut Below) -> Result<()> {
    let fault = |why: std::io::Error| RecordingError::at(folder, why);
    for entry in fs::read_dir(folder).map_err(fault)? {
        let entry = entry.map_err(fault)?;
        let bytes = entry.file_name();
        let name = bytes.to_string_lossy().into_owned();
        if name.starts_with('.') {
            continue;
        }
        let path = format!("{above}{name}");
        let plain = name.strip_suffix(".gz").unwrap_or(&name).to_lowercase();
        let end = plain.rsplit_once('.').map_or("", |(_, end)| end);
        // of the entry itself: what a link leads to is not looked at
        let kind = entry.file_type().map_err(fault)?;
        let why = if bytes.to_str().is_none() {
            Some(NOT_TEXT.to_owned())
        } else if kind.is_dir() {
            if is_ours(&entry.path()) {
                Some("recordings of this project; import that folder by itself".to_owned())
            } else if depth < DEPTH {
                walk(&entry.path(), &format!("{path}/"), depth + 1, below)?;
                continue;
            } else {
                Some(format!(
                    "a folder deeper than {DEPTH}; import the one that it is in"
                ))
            }
        } else if kind.is_symlink() {
            Some("a symbolic link, which is not followed; put the file itself here".to_owned())
        } else if !kind.is_file() {
            Some("a pipe, socket or device, which is not opened; put a file here".to_owned())
        } else if ENDINGS.contains(&end) {
            below.paths.push(path);
            continue;
        } else {
            not_read(end).map(|what| format!("a file of {what}"))
        };
        below
            .skipped
            .extend(why.map(|why| format!("{path}: {why}")));
        if below.paths.len().max(below.skipped.len()) > MOST_FILES {
            return Err(RecordingError::at(
                folder,
                format!("more than {MOST_FILES} files; import a part"),
            ));
        }
    }
    Ok(())
}

/// A key by which `run10` comes after `run9`.
fn natural(path: &str) -> Vec<(String, u64)> {
    let mut key = Vec::new();
    let mut rest = path;
    while !rest.is_empty() {
        let digits = rest
            .find(|c: char| c.is_ascii_digit())
            .unwrap_or(rest.len());
        let (word, after) = rest.split_at(digits);
        let end = after
            .find(|c: char| !c.is_ascii_digit())
            .unwrap_or(after.len());
        let (number, after) = after.split_at(end);
        key.push((word.to_owned(), number.parse().unwrap_or(u64::MAX)));
        rest = after;
    }
    key
}
