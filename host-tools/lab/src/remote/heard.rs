//! A session that goes on, followed by its log.

use tactus_core::table::Table;
use tactus_core::wire::{Command, Event, Identify};
use tactus_link::log::{Line, TableParts};

use super::verifying::{Verifying, config_of, words};
use crate::eval::verified::{Slide, print_answer, print_slide};
use crate::live::{Happening, KnownTable, ProbeMonitor, Received};

#[derive(Default)]
pub(super) struct Heard {
    monitor: ProbeMonitor,
    table: Vec<u8>,
    parts: TableParts,
    verification: Option<(Identify, Vec<Event>)>,
    /// of the table, since the last frame
    known: Option<KnownTable>,
    pub(super) at_ms: u32,
}

impl Heard {
    pub(super) fn hear(&mut self, line: &Line<'_>) {
        match line {
            Line::Session { .. } => {}
            Line::Command(command) => self.asked(command),
            Line::Report(report) => {
                self.at_ms = report.at_ms;
                self.said(&report.event);
            }
        }
    }

    fn asked(&mut self, command: &Command) {
        match command {
            Command::Identify(asked) => {
                self.judged();
                if let Ok(table) = Table::read(&self.table) {
                    self.monitor.explores(asked.config(table.contents()));
                }
            }
            Command::Verify(asked) => {
                self.judged();
                self.verification = Some((asked.clone(), Vec::new()));
            }
            _ => {}
        }
    }

    fn said(&mut self, event: &Event) {
        if let Event::TablePart {
            offset,
            length,
            bytes,
        } = event
        {
            if let Some(whole) = self.parts.take(*offset, *length, bytes) {
                self.judged();
                self.monitor.knows(&whole);
                self.monitor.learned();
                self.known = Some(self.monitor.known().clone());
                self.table = whole;
            }
            return;
        }
        self.monitor.hear(event.clone());
        let Some((_, events)) = &mut self.verification else {
            return;
        };
        match event {
            Event::Done(_) => self.judged(),
            // samples judge nothing
            Event::Rejected { .. }
            | Event::Refused { .. }
            | Event::Trouble(_)
            | Event::Block(_) => {}
            event => {
                events.push(event.clone());
                if !matches!(event, Event::Verified { .. }) {
                    return;
                }
                if let Some((_, Some(slide))) = self.verifying() {
                    self.monitor.happens(Happening::Judged {
                        slide: slide.number,
                        answer: slide.answer,
                        said: words(|out| print_slide(&slide, out)),
                    });
                }
            }
        }
    }

    /// The verification so far, and its last slide.
    fn verifying(&self) -> Option<(Verifying<'_>, Option<Slide>)> {
        let (asked, events) = self.verification.as_ref()?;
        let reference = *asked.among.first()?;
        let mut verifying = Verifying::new(&self.table, reference, config_of(asked)).ok()?;
        let mut last = None;
        for event in events {
            last = verifying.hear(event).cloned().or(last);
        }
        Some((verifying, last))
    }

    fn judged(&mut self) {
        let verified = self.verifying().and_then(|(verifying, last)| {
            last?;
            Some(verifying.end())
        });
        self.verification = None;
        if let Some(verified) = verified {
            let said = words(|out| print_answer(&verified, out));
            self.monitor.happens(Happening::Verified {
                answer: verified.answer,
                said,
            });
        }
    }

    /// Everything since the last time, and the table if it is another one.
    pub(super) fn take(&mut self) -> (Received, Option<KnownTable>) {
        (self.monitor.take(), self.known.take())
    }
}
