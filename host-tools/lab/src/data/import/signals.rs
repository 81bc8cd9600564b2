//! Signals of any file: WAV, CSV and the like, `.npy`, each told by its content; gzip around them is undone.

use std::collections::HashMap;
use std::io::{Cursor, Read as _};
use std::path::Path;

use flate2::read::GzDecoder;

use crate::data::recordings::{RecordingError, Result, npy, read_bounded};

/// Largest file, packed or not: half an hour at 48 kHz in 24 bits.
pub const MAX_BYTES: u64 = 256 << 20;
/// Most columns of a table.
const MAX_COLUMNS: usize = 4096;

/// Channels that were sampled together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Signals {
    /// Samples per second, if the file says so.
    pub rate_hz: Option<f64>,
    /// The channels with numbers: their names, and their samples.
    pub channels: Vec<(String, Vec<f64>)>,
    /// Columns of words: their names, and a word for each sample.
    pub words: Vec<(String, Vec<String>)>,
    /// The kind of file, in words.
    pub kind: &'static str,
}

impl Signals {
    /// Reads a file of any of the kinds.
    /// Errors: It cannot be read, is none of these kinds, or is damaged.
    pub fn read(path: &Path) -> Result<Self> {
        Self::of(&read_bounded(path, MAX_BYTES)?).map_err(|why| RecordingError::at(path, why))
    }

    /// The signals in the bytes of a file.
    /// Errors: These are of none of the kinds, or damaged.
    pub fn of(bytes: &[u8]) -> std::result::Result<Self, String> {
        let mut plain = Vec::new();
        let bytes = if bytes.starts_with(b"\x1f\x8b") {
            let unpacked = GzDecoder::new(bytes)
                .take(MAX_BYTES + 1)
                .read_to_end(&mut plain);
            unpacked.map_err(|why| format!("no whole gzip file ({why}); fetch it again"))?;
            if plain.len() as u64 > MAX_BYTES {
                return Err(format!(
                    "unpacks to more than {} MB; split it",
                    MAX_BYTES >> 20
                ));
            }
            &plain
        } else {
            bytes
        };
        let read = match bytes {
            [b'R', b'I', b'F', b'F', ..] => wav(bytes),
            [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => array(bytes),
            _ => table(bytes),
        }?;
        match read.channels.iter().find(|(_, samples)| samples.len() < 2) {
            Some(_) => Err("fewer than two samples; give a longer recording".to_owned()),
            None if read.channels.is_empty() => Err("no column of numbers in it".to_owned()),
            None => Ok(read),
        }
    }

    /// The channel of this name, or of this number from 1.
    pub fn channel(&self, wanted: &str) -> Option<&(String, Vec<f64>)> {
        let named = self.channels.iter().find(|(name, _)| name == wanted);
        let number = || wanted.parse::<usize>().ok()?.checked_sub(1);
        named.or_else(|| self.channels.get(number()?))
    }
}

fn wav(bytes: &[u8]) -> std::result::Result<Signals, String> {
    let fault = |why: hound::Error| format!("a damaged WAV file ({why}); fetch it again");
    let mut reader = hound::WavReader::new(Cursor::new(bytes)).map_err(fault)?;
    let spec = reader.spec();
    let full_scale = f64::from(1_u32 << (spec.bits_per_sample.clamp(1, 32) - 1));
    let all: std::result::Result<Vec<f64>, _> = match spec.sample_format {
        hound::SampleFormat::Float => reader.samples::<f32>().map(|s| s.map(f64::from)).collect(),
        hound::SampleFormat::Int => {
            let samples = reader.samples::<i32>();
            samples
                .map(|s| s.map(|s| f64::from(s) / full_scale))
                .collect()
        }
    };
    let all = all.map_err(fault)?;
    let channels = usize::from(spec.channels).max(1);
    let channel = |c: usize| all.iter().skip(c).step_by(channels).copied().collect();
    finite(&all)?;
    Ok(Signals {
        rate_hz: Some(f64::from(spec.sample_rate)),
        channels: (0..channels)
            .map(|c| ((c + 1).to_string(), channel(c)))
            .collect(),
        words: Vec::new(),
        kind: "WAV",
    })
}

fn array(bytes: &[u8]) -> std::result::Result<Signals, String> {
    let npy::Array { shape, data } = npy::read_any(bytes)?;
    finite(&data)?;
    let (samples, channels, by_row) = match shape[..] {
        [samples] => (samples, 1, true),
        // a recording is longer than it has channels
        [one, other] if one >= other => (one, other, true),
        [one, other] => (other, one, false),
        _ => {
            return Err(format!(
                "an array of {} dimensions; save one or two",
                shape.len()
            ));
        }
    };
    let at = |sample: usize, channel: usize| match by_row {
        true => data[sample * channels + channel],
        false => data[channel * samples + sample],
    };
    let channel = |c: usize| {
        (
            (c + 1).to_string(),
            (0..samples).map(|s| at(s, c)).collect(),
        )
    };
    if channels > MAX_COLUMNS {
        return Err(format!("{channels} channels are more than {MAX_COLUMNS}"));
    }
    Ok(Signals {
        channels: (0..channels).map(channel).collect(),
        kind: "numpy array",
        ..Signals::default()
    })
}

fn finite(samples: &[f64]) -> std::result::Result<(), String> {
    match samples.iter().position(|s| !s.is_finite()) {
        None => Ok(()),
        Some(at) => Err(format!(
            "value {} is {}, not a number that was measured; cut it out",
            at + 1,
            samples[at]
        )),
    }
}

/// Marks between the columns of a table, in the order in which they are tried.
const MARKS: [u8; 4] = [b'\t', b';', b',', b' '];

/// A table of text: the mark between its columns, decimal commas, comments and a header are found by looking at it.
fn table(bytes: &[u8]) -> std::result::Result<Signals, String> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes)
        .ok()
        .filter(|text| !text.contains('\0'))
        .ok_or("none of WAV, .npy, or a table in UTF-8 text (CSV, TSV); save it as one of them")?;
    let (mark, decimal_comma) = marks(text).ok_or("an empty file")?;
    let number = |field: &str| -> Option<f64> {
        let field = field.trim();
        match decimal_comma {
            true => field.replace(',', ".").parse().ok(),
            false => field.parse().ok(),
        }
    };
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(mark)
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(bytes);
    let mut names: Vec<String> = Vec::new();
    let mut columns: Vec<Vec<(Option<f64>, String)>> = Vec::new();
    let mut record = csv::StringRecord::new();
    loop {
        let line = reader.position().line();
        let more = reader.read_record(&mut record);
        if !more.map_err(|why| format!("line {line}: {why}"))? {
            break;
        }
        let is_comment = |field: &str| field.starts_with(['#', '%']);
        if record.iter().all(str::is_empty) || record.get(0).is_some_and(is_comment) {
            continue;
        }
        let fields: Vec<&str> = record
            .iter()
            .filter(|f| mark != b' ' || !f.is_empty())
            .collect();
        if names.is_empty() {
            if fields.len() > MAX_COLUMNS {
                return Err(format!(
                    "{} columns are more than {MAX_COLUMNS}",
                    fields.len()
                ));
            }
            columns = vec![Vec::new(); fields.len()];
            let is_header = fields.iter().all(|f| number(f).is_none());
            let name = |(at, field): (usize, &&str)| match is_header && !field.is_empty() {
                true => (*field).to_owned(),
                false => (at + 1).to_string(),
            };
            names = fields.iter().enumerate().map(name).collect();
            if is_header {
                continue;
            }
        }
        // one mark too many at the end is let pass
        let rest = fields.get(names.len()..).unwrap_or_default();
        if fields.len() < names.len() || rest.iter().any(|f| !f.is_empty()) {
            return Err(format!(
                "line {line}: {} fields where there are {} columns: cut off or damaged",
                fields.len(),
                names.len()
            ));
        }
        for (column, field) in columns.iter_mut().zip(&fields) {
            let value = number(field);
            let word = value.map_or_else(|| (*field).to_owned(), |_| String::new());
            column.push((value, word));
        }
    }
    columns_of(names, columns)
}

/// The mark between the columns of a text, and whether numbers have a decimal comma, by its second row.
fn marks(text: &str) -> Option<(u8, bool)> {
    let is_row = |line: &&str| !line.is_empty() && !line.starts_with(['#', '%']);
    let mut rows = text.lines().map(str::trim).filter(is_row);
    let first = rows.next()?;
    let row = rows.next().unwrap_or(first);
    let mark = MARKS.iter().find(|mark| row.as_bytes().contains(mark));
    let mark = *mark.unwrap_or(&b',');
    Some((
        mark,
        mark != b',' && !row.contains('.') && row.contains(','),
    ))
}

/// Sorts columns into numbers and words.
fn columns_of(
    names: Vec<String>,
    columns: Vec<Vec<(Option<f64>, String)>>,
) -> std::result::Result<Signals, String> {
    let mut signals = Signals {
        kind: "table",
        ..Signals::default()
    };
    let mut twice = HashMap::new();
    for (name, column) in names.into_iter().zip(columns) {
        if twice.insert(name.clone(), ()).is_some() {
            return Err(format!(
                "two columns are called {name:?}; give each a name of its own"
            ));
        }
        let numbers = column.iter().filter(|(value, _)| value.is_some()).count();
        // a column with some words among its numbers is damaged, not a column of words
        if numbers * 2 > column.len() {
            let wrong = column
                .iter()
                .position(|(value, _)| !value.is_some_and(f64::is_finite));
            if let Some(row) = wrong {
                let (value, word) = &column[row];
                let word = value.map_or_else(|| word.clone(), |value| value.to_string());
                return Err(format!(
                    "row {} of column {name:?}: {:?} is not a number; mend it or cut it out",
                    row + 1,
                    word.chars().take(40).collect::<String>()
                ));
            }
            let values = column.into_iter().filter_map(|(value, _)| value);
            signals.channels.push((name, values.collect()));
        } else {
            let words = column.into_iter();
            let word = |(value, word): (Option<f64>, String)| value.map_or(word, |v| v.to_string());
            signals.words.push((name, words.map(word).collect()));
        }
    }
    Ok(signals)
}

#[cfg(test)]
mod tests;
