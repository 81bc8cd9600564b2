//! All that the monitor knows of the probe, from its reports alone.

use std::collections::VecDeque;
use std::time::Duration;

use tactus_core::movement::Movement;
use tactus_core::rig::guard::Fault;
use tactus_core::table::Action;
use tactus_core::wire::{Felt, Live, PROTOCOL, Phase, Report, Status, Tell};

/// P_AC samples that are shown: a second.
pub(crate) const SHOWN: usize = 2200;
/// Notes that are kept.
pub(crate) const NOTES: usize = 50;

/// How much a note matters.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Weight {
    Said,
    Fault,
}

/// A line for people, with the probe's time.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Note {
    pub(crate) at_ms: u32,
    pub(crate) weight: Weight,
    pub(crate) text: String,
}

/// The movement that is made, and why.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Chosen {
    pub(crate) slide: u8,
    pub(crate) movement: Movement,
    pub(crate) action: Action,
    /// uncertainty that it should leave
    pub(crate) leaves: Option<f32>,
}

/// What is known of the probe.
pub(crate) struct Monitor {
    pub(crate) place: String,
    pub(crate) names: Vec<String>,
    /// of the table that these are from
    pub(crate) table_crc: u32,
    pub(crate) status: Status,
    pub(crate) at_ms: u32,
    pub(crate) phase: Phase,
    pub(crate) fault: Option<Fault>,
    pub(crate) live: Option<Live>,
    pub(crate) pac: VecDeque<i16>,
    pub(crate) chosen: Option<Chosen>,
    pub(crate) felt: Option<Felt>,
    pub(crate) posterior: Vec<f32>,
    pub(crate) answer: Option<String>,
    pub(crate) notes: VecDeque<Note>,
    /// frames damaged and reports lost on the line
    pub(crate) losses: (u64, u64),
    /// no report for so long
    pub(crate) silent: Option<Duration>,
    /// the messages of a probe that has started with other firmware
    pub(crate) protocol: Option<u8>,
    /// it has started anew: what was asked of it is forgotten
    pub(crate) rebooted: bool,
}

impl Monitor {
    pub(crate) fn new(place: &str, status: Status, names: Vec<String>) -> Self {
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

    pub(crate) fn note(&mut self, weight: Weight, text: impl Into<String>) {
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

    pub(crate) fn name(&self, texture: usize) -> &str {
        self.names.get(texture).map_or("?", String::as_str)
    }

    /// Takes in a report.
    pub(crate) fn hear(&mut self, report: &Report) {
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
    pub(crate) fn ranked(&self) -> Vec<(f32, usize)> {
        let mut ranked: Vec<(f32, usize)> = self.posterior.iter().copied().zip(0..).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        ranked
    }
}
