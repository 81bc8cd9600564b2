//! A session heard as if the probe said it now, from its log or from what was converted from that.

use tactus_core::table::Table;
use tactus_core::wire::{Command, Event, Identify};

use super::message::Frame;
use super::verifying::{Verifying, config_of, words};
use crate::eval::show::count;
use crate::eval::verified::{Slide, print_answer, print_slide};
use crate::live::{Happening, ProbeMonitor};
use tactus_link::log;
use tactus_link::log::{Line, TableParts};

/// Everything that a log says of its explorations and verifications.
///
/// # Errors
/// It is no log, or of another version.
pub(super) fn replay(log: &[u8]) -> Result<Frame, log::LogError> {
    let mut heard = Replay::default();
    log::read(log, |line| heard.hear(line))?;
    Ok(heard.end())
}

/// A session by its log: one that is heard again, or one that goes on.
#[derive(Default)]
pub(super) struct Replay {
    monitor: ProbeMonitor,
    /// the one in use
    table: Vec<u8>,
    parts: TableParts,
    verification: Option<(Identify, Vec<Event>)>,
    frame: Frame,
    /// slides of a verification are shown as those of an exploration, too
    live: bool,
}

impl Replay {
    /// A session that goes on.
    pub(super) fn live() -> Self {
        Self {
            live: true,
            ..Self::default()
        }
    }

    /// Takes in a line of the log.
    pub(super) fn hear(&mut self, line: Line<'_>) {
        match line {
            Line::Session { port, .. } => {
                self.frame.said = format!("A session with the probe at {port}.\n");
            }
            Line::Command(command) => self.asked(command.into_owned()),
            Line::Report(report) => {
                let report = report.into_owned();
                self.said(report.at_ms, report.event);
            }
        }
    }

    /// The table in use, as far as it is known.
    pub(super) fn in_use(&self) -> Option<Table<'_>> {
        Table::read(&self.table).ok()
    }

    /// The probe uses this table from now on.
    pub(super) fn table(&mut self, whole: Vec<u8>) {
        self.judged();
        self.monitor.knows(&whole);
        self.monitor.learned();
        self.take();
        let known = self.monitor.known().clone();
        self.frame.tables.push((self.frame.happened.len(), known));
        self.table = whole;
    }

    /// The probe was asked for something.
    pub(super) fn asked(&mut self, command: Command) {
        match command {
            Command::Identify(asked) => {
                self.judged();
                let config = self.in_use().map(|table| asked.config(table.contents()));
                if let Some(config) = config {
                    self.monitor.explores(config);
                }
            }
            Command::Verify(asked) => {
                self.judged();
                self.verification = Some((asked, Vec::new()));
            }
            _ => {}
        }
    }

    /// The probe said something, so many ms since it had booted.
    pub(super) fn said(&mut self, at_ms: u32, event: Event) {
        self.frame.at_ms = at_ms;
        if let Event::TablePart {
            offset,
            length,
            bytes,
        } = &event
        {
            if let Some(whole) = self.parts.take(*offset, *length, bytes) {
                self.table(whole);
            }
            return;
        }
        let Some((_, events)) = &mut self.verification else {
            self.monitor.hear(event);
            return;
        };
        if self.live {
            self.monitor.hear(event.clone());
        }
        match event {
            Event::Done(_) => self.judged(),
            Event::Rejected { .. } | Event::Refused { .. } | Event::Trouble(_) => {
                if !self.live {
                    self.monitor.hear(event);
                }
            }
            // samples judge nothing
            Event::Block(_) => {}
            event => {
                let judges = matches!(event, Event::Verified { .. });
                events.push(event);
                let judged = match judges {
                    true => self.verifying().and_then(|(_, slide)| slide),
                    false => None,
                };
                if let Some(slide) = judged {
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

    /// A verification that was under way is over: what it said.
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

    fn take(&mut self) {
        let heard = self.monitor.take();
        self.frame.pac.extend(heard.pac);
        self.frame.spectra.extend(heard.spectra);
        self.frame.happened.extend(heard.happened);
    }

    /// Everything since the last time.
    pub(super) fn frame(&mut self) -> Frame {
        self.take();
        let next = Frame {
            at_ms: self.frame.at_ms,
            ..Frame::default()
        };
        std::mem::replace(&mut self.frame, next)
    }

    /// All of it.
    pub(super) fn end(mut self) -> Frame {
        self.judged();
        self.take();
        let of = |wanted: fn(&Happening) -> bool, what: &str| {
            let happened = self.frame.happened.iter();
            count(happened.filter(|one| wanted(one)).count() as u64, what)
        };
        let explored = of(
            |one| matches!(one, Happening::Verdict { .. }),
            "exploration",
        );
        let verified = of(
            |one| matches!(one, Happening::Verified { .. }),
            "verification",
        );
        self.frame.said += &format!("{explored}, {verified}.\n");
        self.frame
    }
}
