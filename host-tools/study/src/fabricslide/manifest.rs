//! `manifest.json` of a folder of fabrics: read, checked, and searched for the movements that all fabrics share.
//!
//! Fields that are read from it: per file its name, fabric and both hashes, and per recording set-point, speed,
//! direction, repetition, its number of rows and the place of its first value.
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use tactus_core::features::Movement;

use super::error::FabricError;
use super::features::TAXELS;
use tactus_lab::data::recordings::files::{self, RecordingError};

/// Most bytes of samples of one fabric: it is read into memory as a whole, and all fabrics at once.
const MAX_RAW: u64 = 1 << 28;
/// Most recordings of one fabric. FabricSlide has 120.
const MAX_RECORDINGS: usize = 4096;

/// The contents of a manifest, checked.
#[derive(Debug)]
pub(super) struct Manifest {
    path: PathBuf,
    pub(super) fabrics: Vec<Entry>,
}

/// One fabric and its file.
#[derive(Debug)]
pub(super) struct Entry {
    pub(super) name: String,
    pub(super) file: String,
    sha256_gz: String,
    sha256_raw: String,
    bytes_raw: u64,
    /// Rows in the file.
    recordings: HashMap<Key, Range<usize>>,
}

/// A movement as the manifest has it, not yet known to be one that Tactus can make. Ordered by set-point, then speed.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub(super) struct Action {
    setpoint: u16,
    speed_um_s: u32,
}

/// Key of one recording of a fabric.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub(super) struct Key {
    action: Action,
    direction: i8,
    repetition: u8,
}

/// The movements that all fabrics share.
#[derive(Debug)]
pub(super) struct Shared {
    actions: Vec<Action>,
    /// The same in the same order.
    pub(super) movements: Vec<Movement>,
    pub(super) directions: Vec<i8>,
}

#[derive(Deserialize)]
struct Json {
    files: Vec<File>,
}

#[derive(Deserialize)]
struct File {
    file: String,
    fabric: String,
    sha256_gz: String,
    sha256_raw: String,
    slides: Vec<Recording>,
}

#[derive(Deserialize)]
struct Recording {
    pressure_setpoint: u16,
    speed_mm_s: f64,
    direction: i8,
    rep: u8,
    n: u64,
    offset_values: u64,
}

impl Manifest {
    /// Reads and checks a manifest.
    ///
    /// # Errors
    /// If it cannot be read, is no such manifest, or contradicts itself.
    pub(super) fn read(path: &Path) -> Result<Self, RecordingError> {
        let fault =
            |place: String, cause: String| RecordingError::at(path, format!("{place}: {cause}"));
        let bytes = files::read_bounded(path, files::MAX_MANIFEST)?;
        let json: Json = serde_json::from_slice(&bytes).map_err(|e| {
            let place = format!("line {}, column {}", e.line(), e.column());
            fault(
                place,
                format!("{e}; the layout is that of data/fabricslide"),
            )
        })?;
        if json.files.is_empty() {
            return Err(fault(
                "files".to_owned(),
                "no fabric is listed; list some".to_owned(),
            ));
        }
        let mut names = HashSet::new();
        let mut fabrics = Vec::new();
        for file in json.files {
            let place = format!("files, {}", file.file);
            if !names.insert(file.fabric.clone()) {
                let why = format!(
                    "a second file of the fabric {:?}; give each fabric one file and one name",
                    file.fabric
                );
                return Err(fault(place, why));
            }
            fabrics.push(Entry::of(file).map_err(|(slide, cause)| match slide {
                None => fault(place, cause),
                Some(index) => fault(format!("{place}, slides, entry {}", index + 1), cause),
            })?);
        }
        Ok(Self {
            path: path.to_owned(),
            fabrics,
        })
    }

    /// The movements and directions that all fabrics share, as the module's documentation says.
    ///
    /// # Errors
    /// If there are none, or one is no movement for Tactus.
    pub(super) fn shared(&self) -> Result<Shared, FabricError> {
        let directions: BTreeSet<i8> = self
            .fabrics
            .iter()
            .flat_map(|f| f.recordings.keys())
            .map(|k| k.direction)
            .collect();
        let per_direction: Vec<(i8, BTreeSet<Action>)> = directions
            .into_iter()
            .map(|direction| (direction, self.shared_in(direction)))
            .collect();
        // of equals the last, the positive one: if they share the same, both are taken in the end
        let most = per_direction
            .iter()
            .max_by_key(|(_, actions)| actions.len());
        let grid = most.map_or_else(BTreeSet::new, |(_, actions)| whole_grid(actions.clone()));
        if grid.is_empty() {
            return Err(FabricError::NothingShared {
                manifest: self.path.clone(),
                fabrics: self.fabrics.len(),
            });
        }
        let movements = grid.iter().map(|action| {
            Movement::try_from((action.setpoint, action.speed_um_s)).map_err(|e| {
                let cause = format!(
                    "{action}: {e} (the set-point stands in place of the force); take this movement out of the manifest"
                );
                RecordingError::at(&self.path, cause)
            })
        });
        Ok(Shared {
            movements: movements.collect::<Result<_, _>>()?,
            directions: per_direction
                .into_iter()
                .filter(|(_, actions)| actions.is_superset(&grid))
                .map(|(direction, _)| direction)
                .collect(),
            actions: grid.into_iter().collect(),
        })
    }

    /// The movements that every fabric has with both repetitions in one direction.
    fn shared_in(&self, direction: i8) -> BTreeSet<Action> {
        let Some((first, others)) = self.fabrics.split_first() else {
            return BTreeSet::new();
        };
        let both = |fabric: &Entry, action: Action| {
            [0, 1].iter().all(|&repetition| {
                fabric
                    .recordings
                    .contains_key(&action.of(direction, repetition))
            })
        };
        let actions = first.recordings.keys().map(|key| key.action);
        actions
            .filter(|&action| both(first, action) && others.iter().all(|f| both(f, action)))
            .collect()
    }
}

/// The rest after removing the set-point or speed that lacks the largest share of the movements, until none lacks any.
fn whole_grid(mut actions: BTreeSet<Action>) -> BTreeSet<Action> {
    loop {
        let mut setpoints: BTreeMap<u16, usize> = BTreeMap::new();
        let mut speeds: BTreeMap<u32, usize> = BTreeMap::new();
        for action in &actions {
            *setpoints.entry(action.setpoint).or_default() += 1;
            *speeds.entry(action.speed_um_s).or_default() += 1;
        }
        let (rows, columns) = (setpoints.len(), speeds.len());
        if actions.len() == rows * columns {
            return actions;
        }
        // a/columns < b/rows without a division; of equals the larger goes, which is harder on the fabric
        let setpoint = setpoints.into_iter().rev().min_by_key(|(_, count)| *count);
        let speed = speeds.into_iter().rev().min_by_key(|(_, count)| *count);
        if let (Some((setpoint, a)), Some((speed, b))) = (setpoint, speed) {
            if a * rows < b * columns {
                actions.retain(|action| action.setpoint != setpoint);
            } else {
                actions.retain(|action| action.speed_um_s != speed);
            }
        }
    }
}

impl Shared {
    /// The movements as the manifest has them.
    pub(super) fn keys(&self) -> impl Iterator<Item = Action> {
        self.actions.iter().copied()
    }
}

impl Action {
    /// A recording of this movement.
    pub(super) fn of(self, direction: i8, repetition: u8) -> Key {
        Key {
            action: self,
            direction,
            repetition,
        }
    }
}

impl fmt::Display for Action {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let speed = f64::from(self.speed_um_s) * 1e-3;
        write!(f, "set-point {} at {speed} mm/s", self.setpoint)
    }
}

impl Entry {
    /// Checks the recordings of a file; an error is the number of the recording, if it is one's, and the cause.
    fn of(file: File) -> Result<Self, (Option<usize>, String)> {
        if file.slides.is_empty() || file.slides.len() > MAX_RECORDINGS {
            let cause = format!(
                "the slides listed are {}, and 1 to {MAX_RECORDINGS} can be: add some, or split the file",
                file.slides.len()
            );
            return Err((None, cause));
        }
        let mut recordings = HashMap::new();
        let mut spans: Vec<(u64, u64, usize)> = Vec::new();
        for (index, slide) in file.slides.iter().enumerate() {
            let fault = |cause| (Some(index), cause);
            // `as` saturates and turns not-a-number into 0
            let speed_um_s = (slide.speed_mm_s * 1e3).round() as u32;
            let key = Action {
                setpoint: slide.pressure_setpoint,
                speed_um_s,
            }
            .of(slide.direction, slide.rep);
            if slide.rep > 1 {
                return Err(fault(format!(
                    "rep is {}; the two repetitions are 0 and 1: correct the manifest",
                    slide.rep
                )));
            }
            let end = slide
                .n
                .checked_mul(TAXELS as u64)
                .and_then(|values| values.checked_add(slide.offset_values))
                .filter(|end| *end <= MAX_RAW / 2);
            let Some(end) = end.filter(|_| slide.n > 0) else {
                let cause = format!(
                    "the rows, {} of 16 values from value {} on: a recording has 1 row at least, and a file no more than \
                     {} values; correct the manifest",
                    slide.n,
                    slide.offset_values,
                    MAX_RAW / 2
                );
                return Err(fault(cause));
            };
            // below MAX_RAW, so usize holds them
            let row = |value: u64| (value / TAXELS as u64) as usize;
            spans.push((slide.offset_values, end, index));
            let rows = row(slide.offset_values)..row(end);
            if recordings.insert(key, rows).is_some() {
                return Err(fault(format!(
                    "{}, direction {}, rep {} is listed twice; correct the manifest",
                    key.action, key.direction, key.repetition
                )));
            }
        }
        spans.sort_unstable();
        let mut bytes_raw = 0;
        for (start, end, index) in spans {
            if start != bytes_raw / 2 {
                let why = format!(
                    "offset_values is {start}, but the recording before it ends at {}; recordings follow each other without \
                     gap or overlap: correct the manifest",
                    bytes_raw / 2
                );
                return Err((Some(index), why));
            }
            bytes_raw = end * 2;
        }
        Ok(Self {
            name: file.fabric,
            file: file.file,
            sha256_gz: file.sha256_gz,
            sha256_raw: file.sha256_raw,
            bytes_raw,
            recordings,
        })
    }

    /// The rows of a recording.
    pub(super) fn rows(&self, key: Key) -> Option<Range<usize>> {
        self.recordings.get(&key).cloned()
    }

    /// All samples of the file, hashes checked before and after decompression.
    pub(super) fn samples(&self, path: &Path) -> Result<Vec<u8>, RecordingError> {
        if !path.is_file() {
            let cause = format!(
                "no such file, but the manifest names it; fetch it, or take {} out of the manifest",
                self.name
            );
            return Err(RecordingError::at(path, cause));
        }
        // twice the raw size is more than gzip ever needs
        let packed = files::read_bounded(path, self.bytes_raw * 2 + 4096)?;
        files::unpack(
            path,
            &packed,
            &self.sha256_gz,
            self.bytes_raw,
            &self.sha256_raw,
        )
    }
}
