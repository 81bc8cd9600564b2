//! Anybody's files as recordings: looked at once, to find what they do not say, and written in the project's format.

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use tactus_core::features::Movement;
use tactus_core::sensor::FingerCode;

use super::cut::{Parts, parts};
use super::resample::{RATES_HZ, resample};
use super::settings::{Named, SETTINGS, Settings, guessed, matched};
use super::signals::Signals;
use crate::data::recording::{Labels, PAC_RATE_HZ, Recording, Texture};
use crate::data::recordings::{RecordingError, RecordingWriter, Result};

/// Deepest folder below the one that is imported.
const DEPTH: usize = 8;
/// Most files of one import.
const MOST_FILES: usize = 100_000;
/// Endings of files that are data; others are left alone.
const ENDINGS: [&str; 6] = ["wav", "csv", "tsv", "txt", "npy", "dat"];
/// Largest value that the samples are made to have: 12 bits with a little room.
const FULL: f64 = 2000.0;
/// Names of columns of time.
const TIMES: [&str; 7] = [
    "time",
    "t",
    "timestamp",
    "seconds",
    "sec",
    "elapsed",
    "zeit",
];
/// P_AC before the window, so that the filter has filled, in samples.
const BEFORE: usize = 220;
/// Longest still part that is kept, in samples.
const STILL: usize = 2200;
/// Samples of the slides into which longer sliding is divided: 3 s, and what a slow sensor can have in 20 s.
const LENGTH: usize = 6600;
const SLOW_LENGTH: usize = 2000;
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
    from: PathBuf,
    settings: Settings,
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
        let folder = if from.is_dir() {
            from
        } else {
            from.parent().unwrap_or(from)
        };
        let settings = settings.with_file(folder)?;
        let paths = files(from, &settings)?;
        let first = Signals::read(&folder.join(&paths[0].0))?;
        let at = |why: String| RecordingError::at(from, why);
        let channel = match &settings.channel {
            Some(channel) => channel.clone(),
            None => liveliest(&first, &settings).map_err(at)?,
        };
        let how = How::new(&first, &settings).map_err(at)?;
        let done = std::sync::atomic::AtomicUsize::new(0);
        let looked = paths.par_iter().map(|(path, named)| {
            let signals = Signals::read(&folder.join(path))?;
            let found = how.look(path, named, &signals, &channel, &settings);
            let done = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
            progress(done, paths.len());
            found.map_err(|why| RecordingError::at(&folder.join(path), why))
        });
        let found: Vec<Vec<Found>> = looked.collect::<Result<_>>()?;
        let found: Vec<Found> = found.into_iter().flatten().collect();
        let peak = found.iter().map(|f| f.peak).fold(0.0, f64::max);
        let pressure = found.iter().map(|f| f.pressure).fold(0.0, f64::max);
        if peak == 0.0 {
            return Err(at(format!(
                "channel {channel:?} never changes: is the sensor connected?"
            )));
        }
        let gain = match (settings.gain, settings.unit.as_deref()) {
            (Some(gain), _) if gain.is_finite() && gain > 0.0 => gain,
            (Some(gain), _) => return Err(at(format!("a gain of {gain} is impossible"))),
            (None, Some("counts")) => 1.0,
            (None, _) => rounded(FULL / peak),
        };
        let mut textures: Vec<String> = Vec::new();
        let mut seen = std::collections::HashSet::new();
        for f in &found {
            if seen.insert(f.texture.as_str()) {
                textures.push(f.texture.clone());
            }
        }
        let empty = textures.iter().find(|texture| {
            let mut of = found.iter().filter(|f| f.texture == **texture);
            of.all(|f| f.ranges.slides.is_empty())
        });
        if let Some(texture) = empty {
            return Err(at(format!(
                "no sliding was found in the files of {texture}; say where it is by --window FROM,TO, or move them away"
            )));
        }
        Ok(Self {
            found,
            rate_hz: how.rate_hz,
            channel,
            gain,
            kind: first.kind,
            pressure_gain: (pressure > 0.0).then(|| rounded(FULL / pressure)),
            textures,
            from: from.to_owned(),
            settings,
        })
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

    /// Writes the recordings into a folder that is not there yet; `progress` gets the slides done, and of all.
    /// Errors: A file cannot be read again, or not be written.
    pub fn write(&self, to: &Path, progress: &dyn Fn(usize, usize)) -> Result<()> {
        let textures = (1..).zip(&self.textures).map(|(id, name)| Texture {
            id,
            name: name.clone(),
        });
        let command = format!("tactus import {} ...", self.from.display());
        let mut writer = RecordingWriter::begin(to, textures.collect(), &command)?;
        let folder = match self.from.is_dir() {
            true => self.from.as_path(),
            false => self.from.parent().unwrap_or(&self.from),
        };
        let mut numbers = vec![0; self.textures.len()];
        let mut done = 0;
        // the parts of a file lie next to each other
        for parts in self.found.chunk_by(|a, b| a.path == b.path) {
            let path = folder.join(&parts[0].path);
            let signals = Signals::read(&path)?;
            let at = |why: String| RecordingError::at(&path, why);
            let how = How::new(&signals, &self.settings).map_err(at)?;
            for found in parts {
                let texture = self
                    .textures
                    .iter()
                    .position(|t| *t == found.texture)
                    .unwrap_or(0);
                writer.label(self.labels(found));
                let pac = how.pac(&signals, &self.channel, found.rows.clone(), self.gain);
                let slow = |column: &Option<String>, gain: Option<f64>| {
                    let both = column.as_ref().zip(gain);
                    let slow = both.map(|(column, gain)| how.slow(&signals, column, found, gain));
                    slow.transpose().map_err(at)
                };
                let pdc = slow(&self.settings.pressure, self.pressure_gain)?;
                let shear = slow(&self.settings.shear, Some(1e3))?;
                for range in &found.ranges.slides {
                    numbers[texture] += 1;
                    let slide =
                        self.slide(&pac, range, &found.ranges, pdc.as_deref(), shear.as_deref());
                    let slide = slide.map_err(at)?;
                    writer.write(&Recording {
                        texture,
                        number: numbers[texture],
                        ..slide
                    })?;
                    done += 1;
                    progress(done, self.slides());
                }
            }
        }
        fs::write(to.join(SETTINGS), self.settings().template())
            .map_err(|why| RecordingError::at(&to.join(SETTINGS), why))?;
        writer.finish()
    }
}

impl Survey {
    fn labels(&self, found: &Found) -> Labels {
        Labels {
            session: found.session.clone(),
            run: found.path.clone(),
            finger: FingerCode::OTHER,
            sensor: self
                .settings
                .finger
                .clone()
                .unwrap_or_else(|| "my-sensor".to_owned()),
            ..Labels::default()
        }
    }

    fn slide(
        &self,
        pac: &[i16],
        range: &Range<usize>,
        parts: &Parts,
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
        let still = parts
            .still
            .clone()
            .map(|still| still.start..still.end.min(still.start + STILL));
        let slide = Recording {
            texture: 0,
            number: 0,
            movement: match (self.settings.force, self.settings.speed) {
                (None, None) => Movement::UNKNOWN,
                (force, speed) => Movement::from_si(force.unwrap_or(0.5), speed.unwrap_or(25.0))
                    .map_err(|why| why.to_string())?,
            },
            window: (seconds(range.start - start), seconds(range.end - start)),
            blocks: Vec::new(),
            background: still.is_none().then_some(0.0),
            pdc: pdc.map(slow).unwrap_or_default(),
            pdc_rate_hz: SLOW_HZ,
            outside_mn: None,
            pace: None,
            shear_rate_hz: SLOW_HZ,
            highest_hz: match self.is_stretched() {
                true => None,
                false => {
                    (self.rate_hz < f64::from(PAC_RATE_HZ)).then_some(self.rate_hz as f32 / 2.0)
                }
            },
        };
        let still = still.map(|still| &pac[still]).unwrap_or_default();
        let shear = shear.map(slow);
        slide.cut(still, &pac[start..range.end], shear.as_deref())
    }
}

/// How the samples of a file are read.
struct How {
    rate_hz: f64,
    /// the rate that the signal is resampled from; `None` where a sample stays a sample
    from_hz: Option<u32>,
}

impl How {
    fn new(signals: &Signals, settings: &Settings) -> std::result::Result<Self, String> {
        let timed = time(signals, settings)?
            .map(|(_, times)| rate_of(&times))
            .transpose()?;
        let rate = settings
            .rate
            .or(signals.rate_hz)
            .or(timed.map(|(rate, _)| rate));
        let Some(rate_hz) = rate else {
            let columns: Vec<&str> = signals
                .channels
                .iter()
                .map(|(name, _)| name.as_str())
                .collect();
            return Err(format!(
                "no rate: give --rate HZ, or --time COLUMN; the columns of numbers are {}",
                columns.join(", ")
            ));
        };
        if !(1.0..=*RATES_HZ.end()).contains(&rate_hz) {
            return Err(format!(
                "a rate of {rate_hz} Hz; it is 1 to {} Hz. Is the time in s? Its column's name may say ms or us",
                RATES_HZ.end()
            ));
        }
        let from_hz = RATES_HZ
            .contains(&rate_hz)
            .then_some(rate_hz.round() as u32);
        Ok(Self { rate_hz, from_hz })
    }

    fn look(
        &self,
        path: &str,
        named: &Named,
        signals: &Signals,
        channel: &str,
        settings: &Settings,
    ) -> std::result::Result<Vec<Found>, String> {
        let own = Self::new(signals, settings)?;
        if (own.rate_hz / self.rate_hz - 1.0).abs() > 0.02 {
            return Err(format!(
                "{:.1} Hz, and the first file has {:.1} Hz: import files of one kind at a time, chosen by --texture \
                 \"{{texture}}/*_imu.csv\" and the like",
                own.rate_hz, self.rate_hz
            ));
        }
        let (_, all) = signals.channel(channel).ok_or_else(|| {
            let names: Vec<&str> = signals
                .channels
                .iter()
                .map(|(name, _)| name.as_str())
                .collect();
            format!("no channel {channel:?}; there are {}", names.join(", "))
        })?;
        let gaps = match time(signals, settings)? {
            Some((_, times)) => rate_of(&times)?.1,
            None => Vec::new(),
        };
        let column = settings
            .texture
            .as_ref()
            .filter(|t| !t.contains(['{', '*']));
        let words = match column {
            None => None,
            Some(column) => {
                let words = signals.words.iter().find(|(name, _)| name == column);
                Some(words.ok_or_else(|| format!("no column of words {column:?}"))?)
            }
        };
        let stretches: Vec<(String, Range<usize>)> = match words {
            None => vec![(named.texture.clone(), 0..all.len())],
            Some((_, words)) => {
                let mut at = 0;
                let runs = words.chunk_by(|a, b| a == b).map(|run| {
                    at += run.len();
                    (run[0].clone(), at - run.len()..at)
                });
                runs.filter(|(word, _)| !word.is_empty()).collect()
            }
        };
        let length = match (settings.length, self.from_hz) {
            (Some(seconds), _) => (seconds * self.out_hz()) as usize,
            (None, Some(_)) => LENGTH,
            (None, None) => SLOW_LENGTH,
        };
        let window = settings.window()?;
        let found = stretches.into_iter().map(|(texture, rows)| {
            let out = self.resampled(&all[rows.clone()]);
            let mut ranges = match window {
                Some((from, to)) => {
                    let at = |s: f64| ((s * self.out_hz()) as usize).min(out.len());
                    let still = (at(from) >= STILL / 2).then_some(0..at(from));
                    Parts {
                        slides: Vec::from_iter(Some(at(from)..at(to))),
                        still,
                    }
                }
                None => parts(&out, length.max(1), LEAST),
            };
            ranges.slides.retain(|range| range.len() >= LEAST);
            let there = ranges.slides.len();
            let scale = out.len() as f64 / rows.len() as f64;
            let whole = |range: &Range<usize>| {
                !gaps
                    .iter()
                    .filter_map(|gap| gap.checked_sub(rows.start))
                    .any(|gap| range.contains(&((gap as f64 * scale) as usize)))
            };
            ranges.slides.retain(whole);
            let peak = out.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
            let pressure = settings.pressure.as_ref().map(|column| {
                let (_, values) = signals
                    .channel(column)
                    .ok_or_else(|| format!("no column {column:?}"))?;
                let values = &values[rows.clone()];
                let (low, high) = values
                    .iter()
                    .fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(*x), h.max(*x)));
                Ok::<_, String>(if high > low {
                    low.abs().max(high.abs())
                } else {
                    0.0
                })
            });
            let part = |at: usize| at as f32 / out.len() as f32;
            Ok(Found {
                path: path.to_owned(),
                texture,
                session: settings
                    .session
                    .clone()
                    .unwrap_or_else(|| named.session.clone()),
                seconds: rows.len() as f64 / self.rate_hz,
                envelope: envelope(&out),
                slides: ranges
                    .slides
                    .iter()
                    .map(|r| (part(r.start), part(r.end)))
                    .collect(),
                gaps: there - ranges.slides.len(),
                still: ranges.still.is_some(),
                rows,
                ranges,
                peak,
                pressure: pressure.transpose()?.unwrap_or(0.0),
            })
        });
        found.collect()
    }

    /// Seconds of the sensor's clock in one of 2200 Hz.
    fn stretch(&self) -> f64 {
        match self.from_hz {
            Some(_) => 1.0,
            None => f64::from(PAC_RATE_HZ) / self.rate_hz,
        }
    }

    /// Samples of P_AC per second of the sensor's clock.
    fn out_hz(&self) -> f64 {
        f64::from(PAC_RATE_HZ) / self.stretch()
    }

    /// The signal about its mean, at 2200 Hz.
    fn resampled(&self, samples: &[f64]) -> Vec<f64> {
        let mean = samples.iter().sum::<f64>() / samples.len().max(1) as f64;
        let about: Vec<f64> = samples.iter().map(|x| x - mean).collect();
        match self.from_hz {
            Some(from_hz) => resample(&about, from_hz, PAC_RATE_HZ),
            None => about,
        }
    }

    fn pac(&self, signals: &Signals, channel: &str, rows: Range<usize>, gain: f64) -> Vec<i16> {
        let all = signals.channel(channel).map_or(&[][..], |(_, all)| all);
        let out = self.resampled(all.get(rows).unwrap_or_default());
        // `as` saturates
        out.into_iter().map(|x| (x * gain).round() as i16).collect()
    }

    /// A slow column at [`SLOW_HZ`] of the resampled clock: the mean of what falls between two of its samples.
    fn slow(
        &self,
        signals: &Signals,
        column: &str,
        found: &Found,
        gain: f64,
    ) -> std::result::Result<Vec<i16>, String> {
        let (_, all) = signals
            .channel(column)
            .ok_or_else(|| format!("no column {column:?}"))?;
        let values = all.get(found.rows.clone()).unwrap_or_default();
        let each = self.rate_hz * self.stretch() / f64::from(SLOW_HZ);
        let samples = (values.len() as f64 / each).ceil() as usize;
        let at = |n: usize| ((n as f64 * each) as usize).min(values.len() - 1);
        let mean = |n: usize| {
            let some = &values[at(n)..at(n + 1).max(at(n) + 1)];
            some.iter().sum::<f64>() / some.len() as f64
        };
        Ok((0..samples)
            .map(|n| (mean(n) * gain).round() as i16)
            .collect())
    }
}

/// Fewest samples of a slide: spectra of some frames.
const LEAST: usize = 1100;

/// The file's column of time, in s.
fn time(
    signals: &Signals,
    settings: &Settings,
) -> std::result::Result<Option<(String, Vec<f64>)>, String> {
    let is_time = |name: &str| {
        let name = name.to_lowercase();
        let word = name.split(['_', ' ', '(', '[']).next().unwrap_or_default();
        TIMES.contains(&word)
    };
    let column = match &settings.time {
        Some(time) => Some(
            signals
                .channel(time)
                .ok_or_else(|| format!("no column {time:?}"))?,
        ),
        None => signals.channels.iter().find(|(name, _)| is_time(name)),
    };
    Ok(column.map(|(name, values)| {
        let lower = name.to_lowercase();
        let has = |unit: &str| {
            lower
                .split(|c: char| !c.is_alphanumeric())
                .any(|part| part == unit)
        };
        let unit = match () {
            () if has("ns") => 1e-9,
            () if has("us") || has("µs") => 1e-6,
            () if has("ms") => 1e-3,
            () => 1.0,
        };
        (name.clone(), values.iter().map(|t| t * unit).collect())
    }))
}

/// Samples per second by their times, and before which of them some are missing.
fn rate_of(times: &[f64]) -> std::result::Result<(f64, Vec<usize>), String> {
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let gaps = steps.clone();
    steps.sort_by(f64::total_cmp);
    let middle = steps[steps.len() / 2];
    if middle <= 0.0 {
        return Err("its time does not go on; give --rate HZ instead".to_owned());
    }
    // samples that came in bursts have the right mean, and the median of a clock that jumps is not moved by it
    let usual: Vec<f64> = gaps
        .iter()
        .copied()
        .filter(|s| (0.0..3.0 * middle).contains(s))
        .collect();
    let mean = usual.iter().sum::<f64>() / usual.len() as f64;
    let jumps = gaps
        .iter()
        .enumerate()
        .filter(|(_, s)| !(0.0..=3.0 * middle).contains(*s));
    Ok((1.0 / mean, jumps.map(|(at, _)| at + 1).collect()))
}

/// The channel that changes most from sample to sample, in parts of its range.
fn liveliest(signals: &Signals, settings: &Settings) -> std::result::Result<String, String> {
    let time = time(signals, settings)?.map(|(name, _)| name);
    let slow = [&time, &settings.pressure, &settings.shear];
    let others = signals
        .channels
        .iter()
        .filter(|(name, _)| !slow.contains(&&Some(name.clone())));
    let energy = |samples: &[f64]| {
        samples
            .windows(2)
            .map(|p| (p[1] - p[0]).powi(2))
            .sum::<f64>()
    };
    let best = others.max_by(|(_, a), (_, b)| energy(a).total_cmp(&energy(b)));
    best.map(|(name, _)| name.clone())
        .ok_or_else(|| "no column of numbers beside the time".to_owned())
}

/// Two digits, rounded down.
fn rounded(gain: f64) -> f64 {
    let scale = 10_f64.powf(gain.log10().floor() - 1.0);
    (gain / scale).floor() * scale
}

fn envelope(out: &[f64]) -> Vec<f32> {
    let each = out.len().div_ceil(WIDTH).max(1);
    let powers: Vec<f64> = out
        .chunks(each)
        .map(|part| (part.iter().map(|x| x * x).sum::<f64>() / part.len() as f64).sqrt())
        .collect();
    let most = powers.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    powers
        .into_iter()
        .map(|power| (power / most) as f32)
        .collect()
}

/// The files to import, by their paths below the folder, and what these say, in their natural order.
fn files(from: &Path, settings: &Settings) -> Result<Vec<(String, Named)>> {
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
