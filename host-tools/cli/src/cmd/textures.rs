//! Textures: those of a folder of recordings, and those of Table 1.

use std::path::Path;

use anyhow::Context as _;
use tactus_core::table::Table;
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::data::replay::{MeasuredSlide, measure_all};
use tactus_lab::eval::show::count;
use tactus_lab::sim::collection::{Collection, plain_name, texture_number};
use tactus_world::textures::TEXTURES;

use super::args::Only;
use super::names::{listed, nearest, unknown};
use super::progress::{notice, with_progress};

pub(crate) fn measure_folder(
    folder: &Path,
    only: &Only,
) -> anyhow::Result<(RecordingSet, Vec<Vec<MeasuredSlide>>)> {
    let set = only.open(folder)?;
    set.sensor().with_context(|| folder.display().to_string())?;
    let textures = set.textures().len() as u64;
    let measured = with_progress(textures, "measuring slides", |done| {
        measure_all(&set, |_| done())
    })
    .with_context(|| format!("recordings in {}", folder.display()))?;
    for (texture, slides) in set.textures().iter().zip(&measured) {
        let mut clipped = slides
            .iter()
            .filter_map(|s| Some((s.number, s.measurement.clipped?)));
        if let Some((number, why)) = clipped.next() {
            let more = match clipped.count() {
                0 => String::new(),
                more => format!(" (and {} more of it)", count(more as u64, "slide")),
            };
            notice(&format!("slide {number} of {}{more}: {why}", texture.name));
        }
    }
    Ok((set, measured))
}

/// That slides of this folder can be compared with those that a table was learned from.
pub(crate) fn of_one_finger(set: &RecordingSet, table: Table<'_>) -> anyhow::Result<()> {
    Ok(set.sensor()?.suits(&table)?)
}

/// Index of the texture that is meant by a number or a name.
pub(crate) fn find_material(set: &RecordingSet, wanted: &str) -> anyhow::Result<usize> {
    let number = wanted.trim_start_matches("mat").parse::<u32>().ok();
    let textures = set.textures();
    let named = textures
        .iter()
        .position(|t| t.name.eq_ignore_ascii_case(wanted));
    let as_completed = || {
        let plain = |name: &str| !wanted.is_empty() && plain_name(name) == wanted.to_lowercase();
        textures.iter().position(|t| plain(&t.name))
    };
    let numbered = || textures.iter().position(|t| Some(t.id) == number);
    let found = named.or_else(as_completed).or_else(numbered);
    found.with_context(|| {
        let folder = set.folder().display();
        let names: Vec<&str> = textures.iter().map(|t| t.name.as_str()).collect();
        match nearest(wanted, &names) {
            Some(name) => format!("--material {wanted}: not in {folder}; did you mean {name}?"),
            None => {
                let known = textures.iter().map(|t| format!("{} {}", t.id, t.name));
                let known = listed(&known.collect::<Vec<_>>());
                format!("--material {wanted}: not in {folder}, which has: {known}")
            }
        }
    })
}

/// The textures asked for, by name or number; without any, all.
pub(crate) fn find_textures(wanted: &[String]) -> anyhow::Result<Vec<u8>> {
    if wanted.is_empty() {
        return Ok(TEXTURES.iter().map(|t| t.number).collect());
    }
    let number = |name: &String| {
        texture_number(name.trim())
            .with_context(|| unknown(name.trim(), TEXTURES.iter().map(|t| t.name)))
    };
    wanted.iter().map(number).collect()
}

pub(crate) fn collection(wanted: &[String], trials: u32, seed: u64) -> anyhow::Result<Collection> {
    let mut textures = find_textures(wanted)?;
    textures.sort_unstable();
    textures.dedup();
    Ok(Collection::new(seed, textures, trials))
}
