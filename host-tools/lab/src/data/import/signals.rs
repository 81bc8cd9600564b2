//! Signals of any file: WAV, tables of text, numpy's arrays, MCAP of ours, each told by its content; gzip around them
//! is undone.

use std::borrow::Cow;
use std::collections::HashMap;
use std::io::Read as _;
use std::ops::Range;
use std::path::Path;

use flate2::read::GzDecoder;

use crate::data::recordings::{RecordingError, Result, read_bounded};

mod arrays;
#[cfg(feature = "files")]
mod mcap;
mod table;
mod wav;

/// Largest file, and what one that is packed may unpack to: a few bytes must not fill the memory.
pub const MAX_BYTES: u64 = 256 << 20;
const MAX_UNPACKED: u64 = 32 << 20;
/// Most numbers in a file: ten minutes of two channels at 48 kHz; and in one that is packed.
const MAX_NUMBERS: usize = 60_000_000;
const MAX_PACKED_NUMBERS: usize = 12_000_000;
/// Most columns of a table.
const MAX_COLUMNS: usize = 4096;
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
    /// Samples of channels that are missing in the file, and lie on straight lines here.
    pub missing: HashMap<String, Vec<usize>>,
    /// Columns of words: their names, and each word with the sample behind its last one in a row; none of a column
    /// whose words are too many for names of textures.
    pub words: Vec<(String, Vec<(String, usize)>)>,
    /// The recordings in the file, where it says that these are several; none: one.
    pub pieces: Vec<Piece>,
    /// The kind of file, in words.
    pub kind: &'static str,
}

/// One recording of several in a file; what is `None` the file does not say.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Piece {
    /// Its samples.
    pub rows: Range<usize>,
    /// Its texture.
    pub texture: Option<String>,
    /// Its session.
    pub session: Option<String>,
    /// Its run.
    pub run: Option<String>,
}

/// Files of data that are not read: how they begin, how their names end, and a remedy.
const OTHERS: [(&[u8], &[&str], &str); 9] = [
    (b"PAR1", &["parquet"], PARQUET),
    (b"fLaC", &["flac"], "FLAC; unpack it by `flac -d`"),
    (
        b"OggS",
        &["ogg", "opus"],
        "Ogg, which loses vibration; record WAV",
    ),
    (b"ID3", &["mp3"], "MP3, which loses vibration; record WAV"),
    (b"FORM", &["aif", "aiff"], "AIFF; save it as WAV"),
    (
        b"\x89HDF",
        &["h5", "hdf5"],
        "HDF5; save its arrays by numpy.save",
    ),
    (
        b"MATLAB",
        &["mat"],
        "MATLAB; save its arrays by writematrix or numpy.save",
    ),
    (b"%PDF", &[], "PDF; save the numbers as CSV"),
    (
        b"\xd0\xcf\x11\xe0",
        &["xls", "xlsx", "ods"],
        "a spreadsheet; save it as CSV",
    ),
];

/// Pandas has a reader of its own, and no crate of less than twenty others reads what it writes.
const PARQUET: &str = "parquet, which is not read; these two lines of Python make CSV of all below this folder:\n\
                       import glob, pandas\n\
                       for f in glob.glob(\"**/*.parquet\", recursive=True): \
                       pandas.read_parquet(f).to_csv(f[:-7] + \"csv\", index=False)";

/// The remedy for files whose names end so, which are data but not read.
pub(super) fn not_read(end: &str) -> Option<&'static str> {
    let mut others = OTHERS.iter();
    others.find_map(|(_, ends, what)| ends.contains(&end).then_some(*what))
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
        if let Some((.., what)) = OTHERS.iter().find(|(begin, ..)| bytes.starts_with(begin)) {
            return Err(format!("a file of {what}"));
        }
        let read = match bytes {
            [b'R', b'I', b'F', b'F', ..] | [b'R', b'F', b'6', b'4', ..] => wav::read(bytes, most),
            [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => arrays::npy(bytes, most),
            [b'P', b'K', 3 | 5, 4 | 6, ..] => arrays::npz(bytes, most),
            #[cfg(feature = "files")]
            [0x89, b'M', b'C', b'A', b'P', ..] => mcap::read(bytes, most),
            #[cfg(not(feature = "files"))]
            [0x89, b'M', ..] => Err("MCAP, which is not read here; use `tactus import`".to_owned()),
            _ => table::read(bytes, most),
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
        let ending = |end: &str| path.extension().is_some_and(|own| own == end);
        let (most, numbers) = match () {
            () if ending("gz") => (MAX_UNPACKED, MAX_PACKED_NUMBERS),
            () if ending("npz") => (bytes.clamp(MAX_UNPACKED, MAX_BYTES), MAX_NUMBERS),
            () => (bytes.min(MAX_BYTES), MAX_NUMBERS),
        };
        // the file, its numbers, and one channel about its mean and at another rate
        most + 24 * most.min(numbers as u64)
    }

    /// The channel of this name, with or without its unit, or of this number from 1.
    pub fn channel(&self, wanted: &str) -> Option<&(String, Vec<f64>)> {
        let named = |is: &dyn Fn(&str) -> bool| self.channels.iter().find(|(name, _)| is(name));
        let number = || wanted.parse::<usize>().ok()?.checked_sub(1);
        named(&|name| name == wanted)
            .or_else(|| named(&|name| bare(name).eq_ignore_ascii_case(wanted)))
            .or_else(|| self.channels.get(number()?))
    }

    /// A column as words, each with the sample behind its last one in a row; empty for too many.
    pub(super) fn runs(&self, wanted: &str) -> Option<Cow<'_, [(String, usize)]>> {
        let is = |name: &str| name == wanted || bare(name).eq_ignore_ascii_case(wanted);
        if let Some((_, runs)) = self.words.iter().find(|(name, _)| is(name)) {
            return Some(Cow::Borrowed(runs));
        }
        // not by its place: a session may be called 1
        let (name, values) = self.channels.iter().find(|(name, _)| is(name))?;
        let mut missing = self.missing.get(name).into_iter().flatten().peekable();
        let mut runs: Vec<(Option<f64>, usize)> = Vec::new();
        for (row, value) in values.iter().enumerate() {
            let is_missing = missing.next_if(|at| **at == row).is_some();
            let value = Some(*value).filter(|_| !is_missing);
            match runs.last_mut() {
                Some((last, end)) if *last == value => *end += 1,
                _ => runs.push((value, row + 1)),
            }
            if runs.len() > MOST_RUNS {
                return Some(Cow::Borrowed(&[]));
            }
        }
        let word = |value: Option<f64>| value.map(|x| x.to_string()).unwrap_or_default();
        let runs = runs.into_iter().map(|(value, end)| (word(value), end));
        Some(runs.collect())
    }
}

/// The name of a column without its unit: `ax` of `ax (m/s2)` and of `ax [g]`.
pub(super) fn bare(name: &str) -> &str {
    name.split(['(', '[']).next().unwrap_or(name).trim()
}

/// The unit in the name of a column.
pub(super) fn unit(name: &str) -> Option<&str> {
    let (_, unit) = name.split_once(['(', '['])?;
    Some(unit.trim_end_matches([')', ']']).trim()).filter(|unit| !unit.is_empty())
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

/// Refuses more recordings in a file than are told apart.
fn several(pieces: usize) -> std::result::Result<(), String> {
    match pieces > MOST_RUNS {
        true => Err(format!("more than {MOST_RUNS} recordings; split it")),
        false => Ok(()),
    }
}

/// True if a sensor can have measured it: arithmetic with more ends in infinities.
fn is_measured(x: f64) -> bool {
    x.abs() <= LARGEST
}

#[cfg(test)]
mod tests;
