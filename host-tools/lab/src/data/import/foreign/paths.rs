//! The files below a folder, and what their paths say.

use std::fs;
use std::path::Path;

use crate::data::import::settings::{Named, Settings, guessed, matched};
use crate::data::recordings::{RecordingError, Result};

/// Deepest folder below the one that is imported.
const DEPTH: usize = 8;
/// Most files of one import.
const MOST_FILES: usize = 100_000;
/// Endings of files that are data; others are left alone.
const ENDINGS: [&str; 6] = ["wav", "csv", "tsv", "txt", "npy", "dat"];

/// The files to import, by their paths below the folder, and what these say, in their natural order.
pub(super) fn files(from: &Path, settings: &Settings) -> Result<Vec<(String, Named)>> {
    let mut paths = Vec::new();
    if from.is_dir() {
        walk(from, "", 0, &mut paths)?;
    } else {
        let name = from
            .file_name()
            .map(|name| name.to_string_lossy().into_owned());
        paths.extend(name);
    }
    paths.sort_by_cached_key(|path| natural(path));
    let pattern = settings
        .texture
        .as_ref()
        .filter(|texture| texture.contains(['{', '*']));
    let named = paths.into_iter().filter_map(|path| {
        let named = match pattern {
            Some(pattern) => matched(pattern, &path)?,
            None => guessed(&path),
        };
        Some((path, named))
    });
    let named: Vec<_> = named.collect();
    if named.is_empty() {
        let why = match pattern {
            Some(pattern) => format!("no path in it is like {pattern:?}"),
            None => format!("no file in it ends with {}", ENDINGS.join(", ")),
        };
        return Err(RecordingError::at(from, why));
    }
    Ok(named)
}

fn walk(folder: &Path, below: &str, depth: usize, paths: &mut Vec<String>) -> Result<()> {
    let fault = |why: std::io::Error| RecordingError::at(folder, why);
    for entry in fs::read_dir(folder).map_err(fault)? {
        let entry = entry.map_err(fault)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with('.') {
            continue;
        }
        let path = format!("{below}{name}");
        // of the entry itself: links that lead elsewhere are left alone
        let kind = entry.file_type().map_err(fault)?;
        if kind.is_dir() && depth < DEPTH {
            walk(&entry.path(), &format!("{path}/"), depth + 1, paths)?;
        } else if kind.is_file() {
            let plain = name.strip_suffix(".gz").unwrap_or(&name).to_lowercase();
            if plain
                .rsplit_once('.')
                .is_some_and(|(_, end)| ENDINGS.contains(&end))
            {
                paths.push(path);
            }
        }
        if paths.len() > MOST_FILES {
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
