//! Files that somebody gives: a session's log, or recordings as a folder.

use std::collections::BTreeMap;

use super::message::File;
use super::recorded::{Opened, Recorded};
use super::replay::replay;
use crate::data::recordings::files::{BIOTAC_MANIFEST, INCOMPLETE, OWN_MANIFEST};
use crate::data::recordings::{RecordingError, RecordingSet};
use tactus_link::log::LogError;

/// Why it cannot be shown, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// Nothing was given.
    #[error(
        "{0}: there is no file in it; give a folder of recordings, which has a manifest.csv, or a zip file of one"
    )]
    Empty(String),
    /// None of what can be shown.
    #[error(
        "{0}: neither a session's log (.jsonl, `tactus device identify --log FILE`) nor recordings: of these give the \
             folder with its manifest.csv, or a zip file of it"
    )]
    Other(String),
    /// See [`LogError`].
    #[error("{0}: {1}")]
    Log(String, LogError),
    /// See [`RecordingError`].
    #[error(transparent)]
    Recordings(#[from] RecordingError),
}

/// What these files are, by what is in them.
///
/// # Errors
/// See [`OpenError`].
pub(super) fn open(files: Vec<File>) -> Result<Opened, OpenError> {
    if let [file] = &files[..]
        && (has_end(file, "jsonl") || has_end(file, "json") && !is_manifest(&file.name))
    {
        let read = replay(&file.bytes).map(Opened::Session);
        return read.map_err(|why| OpenError::Log(file.name.clone(), why));
    }
    let first = files.first().map(|file| file.name.clone());
    let first = first.ok_or_else(|| OpenError::Empty("what was given".to_owned()))?;
    // the manifest that lies highest
    let manifests = files.iter().filter(|file| is_manifest(&file.name));
    let depth = |file: &&File| file.name.matches('/').count();
    let Some(manifest) = manifests.min_by_key(depth) else {
        return Err(match first.split_once('/') {
            Some((folder, _)) => RecordingError::NoManifest(folder.into()).into(),
            None => OpenError::Other(first),
        });
    };
    let folder = manifest
        .name
        .rsplit_once('/')
        .map_or("", |(folder, _)| folder);
    let (folder, inside) = (folder.to_owned(), format!("{folder}/"));
    let within = files.into_iter().filter_map(|file| {
        let name = match folder.is_empty() {
            true => Some(&file.name[..]),
            false => file.name.strip_prefix(&inside),
        };
        Some((name?.to_owned(), file.bytes))
    });
    let within: BTreeMap<String, Vec<u8>> = within.collect();
    let set = RecordingSet::in_memory(&folder, within)?;
    Ok(Opened::Recordings(Recorded::of(&set)?))
}

fn has_end(file: &File, end: &str) -> bool {
    let of = file.name.rsplit_once('.').map(|(_, of)| of);
    of.is_some_and(|of| of.eq_ignore_ascii_case(end))
}

fn is_manifest(name: &str) -> bool {
    let name = name.rsplit('/').next().unwrap_or(name);
    [OWN_MANIFEST, BIOTAC_MANIFEST, INCOMPLETE].contains(&name)
}
