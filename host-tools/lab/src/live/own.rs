//! Files that somebody gives to a display: their slides, the map of their textures, and what tables say of each slide
//! that have not seen it.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};
use tactus_core::explorer::{Config, Method as Comparison};
use tactus_core::features::PropertySet;
use tactus_core::table::{Action, Table};

use super::message::{KnownTable, movement_of};
use super::monitor::{ProbeMonitor, decibels};
use super::session::{asked_in_json, sentence};
use crate::data::import::foreign::Survey;
use crate::data::import::settings::Settings;
use crate::data::recordings::RecordingSet;
use crate::data::replay::{MeasuredSlide, measure_all};
use crate::eval::evaluate::{Method, explorer};
use crate::eval::first::learn_first;
use crate::eval::learn::{Expected, TableError};
use crate::eval::transcript::Answer;

/// Most bytes of all files together.
const MOST_BYTES: usize = 256 << 20;
/// Most tables that are learned.
const MOST_FOLDS: usize = 10;
/// Fewest recordings of each texture for whole ones to be held back; two stay to learn from.
const RECORDINGS: usize = 3;

#[derive(Deserialize)]
#[serde(tag = "do", rename_all = "kebab-case")]
enum Request {
    /// The files that were given are slides of these settings: [`Reply::Found`].
    Look { settings: Box<Settings> },
    /// Slides of this fold, by a table learned from all others: [`Reply::Judged`].
    Judge { fold: usize },
}

#[derive(Serialize)]
#[serde(tag = "is", rename_all = "kebab-case")]
#[allow(clippy::large_enum_variant)] // one at a time
enum Reply {
    Found(Found),
    Judged { slides: Vec<Judged> },
    Error { why: String },
}

#[derive(Serialize)]
struct Found {
    kind: &'static str,
    rate_hz: f64,
    channel: String,
    notes: Vec<String>,
    left_out: Vec<String>,
    /// The table of all slides, for the map.
    known: KnownTable,
    slides: Vec<Shown>,
    folds: usize,
    /// True if whole recordings are held back, false if slides of one recording are on both sides.
    by_recording: bool,
}

#[derive(Serialize)]
struct Shown {
    texture: String,
    recording: String,
    movement: Option<u8>,
    /// Place on the map.
    place: Option<(f64, f64)>,
    /// dB per four bins.
    spectrum: Vec<i8>,
}

/// What a table says that has not seen the slide.
#[derive(Serialize)]
struct Judged {
    /// Its number among the slides that were found.
    slide: usize,
    /// The verdict; `None` if too few slides of its movement are left to learn from.
    answer: Option<Answer>,
}

/// Files of a user's own.
#[derive(Default)]
pub struct OwnFiles {
    given: Vec<(String, Vec<u8>)>,
    set: Option<RecordingSet>,
    measured: Vec<Vec<MeasuredSlide>>,
    folds: Vec<Vec<usize>>,
}

impl OwnFiles {
    /// Takes a file: the length of its path, the path, and its bytes.
    pub fn take(&mut self, path_length: usize, bytes: &[u8]) {
        if let Some((path, bytes)) = bytes.split_at_checked(path_length) {
            let path = String::from_utf8_lossy(path).into_owned();
            self.given.push((path, bytes.to_vec()));
        }
    }

    /// Carries out a request in JSON, and replies in JSON: see the requests of this file.
    pub fn ask(&mut self, request: &str) -> String {
        asked_in_json(request, |request| {
            let reply = match request {
                Ok(Request::Look { settings }) => self.look(*settings).map(Reply::Found),
                Ok(Request::Judge { fold }) => {
                    self.judge(fold).map(|slides| Reply::Judged { slides })
                }
                Err(why) => Err(TableError::Said(why)),
            };
            reply.unwrap_or_else(|why| Reply::Error {
                why: sentence(&why),
            })
        })
    }

    fn look(&mut self, settings: Settings) -> Result<Found, TableError> {
        let given = std::mem::take(&mut self.given);
        if given.iter().map(|(_, bytes)| bytes.len()).sum::<usize>() > MOST_BYTES {
            let most = MOST_BYTES >> 20;
            return Err(TableError::Said(format!(
                "these files have more than {most} MB; use `tactus import`"
            )));
        }
        let survey = Survey::of_files(given, settings)?;
        let (set, mut left_out) = survey.recordings()?;
        left_out.extend(survey.left_out.iter().cloned());
        self.measured = measure_all(&set, |_| ())?;
        let by_recording = self.divide();
        let bytes = self.learn(&set, None)?;
        let (mut monitor, table) = (ProbeMonitor::default(), Table::read(&bytes)?);
        monitor.knows(&bytes);
        let names = set.names();
        let shown = self.measured.iter().zip(&names).flat_map(|(slides, name)| {
            slides.iter().map(|slide| {
                let movement = movement_of(table, slide.movement);
                Shown {
                    texture: name.clone(),
                    recording: slide.session[1].clone(),
                    movement,
                    place: movement
                        .and_then(|at| monitor.place_of(table, at, &slide.observation())),
                    spectrum: decibels(slide.measurement.spectrum.psd()),
                }
            })
        });
        let found = Found {
            kind: survey.kind,
            rate_hz: survey.rate_hz,
            channel: survey.channel.clone(),
            notes: survey.notes.clone(),
            left_out,
            known: monitor.known().clone(),
            slides: shown.collect(),
            folds: self.folds.iter().flatten().max().map_or(0, |last| last + 1),
            by_recording,
        };
        self.set = Some(set);
        Ok(found)
    }

    /// Gives each slide the number of the table that does not see it. Returns true if the slides of a recording have
    /// the same one.
    fn divide(&mut self) -> bool {
        let numbered = |slides: &Vec<MeasuredSlide>| -> Vec<usize> {
            let mut numbers = HashMap::new();
            let of = slides.iter().map(|slide| {
                let next = numbers.len();
                *numbers.entry(&slide.session).or_insert(next)
            });
            of.collect()
        };
        let recordings: Vec<Vec<usize>> = self.measured.iter().map(numbered).collect();
        let many = |of: &Vec<usize>| of.iter().max().is_some_and(|last| last + 1 >= RECORDINGS);
        let by_recording = recordings.iter().all(many);
        let fold = |(at, recording): (usize, &usize)| match by_recording {
            true => recording % MOST_FOLDS,
            false => at % MOST_FOLDS,
        };
        let of = |numbers: &Vec<usize>| numbers.iter().enumerate().map(fold).collect();
        self.folds = recordings.iter().map(of).collect();
        by_recording
    }

    /// A table of all slides but those of a fold.
    fn learn(&self, set: &RecordingSet, but: Option<usize>) -> Result<Vec<u8>, TableError> {
        let rows = self.measured.iter().zip(&self.folds);
        let stays = rows.map(|(slides, folds)| {
            let all = slides.iter().zip(folds);
            let stay = all.filter(|(_, fold)| Some(**fold) != but);
            stay.map(|(slide, _)| slide.clone()).collect()
        });
        let stays: Vec<Vec<MeasuredSlide>> = stays.collect();
        let expected = Expected::default();
        learn_first(set, &stays, usize::MAX, Method::Fused, None, &expected)
    }

    fn judge(&self, fold: usize) -> Result<Vec<Judged>, TableError> {
        let none = || TableError::Said("no files were given".to_owned());
        let bytes = self.learn(self.set.as_ref().ok_or_else(none)?, Some(fold))?;
        let table = Table::read(&bytes)?;
        let config = Config {
            method: Comparison::Fused,
            open: true,
            ..Config::default()
        };
        let mut explorer = explorer(&bytes, PropertySet::ALL, config, None)?;
        let slides = self.measured.iter().flatten();
        let of_fold = slides.zip(self.folds.iter().flatten()).enumerate();
        let of_fold = of_fold.filter(|(_, (_, of))| **of == fold);
        let judged = of_fold.map(|(number, (slide, _))| {
            explorer.restart();
            let answer = movement_of(table, slide.movement).and_then(|movement| {
                let action = Action {
                    movement,
                    property: None,
                };
                explorer.observe(action, &slide.observation()).ok()?;
                Some(Answer::new(explorer.best(), 1, table))
            });
            Judged {
                slide: number,
                answer,
            }
        });
        Ok(judged.collect())
    }
}
