//! Signals of any file: WAV, CSV and the like, `.npy`, each told by its content; gzip around them is undone.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::io::{Cursor, Read as _};
use std::path::Path;

use flate2::read::GzDecoder;

use crate::data::recordings::{RecordingError, Result, npy, read_bounded};

/// Largest file, and what one that is packed may unpack to: a few bytes must not fill the memory.
pub const MAX_BYTES: u64 = 256 << 20;
const MAX_UNPACKED: u64 = 32 << 20;
/// Most numbers in a file: ten minutes of two channels at 48 kHz; and in one that is packed.
const MAX_NUMBERS: usize = 60_000_000;
const MAX_PACKED_NUMBERS: usize = 12_000_000;
/// Most columns of a table, and most bytes of a line of it.
const MAX_COLUMNS: usize = 4096;
const MAX_LINE: usize = 1 << 20;
/// Most different words of a column that names textures, and most stretches of the same one.
const MOST_WORDS: usize = 1000;
const MOST_RUNS: usize = 100_000;
/// Largest number of any sensor, in any unit.
const LARGEST: f64 = 1e30;

/// Channels that were sampled together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Signals {
    /// Samples per second, if the file says so.
    pub rate_hz: Option<f64>,
    /// The channels with numbers: their names, and their samples.
    pub channels: Vec<(String, Vec<f64>)>,
    /// Columns of words: their names, and each word with the sample behind its last one in a row; none of a column
    /// whose words are too many for names of textures.
    pub words: Vec<(String, Vec<(String, usize)>)>,
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
        if !bytes.starts_with(b"\x1f\x8b") {
            return Self::unpacked(bytes, MAX_NUMBERS);
        }
        let mut plain = Vec::new();
        let unpacked = GzDecoder::new(bytes)
            .take(MAX_UNPACKED + 1)
            .read_to_end(&mut plain);
        unpacked.map_err(|why| format!("no whole gzip file ({why}); fetch it again"))?;
        if plain.len() as u64 > MAX_UNPACKED {
            let most = MAX_UNPACKED >> 20;
            return Err(format!(
                "unpacks to more than {most} MB; unpack it (gunzip)"
            ));
        }
        Self::unpacked(&plain, MAX_PACKED_NUMBERS)
    }

    fn unpacked(bytes: &[u8], most: usize) -> std::result::Result<Self, String> {
        let read = match bytes {
            [b'R', b'I', b'F', b'F', ..] => wav(bytes, most),
            [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => array(bytes, most),
            _ => table(bytes, most),
        }?;
        for (_, samples) in &read.channels {
            if samples.len() < 2 {
                return Err("fewer than two samples; give a longer recording".to_owned());
            }
            if let Some(at) = samples.iter().position(|x| !is_measured(*x)) {
                return Err(format!(
                    "value {} is {}, not a number that was measured; cut it out",
                    at + 1,
                    samples[at]
                ));
            }
        }
        match read.channels.is_empty() {
            true => Err("no column of numbers in it".to_owned()),
            false => Ok(read),
        }
    }

    /// Most memory that a file takes while it is read and made ready, bytes.
    pub(super) fn memory(path: &Path) -> u64 {
        let bytes = std::fs::metadata(path).map_or(0, |file| file.len());
        let packed = path.extension().is_some_and(|end| end == "gz");
        let (most, numbers) = match packed {
            true => (MAX_UNPACKED, MAX_PACKED_NUMBERS),
            false => (bytes.min(MAX_BYTES), MAX_NUMBERS),
        };
        // the file, its numbers, and one channel about its mean and at another rate
        most + 24 * most.min(numbers as u64)
    }

    /// The channel of this name, or of this number from 1.
    pub fn channel(&self, wanted: &str) -> Option<&(String, Vec<f64>)> {
        let named = self.channels.iter().find(|(name, _)| name == wanted);
        let number = || wanted.parse::<usize>().ok()?.checked_sub(1);
        named.or_else(|| self.channels.get(number()?))
    }
}

fn wav(bytes: &[u8], most: usize) -> std::result::Result<Signals, String> {
    let fault = |why: hound::Error| format!("a damaged WAV file ({why}); fetch it again");
    let mut reader = hound::WavReader::new(Cursor::new(bytes)).map_err(fault)?;
    let spec = reader.spec();
    let full_scale = f64::from(1_u32 << (spec.bits_per_sample.clamp(1, 32) - 1));
    let count = usize::from(spec.channels).max(1);
    let samples = reader.duration() as usize;
    fits(samples, count, most)?;
    // not as many as its header claims, if there are fewer bytes
    let room = samples.min(bytes.len() / count);
    let mut channels: Vec<(String, Vec<f64>)> = (1..=count)
        .map(|channel| (channel.to_string(), Vec::with_capacity(room)))
        .collect();
    let mut put = |at: usize, sample: f64| channels[at % count].1.push(sample);
    match spec.sample_format {
        hound::SampleFormat::Float => {
            for (at, sample) in reader.samples::<f32>().enumerate() {
                put(at, sample.map_err(fault)?.into());
            }
        }
        hound::SampleFormat::Int => {
            for (at, sample) in reader.samples::<i32>().enumerate() {
                put(at, f64::from(sample.map_err(fault)?) / full_scale);
            }
        }
    }
    if channels.iter().any(|(_, all)| all.len() != samples) {
        return Err("a damaged WAV file (its last sample is cut off); fetch it again".to_owned());
    }
    Ok(Signals {
        rate_hz: Some(f64::from(spec.sample_rate)),
        channels,
        kind: "WAV",
        ..Signals::default()
    })
}

fn array(bytes: &[u8], most: usize) -> std::result::Result<Signals, String> {
    let channels = npy::read_channels(bytes, |samples, channels| fits(samples, channels, most))?;
    let named = (1..).map(|channel: usize| channel.to_string());
    Ok(Signals {
        channels: named.zip(channels).collect(),
        kind: "numpy array",
        ..Signals::default()
    })
}

/// Refuses more channels, or more numbers in all, than are read.
fn fits(samples: usize, channels: usize, most: usize) -> std::result::Result<(), String> {
    if channels > MAX_COLUMNS {
        return Err(format!("{channels} channels are more than {MAX_COLUMNS}"));
    }
    match samples.checked_mul(channels) {
        Some(numbers) if numbers <= most => Ok(()),
        _ => Err(format!(
            "more than {} million numbers; split it",
            most / 1_000_000
        )),
    }
}

/// True if a sensor can have measured it: arithmetic with more ends in infinities.
fn is_measured(x: f64) -> bool {
    x.abs() <= LARGEST
}

/// Marks between the columns of a table, in the order in which they are tried.
const MARKS: [u8; 4] = [b'\t', b';', b',', b' '];

/// A table of text: the mark between its columns, decimal commas, comments and a header are found by looking at it.
fn table(bytes: &[u8], most: usize) -> std::result::Result<Signals, String> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes)
        .ok()
        .filter(|text| !text.contains('\0'))
        .ok_or("none of WAV, .npy, or a table in UTF-8 text (CSV, TSV); save it as one of them")?;
    let end = if text.contains('\n') { '\n' } else { '\r' };
    let lines = || text.split(end).map(str::trim);
    let (mark, decimal_comma) = marks(lines()).ok_or("an empty file")?;
    let number = |field: &str| -> Option<f64> {
        match decimal_comma {
            true => field.replace(',', ".").parse().ok(),
            false => field.parse().ok(),
        }
    };
    let mut columns: Vec<Column> = Vec::new();
    for (line, text) in (1..).zip(lines()).filter(|(_, text)| is_row(text)) {
        if text.len() > MAX_LINE {
            return Err(format!(
                "line {line} has {} bytes: no row of a table",
                text.len()
            ));
        }
        let fields = fields(text, mark);
        if columns.is_empty() {
            fits(1, fields.len(), most)?;
            let is_header = fields.iter().all(|f| number(f).is_none());
            let name = |(at, field): (usize, &Cow<'_, str>)| match is_header && !field.is_empty() {
                true => field.to_string(),
                false => (at + 1).to_string(),
            };
            let names = fields.iter().enumerate().map(name);
            columns = names.map(Column::new).collect();
            if is_header {
                continue;
            }
        }
        // one mark too many at the end is let pass
        let mut rest = fields.get(columns.len()..).unwrap_or_default().iter();
        if fields.len() < columns.len() || rest.any(|f| !f.is_empty()) {
            return Err(format!(
                "line {line}: {} fields where there are {} columns: cut off or damaged",
                fields.len(),
                columns.len()
            ));
        }
        fits(columns[0].numbers.len() + 1, columns.len(), most)?;
        for (column, field) in columns.iter_mut().zip(&fields) {
            column.push(field, number(field));
        }
    }
    columns_of(columns)
}

/// True for a line that is neither empty nor a comment.
fn is_row(line: &str) -> bool {
    !line.is_empty() && !line.starts_with(['#', '%'])
}

/// The fields of a line, without blanks and quotes around them.
fn fields(line: &str, mark: u8) -> Vec<Cow<'_, str>> {
    let is_field = |field: &str| mark != b' ' || !field.is_empty();
    if !line.contains('"') {
        let fields = line.split(char::from(mark)).map(str::trim);
        return fields.filter(|f| is_field(f)).map(Cow::Borrowed).collect();
    }
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(mark)
        .has_headers(false)
        .trim(csv::Trim::All)
        .buffer_capacity(line.len())
        .from_reader(line.as_bytes());
    let mut record = csv::StringRecord::new();
    // a line of text in memory is one record at least
    let _ = reader.read_record(&mut record);
    let fields = record.iter().filter(|f| is_field(f));
    fields.map(|f| Cow::Owned(f.to_owned())).collect()
}

/// The mark between the columns of a text, and whether numbers have a decimal comma, by its second row.
fn marks<'t>(lines: impl Iterator<Item = &'t str>) -> Option<(u8, bool)> {
    let mut rows = lines.filter(|line| is_row(line));
    let first = rows.next()?;
    let row = rows.next().unwrap_or(first);
    let mark = MARKS.iter().find(|mark| row.as_bytes().contains(mark));
    let mark = *mark.unwrap_or(&b',');
    Some((
        mark,
        mark != b',' && !row.contains('.') && row.contains(','),
    ))
}

/// A column while it is read.
struct Column {
    name: String,
    /// The number of each row; not a number where there is a word.
    numbers: Vec<f64>,
    /// Rows with a number.
    with_number: usize,
    /// The first row with none, or with one that no sensor measures.
    wrong: Option<(usize, String)>,
    /// Its words, each with its place among them.
    words: HashMap<String, u32>,
    /// Rows with the same word one after the other: its place, and the row behind the last. Empty for too many.
    runs: Vec<(u32, usize)>,
    names_nothing: bool,
}

impl Column {
    fn new(name: String) -> Self {
        Self {
            name,
            numbers: Vec::new(),
            with_number: 0,
            wrong: None,
            words: HashMap::new(),
            runs: Vec::new(),
            names_nothing: false,
        }
    }

    fn push(&mut self, field: &str, number: Option<f64>) {
        let row = self.numbers.len();
        if row == self.numbers.capacity() {
            // doubled, it would be twice as much as is read
            self.numbers.reserve_exact(row / 4 + 16);
        }
        let number = number.filter(|x| !x.is_nan());
        self.numbers.push(number.unwrap_or(f64::NAN));
        self.with_number += usize::from(number.is_some());
        if !number.is_some_and(is_measured) && self.wrong.is_none() {
            self.wrong = Some((row, field.chars().take(40).collect()));
        }
        if number.is_none() && !self.names_nothing {
            self.word(field, row);
        }
    }

    fn word(&mut self, word: &str, row: usize) {
        let place = match self.words.get(word) {
            Some(place) => *place,
            None => {
                let place = self.words.len() as u32;
                self.words.insert(word.to_owned(), place);
                place
            }
        };
        match self.runs.last_mut() {
            Some((last, end)) if *last == place && *end == row => *end += 1,
            _ => self.runs.push((place, row + 1)),
        }
        if self.words.len() > MOST_WORDS || self.runs.len() > MOST_RUNS {
            (self.words, self.runs) = Default::default();
            self.names_nothing = true;
        }
    }

    /// Its stretches of the same word; numbers among words are words, too. None if it is no column of names.
    fn stretches(self) -> Vec<(String, usize)> {
        let mut names = vec![""; self.words.len()];
        for (word, place) in &self.words {
            names[*place as usize] = word;
        }
        let mut stretches: Vec<(String, usize)> = Vec::new();
        let mut put = |word: Cow<'_, str>, end: usize| match stretches.last_mut() {
            Some((last, before)) if *last == word => *before = end,
            _ => stretches.push((word.into_owned(), end)),
        };
        let mut words = self.runs.iter().peekable();
        let mut row = 0;
        while row < self.numbers.len() && !self.names_nothing {
            match words.next_if(|_| self.numbers[row].is_nan()) {
                Some((place, end)) => {
                    put(Cow::Borrowed(names[*place as usize]), *end);
                    row = *end;
                }
                None => {
                    put(Cow::Owned(self.numbers[row].to_string()), row + 1);
                    row += 1;
                }
            }
        }
        if stretches.len() > MOST_RUNS {
            stretches.clear();
        }
        stretches
    }
}

/// Sorts columns into numbers and words.
fn columns_of(columns: Vec<Column>) -> std::result::Result<Signals, String> {
    let mut signals = Signals {
        kind: "table",
        ..Signals::default()
    };
    let mut twice = HashSet::new();
    for mut column in columns {
        let name = std::mem::take(&mut column.name);
        if !twice.insert(name.clone()) {
            return Err(format!(
                "two columns are called {name:?}; give each a name of its own"
            ));
        }
        // a column with some words among its numbers is damaged, not a column of words
        if column.with_number * 2 <= column.numbers.len() {
            signals.words.push((name, column.stretches()));
            continue;
        }
        if let Some((row, word)) = column.wrong {
            return Err(format!(
                "row {} of column {name:?}: {word:?} is not a number that was measured; mend it or cut it out",
                row + 1,
            ));
        }
        signals.channels.push((name, column.numbers));
    }
    Ok(signals)
}

#[cfg(test)]
mod tests;
