//! Logs of sessions, which `tactus device --log` writes: a line of JSON for every command and every report.

use std::borrow::Cow;
use std::io::{self, BufRead as _, BufReader, Read};
use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};
use tactus_core::wire::{Command, PROTOCOL, Report};

/// One line.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Line<'a> {
    /// The first one: who wrote it.
    Session {
        /// The version of the command.
        tactus: Cow<'a, str>,
        /// The version of the messages.
        protocol: u8,
        /// The probe's port.
        port: Cow<'a, str>,
    },
    /// What the probe was asked for.
    #[serde(alias = "ask")]
    Command(Box<Cow<'a, Command>>),
    /// What it said.
    Report(Box<Cow<'a, Report>>),
}

/// Versions of the messages whose logs are read: since the first of them only reasons have become more than sentences.
const LOGGED: RangeInclusive<u8> = 3..=PROTOCOL;

/// Why a log cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum LogError {
    /// A line is none of a log.
    #[error(
        "line {line} is no line of a session's log ({why}); `tactus device identify --log FILE` writes one"
    )]
    Line {
        /// Its number, from 1.
        line: usize,
        /// What is wrong with it.
        why: serde_json::Error,
    },
    /// Messages of another version.
    #[error(
        "written with version {0} of the messages, this program reads {oldest} to {PROTOCOL}: replay it with the tactus \
         that wrote it",
        oldest = LOGGED.start()
    )]
    Protocol(u8),
    /// The file cannot be read.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// Most bytes of a line: the longest reports, many times over.
const MAX_LINE: u64 = 1 << 20;

/// Reads a log line by line.
///
/// # Errors
/// See [`LogError`].
pub fn read(log: impl Read, mut each: impl FnMut(Line<'static>)) -> Result<(), LogError> {
    let (mut lines, mut line) = (BufReader::new(log), Vec::new());
    for number in 1.. {
        line.clear();
        if lines.by_ref().take(MAX_LINE).read_until(b'\n', &mut line)? == 0 {
            break;
        }
        let read = serde_json::from_slice(&line);
        match read.map_err(|why| LogError::Line { line: number, why })? {
            Line::Session { protocol, .. } if !LOGGED.contains(&protocol) => {
                return Err(LogError::Protocol(protocol));
            }
            line => each(line),
        }
    }
    Ok(())
}
