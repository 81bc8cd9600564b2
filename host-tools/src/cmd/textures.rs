//! Textures: those of a folder of recordings, and those of Table 1.

use std::path::Path;

use anyhow::Context as _;
use tactus::collection::{Collection, texture_number};
use tactus::recordings::RecordingSet;
use tactus::replay::{Felt, feel};
use tactus::sim::textures::TEXTURES;

use super::progress::progress;

/// Opens a folder and feels all of its slides.
pub(crate) fn feel_folder(folder: &Path) -> anyhow::Result<(RecordingSet, Vec<Vec<Felt>>)> {
    let set = RecordingSet::open(folder)?;
    let bar = progress(set.textures().len() as u64, "feeling slides");
    let felt = feel(&set, |_| bar.inc(1))
        .with_context(|| format!("recordings in {}", folder.display()))?;
    bar.finish_and_clear();
    Ok((set, felt))
}

pub(crate) fn names(set: &RecordingSet) -> Vec<String> {
    set.textures().iter().map(|t| t.name.clone()).collect()
}

pub(crate) fn find_material(set: &RecordingSet, wanted: &str) -> anyhow::Result<usize> {
    let number = wanted.trim_start_matches("mat").parse::<u32>().ok();
    let by_name = set
        .textures()
        .iter()
        .position(|t| t.name.eq_ignore_ascii_case(wanted));
    by_name
        .or_else(|| set.textures().iter().position(|t| Some(t.id) == number))
        .with_context(|| {
            let known: Vec<String> = set
                .textures()
                .iter()
                .map(|t| format!("{} {}", t.id, t.name))
                .collect();
            format!(
                "--material {wanted}: not in {}, which has: {}",
                set.folder().display(),
                known.join(", ")
            )
        })
}

/// The textures asked for, by name or number; without any, all.
pub(crate) fn find_textures(wanted: &[String]) -> anyhow::Result<Vec<u8>> {
    if wanted.is_empty() {
        return Ok(TEXTURES.iter().map(|t| t.number).collect());
    }
    wanted
        .iter()
        .map(|name| {
            texture_number(name.trim()).with_context(|| {
                let known: Vec<&str> = TEXTURES.iter().map(|t| t.name).collect();
                format!(
                    "no texture {name} in Table 1, which has: {}",
                    known.join(", ")
                )
            })
        })
        .collect()
}

/// The textures that are named, each once.
pub(crate) fn collection(wanted: &[String], trials: u32, seed: u64) -> anyhow::Result<Collection> {
    let mut textures = find_textures(wanted)?;
    textures.sort_unstable();
    textures.dedup();
    Ok(Collection {
        seed,
        textures,
        trials,
    })
}
