//! What is seen of a probe: its host in the simulation.

use std::cell::Cell;
use std::rc::Rc;
use std::time::Duration;

use tactus_core::dsp::{Plain, SpectrumSum};
use tactus_core::explorer::Config;
use tactus_core::features::{BLOCK, Block, Observation};
use tactus_core::probe::RigState;
use tactus_core::rig::{Phase, RigError};
use tactus_core::table::Table;
use tactus_core::wire::{self, Event};

use super::message::{Expected, Frame, Happening, Known, Measured, name};
use super::standing::{Followed, PLAN, Standing};
use crate::eval::places::{Plane, distances, slide_distances};
use crate::eval::transcript::Answer;
use crate::sim::collection::texture_number;
use crate::sim::probe::Host;
use crate::sim::rig::SimRig;
use crate::sim::world::Truth;

/// Samples of a spectrum: a frame of the core's.
const FRAME: usize = 512;
/// Bins that are shown as one, of those over 0 Hz.
const BINS: usize = 4;
/// P_DC is shown so often, ms.
const PDC_MS: u64 = 10;

/// What is under way, and what was seen since the last frame.
pub(super) struct Scene {
    /// The time at which it stands still; `None`: it does not.
    pub(super) until: Option<Duration>,
    /// Whether somebody waits for it to go on.
    pub(super) waits: Cell<bool>,
    /// What is to be done to the rig before its next millisecond.
    texture: Option<u8>,
    pub(super) wear: Option<f64>,
    pub(super) stop: bool,
    /// The table in force, and its maps.
    table: Rc<[u8]>,
    planes: Vec<Plane>,
    known: Known,
    followed: Followed,
    early_ms: Option<u16>,
    now: Duration,
    phase: Phase,
    truth: Truth,
    /// The last samples of P_AC.
    recent: Vec<i16>,
    pac: Vec<i16>,
    pdc: Vec<u16>,
    spectra: Vec<Vec<i8>>,
    happened: Vec<Happening>,
    pub(super) busy: bool,
}

impl Scene {
    pub(super) fn new() -> Self {
        Self {
            until: None,
            waits: Cell::new(false),
            texture: None,
            wear: None,
            stop: false,
            table: Rc::default(),
            planes: Vec::new(),
            known: Known::default(),
            followed: Followed::default(),
            early_ms: None,
            now: Duration::ZERO,
            phase: Phase::Parked,
            truth: Truth::default(),
            recent: Vec::new(),
            pac: Vec::new(),
            pdc: Vec::new(),
            spectra: Vec::new(),
            happened: Vec::new(),
            busy: false,
        }
    }

    /// The time of the rig.
    pub(super) fn now(&self) -> Duration {
        self.now
    }

    /// Number of what lies under the finger.
    pub(super) fn texture(&self) -> u8 {
        self.truth.texture
    }

    /// Another texture is to be put under the finger, which was `lifted` for that.
    pub(super) fn place(&mut self, texture: u8, lifted: Result<(), RigError>) {
        match lifted {
            Ok(()) => self.texture = Some(texture),
            Err(why) => self.happens(Happening::Refused {
                why: why.to_string(),
            }),
        }
    }

    /// An exploration begins.
    pub(super) fn explores(&mut self, config: Config) {
        self.followed = Followed::begin(config);
    }

    /// This table is in force.
    pub(super) fn knows(&mut self, bytes: &[u8]) {
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
        self.known = Known {
            textures: table.names().map(str::to_owned).collect(),
            numbers: table.names().map(texture_number).collect(),
            movements: table
                .movements()
                .map(|m| (m.force_n(), m.speed_mm_s()))
                .collect(),
            lengths_ms: table.lengths_ms().collect(),
            maps: self.planes.iter().map(|p| p.places.clone()).collect(),
            bytes: bytes.len(),
            crc: table.crc(),
        };
    }

    /// What the probe knows.
    pub(super) fn known(&self) -> &Known {
        &self.known
    }

    /// Where a slide lies among the textures at its movement.
    pub(super) fn place_of(
        &self,
        table: Table<'_>,
        movement: u8,
        slide: &Observation,
    ) -> Option<(f64, f64)> {
        let distances = slide_distances(table, movement, slide)?;
        let plane = self.planes.get(usize::from(movement))?;
        Some(plane.place(&distances))
    }

    /// Something that the probe said.
    pub(super) fn happens(&mut self, what: Happening) {
        self.happened.push(what);
    }

    /// What has been since the last frame.
    pub(super) fn frame(&mut self) -> Frame {
        let Truth {
            tip_mm,
            indentation_mm,
            stage_mm,
            speed_mm_s,
            force_n,
            shear_n,
            texture,
            wear,
            ..
        } = self.truth;
        Frame {
            at_ms: self.now.as_millis() as u64,
            busy: self.busy,
            phase: self.phase.into(),
            tip_mm,
            indentation_mm,
            stage_mm,
            speed_mm_s,
            force_n,
            shear_n,
            texture,
            wear: self.wear.unwrap_or(wear),
            pac: std::mem::take(&mut self.pac),
            pdc: std::mem::take(&mut self.pdc),
            spectra: std::mem::take(&mut self.spectra),
            happened: std::mem::take(&mut self.happened),
        }
    }

    fn block(&mut self, block: &Block) {
        if block.number == 0 {
            self.recent.clear();
        }
        self.pac.extend_from_slice(&block.pac);
        self.recent.extend_from_slice(&block.pac);
        let older = self.recent.len().saturating_sub(FRAME);
        self.recent.drain(..older);
        if block.pac.len() == BLOCK {
            self.spectra.extend(spectrum(&self.recent));
        }
        let looked = self.followed.block(&self.known.lengths_ms, block);
        let (Some((ms, seen)), Some(movement)) = (looked, self.followed.movement()) else {
            return;
        };
        let table = Rc::clone(&self.table);
        if let Ok(table) = Table::read(&table) {
            self.happened.push(Happening::Look {
                ms,
                standing: self.followed.so_far(table, &seen),
                place: self.place_of(table, movement, &seen),
            });
        }
    }

    fn heard(&mut self, table: Table<'_>, event: Event) -> Option<Happening> {
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
                // the probe's own word is the one that counts
                let standing = Standing {
                    posterior: posterior.to_vec(),
                    log_odds: standing.as_ref().and_then(|s| s.log_odds),
                    changed: standing.is_some_and(|s| s.changed),
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
                    known: Known::default(),
                })
            }
            Event::Done(_) => Some(Happening::Done),
            _ => None,
        }
    }

    /// A texture was learned, and the table is this one now.
    pub(super) fn learned(&mut self) {
        for happening in &mut self.happened {
            if let Happening::Learned { known, .. } = happening {
                known.clone_from(&self.known);
            }
        }
    }
}

/// The power of these samples, dB per four bins.
fn spectrum(samples: &[i16]) -> Option<Vec<i8>> {
    let mut sum = SpectrumSum::default();
    sum.push::<Plain>(PLAN.angles(), samples);
    let spectrum = sum.finish()?;
    let bins = spectrum.psd().get(1..)?.chunks_exact(BINS);
    let db = |bins: &[f32]| {
        let mean = bins.iter().sum::<f32>() / BINS as f32;
        libm::roundf(10.0 * libm::log10f(mean + 1e-3)) as i8
    };
    Some(bins.map(db).collect())
}

impl Host for Scene {
    fn tell(&mut self, event: Event) {
        if let Event::Block(block) = &event {
            self.block(block);
            return;
        }
        let bytes = Rc::clone(&self.table);
        let table = Table::read(&bytes).ok();
        let happening = table.and_then(|table| self.heard(table, event));
        self.happened.extend(happening);
    }

    fn tick(&mut self, now: Duration, rig: &RigState) {
        self.now = now;
        if let (Phase::Faulted(fault), true) = (rig.phase, rig.phase != self.phase) {
            self.happened.push(Happening::Refused {
                why: fault.to_string(),
            });
        }
        self.phase = rig.phase;
    }

    fn look(&mut self, rig: &mut SimRig) {
        if let Some(texture) = self.texture.take()
            && let Err(why) = rig.place(texture)
        {
            let why = why.to_string();
            self.happened.push(Happening::Refused { why });
        }
        if let Some(wear) = self.wear
            && rig.world().put_on_skin(wear).is_ok()
        {
            self.wear = None;
        }
        if (self.now.as_millis() as u64).is_multiple_of(PDC_MS) {
            self.pdc.extend(rig.pdc().last());
        }
        self.truth = rig.world().truth();
    }

    fn pauses(&self) -> bool {
        let pauses = self.until.is_some_and(|until| self.now >= until);
        if pauses {
            self.waits.set(true);
        }
        pauses
    }

    fn stops(&mut self) -> bool {
        self.stop
    }

    fn is_stopped(&self) -> bool {
        self.stop
    }

    fn streams(&self) -> bool {
        true
    }
}
