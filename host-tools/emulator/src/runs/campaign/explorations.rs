//! Many explorations side by side, in simulated worlds and on recordings, against the bars.

use std::path::Path;

use rayon::prelude::*;
use tactus_core::wire::Identify;
use tactus_lab::eval::evaluate::Method;
use tactus_lab::sim::collection::Collection;
use tactus_lab::sim::recorded::RecordedTexture;

use crate::board::Options;
use crate::host::exploration::{Exploration, ExploreError, explore};
use crate::host::talk::Talk;
use crate::host::under_finger::{self, FirmwareData, LearnError, TRIALS, Unknown};

/// Textures of the simulated world's table.
const AMONG: u8 = 20;

/// Explorations whose firmware knows the same table.
#[derive(Clone, Debug)]
pub struct Group {
    /// What it is called in reports.
    pub name: &'static str,
    /// What the firmware is told.
    pub known: FirmwareData,
    /// What lies under the finger, exploration by exploration.
    pub unknown: Vec<Unknown>,
    /// How it decides.
    pub method: Method,
    /// For the firmware's own draws.
    pub seed: u64,
}

/// `count` explorations of the 20 textures of a simulated world in turn; `done` hears of each that is learned.
pub fn simulated(
    count: usize,
    method: Method,
    seed: u64,
    done: impl Fn() + Sync,
) -> Result<Group, LearnError> {
    let collection = Collection {
        seed,
        textures: Collection::spread(1, AMONG),
        trials: TRIALS,
    };
    let known = under_finger::simulated(&collection, method.method(), done)?;
    let textures = collection.textures.iter().cycle().take(count);
    let unknown = textures
        .zip(1..)
        .map(|(texture, trial)| under_finger::mounted(&collection, *texture, trial))
        .collect();
    Ok(Group {
        name: "simulated",
        known,
        unknown,
        method,
        seed,
    })
}

/// `count` explorations of the recorded materials in turn.
pub fn recorded(
    recorded_texture: &RecordedTexture,
    count: usize,
    method: Method,
    seed: u64,
) -> Result<Group, LearnError> {
    let known = under_finger::recorded(recorded_texture, method.method())?;
    let unknown = (0..recorded_texture.names.len())
        .cycle()
        .zip(seed..)
        .take(count)
        .map(|(texture, seed)| under_finger::played(recorded_texture, texture, seed))
        .collect();
    Ok(Group {
        name: "recordings",
        known,
        unknown,
        method,
        seed,
    })
}

/// What came of each exploration of a group.
#[derive(Debug)]
pub struct Results {
    /// The group's name.
    pub name: &'static str,
    /// Its explorations, in its order.
    pub explorations: Vec<Result<Exploration, ExploreError>>,
}

/// Makes all explorations of the groups, as many at once as there are cores; `done` hears of each.
pub fn run(elf: &Path, groups: &[Group], done: impl Fn() + Sync) -> Vec<Results> {
    let mut tasks = Vec::new();
    let mut results = Vec::new();
    for group in groups {
        tasks.extend((0..group.unknown.len()).map(|index| (results.len(), group, index)));
        results.push(Results {
            name: group.name,
            explorations: Vec::new(),
        });
    }
    let made = tasks.into_par_iter().map(|(number, group, index)| {
        let exploration = one(elf, group, index);
        done();
        (number, exploration)
    });
    for (number, exploration) in made.collect::<Vec<_>>() {
        results[number].explorations.push(exploration);
    }
    results
}

fn one(elf: &Path, group: &Group, index: usize) -> Result<Exploration, ExploreError> {
    let unknown = &group.unknown[index];
    let mut talk = Talk::new(unknown.start(elf, Options::default())?);
    talk.ready(|_, _| ())?;
    let FirmwareData { calibration, table } = &group.known;
    talk.teach(calibration, table, |_, _| ())?;
    let identify = Identify {
        method: Some(group.method.method()),
        strategy: group.method.strategy(),
        seed: (group.seed as u32).wrapping_mul(1009) + index as u32 + 1,
        ..Identify::default()
    };
    explore(&mut talk, table, identify, &unknown.name, |_, _| ())
}

/// What the verdicts of a group are held against.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Bars {
    /// The share of explorations that must be right.
    pub right_share: f64,
    /// The most slides at the median.
    pub median_slides: Option<u8>,
}

impl Bars {
    /// Those of a method.
    pub fn of(method: Method) -> Self {
        match method {
            Method::Fused => Self {
                right_share: 19.0 / 20.0,
                median_slides: Some(2),
            },
            _ => Self {
                right_share: 16.0 / 20.0,
                median_slides: None,
            },
        }
    }
}

impl Results {
    /// The explorations that came to a verdict.
    pub fn verdicts(&self) -> impl Iterator<Item = &Exploration> {
        self.explorations.iter().flatten()
    }

    /// Explorations that were right.
    pub fn right(&self) -> usize {
        self.verdicts().filter(|e| e.right()).count()
    }

    /// Slides at the median, the upper one of two; an exploration without a verdict has the most. None of none.
    pub fn median_slides(&self) -> Option<u8> {
        let explorations = self.explorations.iter();
        let slides = explorations.map(|e| e.as_ref().map_or(u8::MAX, |e| e.found.slides));
        let mut slides: Vec<u8> = slides.collect();
        slides.sort_unstable();
        slides.get(slides.len() / 2).copied()
    }

    /// What is wrong with explorations whatever their verdicts.
    pub fn troubles(&self) -> Vec<String> {
        let mut troubles = Vec::new();
        for (result, number) in self.explorations.iter().zip(1..) {
            match result {
                Ok(exploration) => {
                    let missed = exploration.missed().into_iter();
                    let truth = &exploration.truth;
                    troubles.extend(missed.map(|what| format!("{number} ({truth}): {what}")));
                }
                Err(why) => troubles.push(format!("{number}: {why}")),
            }
        }
        troubles
    }

    /// The bars that are missed; none if all is well.
    pub fn missed(&self, bars: Bars) -> Vec<String> {
        let mut missed = Vec::new();
        let (right, all) = (self.right(), self.explorations.len());
        let wanted = (bars.right_share * all as f64).ceil() as usize;
        if right < wanted {
            missed.push(format!("{right} of {all} right, {wanted} wanted"));
        }
        if let (Some(most), Some(median)) = (bars.median_slides, self.median_slides())
            && median > most
        {
            missed.push(format!("slides at the median: {median}, {most} wanted"));
        }
        missed.extend(self.troubles());
        missed
    }
}
