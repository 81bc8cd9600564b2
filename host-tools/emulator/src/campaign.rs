//! Many explorations side by side, in simulated worlds and on recordings, against the bars.

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use tactus::collection::Collection;
use tactus::evaluate::Method;
use tactus::played::Lesson;
use tactus_core::wire::Identify;

use crate::board::Options;
use crate::exploration::{Exploration, ExploreError, explore};
use crate::lessons::{self, Known, TRIALS, Unknown};
use crate::talk::Talk;

/// A texture more probable than this is the answer (PAPER).
const THRESHOLD: f32 = 0.99;
/// Slides at most (PAPER).
const MAX_SLIDES: u8 = 10;
/// Textures of the simulated world's table.
const AMONG: u8 = 20;

/// Explorations whose firmware knows the same table.
#[derive(Clone, Debug)]
pub struct Group {
    /// What the firmware is told.
    pub known: Known,
    /// What lies under the finger, exploration by exploration.
    pub unknown: Vec<Unknown>,
    /// How it decides.
    pub method: Method,
    /// For the firmware's own draws.
    pub seed: u64,
}

/// `count` explorations of the 20 textures of a simulated world in turn; `done` hears of each that is learned.
///
/// # Errors
/// See [`lessons::LessonError`].
pub fn simulated(
    count: usize,
    method: Method,
    seed: u64,
    done: impl Fn() + Sync,
) -> Result<Group, lessons::LessonError> {
    let collection = Collection {
        seed,
        textures: Collection::spread(1, AMONG),
        trials: TRIALS,
    };
    let known = lessons::simulated(&collection, method.method(), done)?;
    let textures = collection.textures.iter().cycle().take(count);
    let unknown = textures
        .zip(1..)
        .map(|(texture, trial)| lessons::mounted(&collection, *texture, trial))
        .collect();
    Ok(Group {
        known,
        unknown,
        method,
        seed,
    })
}

/// `count` explorations of the recorded materials in turn.
///
/// # Errors
/// See [`lessons::LessonError`].
pub fn recorded(
    lesson: &Lesson,
    count: usize,
    method: Method,
    seed: u64,
) -> Result<Group, lessons::LessonError> {
    let known = lessons::recorded(lesson, method.method())?;
    let unknown = (0..lesson.names.len())
        .cycle()
        .zip(seed..)
        .take(count)
        .map(|(texture, seed)| lessons::played(lesson, texture, seed))
        .collect();
    Ok(Group {
        known,
        unknown,
        method,
        seed,
    })
}

/// What came of each exploration of a group.
pub type Results = Vec<Result<Exploration, ExploreError>>;

/// Makes all explorations of the groups, as many at once as there are cores; `done` hears of each.
pub fn run(elf: &Path, groups: &[&Group], done: impl Fn() + Sync) -> Vec<Results> {
    let tasks: Vec<(usize, usize)> = groups
        .iter()
        .enumerate()
        .flat_map(|(group, of)| (0..of.unknown.len()).map(move |index| (group, index)))
        .collect();
    let next = AtomicUsize::new(0);
    let results = Mutex::new(Vec::new());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..cores.min(tasks.len()) {
            scope.spawn(|| {
                while let Some(&(group, index)) = tasks.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let result = one(elf, groups[group], index);
                    let mut results = results.lock().unwrap_or_else(|e| e.into_inner());
                    results.push(((group, index), result));
                    done();
                }
            });
        }
    });
    let mut results = results.into_inner().unwrap_or_else(|e| e.into_inner());
    results.sort_by_key(|(task, _)| *task);
    let mut sorted: Vec<Results> = groups.iter().map(|_| Vec::new()).collect();
    for ((group, _), result) in results {
        sorted[group].push(result);
    }
    sorted
}

fn one(elf: &Path, group: &Group, index: usize) -> Result<Exploration, ExploreError> {
    let unknown = &group.unknown[index];
    let mut talk = Talk::new(unknown.start(elf, Options::default())?);
    talk.ready(|_, _| ())?;
    let Known { calibration, table } = &group.known;
    talk.teach(calibration, table, |_, _| ())?;
    let identify = Identify {
        among: Default::default(),
        threshold: THRESHOLD,
        max_slides: MAX_SLIDES,
        method: Some(group.method.method()),
        strategy: group.method.strategy(),
        open: true,
        learn: false,
        seed: (group.seed as u32).wrapping_mul(1009) + index as u32 + 1,
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

/// The bars that a group's results miss; none if all is well.
pub fn missed(results: &Results, bars: Bars) -> Vec<String> {
    let mut missed = Vec::new();
    let wanted = (bars.right_share * results.len() as f64).ceil() as usize;
    let right = right(results);
    if right < wanted {
        missed.push(format!(
            "{right} of {} right, {wanted} wanted",
            results.len()
        ));
    }
    if let (Some(most), Some(median)) = (bars.median_slides, median_slides(results))
        && median > most
    {
        missed.push(format!("{median} slides at the median, {most} wanted"));
    }
    missed.extend(troubles(results));
    missed
}

/// Slides at the median, the upper one of two; an exploration without a verdict has the most. None of none.
pub fn median_slides(results: &Results) -> Option<u8> {
    let slides = results
        .iter()
        .map(|result| result.as_ref().map_or(u8::MAX, |e| e.found.slides));
    let mut slides: Vec<u8> = slides.collect();
    slides.sort_unstable();
    slides.get(slides.len() / 2).copied()
}

/// Explorations that were right.
pub fn right(results: &Results) -> usize {
    results.iter().flatten().filter(|e| e.right()).count()
}

/// What is wrong with explorations whatever their verdicts.
pub fn troubles(results: &Results) -> Vec<String> {
    let mut troubles = Vec::new();
    for (result, number) in results.iter().zip(1..) {
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
