//! Recordings, slide by slide: what was measured, and what an exploration would have made of them.

use tactus_core::dsp::Plan;
use tactus_core::explorer::{Config, ExpectedOutcome, Explorer, Method};
use tactus_core::features::{Movement, Observation, PropertySet};
use tactus_core::sensor::FingerCode;
use tactus_core::table::{Action, MAX_TEXTURES, Table};
use tactus_core::wire::SlideReport;

use super::message::{Frame, Streams};
use crate::data::recording::Recording;
use crate::data::recordings::{RecordingSet, Result};
use crate::data::replay::measure;
use crate::eval::learn::learn;
use crate::eval::show::count;
use crate::eval::transcript::Answer;
use crate::live::{Expected, Happening, Measured, ProbeMonitor, Standing, spectra, world_table};
use crate::sim::collection::Collection;

/// Slides of each texture at a movement of which one can be left out: a table needs two.
const ENOUGH: usize = 3;
/// Most tables that are learned from recordings, each without a part of the slides.
const MOST_TABLES: usize = 5;

/// What was given.
#[allow(clippy::large_enum_variant)] // one at a time
pub(super) enum Opened {
    /// All that a session said.
    Session(Frame),
    /// Slides.
    Recordings(Recorded),
}

/// One recorded slide.
pub(super) struct RecordedSlide {
    /// Index of its texture.
    pub(super) texture: usize,
    /// Its number.
    pub(super) number: u32,
    /// The movement that made it.
    pub(super) movement: Movement,
    /// So many samples of P_AC are of the still finger, and come first.
    pub(super) still: usize,
    /// P_AC, counts about the still finger's, at 2200 Hz.
    pub(super) pac: Vec<i16>,
    /// P_DC, counts about the still finger's.
    pub(super) pdc: Stream,
    /// Tangential force, mN; empty where it was not measured.
    pub(super) shear_mn: Stream,
    /// The features of the slide, or the reason why it has none.
    pub(super) measured: std::result::Result<SlideReport, String>,
}

/// Samples, so many a second.
pub(super) struct Stream {
    pub(super) rate_hz: u32,
    pub(super) samples: Vec<i16>,
}

/// Recordings.
#[derive(Default)]
pub(super) struct Recorded {
    /// Of the textures.
    pub(super) names: Vec<String>,
    /// In the order of textures, then of time.
    pub(super) slides: Vec<RecordedSlide>,
    /// The finger, where it is known not to be a BioTac.
    finger: FingerCode,
}

/// What slides are judged with, and which of them.
struct Judge {
    table: Vec<u8>,
    slides: Vec<usize>,
}

impl Recorded {
    /// Those of a set, measured by the core.
    ///
    /// # Errors
    /// A file cannot be read.
    pub(super) fn of(set: &RecordingSet) -> Result<Self> {
        let (plan, mut slides) = (Plan::new(), Vec::new());
        for texture in 0..set.textures().len() {
            let loaded = set.load_texture(texture)?;
            slides.extend(loaded.iter().map(|slide| RecordedSlide::of(&plan, slide)));
        }
        Ok(Self {
            names: set.names(),
            slides,
            finger: set.finger()?.0,
        })
    }

    /// What they show, one slide after the other.
    pub(super) fn show(&self) -> Frame {
        let mut frame = Frame::default();
        let (textures, slides) = (self.names.len() as u64, self.slides.len() as u64);
        frame.said = format!(
            "{} of {}.\n",
            count(slides, "slide"),
            count(textures, "texture")
        );
        let (judges, how) = self.judges();
        frame.said += &how;
        if judges.is_empty() {
            frame.happened = (0..self.slides.len()).map(|at| self.recorded(at)).collect();
        }
        let mut shown = vec![judges.is_empty(); self.slides.len()];
        for judge in &judges {
            self.judge(judge, &mut shown, &mut frame);
        }
        // what no table says anything of
        for at in (0..self.slides.len()).filter(|&at| !shown[at]) {
            frame.happened.push(self.recorded(at));
        }
        frame
    }

    /// The samples of a slide.
    pub(super) fn streams(&self, at: usize) -> Option<Streams> {
        let slide = self.slides.get(at)?;
        Some(Streams {
            still: slide.still,
            spectra: spectra(&slide.pac),
            pac: slide.pac.clone(),
            pdc: slide.pdc.samples.clone(),
            pdc_rate_hz: slide.pdc.rate_hz,
            shear_mn: slide.shear_mn.samples.clone(),
            shear_rate_hz: slide.shear_mn.rate_hz,
        })
    }

    fn recorded(&self, at: usize) -> Happening {
        let slide = &self.slides[at];
        let (force_n, speed_mm_s) = (slide.movement.force_n(), slide.movement.speed_mm_s());
        let measured = slide.observation();
        Happening::Recorded {
            at,
            texture: self.names[slide.texture].clone(),
            number: slide.number,
            movement: (force_n, speed_mm_s),
            measured: measured
                .as_ref()
                .map(|slide_says| Measured::new(slide.movement, slide_says)),
            why: slide.measured.as_ref().err().cloned(),
        }
    }

    /// The tables to judge slides with, none of which has seen the slides that it judges; and how that is.
    fn judges(&self) -> (Vec<Judge>, String) {
        let why = match self.parts() {
            Ok(judges) => {
                let how = format!(
                    "Each slide is judged by a table that was not learned from it: there are {}, each without a part \
                         of the slides.\n",
                    judges.len()
                );
                return (judges, how);
            }
            Err(why) => why,
        };
        // the world's slides have traction
        let mut slides = self.at(&|movement| Collection::MOVEMENTS.contains(&movement));
        slides.retain(|&at| self.slides[at].has_traction());
        match world_table() {
            Ok(table) if self.finger == FingerCode::BIOTAC && !slides.is_empty() => {
                let how = format!(
                    "{why} So the slides are judged with the table of the simulated world 1, which knows its 117 \
                         textures only.\n"
                );
                (vec![Judge { table, slides }], how)
            }
            _ => (
                Vec::new(),
                format!("{why} So no probabilities are shown.\n"),
            ),
        }
    }

    /// Slides that say something, at movements that are `wanted`.
    fn at(&self, wanted: &dyn Fn(Movement) -> bool) -> Vec<usize> {
        let says =
            |&at: &usize| self.slides[at].measured.is_ok() && wanted(self.slides[at].movement);
        (0..self.slides.len()).filter(says).collect()
    }

    /// Tables that are each learned without a part of the slides of every texture and movement, to judge these.
    fn parts(&self) -> std::result::Result<Vec<Judge>, String> {
        if self.names.len() < 2 {
            return Err("A table is learned from two textures or more.".to_owned());
        }
        let mut movements: Vec<Movement> = Vec::new();
        for slide in &self.slides {
            if !movements.contains(&slide.movement) {
                movements.push(slide.movement);
            }
        }
        let of = |texture: usize, movement: Movement| -> Vec<usize> {
            let here = |at: &usize| self.slides[*at].texture == texture;
            let all = self.at(&|other| other == movement);
            all.into_iter().filter(here).collect()
        };
        let textures = 0..self.names.len();
        let fewest = |movement: Movement| {
            let slides = textures.clone().map(|texture| of(texture, movement).len());
            slides.min().unwrap_or_default()
        };
        movements.retain(|&movement| fewest(movement) >= ENOUGH);
        let parts = movements.iter().map(|&movement| fewest(movement)).min();
        let parts = parts.map(|fewest| fewest.min(MOST_TABLES)).ok_or_else(|| {
            format!("A table that has not seen a slide needs {ENOUGH} slides of each texture at a movement.")
        })?;
        let without = |part: usize| {
            let mut judged = Vec::new();
            let mut cell = |texture: usize, movement: Movement| -> Vec<Observation> {
                let mut learned = Vec::new();
                for (trial, at) in of(texture, movement).into_iter().enumerate() {
                    match trial % parts == part {
                        true => judged.push(at),
                        false => learned.extend(self.slides[at].observation()),
                    }
                }
                learned
            };
            let slides: Vec<Vec<Vec<Observation>>> = textures
                .clone()
                .map(|texture| movements.iter().map(|&m| cell(texture, m)).collect())
                .collect();
            judged.sort_unstable();
            let table = learn(Method::Fused, None, &self.names, &movements, &slides);
            table.map(|table| Judge {
                table,
                slides: judged,
            })
        };
        let all: std::result::Result<Vec<Judge>, _> = (0..parts).map(without).collect();
        all.map_err(|why| format!("No table can be learned from them: {why}."))
    }

    /// An exploration of each texture, with the slides that were made.
    fn judge(&self, judge: &Judge, shown: &mut [bool], frame: &mut Frame) {
        let Ok(table) = Table::read(&judge.table) else {
            return;
        };
        let config = Config {
            method: Method::Fused,
            open: true,
            max_slides: u8::MAX,
            ..Config::default()
        };
        let properties = match judge
            .slides
            .iter()
            .any(|&at| self.slides[at].has_traction())
        {
            true => PropertySet::ALL,
            false => PropertySet::WITHOUT_SHEAR,
        };
        let explorer = Explorer::<MAX_TEXTURES>::new(table, properties, config);
        let Ok(mut explorer) = explorer.map(Box::new) else {
            return;
        };
        let mut monitor = ProbeMonitor::default();
        monitor.knows(&judge.table);
        frame
            .tables
            .push((frame.happened.len(), monitor.known().clone()));
        for texture in judge
            .slides
            .chunk_by(|a, b| self.slides[*a].texture == self.slides[*b].texture)
        {
            explorer.restart();
            for &at in texture {
                let slide = &self.slides[at];
                let movements = (0..).zip(table.movements());
                let mut movement = movements.filter(|(_, m)| *m == slide.movement);
                let (Some((movement, _)), Some(seen)) = (movement.next(), slide.observation())
                else {
                    continue;
                };
                let mut expected = explorer.expected_outcomes().to_vec();
                let chosen = explorer.choose(&expected, 0);
                expected.sort_by(|a: &ExpectedOutcome, b| b.benefit.total_cmp(&a.benefit));
                let number = explorer.slides().saturating_add(1);
                let action = Action {
                    movement,
                    property: None,
                };
                if explorer.observe(action, &seen).is_err() {
                    continue;
                }
                frame.happened.push(Happening::Chosen {
                    slide: number,
                    movement: chosen.movement,
                    property: None,
                    expected: expected.iter().map(Expected::from).collect(),
                });
                frame.happened.push(self.recorded(at));
                shown[at] = true;
                frame.happened.push(Happening::Slide {
                    slide: number,
                    movement,
                    early_ms: None,
                    measured: Measured::new(slide.movement, &seen),
                    standing: Standing::of(&explorer),
                    place: monitor.place_of(table, movement, &seen),
                });
            }
            if explorer.slides() > 0 {
                let verdict = explorer.best();
                frame.happened.push(Happening::Verdict {
                    answer: Answer::new(verdict, explorer.slides(), table),
                    index: verdict.texture,
                    wants_label: false,
                });
            }
        }
    }
}

impl RecordedSlide {
    fn of(plan: &Plan, slide: &Recording) -> Self {
        let (mut pac, moving) = (slide.still(), slide.pac());
        let still = pac.len();
        pac.extend(moving);
        let measured = measure(plan, slide)
            .map(|measured| SlideReport::from(&measured))
            .map_err(|why| why.to_string());
        Self {
            texture: slide.texture,
            number: slide.number,
            movement: slide.movement,
            still,
            pac,
            pdc: Stream {
                rate_hz: slide.pdc_rate_hz,
                samples: slide.pdc.clone(),
            },
            shear_mn: Stream {
                rate_hz: slide.shear_rate_hz,
                samples: slide.shear_mn().unwrap_or_default(),
            },
            measured,
        }
    }

    fn observation(&self) -> Option<Observation> {
        Some(self.measured.as_ref().ok()?.observation())
    }

    fn has_traction(&self) -> bool {
        let report = self.measured.as_ref();
        report.is_ok_and(|report| report.properties[0].is_some())
    }
}
