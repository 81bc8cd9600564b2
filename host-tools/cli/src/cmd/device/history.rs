//! What this PC remembers of a probe: its last faults, and since when it has its table. The probe itself forgets its faults when
//! they are over, and what it said while nobody listened is not known.

use std::fs::{self, OpenOptions};
use std::io::{self, BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use tactus_core::rig::Fault;
use tactus_core::wire::{Event, Report};
use tactus_lab::data::whole::write_whole;
use time::OffsetDateTime;

/// A longer file loses its older half.
const MAX_BYTES: u64 = 64 << 10;

/// What can be remembered.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum What {
    Fault(Fault),
    /// The firmware gave up, with these words.
    Died(String),
    /// Checksum of the table in use.
    Table(u32),
}

/// A line of the file.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(crate) struct Remembered {
    /// Seconds since 1970, UTC.
    at: i64,
    /// The port at which the probe was.
    port: String,
    pub(crate) what: What,
}

impl Remembered {
    pub(crate) fn time(&self) -> OffsetDateTime {
        OffsetDateTime::from_unix_timestamp(self.at).unwrap_or(OffsetDateTime::UNIX_EPOCH)
    }
}

/// The probe at one port.
#[derive(Debug)]
pub(crate) struct History {
    /// nowhere, where there is no home folder
    file: Option<PathBuf>,
    port: String,
}

impl History {
    pub(crate) fn of(port: &str) -> Self {
        let file = folder().map(|folder| folder.join("history.jsonl"));
        Self {
            file,
            port: port.to_owned(),
        }
    }

    /// Keeps what a report says of this. That it cannot be kept is no reason to stop.
    pub(crate) fn hear(&self, report: &Report) {
        let what = match &report.event {
            Event::Fault(fault) => What::Fault(*fault),
            Event::Booted {
                last_words: Some(words),
                ..
            } => What::Died(words.as_str().to_owned()),
            // a fault of before this PC listened: once
            Event::Status(status) => match status.fault.map(What::Fault) {
                Some(what) if self.last().is_none_or(|last| last.what != what) => what,
                _ => return,
            },
            _ => return,
        };
        self.keep(what, OffsetDateTime::now_utc());
    }

    /// When the table in use was seen at this port first: now, where another one was seen last.
    pub(crate) fn table_since(&self, crc: u32, now: OffsetDateTime) -> OffsetDateTime {
        let table = What::Table(crc);
        let mut all = self.all();
        all.retain(|one| matches!(one.what, What::Table(_)));
        // it may be seen again after another one
        let since = all.iter().rev().take_while(|one| one.what == table).last();
        match since {
            Some(since) => since.time(),
            None => {
                self.keep(table, now);
                now
            }
        }
    }

    /// Its last faults and deaths, the newest first.
    pub(crate) fn faults(&self, most: usize) -> Vec<Remembered> {
        let mut all = self.all();
        all.retain(|one| !matches!(one.what, What::Table(_)));
        all.reverse();
        all.truncate(most);
        all
    }

    fn last(&self) -> Option<Remembered> {
        self.faults(1).pop()
    }

    fn keep(&self, what: What, now: OffsetDateTime) {
        let remembered = Remembered {
            at: now.unix_timestamp(),
            port: self.port.clone(),
            what,
        };
        if let Some(file) = &self.file
            && let Err(why) = append(file, &remembered)
        {
            tracing::warn!("{}: {why}", file.display());
        }
    }

    /// Of this port; what is no line of it is left out.
    fn all(&self) -> Vec<Remembered> {
        let file = self
            .file
            .as_ref()
            .and_then(|file| fs::File::open(file).ok());
        let lines = file
            .into_iter()
            .flat_map(|file| BufReader::new(file).lines());
        let lines = lines.map_while(Result::ok);
        let read = lines.filter_map(|line| serde_json::from_str::<Remembered>(&line).ok());
        read.filter(|one| one.port == self.port).collect()
    }
}

fn append(file: &Path, remembered: &Remembered) -> io::Result<()> {
    if let Some(folder) = file.parent() {
        fs::create_dir_all(folder)?;
    }
    if fs::metadata(file).is_ok_and(|file| file.len() > MAX_BYTES) {
        let text = fs::read_to_string(file)?;
        let lines: Vec<&str> = text.lines().collect();
        let newer = lines.get(lines.len() / 2..).unwrap_or_default();
        write_whole(file, newer.join("\n") + "\n")?;
    }
    let mut line = serde_json::to_vec(remembered)?;
    line.push(b'\n');
    // at once: another command may write, too
    let mut open = OpenOptions::new();
    open.append(true).create(true).open(file)?.write_all(&line)
}

/// Where tactus keeps what it remembers; none without a home folder.
pub(crate) fn folder() -> Option<PathBuf> {
    let given = |variable| std::env::var_os(variable).map(PathBuf::from);
    let data = given("XDG_DATA_HOME").or_else(|| Some(given("HOME")?.join(".local/share")));
    Some(data?.join("tactus"))
}

#[cfg(test)]
mod tests {
    use time::Duration;

    use super::*;

    fn fault(number: u16, fault: Fault) -> Report {
        let event = Event::Fault(fault);
        let at_ms = 0;
        Report {
            number,
            at_ms,
            event,
        }
    }

    #[test]
    fn faults_of_a_port_are_remembered_newest_first() {
        let temp = tempfile::tempdir().unwrap();
        let at = |port: &str| History {
            file: Some(temp.path().join("new/history.jsonl")),
            port: port.to_owned(),
        };
        let [here, there] = ["here", "there"].map(at);
        assert!(here.faults(5).is_empty());
        here.hear(&fault(0, Fault::EStop));
        there.hear(&fault(0, Fault::LeverNotHome));
        here.hear(&fault(1, Fault::StageStall));
        let faults: Vec<What> = here.faults(5).into_iter().map(|one| one.what).collect();
        let both = [Fault::StageStall, Fault::EStop].map(What::Fault);
        assert_eq!(faults, both);
        assert_eq!(here.faults(1).len(), 1);
        // a line that was cut off is no reason to forget the others
        let file = here.file.as_ref().unwrap();
        let text = fs::read_to_string(file).unwrap();
        fs::write(file, format!("{{\"at\":1\n{text}")).unwrap();
        assert_eq!(here.faults(5).len(), 2);
    }

    #[test]
    fn a_table_is_as_old_as_its_first_sight_without_another_between() {
        let temp = tempfile::tempdir().unwrap();
        let history = History {
            file: Some(temp.path().join("history.jsonl")),
            port: "here".to_owned(),
        };
        let day = |days: i64| OffsetDateTime::UNIX_EPOCH + Duration::days(20_000 + days);
        assert_eq!(history.table_since(7, day(0)), day(0));
        assert_eq!(history.table_since(7, day(3)), day(0));
        assert_eq!(history.table_since(8, day(4)), day(4));
        assert_eq!(history.table_since(7, day(5)), day(5));
        assert!(history.faults(5).is_empty());
    }

    #[test]
    fn the_file_does_not_grow_without_end() {
        let temp = tempfile::tempdir().unwrap();
        let file = temp.path().join("history.jsonl");
        let history = History {
            file: Some(file.clone()),
            port: "here".to_owned(),
        };
        for n in 0..1500 {
            history.keep(What::Table(n), OffsetDateTime::UNIX_EPOCH);
        }
        assert!(fs::metadata(&file).unwrap().len() < MAX_BYTES + 200);
        assert_eq!(history.all().last().unwrap().what, What::Table(1499));
    }
}
