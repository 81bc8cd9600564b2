//! Writing of recordings in the project's own format, so that an interrupted one can continue.
//!
//! Files of samples come first, then the slide's row, in `manifest.csv.part`, which becomes the manifest when all is
//! there. Beside it lies [`INCOMPLETE`], which names the recording in progress: the same command continues after any
//! interruption, and no other one writes into the folder. A lock keeps a second command out meanwhile. A command that
//! fails removes what it made, unless that was made [by hand](RecordingWriter::by_hand).

use std::collections::HashSet;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Read as _, Write as _};
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use tactus_core::sensor::FingerCode;

use super::files::{
    BIOTAC_MANIFEST, INCOMPLETE, OWN_MANIFEST as MANIFEST, RecordingError, Result, check_hash,
    check_text, distinct_textures, inside, open, read_bounded, sha256,
};
use super::own::{COLUMNS, LABELS, VERSION};
use super::{Sensor, npy};
use crate::data::program::program;
use crate::data::recording::{Labels, PAC_RATE_HZ, Recording, Texture};
use crate::data::whole::{Lock, NewOutputs, sync_folder};

const ROWS: &str = "manifest.csv.part";
const LOCK: &str = "INCOMPLETE.lock";
/// Columns of [`COLUMNS`]: texture, name, slide; and of files, each followed by or before its hash.
const KEY: [usize; 3] = [0, 1, 2];
const FILES: [(usize, usize); 4] = [(8, 9), (10, 12), (13, 15), (16, 18)];

/// Writes a folder in the project's own format, slide by slide.
#[derive(Debug)]
pub struct RecordingWriter {
    folder: PathBuf,
    textures: Vec<Texture>,
    labels: Labels,
    rows: Vec<Vec<String>>,
    keys: HashSet<(usize, u32)>,
    journal: File,
    by_hand: bool,
    /// no other command writes into the folder; it goes before what is made, which may be the folder
    _lock: Lock,
    made: NewOutputs,
}

impl RecordingWriter {
    /// Starts the recordings of `textures` in `folder`, which is made if it is not there, or continues the unfinished
    /// ones of the same `command`: [`has`](Self::has) returns the slides that are there.
    /// Errors: if the folder cannot be made, or holds recordings, or unfinished ones of another command, or other
    /// files, or another command writes into it now; or two textures have one number.
    pub fn begin(folder: &Path, textures: Vec<Texture>, command: &str) -> Result<Self> {
        let note = &note(command);
        distinct_textures(&folder.join(MANIFEST), &textures)?;
        for texture in &textures {
            check_text(&folder.join(MANIFEST), "texture", &texture.name)?;
        }
        let mut made = NewOutputs::default();
        made.folder(folder).map_err(|e| io_error(folder, e))?;
        let lock = Lock::take(&folder.join(LOCK)).map_err(|why| match why.kind() {
            ErrorKind::ResourceBusy => {
                let cause = "another command writes recordings here now: wait for that one, or give another folder";
                RecordingError::at(folder, cause)
            }
            _ => io_error(folder, why),
        })?;
        // the last moment of a command that ended after all was whole
        if folder.join(MANIFEST).exists() && read_note(folder)?.as_ref() == Some(note) {
            drop(fs::remove_file(folder.join(INCOMPLETE)));
            return Err(taken(folder, MANIFEST));
        }
        for manifest in [MANIFEST, BIOTAC_MANIFEST] {
            if folder.join(manifest).exists() {
                return Err(taken(folder, manifest));
            }
        }
        let rows = match read_note(folder)? {
            Some(there) if there == *note => rows_there(folder, &textures)?,
            // it had not come to its first slide
            Some(_) if read_rows(folder)?.lines().count() < 2 => Vec::new(),
            Some(there) => return Err(RecordingError::unfinished(folder, &there)),
            None if is_empty(folder)? => Vec::new(),
            None => {
                let cause = "is not empty; give a new folder, so that nothing is mixed up";
                return Err(RecordingError::at(folder, cause));
            }
        };
        let keys = rows.iter().filter_map(|row| key(row, &textures)).collect();
        made.file(folder.join(INCOMPLETE));
        made.file(folder.join(ROWS));
        replace(folder, INCOMPLETE, note.as_bytes())?;
        Ok(Self {
            journal: journal(folder, &rows)?,
            folder: folder.to_owned(),
            textures,
            labels: Labels::default(),
            rows,
            keys,
            by_hand: false,
            _lock: lock,
            made,
        })
    }

    /// Recordings that took somebody's time: whole slides stay where a later one fails, and the same command continues.
    #[must_use]
    pub fn by_hand(mut self) -> Self {
        self.by_hand = true;
        self
    }

    #[must_use]
    pub(crate) fn labelled(mut self, labels: Labels) -> Self {
        self.label(labels);
        self
    }

    /// Gives these labels to the slides to come.
    pub fn label(&mut self, labels: Labels) {
        self.labels = labels;
    }

    /// Number of slides of a texture that are there.
    pub fn slides(&self, texture: usize) -> usize {
        self.keys.iter().filter(|(t, _)| *t == texture).count()
    }

    /// Returns true if this slide of a texture is there.
    pub fn has(&self, texture: usize, number: u32) -> bool {
        self.keys.contains(&(texture, number))
    }

    /// Leaves out the slides of a texture.
    /// Errors: if the rows cannot be written again.
    pub fn forget(&mut self, texture: usize) -> Result<()> {
        self.keys.retain(|(t, _)| *t != texture);
        let (textures, keys) = (&self.textures, &self.keys);
        self.rows
            .retain(|row| key(row, textures).is_some_and(|key| keys.contains(&key)));
        self.journal = journal(&self.folder, &self.rows)?;
        Ok(())
    }

    /// Notes for the slides from here on whether the sample was moved or turned before.
    pub fn moved(&mut self, moved: Option<bool>) {
        self.labels.moved = moved;
    }

    /// Writes the samples of one slide.
    /// Errors: if the slide makes no sense, was written before, or a file cannot be written.
    pub fn write(&mut self, slide: &Recording) -> Result<()> {
        let manifest = self.folder.join(MANIFEST);
        let place = format!("slide {}", slide.number);
        let texture = &self.textures[slide.texture];
        check(texture, slide, &manifest)?;
        let labels = &self.labels;
        if labels.finger == FingerCode::OTHER {
            Sensor::named(&labels.sensor)
                .map_err(|why| RecordingError::at(&manifest, format!("sensor {why}")))?;
        }
        let texts = [
            &labels.lot,
            &labels.operator,
            &labels.note,
            &labels.session,
            &labels.run,
        ];
        for text in texts {
            // what would not be read again
            check_text(&manifest, &place, text)?;
        }
        if self.has(slide.texture, slide.number) {
            return Err(RecordingError::twice(
                &manifest,
                &place,
                texture.id,
                slide.number,
            ));
        }

        let (folder, made) = (&self.folder, &mut self.made);
        let row = row(texture, slide, &self.labels, |file, bytes| {
            put(folder, file, bytes, made)
        })?;
        let written = csv(std::iter::once(&row)).and_then(|row| self.journal.write_all(&row));
        written.map_err(|e| io_error(&self.folder.join(ROWS), e))?;
        self.rows.push(row);
        self.keys.insert((slide.texture, slide.number));
        Ok(())
    }

    /// Writes a file beside the slides.
    /// Errors: if it cannot be written.
    #[cfg(feature = "import")]
    pub(crate) fn put(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        put(&self.folder, name, bytes, &mut self.made)
    }

    /// Gives the manifest its name: from here on the folder holds recordings.
    /// Errors: if a texture has no slide, or the manifest cannot be written.
    pub fn finish(mut self) -> Result<()> {
        let manifest = self.folder.join(MANIFEST);
        let there: HashSet<usize> = self.keys.iter().map(|(texture, _)| *texture).collect();
        let mut textures = self.textures.iter().enumerate();
        if let Some((_, empty)) = textures.find(|(texture, _)| !there.contains(texture)) {
            return Err(RecordingError::empty_texture(&manifest, empty));
        }
        let names = self
            .rows
            .par_iter()
            .flat_map_iter(|row| FILES.map(|(file, _)| &row[file]));
        // of a stream that was not measured there is none
        names.filter(|name| !name.is_empty()).try_for_each(|name| {
            let path = self.folder.join(name);
            let kept = File::open(&path).and_then(|file| file.sync_all());
            kept.map_err(|e| io_error(&path, e))
        })?;
        self.journal
            .sync_all()
            .and_then(|()| fs::rename(self.folder.join(ROWS), &manifest))
            .map_err(|e| io_error(&manifest, e))?;
        self.made.keep();
        sync_folder(&manifest);
        let note = self.folder.join(INCOMPLETE);
        fs::remove_file(&note).map_err(|e| io_error(&note, e))
    }
}

impl Drop for RecordingWriter {
    fn drop(&mut self) {
        if self.by_hand && !self.rows.is_empty() {
            self.made.keep();
        }
    }
}

fn put(folder: &Path, name: &str, bytes: &[u8], made: &mut NewOutputs) -> Result<()> {
    let path = folder.join(name);
    made.file(path.clone());
    write_here(&path, bytes).map_err(|e| io_error(&path, e))
}

/// The row of a slide; its files are `put` where they belong.
fn row(
    texture: &Texture,
    slide: &Recording,
    labels: &Labels,
    mut put: impl FnMut(&str, &[u8]) -> Result<()>,
) -> Result<Vec<String>> {
    let mut stream = |stream: &str, samples: &[i16]| -> Result<[String; 2]> {
        let file = format!("t{:03}_s{:03}_{stream}.npy", texture.id, slide.number);
        let bytes = npy::write(samples);
        put(&file, &bytes)?;
        Ok([file, sha256(&bytes)])
    };
    let none = || [String::new(), String::new()];
    let (power, background) = match slide.background {
        // 0 counts^2 is no power of a sensor
        Some(0.0) => (String::new(), none()),
        Some(power) => (power.to_string(), none()),
        None => (String::new(), stream("still", &slide.still())?),
    };
    let pac = stream("pac", &slide.pac())?;
    let pdc = match &slide.pdc[..] {
        [] => none(),
        pdc => stream("pdc", pdc)?,
    };
    let shear = match slide.shear_mn() {
        Some(shear) => stream("shear", &shear)?,
        None => none(),
    };
    let known = |value| match value {
        0 => String::new(),
        _ => thousandths(value),
    };
    let mut row = vec![
        texture.id.to_string(),
        texture.name.trim().to_owned(),
        slide.number.to_string(),
        known(u32::from(slide.movement.force_mn())),
        known(slide.movement.speed_um_s()),
        slide.window.0.to_string(),
        slide.window.1.to_string(),
        power,
    ];
    row.extend(background);
    for ([file, sha256], rate) in [
        (pac, PAC_RATE_HZ.into()),
        (pdc, slide.pdc_rate_hz),
        (shear, slide.shear_rate_hz),
    ] {
        row.extend([file, rate.to_string(), sha256]);
    }
    row.extend([&labels.lot, &labels.operator, &labels.note].map(Clone::clone));
    let moved = labels.moved.map(|moved| if moved { "yes" } else { "no" });
    row.push(moved.unwrap_or_default().to_owned());
    row.push(match labels.finger {
        FingerCode::OTHER => labels.sensor.clone(),
        finger => finger.to_string(),
    });
    let day = (labels.calibrated != 0).then(|| labels.calibrated.to_string());
    row.push(day.unwrap_or_default());
    let pace = slide.pace.map(|pace| pace.to_string());
    row.push(pace.unwrap_or_default());
    row.push(VERSION.to_string());
    row.extend([&labels.session, &labels.run].map(Clone::clone));
    let highest = slide.highest_hz.map(|hz| hz.to_string());
    row.push(highest.unwrap_or_default());
    Ok(row)
}

/// The files of a folder of recordings of one texture, by their names, for those who have no file system; each slide
/// has labels.
/// Errors: A slide makes no sense.
pub fn files(texture: &Texture, slides: &[(Recording, Labels)]) -> Result<Vec<(String, Vec<u8>)>> {
    let mut files = Vec::new();
    let mut rows = vec![header()];
    for (slide, labels) in slides {
        check(texture, slide, Path::new(MANIFEST))?;
        rows.push(row(texture, slide, labels, |file, bytes| {
            files.push((file.to_owned(), bytes.to_vec()));
            Ok(())
        })?);
    }
    let manifest = csv(rows.iter()).map_err(|e| io_error(Path::new(MANIFEST), e))?;
    files.push((MANIFEST.to_owned(), manifest));
    Ok(files)
}

/// Text of the mark in a folder that is not whole.
fn note(command: &str) -> String {
    format!(
        "{command}\nThe same command continues these recordings; to begin anew, remove this folder.\n({})\n",
        program()
    )
}

fn read_note(folder: &Path) -> Result<Option<String>> {
    match open(&inside(folder, INCOMPLETE, INCOMPLETE)?).and_then(io::read_to_string) {
        Ok(note) => Ok(Some(note)),
        Err(why) if why.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(why) => Err(io_error(&folder.join(INCOMPLETE), why)),
    }
}

/// Returns true if it holds no files of others.
fn is_empty(folder: &Path) -> Result<bool> {
    let mut names = fs::read_dir(folder).map_err(|e| io_error(folder, e))?;
    // a command that ended when it had only begun leaves a part of its note
    let is_ours = |name: std::ffi::OsString| name == PART || name == LOCK;
    Ok(names.all(|entry| entry.is_ok_and(|entry| is_ours(entry.file_name()))))
}

fn header() -> Vec<String> {
    let columns = COLUMNS.into_iter().chain(LABELS);
    columns.map(str::to_owned).collect()
}

/// The index of a row's texture, and the number of its slide.
fn key(row: &[String], textures: &[Texture]) -> Option<(usize, u32)> {
    let [id, name, number] = KEY.map(|column| row.get(column));
    let (id, number): (u32, u32) = (id?.parse().ok()?, number?.parse().ok()?);
    let same = |t: &Texture| t.id == id && Some(t.name.trim()) == name.map(String::as_str);
    Some((textures.iter().position(same)?, number))
}

fn read_rows(folder: &Path) -> Result<String> {
    let path = inside(folder, ROWS, ROWS)?;
    let mut bytes = Vec::new();
    match open(&path).and_then(|mut rows| rows.read_to_end(&mut bytes)) {
        // a character that is cut is in the last row
        Ok(_) => Ok(String::from_utf8_lossy(&bytes).into_owned()),
        Err(why) if why.kind() == std::io::ErrorKind::NotFound => Ok(String::new()),
        Err(why) => Err(io_error(&path, why)),
    }
}

/// The rows of a command that ended, up to the first that is not whole, or whose files are not.
fn rows_there(folder: &Path, textures: &[Texture]) -> Result<Vec<Vec<String>>> {
    let text = read_rows(folder)?;
    // a row that was cut short is not believed
    let (whole, _) = text.rsplit_once('\n').unwrap_or_default();
    let mut reader = csv::Reader::from_reader(whole.as_bytes());
    if reader.headers().is_ok_and(|there| *there != header()) {
        return Ok(Vec::new());
    }
    let is_whole = |row: &Vec<String>| {
        row.len() == header().len()
            && key(row, textures).is_some()
            && FILES
                .iter()
                .all(|&(file, hash)| is_there(folder, &row[file], &row[hash]))
    };
    Ok(reader
        .records()
        .map_while(std::result::Result::ok)
        .map(|row| row.iter().map(str::to_owned).collect::<Vec<String>>())
        .take_while(is_whole)
        .collect())
}

/// Returns true if a file that a row names is unchanged; a stream that was not measured has none.
fn is_there(folder: &Path, file: &str, hash: &str) -> bool {
    file.is_empty()
        || inside(folder, ROWS, file)
            .and_then(|path| {
                let bytes = read_bounded(&path, npy::MAX_BYTES)?;
                check_hash(&path, "the file", &bytes, hash)
            })
            .is_ok()
}

/// A file of these rows, to which others can be added.
fn journal(folder: &Path, rows: &[Vec<String>]) -> Result<File> {
    let path = folder.join(ROWS);
    let header = header();
    let text = csv(std::iter::once(&header).chain(rows)).map_err(|e| io_error(&path, e))?;
    replace(folder, ROWS, &text)?;
    let journal = OpenOptions::new().append(true).open(&path);
    journal.map_err(|e| io_error(&path, e))
}

fn csv<'r>(rows: impl Iterator<Item = &'r Vec<String>>) -> std::io::Result<Vec<u8>> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    for row in rows {
        csv.write_record(row)?;
    }
    csv.into_inner().map_err(|e| e.into_error())
}

const PART: &str = "INCOMPLETE.part";

/// Writes a file at this place, not where a link leads to from it.
fn write_here(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if fs::symlink_metadata(path).is_ok_and(|there| !there.is_file()) {
        fs::remove_file(path)?;
    }
    fs::write(path, bytes)
}

/// Writes a file of the folder, whole or not at all.
fn replace(folder: &Path, name: &str, bytes: &[u8]) -> Result<()> {
    let (part, path) = (folder.join(PART), folder.join(name));
    let replaced = write_here(&part, bytes).and_then(|()| fs::rename(&part, &path));
    replaced.map_err(|e| {
        let _ = fs::remove_file(&part);
        io_error(&path, e)
    })
}

fn thousandths(value: u32) -> String {
    format!("{}.{:03}", value / 1000, value % 1000)
}

fn io_error(path: &Path, cause: std::io::Error) -> RecordingError {
    RecordingError::at(path, cause)
}

fn taken(folder: &Path, manifest: &str) -> RecordingError {
    let cause =
        format!("already holds recordings ({manifest}); give a new folder, or remove these first");
    RecordingError::at(folder, cause)
}

fn check(texture: &Texture, slide: &Recording, manifest: &Path) -> Result<()> {
    slide.check().map_err(|cause| {
        let (id, number) = (texture.id, slide.number);
        RecordingError::at(manifest, format!("texture {id}, slide {number}: {cause}"))
    })
}
