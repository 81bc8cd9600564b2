//! `tactus device monitor`: the probe live on a terminal.
//!
//! [`Monitor`] is all that is known, from the reports alone; [`view`] draws it; [`run`] brings keys, reports and time
//! together.

mod view;

use std::collections::VecDeque;
use std::io::{self, IsTerminal as _};
use std::task::Poll;
use std::time::{Duration, Instant};

use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use tactus::link::{Job, LinkError, PortError, Question, ReadTable};
use tactus_core::movement::Movement;
use tactus_core::rig::guard::Fault;
use tactus_core::table::{Action, Table};
use tactus_core::wire::{Ask, Felt, Identify, Live, PROTOCOL, Phase, Report, Status, Tell};

use super::bench::{Bench, BenchError};

/// P_AC samples that are shown: a second.
const SHOWN: usize = 2200;
/// Notes that are kept.
const NOTES: usize = 50;
/// How often the screen is drawn, and the probe asked how it is.
const DRAWN: Duration = Duration::from_millis(100);
const ASKED: Duration = Duration::from_secs(1);
/// A probe that is asked every second and says nothing for so long is told to be silent.
const SILENT: Duration = Duration::from_secs(3);

/// How much a note matters.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Weight {
    Said,
    Fault,
}

/// A line for people, with the probe's time.
#[derive(Clone, PartialEq, Debug)]
struct Note {
    at_ms: u32,
    weight: Weight,
    text: String,
}

/// The movement that is made, and why.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Chosen {
    slide: u8,
    movement: Movement,
    action: Action,
    /// uncertainty that it should leave
    leaves: Option<f32>,
}

/// What is known of the probe.
pub(super) struct Monitor {
    place: String,
    names: Vec<String>,
    /// of the table that these are from
    table_crc: u32,
    status: Status,
    at_ms: u32,
    phase: Phase,
    fault: Option<Fault>,
    live: Option<Live>,
    pac: VecDeque<i16>,
    chosen: Option<Chosen>,
    felt: Option<Felt>,
    posterior: Vec<f32>,
    answer: Option<String>,
    notes: VecDeque<Note>,
    /// frames damaged and reports lost on the line
    losses: (u64, u64),
    /// no report for so long
    silent: Option<Duration>,
    /// the messages of a probe that has started with other firmware
    protocol: Option<u8>,
    /// it has started anew: what was asked of it is forgotten
    rebooted: bool,
}

impl Monitor {
    pub(super) fn new(place: &str, status: Status, names: Vec<String>) -> Self {
        Self {
            place: place.to_owned(),
            names,
            table_crc: status.table_crc,
            at_ms: 0,
            phase: status.phase,
            fault: status.fault,
            live: None,
            pac: VecDeque::new(),
            chosen: None,
            felt: None,
            posterior: Vec::new(),
            answer: None,
            notes: VecDeque::new(),
            losses: (0, 0),
            silent: None,
            protocol: None,
            rebooted: false,
            status,
        }
    }

    fn note(&mut self, weight: Weight, text: impl Into<String>) {
        let text = text.into();
        self.notes.push_back(Note {
            at_ms: self.at_ms,
            weight,
            text,
        });
        if self.notes.len() > NOTES {
            self.notes.pop_front();
        }
    }

    fn name(&self, texture: usize) -> &str {
        self.names.get(texture).map_or("?", String::as_str)
    }

    /// Takes in a report.
    pub(super) fn hear(&mut self, report: &Report) {
        self.at_ms = report.at_ms;
        match &report.tell {
            Tell::Status(status) => {
                self.phase = status.phase;
                self.fault = status.fault;
                self.status = status.clone();
            }
            Tell::Booted {
                protocol,
                version,
                reset,
                last_words,
            } => {
                if *protocol != PROTOCOL {
                    self.protocol = Some(*protocol);
                }
                self.rebooted = true;
                let words = last_words
                    .as_ref()
                    .map(|words| format!("; its last words: {words}"));
                self.note(
                    Weight::Fault,
                    format!(
                        "the probe has started, firmware {version}, after {reset:?}{}",
                        words.unwrap_or_default()
                    ),
                );
            }
            Tell::Phase(phase) => {
                self.phase = *phase;
                if *phase != Phase::Faulted {
                    self.fault = None;
                }
                if matches!(phase, Phase::Ready | Phase::Parked) {
                    self.live = None;
                }
            }
            Tell::Live(live) => self.live = Some(*live),
            Tell::Fault(fault) => {
                self.fault = Some(*fault);
                let recovery = fault.row().map_or("reset", |row| row.recovery);
                self.note(Weight::Fault, format!("{fault}: {recovery} (key h)"));
            }
            Tell::Chosen {
                slide,
                movement,
                action,
                outlook,
            } => {
                if *slide == 1 {
                    self.posterior.clear();
                    self.answer = None;
                    self.felt = None;
                }
                let promise = outlook.iter().find(|promise| promise.action == *action);
                self.chosen = Some(Chosen {
                    slide: *slide,
                    movement: *movement,
                    action: *action,
                    leaves: promise.map(|promise| promise.uncertainty),
                });
            }
            Tell::Felt {
                slide,
                felt,
                posterior,
                ..
            } => {
                self.felt = Some(felt.clone());
                self.posterior = posterior.to_vec();
                if let Some((p, texture)) = self.ranked().first().copied() {
                    let name = self.name(texture).to_owned();
                    self.note(
                        Weight::Said,
                        format!("slide {slide}: most likely {name}, {:.1} %", p * 100.0),
                    );
                }
            }
            Tell::Rejected { slide, why } => {
                self.note(Weight::Said, format!("slide {slide} is repeated: {why}"));
            }
            Tell::Verdict {
                name,
                probability,
                sure,
                unknown,
                slides,
                ..
            } => {
                let p = probability * 100.0;
                let after = format!("{slides} slide{}", if *slides == 1 { "" } else { "s" });
                let (answer, said) = if *unknown {
                    (
                        "It is none that I know".to_owned(),
                        format!("none that I know, most like {name}, after {after}"),
                    )
                } else if *sure {
                    (
                        format!("It is {name}"),
                        format!("it is {name}: {p:.1} % after {after}"),
                    )
                } else {
                    (
                        "Not sure; most likely".to_owned(),
                        format!("not sure after {after}; most likely {name}, {p:.1} %"),
                    )
                };
                self.note(Weight::Said, said);
                self.answer = Some(answer);
            }
            Tell::Taught {
                name,
                slides,
                itself,
            } => {
                let whom = if *itself { "by itself" } else { "from you" };
                self.note(
                    Weight::Said,
                    format!("it has learned {name} {whom}: {slides} slides"),
                );
            }
            Tell::Block(block) => {
                if block.number == 0 {
                    self.pac.clear();
                }
                self.pac.extend(&block.pac);
                let over = self.pac.len().saturating_sub(SHOWN);
                self.pac.drain(..over);
            }
            Tell::Damaged(_)
            | Tell::Done(_)
            | Tell::Refused { .. }
            | Tell::Learned { .. }
            | Tell::Calibration(_)
            | Tell::TablePart { .. } => {}
        }
    }

    /// Probabilities and indices of the textures, the most probable one first.
    fn ranked(&self) -> Vec<(f32, usize)> {
        let mut ranked: Vec<(f32, usize)> = self.posterior.iter().copied().zip(0..).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        ranked
    }
}

/// What the probe is asked for, one after the other.
enum Doing {
    Asked(Box<Job<Question<()>>>),
    Table(Box<Job<ReadTable>>),
}

/// How the user ended it.
enum End {
    Quit,
    Interrupt,
}

/// Watches until the user has enough of it; the rig is stopped and lifted then.
///
/// # Errors
/// See [`BenchError`].
pub(super) fn run(
    bench: &mut Bench,
    status: Status,
    names: Vec<String>,
    wanted: Identify,
) -> Result<(), BenchError> {
    if !io::stdout().is_terminal() {
        return Err(io::Error::other(
            "the monitor needs a terminal; `tactus device identify` writes lines, `--log FILE` a record",
        )
        .into());
    }
    let mut monitor = Monitor::new(&bench.name, status, names);
    // whatever happens, a panic too, the terminal is given back as it was
    let mut terminal = ratatui::try_init()?;
    let ended = watch(bench, &mut monitor, &mut terminal, &wanted);
    ratatui::restore();
    let end = match ended {
        Ok(end) => end,
        Err(why @ BenchError::Port { .. }) => return Err(why),
        Err(why) => {
            // the line is good
            bench.lift();
            return Err(why);
        }
    };
    eprintln!("Stopping and lifting the finger (Ctrl-C: do not wait) ...");
    match (bench.lift(), end) {
        (BenchError::Stopped, End::Quit) => {
            eprintln!("Stopped: the finger is lifted and the stage stands.");
            Ok(())
        }
        (why, _) => Err(why),
    }
}

fn watch(
    bench: &mut Bench,
    monitor: &mut Monitor,
    terminal: &mut DefaultTerminal,
    wanted: &Identify,
) -> Result<End, BenchError> {
    let mut wanted = wanted.clone();
    let mut to_do: VecDeque<Ask> = VecDeque::new();
    let mut doing: Option<Doing> = None;
    let mut drawn: Option<Instant> = None;
    let mut asked: Option<Instant> = None;
    let mut heard = Instant::now();
    bench.ask(Ask::Stream(true))?;
    loop {
        if bench.interrupt().take() {
            return Ok(End::Interrupt);
        }
        let mut hear = |report: &Report| {
            heard = Instant::now();
            monitor.hear(report);
        };
        let polled = match &mut doing {
            Some(Doing::Asked(job)) => bench.step(job, &mut hear),
            Some(Doing::Table(job)) => {
                let polled = bench.step(job, &mut hear)?;
                Ok(match polled {
                    Poll::Ready(bytes) => {
                        let table = Table::read(&bytes)?;
                        monitor.names = table.names().map(str::to_owned).collect();
                        monitor.table_crc = table.crc();
                        Poll::Ready(())
                    }
                    Poll::Pending => Poll::Pending,
                })
            }
            None => bench.listen(&mut hear).map(|()| Poll::Pending),
        };
        match polled {
            Ok(Poll::Ready(())) => doing = None,
            Ok(Poll::Pending) => {}
            Err(BenchError::Port {
                why: PortError::Link(why),
                ..
            }) if !matches!(why, LinkError::Protocol(_) | LinkError::Foreign) => {
                // the probe said why, and goes on
                doing = None;
                to_do.clear();
                monitor.note(Weight::Said, why.to_string());
            }
            Err(why) => return Err(why),
        }
        if let Some(protocol) = monitor.protocol {
            return Err(BenchError::Port {
                name: bench.name.clone(),
                why: PortError::Link(LinkError::Protocol(protocol)),
                moving: false,
            });
        }
        if std::mem::take(&mut monitor.rebooted) {
            bench.ask(Ask::Stream(true))?;
        }
        if doing.is_none()
            && let Some(ask) = to_do.pop_front()
        {
            let job = match ask {
                Ask::ReadTable(_) => Doing::Table(Box::new(bench.begin(ReadTable::default())?)),
                ask => Doing::Asked(Box::new(bench.begin(Question::command(ask))?)),
            };
            doing = Some(job);
        }
        if asked.is_none_or(|at| at.elapsed() >= ASKED) {
            asked = Some(Instant::now());
            bench.ask(Ask::Status)?;
        }
        monitor.silent = Some(heard.elapsed()).filter(|silent| *silent >= SILENT);
        monitor.losses = bench.losses();
        if drawn.is_none_or(|at| at.elapsed() >= DRAWN) {
            drawn = Some(Instant::now());
            terminal.draw(|frame| view::draw(monitor, frame))?;
        }
        if is_gone(&io::stdin()) {
            return Ok(End::Interrupt);
        }
        while event::poll(Duration::ZERO)? {
            let Event::Key(key) = event::read()? else {
                continue;
            };
            if key.kind != KeyEventKind::Press {
                continue;
            }
            let control = key.modifiers.contains(KeyModifiers::CONTROL);
            let busy = doing.is_some() || !to_do.is_empty();
            match key.code {
                KeyCode::Char('c') if control => return Ok(End::Interrupt),
                KeyCode::Char('q') => return Ok(End::Quit),
                KeyCode::Char('s') | KeyCode::Esc => {
                    to_do.clear();
                    bench.ask(Ask::Stop)?;
                    monitor.note(Weight::Said, "stopping");
                }
                KeyCode::Char('i' | 'h') if busy => {
                    monitor.note(Weight::Said, "it is busy: wait, or stop it with s");
                }
                KeyCode::Char('i') => {
                    if monitor.table_crc != monitor.status.table_crc {
                        to_do.push_back(Ask::ReadTable(0));
                    }
                    to_do.push_back(Ask::Identify(wanted.clone()));
                    // the next one begins elsewhere on the sample
                    wanted.seed = wanted.seed.wrapping_add(1);
                    monitor.note(Weight::Said, "identify");
                }
                KeyCode::Char('h') => {
                    to_do.push_back(Ask::Home);
                    monitor.note(Weight::Said, "home");
                }
                _ => {}
            }
        }
    }
}

/// Whether the terminal has been closed: crossterm would read its end for ever.
#[cfg(unix)]
fn is_gone(terminal: &impl std::os::fd::AsFd) -> bool {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let mut polled = [PollFd::new(terminal, PollFlags::IN)];
    let now = Timespec::default();
    poll(&mut polled, Some(&now)).is_ok()
        && polled
            .iter()
            .any(|p| p.revents().intersects(PollFlags::HUP))
}

#[cfg(not(unix))]
fn is_gone(_: &io::Stdin) -> bool {
    false
}

#[cfg(test)]
mod tests;
