//! The project's own format: `manifest.csv` with one row per slide, and one `.npy` file per slide and stream, which
//! `numpy.load` opens in one line. This page is the format's reference.
//!
//! | column | what it holds |
//! |---|---|
//! | `name` | name of the texture, without spaces around it |
//! | `pac_file`, `pac_rate_hz`, `pac_sha256` | P_AC in counts about the still baseline; 500 to 192000 Hz |
//! | `texture` | number of the texture; the same number always has the same name; empty: the next that is free |
//! | `slide` | number of the slide of its texture, in the order of time, each once; empty: one more than the last |
//! | `force_n`, `speed_mm_s` | the movement: contact force in N, sliding speed in mm/s; empty if unknown |
//! | `window_start_s`, `window_end_s` | the steady part, in s from the record's start; empty for its start and end |
//! | `background_power` | power of P_AC without texture after the band-pass, in counts^2; empty if not measured |
//! | `background_file`, `background_sha256` | P_AC of the finger at rest, like `pac_file`; empty if not measured |
//! | `pdc_file`, `pdc_rate_hz`, `pdc_sha256` | P_DC in counts about the still baseline; empty if not measured |
//! | `shear_file`, `shear_rate_hz`, `shear_sha256` | tangential force against the motion, mN; empty if not measured |
//! | `lot`, `operator`, `note` | batch or piece, operator, remark |
//! | `moved` | sample moved or turned since the slide before: `yes`, `no`, or empty if unknown |
//! | `session`, `run` | session, and run of the machine in it |
//! | `finger` | `biotac`, `analog`, `mems`, or another sensor's name, not `tactus-...`; empty for a BioTac |
//! | `highest_hz` | highest frequency that the sensor measures, Hz; empty for 1100 |
//! | `calibrated` | day of the force calibration, as 20261121; 1: day unknown; 0 or empty: none, or unknown |
//! | `pace` | ln(mean speed / `speed_mm_s`) in 1/1024, by a sensor of motion; empty if not measured |
//! | `version` | version of this format, 1; empty for 1 |
//!
//! P_AC of another rate than 2200 Hz is resampled, band-limited, where it is read; what a slower one could not measure
//! is left out. `name`, `pac_file` and `pac_rate_hz` must be there. Any other cell may be empty, and any other column
//! missing. The rate of P_DC and of shear, where it is empty, is that by which their samples last as long as those of
//! P_AC.
//!
//! Columns may come in any order, others are ignored. Files are named relative to the folder and lie inside it, and
//! symbolic links do not lead out; each is a one-dimensional array of `<i2` (numpy.int16) of 262144 samples at most.
//! The hash is the SHA-256 of the whole file in hexadecimal, or empty. The rows may come in any order; textures are
//! taken in the order of their first row. Texts hold no character that does not print.
//!
//! All streams of a slide cover the same time. Commands refuse a slide, and `tactus import` leaves it out, where P_AC
//! does not change for 100 ms, stands at an end of the converter's range, has more than a quarter of its samples there,
//! has more than a third of the samples of other slides in it, shifted or not, or lasts longer or shorter than another
//! stream. They report more than 1 % of samples at an end of the range.
use std::collections::HashMap;
use std::collections::hash_map::Entry as Place;
use std::path::Path;
use std::str::FromStr;

use super::files::{
    OWN_MANIFEST as MANIFEST, RecordingError, Result, check_hash, distinct_textures,
    in_order_of_time, inside, read_named,
};
use super::{Sensor, npy};
use crate::data::recording::{LEAVE_OUT, Labels, PAC_RATE_HZ, Recording, SlideKey, Texture};
use crate::data::rows::{Row, Rows};
use tactus_core::features::Movement;

/// Its columns, in the order in which they are written.
pub const COLUMNS: [&str; 19] = [
    "texture",
    "name",
    "slide",
    "force_n",
    "speed_mm_s",
    "window_start_s",
    "window_end_s",
    "background_power",
    "background_file",
    "background_sha256",
    "pac_file",
    "pac_rate_hz",
    "pac_sha256",
    "pdc_file",
    "pdc_rate_hz",
    "pdc_sha256",
    "shear_file",
    "shear_rate_hz",
    "shear_sha256",
];

/// Those of [`COLUMNS`] that no recording does without.
const NEEDED: [&str; 3] = ["name", "pac_file", "pac_rate_hz"];
/// Rate of P_DC and shear, Hz, where they were not measured.
const SLOW_HZ: f64 = 100.0;

/// Version of the format.
pub const VERSION: u32 = 1;

/// Columns that follow them, and may be missing: not everybody measures, or notes, what they hold.
pub(crate) const LABELS: [&str; 11] = [
    "lot",
    "operator",
    "note",
    "moved",
    "finger",
    "calibrated",
    "pace",
    "version",
    "session",
    "run",
    "highest_hz",
];

/// The contents of a manifest, checked.
#[derive(Debug)]
pub struct Manifest {
    textures: Vec<(Texture, Vec<Entry>)>,
}

#[derive(Debug)]
struct Entry {
    line: u64,
    number: u32,
    movement: Movement,
    labels: Labels,
    window: [Option<f32>; 2],
    background: Background,
    pac: Stream,
    pac_rate_hz: f64,
    pdc: Option<Stream>,
    pdc_rate_hz: Option<f64>,
    shear: Option<Stream>,
    shear_rate_hz: Option<f64>,
    pace: Option<i16>,
    highest_hz: Option<f32>,
}

#[derive(Debug)]
enum Background {
    Power(f32),
    Still(Stream),
}

#[derive(Debug)]
struct Stream {
    file: String,
    /// empty: it is not checked
    sha256: String,
}

impl Manifest {
    /// Reads and checks a manifest.
    /// Errors: if it cannot be read, a row makes no sense, or two rows contradict each other.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = &inside(folder, MANIFEST, MANIFEST)?;
        let mut textures: Vec<(Texture, Vec<Entry>)> = Vec::new();
        let mut places: HashMap<Texture, usize> = HashMap::new();
        let optional = COLUMNS.into_iter().filter(|name| !NEEDED.contains(name));
        let optional: Vec<&str> = optional.chain(LABELS).collect();
        let mut rows = Rows::open(path, &NEEDED, &optional)?;
        let mut numbers = Numbers::default();
        while let Some(row) = rows.next_row()? {
            let texture = numbers.texture(&row)?;
            let entry = Entry::of(&row, numbers.slide(&row, texture.id)?)?;
            match places.entry(texture) {
                Place::Occupied(place) => textures[*place.get()].1.push(entry),
                Place::Vacant(place) => {
                    textures.push((place.key().clone(), vec![entry]));
                    place.insert(textures.len() - 1);
                }
            }
        }
        if textures.is_empty() {
            let cause = "line 1: no slide is listed below the header; record some";
            return Err(RecordingError::at(path, cause));
        }
        let names: Vec<Texture> = textures.iter().map(|(t, _)| t.clone()).collect();
        distinct_textures(path, &names)?;
        for (texture, entries) in &mut textures {
            in_order_of_time(
                path,
                texture.id,
                entries,
                |e| e.number,
                |e| format!("line {}", e.line),
            )?;
        }
        Ok(Self { textures })
    }

    /// Keeps the slides of these labels.
    pub(super) fn retain(&mut self, is_one: impl Fn(&Labels) -> bool) {
        for (_, entries) in &mut self.textures {
            entries.retain(|entry| is_one(&entry.labels));
        }
        self.textures.retain(|(_, entries)| !entries.is_empty());
    }

    pub(super) fn contents(&self) -> (Vec<Texture>, Vec<Vec<SlideKey>>) {
        let key = |e: &Entry| SlideKey {
            number: e.number,
            movement: e.movement,
            labels: e.labels.clone(),
        };
        self.textures
            .iter()
            .map(|(t, entries)| (t.clone(), entries.iter().map(key).collect()))
            .unzip()
    }

    pub(super) fn each_slide(
        &self,
        folder: &Path,
        texture: usize,
        take: &mut dyn FnMut(Recording) -> Result<()>,
    ) -> Result<()> {
        let (_, entries) = &self.textures[texture];
        let mut loaded = entries.iter().map(|entry| entry.load(folder, texture));
        loaded.try_for_each(|slide| take(slide?))
    }
}

/// The numbers of textures and slides where rows do not say them.
#[derive(Default)]
struct Numbers {
    /// the number of a texture by its name, and the largest one
    textures: HashMap<String, u32>,
    most: u32,
    /// the last slide of each texture
    slides: HashMap<u32, u32>,
}

impl Numbers {
    fn texture(&mut self, row: &Row<'_>) -> Result<Texture> {
        let name = row.shown("name")?;
        let id = match row.text("texture") {
            "" if name.is_empty() => {
                return Err(row.error(Some("name"), "is empty; give the texture's name"));
            }
            "" => self.textures.get(name).copied(),
            _ => Some(row.parse("texture", "the number of a texture")?),
        };
        let id = id.unwrap_or(self.most.saturating_add(1));
        self.most = self.most.max(id);
        self.textures.entry(name.to_owned()).or_insert(id);
        Ok(Texture {
            id,
            name: name.to_owned(),
        })
    }

    fn slide(&mut self, row: &Row<'_>, texture: u32) -> Result<u32> {
        let last = self.slides.entry(texture).or_default();
        *last = match row.text("slide") {
            "" => last.saturating_add(1),
            _ => row.parse("slide", "the number of a slide")?,
        };
        Ok(*last)
    }
}

/// True for rates that P_AC is read at.
fn is_read(rate_hz: f64) -> bool {
    #[cfg(feature = "import")]
    if crate::data::import::resample::RATES_HZ.contains(&rate_hz) {
        return true;
    }
    rate_hz == f64::from(PAC_RATE_HZ)
}

/// P_AC at its own rate, from the rate that it was recorded at.
fn resampled(samples: Vec<i16>, rate_hz: f64) -> Vec<i16> {
    #[cfg(feature = "import")]
    if rate_hz != f64::from(PAC_RATE_HZ) {
        use crate::data::import::resample::resample;
        let samples: Vec<f64> = samples.into_iter().map(f64::from).collect();
        // `as` saturates
        let resampled = resample(&samples, rate_hz.round() as u32, PAC_RATE_HZ);
        return resampled.into_iter().map(|x| x.round() as i16).collect();
    }
    let _ = rate_hz;
    samples
}

/// A number that may be unknown.
fn optional<T>(row: &Row<'_>, column: &'static str) -> Result<Option<T>>
where
    T: FromStr + Into<f64> + Copy,
{
    let there = !row.text(column).is_empty();
    there.then(|| row.number(column)).transpose()
}

impl Entry {
    fn of(row: &Row<'_>, number: u32) -> Result<Self> {
        if !row.text("version").is_empty() {
            let version: u32 = row.parse("version", "the number of a version")?;
            if version != VERSION {
                let cause = format!(
                    "version {version}, and this program reads version {VERSION}: write the recordings anew, or use \
                     the program that wrote them"
                );
                return Err(row.error(Some("version"), cause));
            }
        }
        let movement = Movement::partly(optional(row, "force_n")?, optional(row, "speed_mm_s")?)
            .map_err(|why| row.error(None, format!("{why}; {LEAVE_OUT}")))?;
        let pac_rate_hz: f64 = row.number("pac_rate_hz")?;
        if !is_read(pac_rate_hz) {
            let cause = format!(
                "{pac_rate_hz} Hz, and 500 to 192000 Hz are resampled to {PAC_RATE_HZ} Hz: `tactus import FOLDER NEW \
                 --rate {pac_rate_hz}` reads .npy files of a slower sensor, in folders of their textures"
            );
            return Err(row.error(Some("pac_rate_hz"), cause));
        }
        let still = Stream::of(row, "background_file", "background_sha256")?;
        let background = match (row.text("background_power"), still) {
            ("", Some(still)) => Background::Still(still),
            (_, None) => Background::Power(optional(row, "background_power")?.unwrap_or(0.0)),
            (_, Some(_)) => {
                let why = "there is a background_file too; leave one of them empty";
                return Err(row.error(Some("background_power"), why));
            }
        };
        let pac = Stream::of(row, "pac_file", "pac_sha256")?;
        Ok(Self {
            line: row.line(),
            number,
            movement,
            labels: labels(row)?,
            window: [
                optional(row, "window_start_s")?,
                optional(row, "window_end_s")?,
            ],
            background,
            pac: pac.ok_or_else(|| row.error(Some("pac_file"), "no file is named"))?,
            pac_rate_hz,
            pdc: Stream::of(row, "pdc_file", "pdc_sha256")?,
            pdc_rate_hz: optional(row, "pdc_rate_hz")?,
            shear: Stream::of(row, "shear_file", "shear_sha256")?,
            shear_rate_hz: optional(row, "shear_rate_hz")?,
            pace: match row.text("pace") {
                "" => None,
                _ => Some(row.parse("pace", "a whole number of 1/1024")?),
            },
            highest_hz: optional(row, "highest_hz")?,
        })
    }

    fn load(&self, folder: &Path, texture: usize) -> Result<Recording> {
        let pac = resampled(self.pac.load(folder)?, self.pac_rate_hz);
        let pdc = self.pdc.as_ref().map(|s| s.load(folder)).transpose()?;
        let shear = self.shear.as_ref().map(|s| s.load(folder)).transpose()?;
        let (background, still) = match &self.background {
            Background::Power(power) => (Some(*power), Vec::new()),
            Background::Still(still) => (None, resampled(still.load(folder)?, self.pac_rate_hz)),
        };
        let seconds = pac.len() as f64 / f64::from(PAC_RATE_HZ);
        // all streams cover the same time
        let rate = |said: Option<f64>, samples: Option<&Vec<i16>>| {
            let lasts = samples.map_or(SLOW_HZ, |all| all.len() as f64 / seconds.max(1e-3));
            said.unwrap_or(lasts)
        };
        let pdc_rate_hz = rate(self.pdc_rate_hz, pdc.as_ref());
        let shear_rate_hz = rate(self.shear_rate_hz, shear.as_ref());
        let ends = [(&pdc, pdc_rate_hz), (&shear, shear_rate_hz)];
        let ends = ends.map(|(samples, rate_hz)| Some(samples.as_ref()?.len() as f64 / rate_hz));
        let last = ends.into_iter().flatten().fold(seconds, f64::min);
        let [start, end] = self.window;
        let slide = Recording {
            texture,
            number: self.number,
            movement: self.movement,
            window: (start.unwrap_or(0.0), end.unwrap_or(last as f32)),
            blocks: Vec::new(),
            background,
            pdc_rate_hz,
            pdc: pdc.unwrap_or_default(),
            outside_mn: None,
            pace: self.pace,
            shear_rate_hz,
            highest_hz: self.highest_hz.or_else(|| {
                let slow = self.pac_rate_hz < f64::from(PAC_RATE_HZ);
                slow.then_some(self.pac_rate_hz as f32 / 2.0)
            }),
        };
        let slide = slide.cut(&still, &pac, shear.as_deref());
        slide.map_err(|cause| {
            let cause = format!("line {}, {}: {cause}", self.line, self.pac.file);
            RecordingError::at(&folder.join(MANIFEST), cause)
        })
    }
}

/// What a row says of its sample, its session and its sensor.
fn labels(row: &Row<'_>) -> Result<Labels> {
    let [lot, operator, note, session, run] = ["lot", "operator", "note", "session", "run"]
        .map(|column| row.shown(column).map(str::to_owned));
    let (finger, sensor) =
        Sensor::named(row.text("finger")).map_err(|why| row.error(Some("finger"), why))?;
    let moved = match row.text("moved") {
        "" => None,
        "yes" => Some(true),
        "no" => Some(false),
        other => {
            let other: String = other.chars().take(40).collect();
            let cause = format!("{other:?} is not yes, no or nothing");
            return Err(row.error(Some("moved"), cause));
        }
    };
    Ok(Labels {
        lot: lot?,
        operator: operator?,
        note: note?,
        moved,
        session: session?,
        run: run?,
        sensor,
        finger,
        calibrated: match row.text("calibrated") {
            "" => 0,
            _ => row.parse("calibrated", "a day as 20261121")?,
        },
    })
}

impl Stream {
    /// The file and hash in two columns, if a file is named.
    fn of(row: &Row<'_>, file: &'static str, sha256: &'static str) -> Result<Option<Self>> {
        match (row.text(file), row.text(sha256)) {
            ("", "") => Ok(None),
            ("", _) => Err(row.error(Some(file), "a hash, but no file is named")),
            (name, hash) => Ok(Some(Self {
                file: name.to_owned(),
                sha256: hash.to_owned(),
            })),
        }
    }

    fn load(&self, folder: &Path) -> Result<Vec<i16>> {
        let bytes = read_named(folder, MANIFEST, &self.file, npy::MAX_BYTES)?;
        let path = folder.join(&self.file);
        if !self.sha256.is_empty() {
            check_hash(&path, "the file", &bytes, &self.sha256)?;
        }
        npy::read(&bytes).map_err(|why| RecordingError::at(&path, why))
    }
}
