//! A probe's messages for a display: its explorations, followed with the same core, and the map of its textures.

use std::rc::Rc;

use tactus_core::dsp::SpectrumSum;
use tactus_core::explorer::Config;
use tactus_core::features::{BLOCK, Block, Observation};
use tactus_core::table::Table;
use tactus_core::wire::{self, Event};

use crate::eval::open_set::in_words;

use super::message::{Expected, Happening, KnownTable, Measured, name};
use super::standing::{Followed, PLAN, Standing};
use crate::eval::places::{Plane, distances, slide_distances};
use crate::eval::transcript::Answer;
use crate::sim::collection::texture_number;

/// Samples of a spectrum: a frame of the core's.
const FRAME: usize = 512;
/// Bins that are shown as one, of those over 0 Hz.
const BINS: usize = 4;

#[derive(Default)]
pub(crate) struct Received {
    pub(crate) pac: Vec<i16>,
    /// Spectra of the last 233 ms, one every 64 samples: dB of the mean power of four bins, of 17.2 Hz together.
    pub(crate) spectra: Vec<Vec<i8>>,
    pub(crate) happened: Vec<Happening>,
}

#[derive(Default)]
pub(crate) struct ProbeMonitor {
    table: Rc<[u8]>,
    planes: Vec<Plane>,
    known: KnownTable,
    followed: Followed,
    early_ms: Option<u16>,
    recent: Vec<i16>,
    received: Received,
}

impl ProbeMonitor {
    pub(crate) fn explores(&mut self, config: Config) {
        self.followed = Followed::begin(config);
    }

    pub(crate) fn knows(&mut self, bytes: &[u8]) {
        if *self.table == *bytes {
            return;
        }
        self.table = bytes.into();
        let Ok(table) = Table::read(bytes) else {
            return;
        };
        self.planes.clear();
        for (movement, _) in (0..).zip(table.movements()) {
            let plane = Plane::of(&distances(table, Some(movement)));
            self.planes.push(match self.planes.first() {
                Some(first) => plane.turned_to(first),
                None => plane,
            });
        }
        self.known = KnownTable {
            textures: table.names().map(str::to_owned).collect(),
            numbers: table.names().map(texture_number).collect(),
            movements: table.movements().map(|m| m.written()).collect(),
            lengths_ms: table.lengths_ms().collect(),
            maps: self.planes.iter().map(|p| p.places.clone()).collect(),
            bytes: bytes.len(),
            crc: table.crc(),
            figures: table.open_set().map(|figures| in_words(&figures)),
        };
    }

    pub(crate) fn known(&self) -> &KnownTable {
        &self.known
    }

    pub(crate) fn place_of(
        &self,
        table: Table<'_>,
        movement: u8,
        slide: &Observation,
    ) -> Option<(f64, f64)> {
        let distances = slide_distances(table, movement, slide)?;
        let plane = self.planes.get(usize::from(movement))?;
        Some(plane.place(&distances))
    }

    pub(crate) fn happens(&mut self, what: Happening) {
        self.received.happened.push(what);
    }

    pub(crate) fn take(&mut self) -> Received {
        std::mem::take(&mut self.received)
    }

    pub(crate) fn hear(&mut self, event: Event) {
        if let Event::Block(block) = &event {
            self.block(block);
            return;
        }
        let bytes = Rc::clone(&self.table);
        let table = Table::read(&bytes).ok();
        let happening = table.and_then(|table| self.told(table, event));
        self.received.happened.extend(happening);
    }

    fn block(&mut self, block: &Block) {
        if block.number == 0 {
            self.recent.clear();
        }
        self.received.pac.extend_from_slice(&block.pac);
        self.recent.extend_from_slice(&block.pac);
        let older = self.recent.len().saturating_sub(FRAME);
        self.recent.drain(..older);
        if block.pac.len() == BLOCK {
            self.received.spectra.extend(spectrum(&self.recent));
        }
        let looked = self.followed.block(&self.known.lengths_ms, block);
        let (Some((ms, seen)), Some(movement)) = (looked, self.followed.movement()) else {
            return;
        };
        let table = Rc::clone(&self.table);
        if let Ok(table) = Table::read(&table) {
            self.received.happened.push(Happening::Look {
                ms,
                standing: self.followed.so_far(table, &seen),
                place: self.place_of(table, movement, &seen),
            });
        }
    }

    fn told(&mut self, table: Table<'_>, event: Event) -> Option<Happening> {
        match event {
            Event::Chosen {
                slide,
                movement,
                action,
                expected,
            } => {
                self.followed.chosen(action, movement);
                self.early_ms = None;
                Some(Happening::Chosen {
                    slide,
                    movement: action.movement,
                    property: name(action),
                    expected: expected.iter().map(Expected::from).collect(),
                })
            }
            Event::Early(ms) => {
                self.early_ms = Some(ms);
                None
            }
            Event::SlideReport {
                slide,
                action,
                observed,
                posterior,
            } => {
                let seen = observed.observation();
                let early_ms = self.early_ms.take();
                let place = self.place_of(table, action.movement, &seen);
                let standing = self
                    .followed
                    .observed(table, action, seen.clone(), early_ms);
                // the probe's own figures count
                let standing = Standing {
                    posterior: posterior.to_vec(),
                    log_odds: standing.as_ref().and_then(|s| s.log_odds),
                    changed: standing.as_ref().is_some_and(|s| s.changed),
                    changed_by: standing.and_then(|s| s.changed_by),
                };
                Some(Happening::Slide {
                    slide,
                    movement: action.movement,
                    early_ms,
                    measured: Measured::new(table.movement(action.movement)?, &seen),
                    standing,
                    place,
                })
            }
            Event::Rejected { why, .. } => Some(Happening::Rejected {
                why: why.to_string(),
            }),
            Event::Verdict(verdict) => Some(Happening::Verdict {
                answer: Answer::new((&verdict).into(), verdict.slides, table),
                index: verdict.texture,
                wants_label: verdict.wants_label,
            }),
            Event::Refused { why, .. } | Event::Trouble(why) => Some(Happening::Refused {
                why: why.to_string(),
            }),
            Event::TextureLearned(wire::TextureLearned { name, slides, .. }) => {
                Some(Happening::Learned {
                    name: name.to_string(),
                    slides,
                    // the table is another one when the request is over: see `Session`
                    known: KnownTable::default(),
                })
            }
            Event::Done(_) => Some(Happening::Done),
            _ => None,
        }
    }

    pub(crate) fn learned(&mut self) {
        for happening in &mut self.received.happened {
            if let Happening::Learned { known, .. } = happening {
                known.clone_from(&self.known);
            }
        }
    }
}

/// The power of these samples, dB per four bins.
fn spectrum(samples: &[i16]) -> Option<Vec<i8>> {
    let mut sum = SpectrumSum::default();
    sum.push(&PLAN, samples);
    Some(decibels(sum.finish()?.psd()))
}

/// A spectrum in dB per four bins, of those over 0 Hz.
pub(super) fn decibels(psd: &[f32]) -> Vec<i8> {
    let bins = psd.get(1..).unwrap_or_default().chunks_exact(BINS);
    let db = |bins: &[f32]| {
        let mean = bins.iter().sum::<f32>() / BINS as f32;
        libm::roundf(10.0 * libm::log10f(mean + 1e-3)) as i8
    };
    bins.map(db).collect()
}
