//! Recorded slides, divided by a protocol into those to learn from and those to test on.

use std::collections::{HashMap, HashSet};

use tactus_core::features::{Movement, Observation};

use super::{ExperimentError, Pool, Protocol};
use crate::data::quality::SeenSlides;
use crate::data::replay::MeasuredSlide;

/// Slides of a session that [`Protocol::Blocked`] trains from, out of [`SESSION`].
const BLOCKED_TRAINING: usize = 19;
const SESSION: usize = 34;
/// Limit of the slide numbers that blocked trains on, where a second folder brings the test slides ...
const BLOCKED_BELOW: u32 = 30;
const BLOCKED_ABOVE: u32 = 34;

/// All slides of recordings, and how they are divided.
pub(super) struct Division<'s> {
    observed: &'s [Vec<MeasuredSlide>],
    /// Those of a second folder, per texture.
    test: Option<Vec<&'s [MeasuredSlide]>>,
    /// Slides that are learned from, where a second folder brings the test slides.
    learned: SeenSlides,
    protocol: Protocol,
    /// Session and run of each part that is tested in turn; none where nothing is.
    pub(super) parts: Vec<[String; 2]>,
    /// The number of each.
    numbers: HashMap<[String; 2], usize>,
}

/// The slides of a texture at a movement.
pub(super) struct Divided<'s> {
    train: Vec<&'s MeasuredSlide>,
    test: Option<Vec<&'s MeasuredSlide>>,
    parts: Vec<usize>,
    /// Slides of the second folder that are learned from.
    pub(super) left_out: usize,
}

impl<'s> Division<'s> {
    /// Errors: the recordings have not what the protocol takes.
    pub(super) fn new(
        names: &[String],
        observed: &'s [Vec<MeasuredSlide>],
        test: Option<(&[String], &'s [Vec<MeasuredSlide>])>,
        protocol: Protocol,
        train_slides: usize,
    ) -> Result<Self, ExperimentError> {
        let test = test.map(|(others, slides)| {
            let of = names.iter().map(|name| {
                let other = others.iter().position(|other| other == name);
                let slides = other.and_then(|other| slides.get(other)).map(Vec::as_slice);
                slides.ok_or_else(|| {
                    ExperimentError(format!(
                        "the test folder has no {name}, which the training folder has; give a folder of the same \
                         textures"
                    ))
                })
            });
            of.collect::<Result<Vec<_>, _>>()
        });
        let parts = parts(names, observed, protocol)?;
        let mut division = Self {
            numbers: parts.iter().cloned().zip(0..).collect(),
            observed,
            test: test.transpose()?,
            learned: SeenSlides::default(),
            protocol,
            parts,
        };
        if !division.parts.is_empty() && division.test.is_some() {
            let name = protocol.name();
            return Err(ExperimentError(format!(
                "--protocol {name} tests on sessions of the same folder: leave out --test, or give another --protocol"
            )));
        }
        if division.test.is_some() {
            let mut learned = Vec::new();
            for (texture, slides) in observed.iter().enumerate() {
                let movements: HashSet<Movement> = slides.iter().map(|s| s.movement).collect();
                for movement in movements {
                    let train = division.of(texture, movement).train;
                    let first = match protocol {
                        Protocol::Drift => train_slides,
                        _ => train.len(),
                    };
                    learned.extend(train.iter().take(first).map(|slide| &slide.marks));
                }
            }
            division.learned = SeenSlides::of(learned);
        }
        Ok(division)
    }

    /// Divides the slides of a texture at a movement.
    pub(super) fn of(&self, texture: usize, movement: Movement) -> Divided<'s> {
        let of = |slides: &'s [MeasuredSlide]| -> Vec<&'s MeasuredSlide> {
            slides.iter().filter(|s| s.movement == movement).collect()
        };
        let mut train = of(&self.observed[texture]);
        let mut test = self.test.as_ref().map(|test| of(test[texture]));
        match (self.protocol, &mut test) {
            (Protocol::Blocked, Some(test)) => {
                train.retain(|s| s.number < BLOCKED_BELOW);
                test.retain(|s| s.number > BLOCKED_ABOVE);
            }
            (Protocol::Blocked, None) => {
                let first = (train.len() * BLOCKED_TRAINING + SESSION / 2) / SESSION;
                test = Some(train.split_off(first));
            }
            _ => {}
        }
        let there = test.as_ref().map_or(0, Vec::len);
        if let Some(test) = &mut test {
            test.retain(|slide| !self.learned.has(&slide.marks));
        }
        let left_out = there - test.as_ref().map_or(0, Vec::len);
        let part = |slide: &&MeasuredSlide| {
            let number = self.numbers.get(&part_of(slide, self.protocol));
            number.copied().unwrap_or(0)
        };
        let parts = match self.parts.is_empty() {
            true => Vec::new(),
            false => train.iter().map(part).collect(),
        };
        Divided {
            train,
            test,
            parts,
            left_out,
        }
    }
}

impl Divided<'_> {
    /// The most slides that can be learned from, with one left to test on.
    pub(super) fn can_learn(&self) -> usize {
        let all = self.train.len();
        if let Some(test) = &self.test {
            return if test.is_empty() { 0 } else { all };
        }
        match self.parts.iter().max() {
            None => all.saturating_sub(1),
            Some(&last) => {
                let of = |part| self.parts.iter().filter(|of| **of == part).count();
                all - (0..=last).map(of).max().unwrap_or(0)
            }
        }
    }

    /// The slides, of which so many are learned from.
    pub(super) fn pool(mut self, protocol: Protocol, train_slides: usize) -> Pool {
        if protocol == Protocol::Drift && self.test.is_none() {
            self.test = Some(self.train.split_off(train_slides.min(self.train.len())));
        }
        let observed = |slides: Vec<&MeasuredSlide>| -> Vec<Observation> {
            let slides = slides.into_iter();
            slides.map(|s| s.observation()).collect()
        };
        Pool {
            train: observed(self.train),
            test: self.test.map(observed),
            parts: self.parts,
        }
    }
}

/// The session and run by which a slide is left out; without the run, where sessions are.
fn part_of(slide: &MeasuredSlide, protocol: Protocol) -> [String; 2] {
    let [session, run] = &slide.session;
    let run = match protocol {
        Protocol::LeaveOneRunOut => run.clone(),
        _ => String::new(),
    };
    [session.clone(), run]
}

/// The parts that are tested in turn, in the order in which they are first seen; none for other protocols.
/// Errors: a slide names none, or all are of one.
fn parts(
    names: &[String],
    observed: &[Vec<MeasuredSlide>],
    protocol: Protocol,
) -> Result<Vec<[String; 2]>, ExperimentError> {
    let (what, at) = match protocol {
        Protocol::LeaveOneSessionOut => ("session", 0),
        Protocol::LeaveOneRunOut => ("run", 1),
        _ => return Ok(Vec::new()),
    };
    let mut parts: Vec<[String; 2]> = Vec::new();
    let mut seen = HashSet::new();
    for (name, slides) in names.iter().zip(observed) {
        for slide in slides {
            if slide.session[at].is_empty() {
                let number = slide.number;
                return Err(ExperimentError(format!(
                    "slide {number} of {name} is of no {what}: write it into the column {what} of manifest.csv, or \
                     give another --protocol{}",
                    match at {
                        0 => "; `tactus import` takes sessions from folders such as day1",
                        _ => "",
                    }
                )));
            }
            let part = part_of(slide, protocol);
            if seen.insert(part.clone()) {
                parts.push(part);
            }
        }
    }
    if let [[session, run]] = parts.as_slice() {
        let one = format!("{session} {run}");
        return Err(ExperimentError(format!(
            "all slides are of one {what}, {}: record another {what}, or give --protocol interleaved, blocked or drift",
            one.trim()
        )));
    }
    Ok(parts)
}
