//! The project's own format: `manifest.csv` with one row per slide, and one `.npy` file per slide and stream, which
//! `numpy.load` opens in one line. This page is the format's reference.
//!
//! | column | what it holds |
//! |---|---|
//! | `texture` | number of the texture; the same number always has the same name |
//! | `name` | name of the texture, without spaces around it |
//! | `slide` | number of the slide; slides of a texture are numbered in the order of time, each number once |
//! | `force_n`, `speed_mm_s` | the movement: contact force in N, sliding speed in mm/s |
//! | `window_start_s`, `window_end_s` | the steady part, in s from the start of the record |
//! | `background_power` | power of P_AC without texture after the band-pass, in counts^2; empty if there is a file |
//! | `background_file`, `background_sha256` | P_AC of the finger at rest, like `pac_file`; empty if there is a power |
//! | `pac_file`, `pac_rate_hz`, `pac_sha256` | P_AC in counts about the still baseline; the rate is 2200 |
//! | `pdc_file`, `pdc_rate_hz`, `pdc_sha256` | P_DC in counts about the still baseline |
//! | `shear_file`, `shear_rate_hz`, `shear_sha256` | tangential force in mN, positive against the motion; file and hash are empty where it was not measured |
//!
//! Columns may come in any order, others are ignored. Files are named relative to the folder and lie inside it; each is a
//! one-dimensional array of `<i2` (numpy.int16). The hash is the SHA-256 of the whole file in hexadecimal. The rows may come
//! in any order; textures are taken in the order of their first row.
use std::collections::HashSet;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use tactus_core::features::Movement;

use super::files::{
    BIOTAC_MANIFEST, OWN_MANIFEST as MANIFEST, RecordingError, Result, check_hash,
    distinct_textures, in_order_of_time, inside, read_bounded, sha256,
};
use super::npy;
use crate::data::content::ContentError;
use crate::data::recording::{PAC_RATE_HZ, Recording, SlideKey, Texture};
use crate::data::rows::{Row, RowError, Rows};

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

/// What the manifest says, checked.
#[derive(Debug)]
pub struct Manifest {
    textures: Vec<(Texture, Vec<Entry>)>,
}

/// One row.
#[derive(Debug)]
struct Entry {
    line: u64,
    number: u32,
    movement: Movement,
    window: (f32, f32),
    background: Background,
    pac: Stream,
    pdc: Stream,
    pdc_rate_hz: u32,
    shear: Option<Stream>,
    shear_rate_hz: u32,
}

#[derive(Debug)]
enum Background {
    Power(f32),
    Still(Stream),
}

/// A file of samples.
#[derive(Debug)]
struct Stream {
    file: String,
    sha256: String,
}

impl Manifest {
    /// Reads and checks a manifest.
    ///
    /// # Errors
    /// If it cannot be read, a row makes no sense, or two rows contradict each other.
    pub fn read(path: &Path) -> Result<Self> {
        let mut textures: Vec<(Texture, Vec<Entry>)> = Vec::new();
        let mut rows = Rows::open(path, &COLUMNS)?;
        while let Some(row) = rows.next_row()? {
            let texture = Texture {
                id: row.parse("texture", "the number of a texture")?,
                name: row.text("name").to_owned(),
            };
            let entry = Entry::of(&row)?;
            match textures.iter_mut().find(|(t, _)| *t == texture) {
                Some((_, entries)) => entries.push(entry),
                None => textures.push((texture, vec![entry])),
            }
        }
        if textures.is_empty() {
            return Err(RecordingError::Entry {
                path: path.to_owned(),
                place: "line 1".to_owned(),
                cause: ContentError::NoSlides,
            });
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

    /// The textures, and the slides of each.
    pub(super) fn contents(&self) -> (Vec<Texture>, Vec<Vec<SlideKey>>) {
        let key = |e: &Entry| SlideKey {
            number: e.number,
            movement: e.movement,
        };
        self.textures
            .iter()
            .map(|(t, entries)| (t.clone(), entries.iter().map(key).collect()))
            .unzip()
    }

    /// Reads all slides of one texture.
    pub(super) fn load(&self, folder: &Path, texture: usize) -> Result<Vec<Recording>> {
        let (_, entries) = &self.textures[texture];
        entries
            .iter()
            .map(|entry| entry.load(folder, texture))
            .collect()
    }
}

impl Entry {
    fn of(row: &Row<'_>) -> std::result::Result<Self, RowError> {
        let rate = |column| row.parse(column, "a rate in whole Hz");
        let movement = Movement::from_si(row.number("force_n")?, row.number("speed_mm_s")?)
            .map_err(|e| row.error(None, e.into()))?;
        let pac_rate_hz: u32 = rate("pac_rate_hz")?;
        if pac_rate_hz != PAC_RATE_HZ {
            let cause = ContentError::PacRate(pac_rate_hz);
            return Err(row.error(Some("pac_rate_hz"), cause));
        }
        let still = Stream::of(row, "background_file", "background_sha256")?;
        let background = match (row.text("background_power"), still) {
            ("", Some(still)) => Background::Still(still),
            (_, None) => Background::Power(row.number("background_power")?),
            (_, Some(_)) => {
                return Err(row.error(Some("background_power"), ContentError::TwoBackgrounds));
            }
        };
        let needed = |file, sha256| {
            Stream::of(row, file, sha256)?
                .ok_or_else(|| row.error(Some(file), ContentError::NoFile))
        };
        Ok(Self {
            line: row.line(),
            number: row.parse("slide", "the number of a slide")?,
            movement,
            window: (row.number("window_start_s")?, row.number("window_end_s")?),
            background,
            pac: needed("pac_file", "pac_sha256")?,
            pdc: needed("pdc_file", "pdc_sha256")?,
            pdc_rate_hz: rate("pdc_rate_hz")?,
            shear: Stream::of(row, "shear_file", "shear_sha256")?,
            shear_rate_hz: rate("shear_rate_hz")?,
        })
    }

    fn load(&self, folder: &Path, texture: usize) -> Result<Recording> {
        let pac = self.pac.load(folder)?;
        let pdc = self.pdc.load(folder)?;
        let shear = self.shear.as_ref().map(|s| s.load(folder)).transpose()?;
        let (background, still) = match &self.background {
            Background::Power(power) => (Some(*power), Vec::new()),
            Background::Still(still) => (None, still.load(folder)?),
        };
        let slide = Recording {
            texture,
            number: self.number,
            movement: self.movement,
            window: self.window,
            blocks: Vec::new(),
            background,
            pdc,
            pdc_rate_hz: self.pdc_rate_hz,
            outside_mn: None,
            shear_rate_hz: self.shear_rate_hz,
        };
        let slide = slide.cut(&still, &pac, shear.as_deref());
        slide.map_err(|cause| RecordingError::Entry {
            path: folder.join(MANIFEST),
            place: format!("line {}, {}", self.line, self.pac.file),
            cause,
        })
    }
}

impl Stream {
    /// The file and hash in two columns, if a file is named.
    fn of(
        row: &Row<'_>,
        file: &'static str,
        sha256: &'static str,
    ) -> std::result::Result<Option<Self>, RowError> {
        match (row.text(file), row.text(sha256)) {
            ("", "") => Ok(None),
            ("", _) => Err(row.error(Some(file), ContentError::HashAlone)),
            (_, "") => Err(row.error(Some(sha256), ContentError::FileAlone)),
            (name, hash) => Ok(Some(Self {
                file: name.to_owned(),
                sha256: hash.to_owned(),
            })),
        }
    }

    fn load(&self, folder: &Path) -> Result<Vec<i16>> {
        let path = inside(folder, MANIFEST, &self.file)?;
        let bytes = read_bounded(&path, npy::MAX_BYTES)?;
        check_hash(&path, "the file", &bytes, &self.sha256)?;
        npy::read(&bytes).map_err(|why| RecordingError::Samples {
            path,
            cause: why.into(),
        })
    }
}

/// Writes a folder in this format, slide by slide.
///
/// The manifest comes last, under another name first: a writer that is interrupted leaves samples without a manifest, which
/// is no recording, and a new writer may take the folder over.
#[derive(Debug)]
pub struct RecordingWriter {
    folder: PathBuf,
    textures: Vec<Texture>,
    /// rows of the manifest
    rows: Vec<Vec<String>>,
    /// texture and number of each
    keys: HashSet<(usize, u32)>,
}

impl RecordingWriter {
    /// Starts the recordings of `textures` in `folder`, which is made if it is not there.
    ///
    /// # Errors
    /// If the folder cannot be made or already holds recordings, or two textures have one number.
    pub fn create(folder: &Path, textures: Vec<Texture>) -> Result<Self> {
        distinct_textures(&folder.join(MANIFEST), &textures)?;
        fs::create_dir_all(folder).map_err(|e| io_error(folder, e))?;
        for manifest in [MANIFEST, BIOTAC_MANIFEST] {
            if folder.join(manifest).exists() {
                return Err(RecordingError::Taken {
                    folder: folder.to_owned(),
                    manifest,
                });
            }
        }
        Ok(Self {
            folder: folder.to_owned(),
            textures,
            rows: Vec::new(),
            keys: HashSet::new(),
        })
    }

    /// Writes the samples of one slide.
    ///
    /// # Errors
    /// If the slide makes no sense, was written before, or a file cannot be written.
    pub fn write(&mut self, slide: &Recording) -> Result<()> {
        let manifest = self.folder.join(MANIFEST);
        let place = format!("slide {}", slide.number);
        let texture = self.textures.get(slide.texture);
        let texture = texture.ok_or_else(|| RecordingError::NoTexture {
            folder: self.folder.clone(),
            index: slide.texture,
            count: self.textures.len(),
        })?;
        slide.check().map_err(|cause| RecordingError::Entry {
            path: manifest.clone(),
            place: format!("texture {}, {place}", texture.id),
            cause,
        })?;
        if self.keys.contains(&(slide.texture, slide.number)) {
            return Err(RecordingError::DuplicateSlide {
                manifest,
                place,
                id: texture.id,
                number: slide.number,
            });
        }

        let stream = |stream: &str, samples: &[i16]| -> Result<[String; 2]> {
            let file = format!("t{:03}_s{:03}_{stream}.npy", texture.id, slide.number);
            let path = self.folder.join(&file);
            let bytes = npy::write(samples);
            fs::write(&path, &bytes).map_err(|e| io_error(&path, e))?;
            Ok([file, sha256(&bytes)])
        };
        let none = || [String::new(), String::new()];
        let (power, background) = match slide.background {
            Some(power) => (power.to_string(), none()),
            None => (String::new(), stream("still", &slide.still())?),
        };
        let pac = stream("pac", &slide.pac())?;
        let pdc = stream("pdc", &slide.pdc)?;
        let shear = match slide.shear_mn() {
            Some(shear) => stream("shear", &shear)?,
            None => none(),
        };
        let mut row = vec![
            texture.id.to_string(),
            texture.name.trim().to_owned(),
            slide.number.to_string(),
            thousandths(u32::from(slide.movement.force_mn())),
            thousandths(slide.movement.speed_um_s()),
            slide.window.0.to_string(),
            slide.window.1.to_string(),
            power,
        ];
        row.extend(background);
        for ([file, sha256], rate) in [
            (pac, PAC_RATE_HZ),
            (pdc, slide.pdc_rate_hz),
            (shear, slide.shear_rate_hz),
        ] {
            row.extend([file, rate.to_string(), sha256]);
        }
        self.rows.push(row);
        self.keys.insert((slide.texture, slide.number));
        Ok(())
    }

    /// Writes the manifest: from here on the folder holds recordings.
    ///
    /// # Errors
    /// If a texture has no slide, or the manifest cannot be written.
    pub fn finish(self) -> Result<()> {
        let manifest = self.folder.join(MANIFEST);
        for (index, texture) in self.textures.iter().enumerate() {
            if !self.keys.iter().any(|(t, _)| *t == index) {
                return Err(RecordingError::EmptyTexture {
                    manifest,
                    id: texture.id,
                    name: texture.name.clone(),
                });
            }
        }
        let mut csv = csv::Writer::from_writer(Vec::new());
        let text = csv
            .write_record(COLUMNS)
            .and_then(|()| self.rows.iter().try_for_each(|row| csv.write_record(row)))
            .map_err(std::io::Error::from)
            .and_then(|()| csv.into_inner().map_err(|e| e.into_error()))
            .map_err(|e| io_error(&manifest, e))?;
        let part = self.folder.join("manifest.csv.part");
        let written = File::create(&part).and_then(|mut file| {
            file.write_all(&text)?;
            file.sync_all()
        });
        written.map_err(|e| io_error(&part, e))?;
        fs::rename(&part, &manifest).map_err(|e| io_error(&manifest, e))
    }
}

/// A value in thousandths as a decimal number.
fn thousandths(value: u32) -> String {
    format!("{}.{:03}", value / 1000, value % 1000)
}

fn io_error(path: &Path, cause: std::io::Error) -> RecordingError {
    RecordingError::Io {
        path: path.to_owned(),
        cause,
    }
}
