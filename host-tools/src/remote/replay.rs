//! A log of a session, heard as if the probe said it now.

use tactus_core::table::Table;
use tactus_core::wire::{self, Event};

use super::message::Frame;
use crate::eval::show::count;
use crate::link::log::{self, Line, LogError};
use crate::live::{Happening, Hearing};

/// Everything that a log says of its explorations.
///
/// # Errors
/// It is no log, or of another version.
pub(super) fn replay(log: &[u8]) -> Result<Frame, LogError> {
    let mut hearing = Hearing::default();
    let (mut parts, mut table) = (log::TableParts::default(), Vec::new());
    let mut frame = Frame::default();
    log::read(log, |line| match line {
        Line::Session { port, .. } => {
            frame.said = format!("A session with the probe at {port}.\n");
        }
        Line::Command(command) => {
            if let wire::Command::Identify(asked) = command.into_owned()
                && let Ok(table) = Table::read(&table)
            {
                hearing.explores(asked.config(table.contents()));
            }
        }
        Line::Report(report) => {
            let report = report.into_owned();
            if let Event::TablePart {
                offset,
                length,
                bytes,
            } = &report.event
            {
                if let Some(whole) = parts.take(*offset, *length, bytes) {
                    hearing.knows(&whole);
                    take(&mut frame, &mut hearing);
                    let known = hearing.known().clone();
                    frame.tables.push((frame.happened.len(), known));
                    table = whole;
                }
                return;
            }
            frame.at_ms = report.at_ms;
            hearing.hear(report.event);
        }
    })?;
    take(&mut frame, &mut hearing);
    let answers = |one: &&Happening| matches!(one, Happening::Verdict { .. });
    let explorations = frame.happened.iter().filter(answers).count();
    frame.said += &format!("{}.\n", count(explorations as u64, "exploration"));
    Ok(frame)
}

fn take(frame: &mut Frame, hearing: &mut Hearing) {
    let heard = hearing.take();
    frame.pac.extend(heard.pac);
    frame.spectra.extend(heard.spectra);
    frame.happened.extend(heard.happened);
}
