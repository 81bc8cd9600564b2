//! Anybody's files as recordings: looked at once, to find what they do not say, and written in the project's format.

use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use tactus_core::features::Movement;

use super::cut::Parts;
use super::resample::RATES_HZ;
use super::settings::{Named, SETTINGS, Settings};
use super::signals::Signals;
use crate::data::quality::{DuplicateSearch, Fingerprint, check};
use crate::data::recording::{Labels, PAC_RATE_HZ, Recording, Texture};
use crate::data::recordings::files::{confined, each_in_flight};
use crate::data::recordings::{RecordingError, RecordingWriter, Result};

mod columns;
mod memory;
mod paths;
mod reading;
mod summary;

use columns::lively;
pub use memory::InMemory;
use paths::{BESIDE, add, files, folder_of, known_layout};
use reading::How;
use summary::{gains, notes, readable, textures};

/// Largest value that the samples are made to have: 12 bits with a little room.
const FULL: f64 = 2000.0;
/// P_AC before the window, so that the filter has filled, in samples.
const BEFORE: usize = 220;
/// Longest still part that is kept, in samples.
const STILL: usize = 2200;
/// Rate of P_DC and of shear in what is written, Hz.
const SLOW_HZ: u32 = 100;
/// Width of a picture of a file, in characters.
pub const WIDTH: usize = 60;

/// One file, or one part of it with a texture of its own, as it was found.
#[derive(Clone, Debug)]
pub struct Found {
    /// Path below the folder.
    pub path: String,
    /// Its texture.
    pub texture: String,
    /// Its session, empty if unknown.
    pub session: String,
    /// The run that it is of.
    pub run: String,
    /// Its movement, as far as it is known.
    pub movement: Movement,
    /// Length in s, on the sensor's clock.
    pub seconds: f64,
    /// How lively each of [`WIDTH`] parts is, 0 to 1.
    pub envelope: Vec<f32>,
    /// Slides, in parts of the whole.
    pub slides: Vec<(f32, f32)>,
    /// Slides that are left out since samples are missing in them.
    pub gaps: usize,
    /// True if the finger is still in a part of it.
    pub still: bool,
    /// Shortest recording with a slide, s, where this one is shorter.
    short: Option<f64>,
    rows: Range<usize>,
    ranges: Parts,
    peak: f64,
    pressure: f64,
}

/// What was found in a folder, and how it is read.
#[derive(Clone, Debug)]
pub struct Survey {
    /// Each file.
    pub found: Vec<Found>,
    /// Samples per second.
    pub rate_hz: f64,
    /// The channel of the vibration.
    pub channel: String,
    /// Counts per unit of it.
    pub gain: f64,
    /// What kind of files these are.
    pub kind: &'static str,
    /// Names of the textures, in the order of their first file.
    pub textures: Vec<String>,
    /// Counts of P_DC per unit of its column; `None` where there is none, or it never changes.
    pub pressure_gain: Option<f64>,
    /// Facts that nothing said, and how they were found.
    pub notes: Vec<String>,
    /// The files that cannot be read, and the textures without a slide.
    pub left_out: Vec<String>,
    source: Source,
    settings: Settings,
}

/// The place of the signals.
#[derive(Clone, Debug)]
enum Source {
    /// Files below a folder, or one file.
    Files(PathBuf),
    /// Memory: a path is the number of a signal.
    Memory(Arc<[InMemory]>),
}

impl Source {
    /// The signals of a path, and its name in errors.
    fn signals(&self, path: &str, settings: &Settings) -> Result<(Cow<'_, Signals>, PathBuf)> {
        match self {
            Self::Files(_) => {
                let beside = self.folder().join("..").join(BESIDE).join(path);
                let path = self.folder().join(path);
                let mut signals = Signals::read(&path)?;
                if settings.pressure.as_deref() == Some(BESIDE) {
                    add(&mut signals, &beside, settings)?;
                }
                Ok((Cow::Owned(signals), path))
            }
            Self::Memory(all) => Ok((Cow::Borrowed(memory::find(all, path)?), path.into())),
        }
    }

    /// Bytes that the signals of a path take, about.
    fn memory(&self, path: &str) -> u64 {
        match self {
            Self::Files(_) => Signals::memory(&self.folder().join(path)),
            Self::Memory(_) => 0,
        }
    }

    /// True for arrays, which somebody chose one by one; files are left out where others can be read.
    fn is_arrays(&self) -> bool {
        matches!(self, Self::Memory(all) if all.iter().all(|one| one.path.is_empty()))
    }

    fn folder(&self) -> &Path {
        folder_of(self.path())
    }

    fn path(&self) -> &Path {
        match self {
            Self::Files(from) => from,
            Self::Memory(_) => Path::new(memory::FOLDER),
        }
    }
}

/// Finds how all files are read, the channels that may be the vibration, their kind and what it says: by the first one
/// that can be read.
fn first(
    source: &Source,
    paths: &[(String, Named)],
    settings: Settings,
) -> Result<(How, Vec<String>, &'static str, Settings)> {
    let mut refused = None;
    let found = paths.iter().find_map(|(path, _)| {
        let first = source
            .signals(path, &settings)
            .and_then(|(signals, place)| {
                let at = |why: String| RecordingError::at(&place, why);
                let lively = match &settings.channel {
                    Some(channel) => vec![channel.clone()],
                    None => lively(&signals, &settings).map_err(at)?,
                };
                let how = How::new(&signals, &settings).map_err(at)?;
                Ok((
                    how,
                    lively,
                    signals.kind,
                    settings.clone().completed(&signals),
                ))
            });
        first.map_err(|why| refused.get_or_insert(why)).ok()
    });
    let none = || RecordingError::at(source.path(), "there are no recordings");
    found.ok_or_else(|| refused.unwrap_or_else(none))
}

impl Survey {
    /// Looks at the files below a folder, or at one file; `progress` is called with the number of files looked at, and
    /// of all.
    /// Errors: something that must be known is neither in the files nor in the settings, or a file is damaged.
    pub fn of(
        from: &Path,
        settings: Settings,
        progress: &(dyn Fn(usize, usize) + Sync),
    ) -> Result<Self> {
        let whole = from;
        let (from, settings) = known_layout(whole, settings);
        confined(folder_of(whole), &from)?;
        let settings = settings.with_file(folder_of(&from))?;
        settings
            .check()
            .map_err(|why| RecordingError::at(&from, why))?;
        let (paths, skipped) = files(&from, &settings)?;
        let mut survey = Self::look(Source::Files(from), &paths, settings, progress)?;
        survey.left_out.extend(skipped);
        Ok(survey)
    }

    fn look(
        source: Source,
        paths: &[(String, Named)],
        settings: Settings,
        progress: &(dyn Fn(usize, usize) + Sync),
    ) -> Result<Self> {
        let (how, lively, kind, settings) = first(&source, paths, settings)?;
        let channel = lively[0].as_str();
        let done = std::sync::atomic::AtomicUsize::new(0);
        let memory = |(path, _): &(String, _)| source.memory(path);
        let looked = each_in_flight(paths, memory, |(path, named)| {
            let looked = source.signals(path, &settings).and_then(|(signals, place)| {
                let at = |why: String| RecordingError::at(&place, why);
                let own = How::new(&signals, &settings).map_err(at)?;
                Ok(match own.is_like(&how) {
                    true => Ok(own.look(path, named, &signals, channel, &settings).map_err(at)?),
                    false => Err(at(format!(
                        "{:.1} Hz, and the first file has {:.1} Hz: import files of one kind at a time, chosen by \
                         --texture \"{{texture}}/*_imu.csv\" and the like",
                        own.rate_hz, how.rate_hz
                    ))),
                })
            });
            let done = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
            progress(done, paths.len());
            // two kinds of files are no accident
            looked.map_or_else(
                |why| Ok(Err(why)),
                |found: Result<Vec<Found>>| found.map(Ok),
            )
        })?;
        let (found, mut left_out) = readable(looked, &source)?;
        let at = |why: String| RecordingError::at(source.path(), why);
        let (textures, short) = textures(&found).map_err(at)?;
        if let (true, Some(why)) = (source.is_arrays(), short.first()) {
            return Err(at(why.clone()));
        }
        left_out.extend(short);
        let found: Vec<Found> = found
            .into_iter()
            .filter(|f| textures.contains(&f.texture))
            .collect();
        let (gain, pressure) = gains(&found, channel, &settings).map_err(at)?;
        Ok(Self {
            found,
            rate_hz: how.rate_hz,
            channel: channel.to_owned(),
            gain,
            kind,
            pressure_gain: pressure,
            textures,
            notes: notes(&how, &lively),
            left_out,
            source: source.clone(),
            settings,
        })
    }

    /// The unit of the vibration.
    pub fn unit(&self) -> &str {
        let said = self.settings.unit.as_deref();
        let unit = said.or_else(|| super::signals::unit(&self.channel));
        unit.unwrap_or("unit")
    }

    /// The column of P_DC.
    pub fn pressure(&self) -> Option<&str> {
        self.settings.pressure.as_deref()
    }

    /// The folder of the files.
    pub fn folder(&self) -> &Path {
        self.source.folder()
    }

    /// Slides in all.
    pub fn slides(&self) -> usize {
        self.found.iter().map(|f| f.ranges.slides.len()).sum()
    }

    /// True if the sensor's clock is taken for a slower one of 2200 Hz.
    pub fn is_stretched(&self) -> bool {
        !RATES_HZ.contains(&self.rate_hz)
    }

    /// All that was found, as settings that say it.
    pub fn settings(&self) -> Settings {
        let mut settings = self.settings.clone();
        settings.rate.get_or_insert(self.rate_hz);
        settings.channel.get_or_insert_with(|| self.channel.clone());
        settings.gain.get_or_insert(self.gain);
        settings
    }

    /// Writes the recordings into a folder that is not there yet; `progress` gets the slides done, and of all. Returns
    /// the slides that were left out, and why: those of a dead sensor, copies. Errors: A file cannot be read again, or
    /// not be written.
    pub fn write(&self, to: &Path, progress: &dyn Fn(usize, usize)) -> Result<Vec<String>> {
        let command = format!("tactus import {} ...", self.source.path().display());
        let mut writer = RecordingWriter::begin(to, self.texture_list(), &command)?;
        let mut written = 0;
        let left_out = self.each_slide(&mut |slide, labels| {
            writer.label(labels);
            writer.write(&slide)?;
            written += 1;
            progress(written, self.slides());
            Ok(())
        })?;
        writer.put(SETTINGS, self.settings().template().as_bytes())?;
        writer.finish()?;
        Ok(left_out)
    }

    fn texture_list(&self) -> Vec<Texture> {
        let numbered = (1..).zip(&self.textures).map(|(id, name)| Texture {
            id,
            name: name.clone(),
        });
        numbered.collect()
    }

    /// Gives away each slide with its labels. Returns the slides that were left out, and why.
    /// Errors: A file cannot be read again, or no slide is left of a texture.
    fn each_slide(
        &self,
        take: &mut dyn FnMut(Recording, Labels) -> Result<()>,
    ) -> Result<Vec<String>> {
        let places = self.textures.iter().zip(0..);
        let places: HashMap<&String, usize> = places.collect();
        let mut numbers = vec![0_u32; self.textures.len()];
        let (mut copies, mut left_out) = (DuplicateSearch::default(), Vec::new());
        // the parts of a file lie next to each other
        for parts in self.found.chunk_by(|a, b| a.path == b.path) {
            let (signals, place) = self.source.signals(&parts[0].path, &self.settings)?;
            let at = |why: String| RecordingError::at(&place, why);
            let how = How::new(&signals, &self.settings).map_err(at)?;
            for found in parts {
                let texture = places.get(&found.texture).copied().unwrap_or(0);
                let pac = how.pac(&signals, &self.channel, found.rows.clone(), self.gain);
                let ends = found.ranges.slides.iter().chain(&found.ranges.still);
                if ends.map(|range| range.end).max().unwrap_or(0) > pac.len() {
                    return Err(at(
                        "has changed since it was looked at; import again".to_owned()
                    ));
                }
                let slow = |column: &Option<String>, gain: Option<f64>| {
                    let both = column.as_ref().zip(gain);
                    let slow = both.map(|(column, gain)| how.slow(&signals, column, found, gain));
                    slow.transpose().map_err(at)
                };
                let pdc = slow(&self.settings.pressure, self.pressure_gain)?;
                let shear = slow(&self.settings.shear, Some(1e3))?;
                for range in &found.ranges.slides {
                    let slide = self.slide(&pac, range, found, pdc.as_deref(), shear.as_deref());
                    let slide = Recording {
                        texture,
                        number: numbers[texture] + 1,
                        ..slide.map_err(at)?
                    };
                    let name = format!(
                        "slide {} of {} ({})",
                        slide.number, found.texture, found.path
                    );
                    // a shift in these samples is none of whole samples after resampling
                    let raw = how.rows(found, range, pac.len());
                    let raw = signals
                        .channel(&self.channel)
                        .and_then(|(_, all)| all.get(raw));
                    let print = Fingerprint::of_signal(raw.unwrap_or_default(), how.rate_hz);
                    let checked = check(&slide).map_err(|why| why.to_string());
                    let checked = checked
                        .and_then(|_| copies.add(&print, name).map_err(|why| why.to_string()));
                    if let Err(why) = checked {
                        left_out.push(format!("{}: {why}", found.path));
                        continue;
                    }
                    numbers[texture] += 1;
                    take(slide, self.labels(found))?;
                }
            }
        }
        if let Some(texture) = numbers.iter().position(|slides| *slides == 0) {
            let (of, why) = (&self.textures[texture], left_out.first());
            return Err(RecordingError::said(format!(
                "no slide of {of} can be used, record others: {}",
                why.map_or("", String::as_str)
            )));
        }
        Ok(left_out)
    }

    fn labels(&self, found: &Found) -> Labels {
        // it was checked before
        let (finger, sensor) = self.settings.sensor().unwrap_or_default();
        Labels {
            session: found.session.clone(),
            run: found.run.clone(),
            finger,
            sensor,
            ..Labels::default()
        }
    }

    fn slide(
        &self,
        pac: &[i16],
        range: &Range<usize>,
        found: &Found,
        pdc: Option<&[i16]>,
        shear: Option<&[i16]>,
    ) -> std::result::Result<Recording, String> {
        let start = range.start.saturating_sub(BEFORE);
        let seconds = |samples: usize| samples as f32 / PAC_RATE_HZ as f32;
        let slow = |samples: &[i16]| {
            let at = |sample: usize| sample * SLOW_HZ as usize / PAC_RATE_HZ as usize;
            samples
                .get(at(start)..samples.len().min(at(range.end) + 2))
                .unwrap_or_default()
                .to_vec()
        };
        let still = found
            .ranges
            .still
            .clone()
            .map(|still| &pac[still.start..still.end.min(still.start + STILL)]);
        // a converter that is switched on late is no background
        let still = still.filter(|still| still.iter().any(|x| *x != still[0]));
        let slide = Recording {
            texture: 0,
            number: 0,
            movement: found.movement,
            window: (seconds(range.start - start), seconds(range.end - start)),
            blocks: Vec::new(),
            background: still.is_none().then_some(0.0),
            pdc: pdc.map(slow).unwrap_or_default(),
            pdc_rate_hz: SLOW_HZ.into(),
            outside_mn: None,
            pace: None,
            shear_rate_hz: SLOW_HZ.into(),
            highest_hz: match self.is_stretched() {
                true => None,
                false => {
                    (self.rate_hz < f64::from(PAC_RATE_HZ)).then_some(self.rate_hz as f32 / 2.0)
                }
            },
        };
        let shear = shear.map(slow);
        slide.cut(
            still.unwrap_or_default(),
            &pac[start..range.end],
            shear.as_deref(),
        )
    }
}
