//! Import of recordings into the project's own format: from any folder that [`RecordingSet`] opens, and from the CSV
//! files of the BioTac's publisher.
//!
//! # The publisher's files
//! <https://github.com/dexrob/BioTac_slide_20_50> (Gao et al., IROS 2020) has `raw_data/matX/matX_N_bio.csv` and
//! `matX_N_cw.csv` for slide N over material X; `_cp`, `_cv`, `_jp`, `_jt`, `_jv` and `.pt` are not wanted here.
//!
//! - `_bio`: `timestamp,tdc,tac,pdc,pac1..pac22,ele1..ele19`, one row about every 10 ms with the 22 samples of P_AC
//!   since the row before; each row ends in a comma too many. P_DC and P_AC are |raw - baseline|, in counts.
//! - `_cw`: `timestamp,fx,fy,fz,tx,ty,tz`, the wrench at the arm's hand in N and Nm, in bursts of about 150 Hz; the arm
//!   slides along z, so that `fz` is the tangential force.
//!
//! The result of the import: `pac` row by row, `pdc` unchanged, `shear` = `fz` at the times of the rows of `_bio`,
//! interpolated, in mN. `data/biotac` was made in this way, and keeps the first 590 of some 600 rows: this was checked
//! by hand on rows of its slide 10 over material 1.
//!
//! **The signs of P_AC are not in the files; they are rebuilt** ([`signs`]): magnitudes are exact, power is exact,
//! spectra are good, zero crossings and the sign of the whole are not known. The sign of P_DC is not rebuilt.
//!
//! A slide whose rows are not 10 ms apart, whose samples no working sensor gives, or that is a copy of another, is left
//! out and named.
//!
//! The files name neither material nor force nor a still record: textures are called `matX`, and movement, window and
//! background are those of `data/biotac`.
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Display;
use std::fs;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use tactus_core::features::Movement;

use crate::data::quality::{DuplicateSearch, Fingerprint, check};
use crate::data::recording::{Recording, Texture};
use crate::data::recordings::biotac::{BACKGROUND_POWER, NOMINAL_FORCE_MN};
use crate::data::recordings::files::confined;
use crate::data::recordings::{RecordingError, RecordingSet, RecordingWriter, Result, is_there};
use crate::data::rows::Rows;

use settings::{SETTINGS, Settings};

mod cut;
pub mod foreign;
pub(crate) mod resample;
pub mod settings;
pub mod signals;
pub mod signs;

const SPEED_UM_S: u32 = 25_000;
/// The part at constant speed, in s.
const WINDOW: (f32, f32) = (0.5, 5.5);
const ROW_RATE_HZ: u32 = 100;
/// Longest slide that is imported, in rows: a minute. The publisher's last six seconds.
const MAX_ROWS: usize = 6000;

/// The outcome of an import.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct Imported {
    /// Number of textures.
    pub textures: usize,
    /// Number of slides.
    pub slides: usize,
    /// The slides that were left out, and why: samples are missing, or are those of a dead sensor or of another slide.
    pub left_out: Vec<String>,
    /// The slides whose P_AC is cut off a little, and how much.
    pub clipped: Vec<String>,
}

/// The slides of one texture on their way into a folder.
struct Copying<'w> {
    writer: &'w mut RecordingWriter,
    copies: &'w mut DuplicateSearch,
    texture: usize,
    name: String,
    written: usize,
    left_out: Vec<String>,
    clipped: Vec<String>,
}

impl<'w> Copying<'w> {
    fn new(
        writer: &'w mut RecordingWriter,
        copies: &'w mut DuplicateSearch,
        texture: usize,
        name: &str,
    ) -> Self {
        Self {
            writer,
            copies,
            texture,
            name: name.to_owned(),
            written: 0,
            left_out: Vec::new(),
            clipped: Vec::new(),
        }
    }

    /// Writes the next slide, unless it is there; one with a fault is left out.
    fn take(&mut self, number: u32, slide: std::result::Result<&Recording, String>) -> Result<()> {
        let name = format!("slide {number} of {}", self.name);
        let checked = slide.and_then(|slide| {
            let clipped = check(slide).map_err(|why| why.to_string())?;
            let added = self.copies.add(&Fingerprint::of(slide), name.clone());
            added.map_err(|why| why.to_string())?;
            Ok((slide, clipped))
        });
        let named = |why: &dyn Display| format!("{name}: {why}");
        match checked {
            Ok((slide, clipped)) => {
                self.clipped.extend(clipped.map(|why| named(&why)));
                self.written += 1;
                match self.writer.has(self.texture, number) {
                    true => Ok(()),
                    false => self.writer.write(slide),
                }
            }
            Err(why) => {
                self.left_out.push(named(&why));
                Ok(())
            }
        }
    }

    /// Ends the texture.
    /// Errors: all of its slides were left out.
    fn end(self, done: &mut Imported) -> Result<()> {
        done.slides += self.written;
        match self.left_out.first().filter(|_| self.written == 0) {
            Some(why) => {
                let of = &self.name;
                let cause = format!("no slide of {of} can be used, record others: {why}");
                Err(RecordingError::said(cause))
            }
            None => {
                done.left_out.extend(self.left_out);
                done.clipped.extend(self.clipped);
                Ok(())
            }
        }
    }
}

/// Returns true if a folder has one of the layouts that say everything themselves: the project's own, that of
/// `data/biotac`, or the publisher's files.
pub fn is_known(from: &Path) -> bool {
    let raw = from.join("raw_data");
    let raw = if raw.is_dir() { raw } else { from.to_owned() };
    is_there(from) || materials(&raw).is_ok_and(|materials| !materials.is_empty())
}

/// Converts the recordings in the folder `from` to the project's own format in the folder `to`; an interrupted import
/// continues. `progress` is called with the number of slides done, and of slides in all.
/// Errors: if there are no recordings in `from`, a file is damaged, or `to` already holds recordings or cannot be
/// written.
pub fn import(from: &Path, to: &Path, progress: &mut dyn FnMut(usize, usize)) -> Result<Imported> {
    if !from.is_dir() || is_there(from) {
        return copy(&RecordingSet::open(from)?, to, None, progress);
    }
    import_csv(from, to, progress)
}

/// Writes recordings in the project's own format into the folder `to`, as [`import`] does, and the settings that they
/// were read with beside them, if there are any.
/// Errors: as of [`import`].
pub fn copy(
    set: &RecordingSet,
    to: &Path,
    settings: Option<&Settings>,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Imported> {
    let mut done = Imported {
        textures: set.textures().len(),
        ..Imported::default()
    };
    let total = (0..done.textures).map(|t| set.slides(t).len()).sum();
    let mut writer = begin("import", set.folder(), to, set.textures().to_vec())?;
    let (mut copies, mut read) = (DuplicateSearch::default(), 0);
    for (texture, Texture { name, .. }) in set.textures().iter().enumerate() {
        let mut keys = set.slides(texture).iter();
        let mut copying = Copying::new(&mut writer, &mut copies, texture, name);
        set.each_slide(texture, &mut |slide| {
            let labels = keys.next().map(|key| key.labels.clone());
            copying.writer.label(labels.unwrap_or_default());
            copying.take(slide.number, Ok(&slide))?;
            read += 1;
            progress(read, total);
            Ok(())
        })?;
        copying.end(&mut done)?;
    }
    if let Some(settings) = settings {
        writer.put(SETTINGS, settings.template().as_bytes())?;
    }
    writer.finish()?;
    Ok(done)
}

fn import_csv(from: &Path, to: &Path, progress: &mut dyn FnMut(usize, usize)) -> Result<Imported> {
    let raw = from.join("raw_data");
    let raw = if raw.is_dir() { raw } else { from.to_owned() };
    confined(from, &raw)?;
    let materials = materials(&raw)?;
    if materials.is_empty() {
        let cause = "nothing to import: neither a manifest, nor raw_data/mat1/mat1_1_bio.csv and the like of \
                     https://github.com/dexrob/BioTac_slide_20_50; give the folder that holds raw_data or mat1, mat2, \
                     ...";
        return Err(RecordingError::at(from, cause));
    }
    let mut done = Imported {
        textures: materials.len(),
        ..Imported::default()
    };
    let total = materials.values().map(BTreeSet::len).sum();
    let textures = materials.keys().map(|&id| Texture {
        id,
        name: format!("mat{id}"),
    });
    let mut writer = begin("import", from, to, textures.collect())?;
    let (mut copies, mut read) = (DuplicateSearch::default(), 0);
    for (texture, (&material, numbers)) in materials.iter().enumerate() {
        let name = format!("mat{material}");
        let folder = raw.join(&name);
        confined(from, &folder)?;
        // a few slides at a time: rebuilding the signs takes most of a second each
        let numbers: Vec<u32> = numbers.iter().copied().collect();
        let mut copying = Copying::new(&mut writer, &mut copies, texture, &name);
        for some in numbers.chunks(2 * rayon::current_num_threads()) {
            let slides: Vec<_> = some
                .par_iter()
                .map(|&number| {
                    let slide = match SlideFiles::read(&folder, material, number)? {
                        Ok(files) => Ok(files.slide(texture, number)?),
                        Err(jump) => Err(jump),
                    };
                    Ok((number, slide))
                })
                .collect::<Result<_>>()?;
            for (number, slide) in &slides {
                copying.take(*number, slide.as_ref().map_err(Clone::clone))?;
                read += 1;
                progress(read, total);
            }
        }
        copying.end(&mut done)?;
    }
    writer.finish()?;
    Ok(done)
}

/// The slide numbers of each `matX` below `raw`. A slide of which only one file is there is listed too, so that reading
/// it names the missing one.
fn materials(raw: &Path) -> Result<BTreeMap<u32, BTreeSet<u32>>> {
    let mut materials = BTreeMap::new();
    for folder in names(raw)? {
        let material = folder.strip_prefix("mat").and_then(number);
        let Some(material) = material.filter(|_| raw.join(&folder).is_dir()) else {
            continue;
        };
        let numbers: BTreeSet<u32> = names(&raw.join(&folder))?
            .iter()
            .filter_map(|file| {
                let rest = file.strip_prefix(&folder)?.strip_prefix('_')?;
                let stem = rest.strip_suffix(".csv")?;
                number(stem.strip_suffix("_bio").or(stem.strip_suffix("_cw"))?)
            })
            .collect();
        if !numbers.is_empty() {
            materials.insert(material, numbers);
        }
    }
    Ok(materials)
}

/// A number written without sign and leading zeros, as the publisher does.
fn number(text: &str) -> Option<u32> {
    text.parse().ok().filter(|n: &u32| n.to_string() == text)
}

fn names(folder: &Path) -> Result<Vec<String>> {
    let io_error = |why: std::io::Error| RecordingError::at(folder, why);
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(io_error)? {
        // the publisher's names are ASCII: others are not his
        names.extend(entry.map_err(io_error)?.file_name().into_string());
    }
    Ok(names)
}

fn begin(command: &str, from: &Path, to: &Path, textures: Vec<Texture>) -> Result<RecordingWriter> {
    let from = fs::canonicalize(from).unwrap_or_else(|_| from.to_owned());
    let command = format!("tactus {command} {} ...", from.display());
    RecordingWriter::begin(to, textures, &command)
}

struct SlideFiles {
    bio_path: PathBuf,
    bio: Bio,
    shear: Vec<i16>,
}

impl SlideFiles {
    /// The files, or the place where a clock jumps.
    fn read(
        folder: &Path,
        material: u32,
        number: u32,
    ) -> Result<std::result::Result<Self, String>> {
        let file = |kind| folder.join(format!("mat{material}_{number}_{kind}.csv"));
        let (bio_path, cw_path) = (file("bio"), file("cw"));
        confined(folder, &bio_path)?;
        confined(folder, &cw_path)?;
        let bio = read_bio(&bio_path)?;
        let (force, force_jump) = read_force(&cw_path)?;
        if let Some(jump) = bio.jump.clone().or(force_jump) {
            return Ok(Err(jump));
        }
        let shear =
            interpolate(&force, &bio.times).map_err(|cause| RecordingError::at(&cw_path, cause))?;
        Ok(Ok(Self {
            bio_path,
            bio,
            shear,
        }))
    }

    /// The slide, with the signs of its P_AC, which take most of a second.
    fn slide(self, texture: usize, number: u32) -> Result<Recording> {
        let fault = |cause: String| RecordingError::at(&self.bio_path, cause);
        let movement =
            Movement::new(NOMINAL_FORCE_MN, SPEED_UM_S).map_err(|e| fault(e.to_string()))?;
        let slide = Recording {
            texture,
            number,
            movement,
            window: WINDOW,
            blocks: Vec::new(),
            background: Some(BACKGROUND_POWER),
            pdc: self.bio.pdc,
            pdc_rate_hz: ROW_RATE_HZ.into(),
            outside_mn: None,
            pace: None,
            shear_rate_hz: ROW_RATE_HZ.into(),
            highest_hz: None,
        };
        let imported = |why| {
            fault(format!(
                "{why}; fetch the file again, or move it and its _cw away"
            ))
        };
        let slide = slide.cut(&[], &signs::rebuild(&self.bio.pac), Some(&self.shear));
        slide.map_err(imported)
    }
}

#[derive(Default)]
struct Bio {
    times: Vec<f64>,
    pac: Vec<u16>,
    pdc: Vec<i16>,
    /// The first row that is not 10 ms after the one before.
    jump: Option<String>,
}

const PAC_COLUMNS: [&str; 22] = [
    "pac1", "pac2", "pac3", "pac4", "pac5", "pac6", "pac7", "pac8", "pac9", "pac10", "pac11",
    "pac12", "pac13", "pac14", "pac15", "pac16", "pac17", "pac18", "pac19", "pac20", "pac21",
    "pac22",
];

fn read_bio(path: &Path) -> Result<Bio> {
    const COUNT: &str = "a count of 0 to 4095";
    let mut columns = vec!["timestamp", "pdc"];
    columns.extend(PAC_COLUMNS);
    let mut rows = Rows::open(path, &columns, &[])?;
    let mut bio = Bio::default();
    while let Some(row) = rows.next_row()? {
        let count = |column| -> Result<u16> {
            let count = row.parse(column, COUNT)?;
            if count > 4095 {
                let why = format!("{count} is not a count of 0 to 4095");
                return Err(row.error(Some(column), why));
            }
            Ok(count)
        };
        let time: f64 = row.number("timestamp")?;
        let before = bio.times.last().copied();
        // rows jitter by 2 ms
        let is_next = |step: f64| 0.0 < step && (step * f64::from(ROW_RATE_HZ)).round() <= 1.0;
        if let Some(step) = before
            .map(|before| time - before)
            .filter(|step| !is_next(*step))
        {
            let jump = || row.error(Some("timestamp"), jumped(step)).to_string();
            bio.jump.get_or_insert_with(jump);
        }
        if bio.times.len() == MAX_ROWS {
            let why = format!("a slide has fewer rows than {MAX_ROWS}");
            return Err(row.error(None, why));
        }
        bio.times.push(time);
        bio.pdc.push(count("pdc")?.cast_signed());
        for column in PAC_COLUMNS {
            bio.pac.push(count(column)?);
        }
    }
    Ok(bio)
}

fn jumped(step_s: f64) -> String {
    format!("{step_s:+.3} s after the row before: the clock jumps, or samples are missing")
}

/// Times in s and tangential forces in N.
type Forces = Vec<(f64, f64)>;

/// The forces, and the first row whose time is before that of the one before it.
fn read_force(path: &Path) -> Result<(Forces, Option<String>)> {
    let mut rows = Rows::open(path, &["timestamp", "fz"], &[])?;
    let (mut force, mut jump) = (Forces::new(), None);
    while let Some(row) = rows.next_row()? {
        let time = row.number("timestamp")?;
        let step = force.last().map_or(0.0, |(before, _)| time - before);
        if step < 0.0 {
            jump.get_or_insert_with(|| row.error(Some("timestamp"), jumped(step)).to_string());
        }
        let newton: f64 = row.number("fz")?;
        if newton.abs() > 32.0 {
            let why = format!("{newton} N would tear the finger off; fetch the file again");
            return Err(row.error(Some("fz"), why));
        }
        force.push((time, newton));
    }
    Ok((force, jump))
}

/// The force at `times`, in mN: on a straight line between its neighbours, before the first and after the last as
/// these.
fn interpolate(force: &[(f64, f64)], times: &[f64]) -> std::result::Result<Vec<i16>, String> {
    let span = |of: Option<f64>, to: Option<f64>| of.zip(to);
    let measured = span(force.first().map(|f| f.0), force.last().map(|f| f.0));
    let wanted = span(times.first().copied(), times.last().copied());
    match (measured, wanted) {
        (Some(m), Some(w)) if m.0 <= w.1 && w.0 <= m.1 => {}
        _ => {
            let why = "no force at the time of the slide; fetch it and its _bio again";
            return Err(why.to_owned());
        }
    }
    // at most 32 N: fits
    let mn = on_line(force, times).map(|newton| (newton * 1e3).round() as i16);
    Ok(mn.collect())
}

/// The values at `times`, as [`interpolate`] has them; there is one value at least.
fn on_line<'a>(values: &'a [(f64, f64)], times: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
    times.iter().map(|&time| {
        let after = values.partition_point(|(t, _)| *t <= time);
        let (before, after) = (after.saturating_sub(1), after.min(values.len() - 1));
        let ((t0, v0), (t1, v1)) = (values[before], values[after]);
        let part = if t1 > t0 {
            ((time - t0) / (t1 - t0)).clamp(0.0, 1.0)
        } else {
            0.0
        };
        v0 + part * (v1 - v0)
    })
}

#[cfg(test)]
mod tests;
