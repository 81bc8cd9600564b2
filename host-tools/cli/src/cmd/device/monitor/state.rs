//! All that the monitor knows of the probe, from its reports alone.

use std::collections::VecDeque;
use std::time::Duration;

use tactus_core::features::Movement;
use tactus_core::wire::{Command, Event, Live, PROTOCOL, Phase, Prompt, Report, Status};
use tactus_lab::eval::show::count;

/// P_AC samples that are shown: a second.
pub(crate) const SHOWN: usize = 2200;
pub(crate) const NOTES: usize = 50;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Weight {
    Message,
    Fault,
}

/// A line for people, with the probe's time.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Note {
    pub(crate) at_ms: u32,
    pub(crate) weight: Weight,
    pub(crate) text: String,
}

#[derive(Default)]
pub(crate) struct Monitor {
    pub(crate) place: String,
    pub(crate) names: Vec<String>,
    pub(crate) status: Status,
    pub(crate) at_ms: u32,
    pub(crate) live: Option<Live>,
    pub(crate) pac: VecDeque<i16>,
    /// the one that is made
    pub(crate) movement: Option<Movement>,
    pub(crate) posterior: Vec<f32>,
    pub(crate) answer: Option<String>,
    pub(crate) notes: VecDeque<Note>,
    /// frames damaged and reports lost on the line
    pub(crate) losses: (u64, u64),
    /// no report for so long
    pub(crate) silent: Option<Duration>,
    /// the messages of a probe that has started with other firmware
    pub(crate) protocol: Option<u8>,
    /// it has restarted and no longer knows the commands it was given
    pub(crate) rebooted: bool,
    /// the user has had the rig stopped: what is still on the line is of what was stopped
    stopped: bool,
    /// what a person was asked to do last
    prompt: Option<Prompt>,
}

impl Monitor {
    pub(crate) fn new(place: &str, status: Status, names: Vec<String>) -> Self {
        Self {
            place: place.to_owned(),
            names,
            status,
            ..Self::default()
        }
    }

    pub(crate) fn note(&mut self, weight: Weight, text: impl Into<String>) {
        self.notes.push_back(Note {
            at_ms: self.at_ms,
            weight,
            text: text.into(),
        });
        if self.notes.len() > NOTES {
            self.notes.pop_front();
        }
    }

    /// The user has asked the probe for something.
    pub(crate) fn asked(&mut self, command: &Command) {
        let note = match command {
            // what it was at says nothing any more
            Command::Stop => {
                self.forget_exploration();
                self.stopped = true;
                "stopping".to_owned()
            }
            Command::Identify(_) => {
                self.forget_exploration();
                self.stopped = false;
                "identify".to_owned()
            }
            Command::Home => "home".to_owned(),
            _ => return,
        };
        self.note(Weight::Message, note);
    }

    fn forget_exploration(&mut self) {
        self.movement = None;
        self.posterior.clear();
        self.answer = None;
    }

    /// Returns true if samples come now: only while the finger is at rest before a slide, and slides.
    pub(crate) fn is_sampling(&self) -> bool {
        matches!(self.status.phase, Phase::Background | Phase::Sliding)
    }

    pub(crate) fn name(&self, texture: usize) -> &str {
        self.names.get(texture).map_or("?", String::as_str)
    }

    pub(crate) fn hear(&mut self, report: &Report) {
        self.at_ms = report.at_ms;
        match &report.event {
            Event::Chosen { .. } | Event::SlideReport { .. } if self.stopped => {}
            Event::Status(status) => self.status = status.clone(),
            Event::Booted {
                protocol,
                version,
                reset,
                last_words,
                ..
            } => {
                if *protocol != PROTOCOL {
                    self.protocol = Some(*protocol);
                }
                self.rebooted = true;
                let mut note =
                    format!("the probe has started, firmware {version}, after {reset:?}");
                if let Some(words) = last_words {
                    note += &format!("; its last words: {words}");
                }
                self.note(Weight::Fault, note);
            }
            Event::Phase(phase) => {
                if self.status.phase == Phase::Homing && *phase == Phase::Ready {
                    self.note(Weight::Message, "homed: the rig is ready");
                }
                self.status.phase = *phase;
                if *phase != Phase::Faulted {
                    self.status.fault = None;
                }
                if matches!(phase, Phase::Ready | Phase::Parked) {
                    self.live = None;
                }
            }
            Event::Live(live) => self.live = Some(*live),
            Event::Fault(fault) => {
                self.status.fault = Some(*fault);
                let recovery = fault.recovery();
                self.note(Weight::Fault, format!("{fault}: {recovery} (key h)"));
            }
            Event::Chosen {
                slide, movement, ..
            } => {
                if *slide == 1 {
                    self.posterior.clear();
                    self.answer = None;
                }
                self.movement = Some(*movement);
                self.note(Weight::Message, format!("slide {slide}: {movement}"));
            }
            Event::SlideReport {
                slide, posterior, ..
            } => {
                self.posterior = posterior.to_vec();
                if let Some((p, texture)) = self.ranked().first().copied() {
                    let (name, p) = (self.name(texture), p * 100.0);
                    let note = format!("slide {slide}: most likely {name}, {p:.1} %");
                    self.note(Weight::Message, note);
                }
            }
            Event::Rejected { slide, why } => {
                self.note(Weight::Message, format!("slide {slide} is repeated: {why}"));
            }
            Event::Trouble(why) => self.note(Weight::Message, why.to_string()),
            Event::Verdict(verdict) => {
                let (name, slides) = (&verdict.name, verdict.slides);
                let p = verdict.probability * 100.0;
                let after = count(slides, "slide");
                let (answer, note) = if verdict.unknown {
                    let note = format!("none that I know, most like {name}, after {after}");
                    ("It is none that I know".to_owned(), note)
                } else if verdict.changed {
                    let note =
                        format!("it is {name}, but not as it was learned: {p:.1} % after {after}");
                    (format!("It is {name}, but changed"), note)
                } else if verdict.most_like {
                    let note = format!("most like {name}: {p:.1} % after {after}");
                    (format!("Most like {name}"), note)
                } else if verdict.sure {
                    let note = format!("it is {name}: {p:.1} % after {after}");
                    (format!("It is {name}"), note)
                } else {
                    let note = format!("not sure after {after}; most likely {name}, {p:.1} %");
                    ("Not sure; most likely".to_owned(), note)
                };
                self.answer = Some(answer);
                self.note(Weight::Message, note);
            }
            Event::TextureLearned(learned) => {
                let (name, slides) = (&learned.name, learned.slides);
                let whom = if learned.itself {
                    "by itself"
                } else {
                    "from you"
                };
                let slides = count(slides, "slide");
                let note = format!("it has learned {name} {whom}: {slides}");
                self.note(Weight::Message, note);
            }
            Event::Block(block) => {
                if block.number == 0 {
                    self.pac.clear();
                }
                self.pac.extend(&block.pac);
                let over = self.pac.len().saturating_sub(SHOWN);
                self.pac.drain(..over);
            }
            Event::Prompt(prompt) if self.prompt.replace(*prompt) != Some(*prompt) => {
                self.note(Weight::Message, format!("the display says: {prompt}"));
            }
            _ => {}
        }
    }

    /// Probabilities and indices of the textures, the most probable one first.
    pub(crate) fn ranked(&self) -> Vec<(f32, usize)> {
        let mut ranked: Vec<(f32, usize)> = self.posterior.iter().copied().zip(0..).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        ranked
    }
}
