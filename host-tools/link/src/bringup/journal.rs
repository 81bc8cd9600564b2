//! What was found so far, a line of JSON for each step that is over, so that the next evening goes on where this one
//! ended.

use std::fs::{File, OpenOptions};
use std::io::{self, Read as _, Write as _};
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::judge::Finding;
use super::steps::Step;

/// A step that is over.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Entry {
    /// The step's key.
    pub step: String,
    /// When, as 2026-11-24T19:30:00Z.
    pub at: String,
    /// True if nothing is wrong.
    pub passed: bool,
    /// The observation.
    pub saw: String,
    /// The mistakes.
    pub mistakes: Vec<EntryMistake>,
    /// Counts of P_DC and weights, mN, of the force scale.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub points: Vec<[f64; 2]>,
}

/// Something that is wrong.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct EntryMistake {
    /// Its key.
    pub key: String,
    /// The mistake, and its place.
    pub what: String,
    /// The remedy.
    pub remedy: String,
}

impl Entry {
    /// The finding of a step at a time.
    pub fn new(step: &Step, at: String, found: &Finding) -> Self {
        let mistakes = found.named.iter().map(|named| {
            let place = match named.place {
                "" => String::new(),
                place => format!(" ({place})"),
            };
            EntryMistake {
                key: named.mistake.key.to_owned(),
                what: format!("{}{place}", named.mistake.what),
                remedy: named.mistake.remedy.to_owned(),
            }
        });
        Self {
            step: step.key.to_owned(),
            at,
            passed: found.passed(),
            saw: found.saw.clone(),
            mistakes: mistakes.collect(),
            points: found.points.clone(),
        }
    }
}

/// The journal's file and what is in it.
#[derive(Debug)]
pub struct Journal {
    file: File,
    entries: Vec<Entry>,
}

impl Journal {
    /// Opens the journal at a path, or begins it. A last line that a power cut left unfinished is nothing.
    pub fn open(path: &Path) -> io::Result<Self> {
        let mut file = OpenOptions::new()
            .read(true)
            .append(true)
            .create(true)
            .open(path)?;
        let mut text = String::new();
        file.read_to_string(&mut text)?;
        let whole = text.rfind('\n').map_or(0, |end| end + 1);
        file.set_len(whole as u64)?;
        let mut entries = Vec::new();
        for (line, number) in text[..whole].lines().zip(1..) {
            entries.push(serde_json::from_str(line).map_err(|why| {
                let why = format!(
                    "{}, line {number}: {why}; begin a new report with another --report",
                    path.display()
                );
                io::Error::new(io::ErrorKind::InvalidData, why)
            })?);
        }
        Ok(Self { file, entries })
    }

    /// True if a step has passed when it ran last.
    pub fn has_passed(&self, key: &str) -> bool {
        self.last(key).is_some_and(|entry| entry.passed)
    }

    /// The last entry of a step.
    pub fn last(&self, key: &str) -> Option<&Entry> {
        self.entries.iter().rfind(|entry| entry.step == key)
    }

    /// Writes an entry, and has the disk keep it.
    pub fn add(&mut self, entry: Entry) -> io::Result<()> {
        let mut line = serde_json::to_string(&entry)?;
        line.push('\n');
        self.file.write_all(line.as_bytes())?;
        self.file.sync_data()?;
        self.entries.push(entry);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(step: &str, passed: bool) -> Entry {
        Entry {
            step: step.to_owned(),
            at: "2026-11-24T19:30:00Z".to_owned(),
            passed,
            saw: "3.30 V".to_owned(),
            mistakes: Vec::new(),
            points: Vec::new(),
        }
    }

    #[test]
    fn a_journal_goes_on_where_it_ended_even_in_the_middle_of_a_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal.jsonl");
        let mut journal = Journal::open(&path).unwrap();
        journal.add(entry("supply", true)).unwrap();
        journal.add(entry("chip", false)).unwrap();
        drop(journal);
        let mut torn = OpenOptions::new().append(true).open(&path).unwrap();
        write!(torn, "{{\"step\": \"pi").unwrap();
        let mut journal = Journal::open(&path).unwrap();
        assert!(journal.has_passed("supply") && !journal.has_passed("chip"));
        assert!(journal.last("pins").is_none());
        journal.add(entry("chip", true)).unwrap();
        let journal = Journal::open(&path).unwrap();
        assert!(journal.has_passed("chip"));
        std::fs::write(&path, "nonsense\n").unwrap();
        let why = Journal::open(&path).unwrap_err().to_string();
        assert!(why.contains("line 1") && why.contains("--report"), "{why}");
    }
}
