//! Arrays of numpy: `.npy`, one signal or channels side by side; `.npz`, channels by their names, or a row for each
//! slide with labels.

use super::{Piece, Signals, fits, several};
use crate::data::recordings::npy::{Array, Elements};

/// Names of a number that is the rate, of the labels of slides, of their sessions and of their runs.
const RATES: [&str; 6] = [
    "fs",
    "sr",
    "rate",
    "rate_hz",
    "sample_rate",
    "sampling_rate",
];
const TEXTURES: [&str; 10] = [
    "y",
    "label",
    "labels",
    "texture",
    "textures",
    "material",
    "materials",
    "class",
    "target",
    "targets",
];
const SESSIONS: [&str; 4] = ["session", "sessions", "day", "days"];
const RUNS: [&str; 4] = ["run", "runs", "group", "groups"];
/// Fewest samples in a row that is a slide, not the channels of an instant.
const LEAST: usize = 64;

type Channels = Vec<(String, Vec<f64>)>;

/// A view of an array: how many rows, samples and channels, and elements from one to the next.
struct StridedView<'a> {
    data: &'a [f64],
    rows: (usize, usize),
    samples: (usize, usize),
    channels: (usize, usize),
}

impl<'a> StridedView<'a> {
    /// That of one recording: of two dimensions the longer one is time.
    fn once(array: &'a Array) -> Option<Self> {
        let strides = array.strides();
        let (samples, channels) = match (&array.shape[..], &strides[..]) {
            (&[samples], &[step]) => ((samples, step), (1, 0)),
            (&[a, b], &[of_a, of_b]) if a >= b => ((a, of_a), (b, of_b)),
            (&[a, b], &[of_a, of_b]) => ((b, of_b), (a, of_a)),
            _ => return None,
        };
        Some(Self {
            data: array.numbers()?,
            rows: (1, 0),
            samples,
            channels,
        })
    }

    /// That of a recording in each row: channels are behind the samples, or before them where these are fewer.
    fn rows(array: &'a Array) -> Option<Self> {
        let strides = array.strides();
        let (rows, samples, channels) = match (&array.shape[..], &strides[..]) {
            (&[rows, a], &[of_rows, of_a]) => ((rows, of_rows), (a, of_a), (1, 0)),
            (&[rows, a, b], &[of_rows, of_a, of_b]) if a >= b => {
                ((rows, of_rows), (a, of_a), (b, of_b))
            }
            (&[rows, a, b], &[of_rows, of_a, of_b]) => ((rows, of_rows), (b, of_b), (a, of_a)),
            _ => return None,
        };
        Some(Self {
            data: array.numbers()?,
            rows,
            samples,
            channels,
        })
        .filter(|walk| walk.samples.0 >= LEAST)
    }

    fn channels(&self, most: usize) -> Result<Channels, String> {
        let samples = self.rows.0.saturating_mul(self.samples.0);
        fits(samples, self.channels.0, most)?;
        let at = |row: usize, sample: usize, channel: usize| {
            row * self.rows.1 + sample * self.samples.1 + channel * self.channels.1
        };
        let channel = |c: usize| {
            let places = (0..self.rows.0).flat_map(|r| (0..self.samples.0).map(move |s| (r, s)));
            let numbers = places.filter_map(|(r, s)| self.data.get(at(r, s, c)).copied());
            ((c + 1).to_string(), numbers.collect())
        };
        Ok((0..self.channels.0).map(channel).collect())
    }
}

pub(super) fn npy(file: &[u8], most: usize) -> Result<Signals, String> {
    let array = Array::read(file, most)?;
    if array.numbers().is_none() {
        return Err("an array of words; save one of numbers".to_owned());
    }
    let walk = StridedView::once(&array).ok_or_else(|| {
        let dimensions = array.shape.len();
        format!(
            "an array of {dimensions} dimensions; save one or two, or a .npz of X with a row for each slide, and y \
             with its texture"
        )
    })?;
    Ok(Signals {
        channels: walk.channels(most)?,
        kind: "numpy array",
        ..Signals::default()
    })
}

struct Arrays(Vec<(String, Array)>);

pub(super) fn npz(file: &[u8], most: usize) -> Result<Signals, String> {
    let arrays = unpacked(file, most)?;
    if arrays.is_empty() {
        return Err(
            "a zip file without an array of numpy; unpack it, and import its folder".to_owned(),
        );
    }
    let arrays = Arrays(arrays);
    let mut signals = match arrays.slides(most)? {
        Some(slides) => slides,
        None => arrays.side_by_side(most)?,
    };
    signals.kind = "numpy arrays";
    signals.rate_hz = arrays.rate();
    Ok(signals)
}

#[cfg(not(feature = "files"))]
fn unpacked(_: &[u8], _: usize) -> Result<Vec<(String, Array)>, String> {
    Err("a zip file, which is not read here; use `tactus import`".to_owned())
}

#[cfg(feature = "files")]
fn unpacked(file: &[u8], most: usize) -> Result<Vec<(String, Array)>, String> {
    use super::{MAX_COLUMNS, MAX_PACKED_NUMBERS, MAX_UNPACKED};
    use std::io::{Cursor, Read as _};
    let damaged = |why: &dyn std::fmt::Display| {
        format!("a .npz file that cannot be read ({why}); save it again")
    };
    let entries = file.windows(4).filter(|begin| begin == b"PK\x01\x02");
    if entries.take(MAX_COLUMNS + 1).count() > MAX_COLUMNS {
        return Err(format!("more than {MAX_COLUMNS} arrays; split it"));
    }
    let mut zip = zip::ZipArchive::new(Cursor::new(file)).map_err(|why| damaged(&why))?;
    // what is packed must not fill the memory
    let (room, most) = match file.len() as u64 > MAX_UNPACKED {
        true => (file.len() as u64, most),
        false => (MAX_UNPACKED, most.min(MAX_PACKED_NUMBERS)),
    };
    let (mut arrays, mut total, mut numbers) = (Vec::new(), 0, 0);
    for index in 0..zip.len() {
        let entry = zip.by_index(index).map_err(|why| damaged(&why))?;
        let name = entry.name().map_err(|why| damaged(&why))?.into_owned();
        let Some(name) = name.strip_suffix(".npy").map(str::to_owned) else {
            continue;
        };
        let mut plain = Vec::new();
        let unpacked = entry.take(room + 1 - total).read_to_end(&mut plain);
        unpacked.map_err(|why| damaged(&why))?;
        total += plain.len() as u64;
        if total > room {
            return Err(format!("unpacks to more than {} MB; split it", room >> 20));
        }
        let array = Array::read(&plain, most - numbers);
        let array = array.map_err(|why| format!("array {name:?}: {why}"))?;
        numbers += array.numbers().map_or(0, <[f64]>::len);
        arrays.push((name, array));
    }
    Ok(arrays)
}

impl Arrays {
    /// The array of one of these names.
    fn named(&self, names: &[&str]) -> Option<&Array> {
        let is = |name: &str| names.contains(&name.to_lowercase().as_str());
        let found = self.0.iter().find(|(name, _)| is(name));
        found.map(|(_, array)| array)
    }

    /// The one number that is the rate.
    fn rate(&self) -> Option<f64> {
        match self.named(&RATES)?.numbers()? {
            [rate] => Some(*rate),
            _ => None,
        }
    }

    /// The labels of so many rows under any of these names, as words.
    fn labels(&self, rows: usize, names: &[&str]) -> Option<Vec<String>> {
        let array = self.named(names).filter(|array| array.shape == [rows])?;
        Some(match &array.data {
            Elements::Words(words) => words.clone(),
            Elements::Numbers(data) => data.iter().map(f64::to_string).collect(),
        })
    }

    /// A recording for each row of the largest array, if each has the name of its texture.
    fn slides(&self, most: usize) -> Result<Option<Signals>, String> {
        let wide = self.0.iter().filter_map(|(_, array)| {
            let walk = StridedView::rows(array)?;
            let textures = self.labels(walk.rows.0, &TEXTURES)?;
            Some((walk, textures))
        });
        let Some((walk, textures)) = wide.max_by_key(|(walk, _)| walk.data.len()) else {
            return Ok(None);
        };
        let ((rows, _), (samples, _)) = (walk.rows, walk.samples);
        several(rows)?;
        let [sessions, runs] = [&SESSIONS, &RUNS].map(|names| self.labels(rows, names));
        let of = |labels: &Option<Vec<String>>, n: usize| labels.as_ref()?.get(n).cloned();
        let piece = |(n, texture): (usize, String)| Piece {
            rows: n * samples..(n + 1) * samples,
            texture: Some(texture),
            session: of(&sessions, n),
            // slides that are not said to be of one run may be
            run: Some(of(&runs, n).unwrap_or_default()),
        };
        Ok(Some(Signals {
            channels: walk.channels(most)?,
            pieces: textures.into_iter().enumerate().map(piece).collect(),
            ..Signals::default()
        }))
    }

    /// Arrays as long as the longest one, side by side.
    fn side_by_side(&self, most: usize) -> Result<Signals, String> {
        let long = |array: &Array| array.shape.iter().copied().max().unwrap_or(0);
        let rows = self.0.iter().map(|(_, array)| long(array)).max();
        let mut signals = Signals::default();
        for (name, array) in &self.0 {
            if Some(long(array)) != rows || array.shape.len() > 2 {
                continue;
            }
            if let Elements::Words(words) = &array.data {
                let mut runs: Vec<(String, usize)> = Vec::new();
                for (row, word) in (1..).zip(words) {
                    match runs.last_mut() {
                        Some((last, end)) if last == word => *end = row,
                        _ => runs.push((word.clone(), row)),
                    }
                }
                if runs.len() > super::MOST_RUNS {
                    runs.clear();
                }
                signals.words.push((name.clone(), runs));
            } else if let Some(walk) =
                StridedView::once(array).filter(|walk| Some(walk.samples.0) == rows)
            {
                let channels = walk.channels(most)?;
                let several = channels.len() > 1;
                let own = |(c, samples): (String, Vec<f64>)| match several {
                    true => (format!("{name}_{c}"), samples),
                    false => (name.clone(), samples),
                };
                signals.channels.extend(channels.into_iter().map(own));
            }
        }
        fits(rows.unwrap_or(0), signals.channels.len(), most)?;
        Ok(signals)
    }
}
