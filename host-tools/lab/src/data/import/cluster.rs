//! Import of the Cluster Haptic Texture Dataset (Eguchi et al., arXiv 2407.16206): an IIS3DWB accelerometer in a rubber tip on a
//! load cell of 1 kg, moved by a machine over 118 surfaces in 8 directions at 5 speeds with 2 forces, twice each.
//!
//! # The layout
//! As `documents/dataset_details.md` and the loaders in <https://github.com/cluster-lab/Cluster-Haptic-Texture-Dataset> have it:
//! `sensor_data/{accel,force,position}/T/T_D_V_F_R.csv`, where T is the surface, D the direction in degrees, V the speed in mm/s,
//! F the force in mN, R the repetition. In `accel` the columns are `time,X,Y,Z` in s and g at about 6 kHz, in `force`
//! `time,force` in N at the same rate, in `position` `time,X,Y` in mm at 100 Hz. Times are those at which each value was read,
//! and jitter. Nobody here has seen the files themselves. Guessed are: that the three times of a slide have one zero; that Z
//! points along the pressing force, since the example has gravity on it; that surfaces have the numbers 0 to 118, since the
//! authors' loader takes 119.
//!
//! # What is made of it
//! What the finger `mems` gives: P_AC is Z in counts of 0.98 mg, behind a high-pass of 10 Hz, clipped at 2 g; P_DC is the force in
//! counts of [`MN_PER_COUNT`]. There is no tangential force. The rate is that of the times, whatever it is: Z is put on equal
//! steps along straight lines (a tone of 500 Hz in a record of 6 kHz errs by 3.4 % at most), and taken to 2200 Hz by a
//! polyphase windowed-sinc filter of constant length in time (128 samples of 2200 Hz, squared Blackman-Harris).
//!
//! The steady part is from 10 % to 90 % of the way that `position` shows. A slide's number follows from its name, the
//! repetition first: "early" and "late" slides are the two repetitions. When they were made is not known.
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use rubato::audioadapter::Adapter as _;
use rubato::audioadapter_buffers::direct::InterleavedSlice;
use rubato::{Async, FixedAsync, Resampler as _, SincInterpolationParameters, WindowFunction};
use tactus_core::features::Movement;
use tactus_core::sensor::mems::Mems;
use tactus_core::sensor::{FingerCode, PressureSensor as _};

use super::{Imported, begin, names, number};
use crate::data::content::ContentError;
use crate::data::recording::{Labels, PAC_RATE_HZ, Recording, Texture};
use crate::data::recordings::{RecordingError, Result};
use crate::data::rows::{Row, RowError, Rows};

/// Acceleration of a count of the finger `mems`, g.
const G_PER_COUNT: f64 = Mems::MODEL.calibration.pac_pa_per_count as f64 * 1e-3;
/// Force of a count of its P_DC, mN.
pub const MN_PER_COUNT: f64 = Mems::MODEL.calibration.force_mn_per_count as f64;
/// The high-pass before P_AC, Hz.
const HIGH_PASS_HZ: f64 = 10.0;
/// The accelerometer's noise, g/sqrt(Hz): the dataset's own figure. It stands in for a record of the still finger.
const NOISE: f64 = 75e-6;
/// Length of the resampling filter, samples of 2200 Hz.
const LOBES: f64 = 128.0;
/// Rate of P_DC.
const PDC_RATE_HZ: u32 = 100;
/// The longest time between two values, s: a slide with a longer one is left out, since nothing is interpolated there.
const LONGEST_PAUSE: f64 = 0.01;
/// Surfaces have numbers up to this.
const LAST_SURFACE: u32 = 118;
/// How far the speed of a slide may be from that in its name.
const SPEED_OFF: f64 = 0.1;
/// Longest file, in rows: half a minute at 26.7 kHz.
const MAX_ROWS: usize = 800_000;

/// Imports the dataset from the folder that holds `sensor_data`, or from that itself. As [`import`](super::import) otherwise.
///
/// # Errors
/// As [`import`](super::import); also if a slide's force or position is missing, or its speed is not that of its name.
pub fn import(from: &Path, to: &Path, progress: &mut dyn FnMut(usize, usize)) -> Result<Imported> {
    let inner = from.join("sensor_data");
    let root = if inner.is_dir() {
        inner
    } else {
        from.to_owned()
    };
    let slides = slides(&root, from)?;
    let mut surfaces: Vec<u32> = slides.iter().map(|slide| slide.surface).collect();
    surfaces.dedup();
    let textures = surfaces.iter().map(|&id| Texture {
        id,
        name: format!("surface {id}"),
    });
    let mut writer = begin("import cluster", from, to, textures.collect())?;
    let mut done = Imported {
        textures: surfaces.len(),
        ..Imported::default()
    };
    let mut seen = 0;
    for some in slides.chunks(2 * rayon::current_num_threads()) {
        let texture = |slide: &Name| surfaces.binary_search(&slide.surface).unwrap_or_default();
        let read: Vec<_> = some
            .par_iter()
            .map(|name| {
                let there = writer.has(texture(name), name.number());
                (!there)
                    .then(|| name.read(&root, texture(name)))
                    .transpose()
            })
            .collect::<Result<_>>()?;
        for (name, read) in some.iter().zip(read) {
            match read {
                Some(Some(slide)) => {
                    writer.label(Labels {
                        note: format!("direction {} degrees", name.degrees),
                        finger: FingerCode::MEMS,
                        ..Labels::default()
                    });
                    writer.write(&slide)?;
                    done.slides += 1;
                }
                Some(None) => done.left_out += 1,
                None => done.slides += 1,
            }
            seen += 1;
            progress(seen, slides.len());
        }
    }
    writer.finish()?;
    Ok(done)
}

/// What the name of a file says.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
struct Name {
    surface: u32,
    repetition: u32,
    degrees: u32,
    mm_s: u32,
    mn: u32,
    /// its file below `accel`, `force` and `position`
    file: PathBuf,
}

impl Name {
    fn of(file: PathBuf) -> std::result::Result<Self, ContentError> {
        let stem = file.file_stem().and_then(|stem| stem.to_str());
        let parts: Option<Vec<u32>> = stem.unwrap_or("").split('_').map(number).collect();
        let parts: Option<[u32; 5]> = parts.and_then(|parts| parts.try_into().ok());
        let Some([surface, degrees, mm_s, mn, repetition]) = parts else {
            return Err(ContentError::ClusterName);
        };
        if surface > LAST_SURFACE {
            return Err(ContentError::Surface(surface, LAST_SURFACE));
        }
        let known = degrees % 45 == 0
            && degrees < 360
            && mm_s % 10 == 0
            && (20..=60).contains(&mm_s)
            && [500, 1000].contains(&mn)
            && repetition < 2;
        known.then_some(()).ok_or(ContentError::ClusterName)?;
        Ok(Self {
            surface,
            repetition,
            degrees,
            mm_s,
            mn,
            file,
        })
    }

    /// Number of the slide among those of its surface, from 1.
    fn number(&self) -> u32 {
        let direction = 8 * self.repetition + self.degrees / 45;
        1 + 2 * (5 * direction + self.mm_s / 10 - 2) + u32::from(self.mn == 1000)
    }

    /// The slide; `None` if values are missing from it.
    fn read(&self, root: &Path, texture: usize) -> Result<Option<Recording>> {
        let path = |kind: &str| root.join(kind).join(&self.file);
        let accel = path("accel");
        let fault = |cause| RecordingError::Samples {
            path: accel.clone(),
            cause,
        };
        let z = read(&accel, &["X", "Y", "Z"], |row| row.number("Z"))?;
        let force = read(&path("force"), &["force"], |row| {
            let newton: f64 = row.number("force")?;
            if newton.abs() > 32.0 {
                return Err(row.error(Some("force"), ContentError::Force(newton)));
            }
            Ok(newton)
        })?;
        let at = path("position");
        let xy = read(&at, &["X", "Y"], |row| {
            Ok([row.number("X")?, row.number("Y")?])
        })?;
        let way = self.way(&xy).map_err(|cause| RecordingError::Samples {
            path: at.clone(),
            cause,
        })?;
        let paused =
            |times: &[(f64, f64)]| times.windows(2).any(|w| w[1].0 - w[0].0 > LONGEST_PAUSE);
        if paused(&z) || paused(&force) {
            return Ok(None);
        }
        let movement = u16::try_from(self.mn).unwrap_or(u16::MAX);
        let movement = Movement::new(movement, 1000 * self.mm_s).map_err(|e| fault(e.into()))?;
        let (begin, end) = span(&z);
        let pac = pac(&z).map_err(fault)?;
        // beyond its ends it would be held
        if span(&force).1 < way[1] {
            return Err(RecordingError::Samples {
                path: path("force"),
                cause: ContentError::NoForceThen,
            });
        }
        let steps = 0..((end - begin) * f64::from(PDC_RATE_HZ)) as usize;
        let times: Vec<f64> = steps
            .map(|step| begin + step as f64 / f64::from(PDC_RATE_HZ))
            .collect();
        // of the saturating kind; at most 32 N
        let pdc = super::on_line(&force, &times).map(|n| (n * 1e3 / MN_PER_COUNT).round() as i16);
        let slide = Recording {
            texture,
            number: self.number(),
            movement,
            window: way.map(|time| (time - begin).max(0.0) as f32).into(),
            blocks: Vec::new(),
            background: Some((NOISE.powi(2) * 1e3 / G_PER_COUNT.powi(2)) as f32),
            pdc: pdc.collect(),
            pdc_rate_hz: PDC_RATE_HZ,
            outside_mn: None,
            pace: None,
            shear_rate_hz: PDC_RATE_HZ,
        };
        slide.cut(&[], &pac, None).map(Some).map_err(fault)
    }

    /// When 10 % and 90 % of the way are done, s.
    fn way(&self, at: &[(f64, [f64; 2])]) -> std::result::Result<[f64; 2], ContentError> {
        let mut total = 0.0;
        let steps = at.windows(2).map(|w| {
            let [(_, from), (time, to)] = [w[0], w[1]];
            total += (to[0] - from[0]).hypot(to[1] - from[1]);
            (total, time)
        });
        let steps: Vec<(f64, f64)> = steps.collect();
        let after = |share: f64| {
            let at = steps.partition_point(|(way, _)| *way < share * total);
            steps.get(at).copied().unwrap_or_default()
        };
        let [from, to] = [after(0.1), after(0.9)];
        let mm_s = (to.0 - from.0) / (to.1 - from.1);
        let named = f64::from(self.mm_s);
        // not-a-number, of a finger that stays where it is, is not near either
        if (mm_s / named - 1.0).abs() <= SPEED_OFF {
            Ok([from.1, to.1])
        } else {
            Err(ContentError::Speed(mm_s, self.mm_s))
        }
    }
}

/// The slides below `root`, in the order of surfaces and numbers.
fn slides(root: &Path, from: &Path) -> Result<Vec<Name>> {
    let accel = root.join("accel");
    if !accel.is_dir() {
        return Err(RecordingError::NoCluster(from.to_owned()));
    }
    let mut slides = Vec::new();
    for folder in names(&accel)? {
        if !accel.join(&folder).is_dir() {
            continue;
        }
        for file in names(&accel.join(&folder))? {
            if !file.ends_with(".csv") {
                continue;
            }
            let file = Path::new(&folder).join(file);
            let name = Name::of(file.clone()).map_err(|cause| RecordingError::Samples {
                path: accel.join(&file),
                cause,
            })?;
            slides.push(name);
        }
    }
    if slides.is_empty() {
        return Err(RecordingError::NoCluster(from.to_owned()));
    }
    slides.sort();
    Ok(slides)
}

/// Times and values of a table.
fn read<T>(
    path: &Path,
    columns: &[&'static str],
    value: impl Fn(&Row<'_>) -> std::result::Result<T, RowError>,
) -> Result<Vec<(f64, T)>> {
    let columns: Vec<&'static str> = ["time"].iter().chain(columns).copied().collect();
    let mut rows = Rows::open(path, &columns, &[])?;
    let mut values: Vec<(f64, T)> = Vec::new();
    while let Some(row) = rows.next_row()? {
        let time: f64 = row.number("time")?;
        if values.last().is_some_and(|(before, _)| time <= *before) {
            return Err(row.error(Some("time"), ContentError::NotAfter).into());
        }
        if values.len() == MAX_ROWS {
            return Err(row.error(None, ContentError::Rows(MAX_ROWS)).into());
        }
        values.push((time, value(&row)?));
    }
    if values.len() < 2 {
        return Err(RecordingError::Samples {
            path: path.to_owned(),
            cause: ContentError::Short(values.len(), 2),
        });
    }
    Ok(values)
}

/// The first and last time.
fn span<T>(values: &[(f64, T)]) -> (f64, f64) {
    let time = |value: Option<&(f64, T)>| value.map_or(0.0, |value| value.0);
    (time(values.first()), time(values.last()))
}

/// P_AC from the times and values of Z in g, from the first of them on.
fn pac(z: &[(f64, f64)]) -> std::result::Result<Vec<i16>, ContentError> {
    let (begin, end) = span(z);
    let rate = (z.len() - 1) as f64 / (end - begin);
    // two samples for each cycle of what is kept, and no more than the fastest of these parts gives
    if !(2.0 * f64::from(PAC_RATE_HZ)..=30_000.0).contains(&rate) {
        return Err(ContentError::Rate(rate as u32, "acceleration"));
    }
    let times: Vec<f64> = (0..z.len()).map(|n| begin + n as f64 / rate).collect();
    // about the first value, so that the filter does not begin with a step of 1 g
    let first = z.first().map_or(0.0, |first| first.1);
    let even: Vec<f64> = super::on_line(z, &times).map(|z| z - first).collect();
    let share = std::f64::consts::TAU * HIGH_PASS_HZ / f64::from(PAC_RATE_HZ);
    let mut slow = 0.0;
    let counts = resample(&even, rate).into_iter().map(|z| {
        let before = slow;
        slow += (z - before) * share;
        let counts = (z - (before + slow) / 2.0) / G_PER_COUNT;
        counts.round().clamp(-2048.0, 2047.0) as i16
    });
    Ok(counts.collect())
}

/// From `rate` to [`PAC_RATE_HZ`].
fn resample(samples: &[f64], rate: f64) -> Vec<f64> {
    let ratio = f64::from(PAC_RATE_HZ) / rate;
    let taps = (LOBES / ratio) as usize;
    let filter = SincInterpolationParameters::new(taps, WindowFunction::BlackmanHarris2);
    let resampler = Async::<f64>::new_sinc(ratio, 1.0, &filter, 1024, 1, FixedAsync::Input);
    let mut resampler = resampler.expect("a ratio between 0 and 1");
    let input = InterleavedSlice::new(samples, 1, samples.len()).expect("one channel");
    let output = resampler.process_all(&input, samples.len(), None);
    let output = output.expect("one channel");
    (0..output.frames())
        .filter_map(|frame| output.read_sample(0, frame))
        .collect()
}

#[cfg(test)]
mod tests;
