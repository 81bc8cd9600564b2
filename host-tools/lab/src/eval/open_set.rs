//! A table's own figures: each of its textures left out in turn and presented to a table of the others, and slides that
//! it was not learned from.
//!
//! A table learns from few slides, and these are all that there may be. Of one known texture some are left out, and
//! none of the others, so that the table is nearly the whole one. Runs of one texture are alike: the intervals
//! (Wilson's) count textures, not runs.

use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use tactus_core::explorer::{Config, VerdictKind};
use tactus_core::features::Observation;
use tactus_core::table::{Contents, EncodeError, OpenSet, Share, Table, with_open_set};

use super::evaluate::{Method, Outcome, explorer, play};
use super::experiment::Experiment;
use super::learn::{Expected, TableError, learn_for, measured};
use super::verdicts::Verdicts;

/// Fewest textures: one that is known is presented while another is left out, and limits take three.
const LEAST: usize = 4;
/// Tables that are learned, and so many where learning one takes long.
const TABLES: [usize; 2] = [120, 12];
/// Work of the tables: each takes the square of the textures, by their slides.
const WORK: usize = 400_000_000;
/// Explorations of each of the two textures that a table is shown.
const RUNS: u64 = 8;

/// A slide of a texture at a movement.
#[derive(Clone, Debug)]
pub struct TaughtSlide {
    /// Its features.
    pub slide: Observation,
    /// Session and run that it is of; empty where nobody said.
    pub part: [String; 2],
    /// True if the table was learned from it.
    pub learned: bool,
}

/// Slides per texture and movement.
pub type Taught = [Vec<Vec<TaughtSlide>>];

/// Slides of which nobody said more, all learned from.
pub fn all_learned(slides: &[Vec<Vec<Observation>>]) -> Vec<Vec<Vec<TaughtSlide>>> {
    let slide = |slide: &Observation| TaughtSlide {
        slide: slide.clone(),
        part: Default::default(),
        learned: true,
    };
    let cell = |cell: &Vec<Observation>| cell.iter().map(slide).collect();
    let rows = slides.iter();
    rows.map(|row| row.iter().map(cell).collect()).collect()
}

/// Those of the slides of a texture that are wanted, by movement.
pub fn select(
    row: &[Vec<TaughtSlide>],
    is: impl Fn(&TaughtSlide) -> bool,
) -> Vec<Vec<Observation>> {
    let of = |slides: &Vec<TaughtSlide>| {
        let wanted = slides.iter().filter(|slide| is(slide));
        wanted.map(|slide| slide.slide.clone()).collect()
    };
    row.iter().map(of).collect()
}

/// The table with its figures; as it is where it has less than four textures, or other contents than the method fused
/// compares. `taught` has its textures and movements; `done` is called after each of [`tables`].
pub fn with_figures(
    bytes: Vec<u8>,
    expected: &Expected,
    taught: &Taught,
    done: impl Fn() + Sync,
) -> Result<Vec<u8>, TableError> {
    match figures(Table::read(&bytes)?, expected, taught, done)? {
        Some(figures) => Ok(noted(&bytes, &figures).map_err(TableError::from)?),
        None => Ok(bytes),
    }
}

/// The table with these figures in place of its own.
pub(crate) fn noted(bytes: &[u8], figures: &OpenSet) -> Result<Vec<u8>, EncodeError> {
    let table = Table::read(bytes).map_err(EncodeError::Invalid)?;
    let mut out = vec![0; bytes.len() + OpenSet::LENGTH];
    let length = with_open_set(&mut out, &table, figures)?.as_bytes().len();
    out.truncate(length);
    Ok(out)
}

/// Number of tables that are learned for the figures of a table.
pub fn tables(taught: &Taught) -> usize {
    let slides: usize = taught.iter().flatten().map(Vec::len).sum();
    let [most, fewest] = TABLES;
    (WORK / (taught.len().pow(2) * slides).max(1)).clamp(fewest, most)
}

pub(crate) fn figures(
    table: Table<'_>,
    expected: &Expected,
    taught: &Taught,
    done: impl Fn() + Sync,
) -> Result<Option<OpenSet>, TableError> {
    let Contents::Fused(..) = table.contents() else {
        return Ok(None);
    };
    let (textures, all) = (taught.len(), tables(taught));
    if textures < LEAST {
        return Ok(None);
    }
    let one = |n: usize| {
        // every texture is new as often as the others, with other ones known; evenly, where there are few tables
        let (new, round) = match all < textures {
            true => (n * textures / all, 0),
            false => (n % textures, n / textures),
        };
        let known = (new + 1 + round % (textures - 1)) % textures;
        let told = told(table, expected, taught, [new, known], n as u64)?;
        done();
        Ok::<_, TableError>(told)
    };
    let tables = (0..all).into_par_iter().panic_fuse();
    let told = tables.map(one).collect::<Result<Vec<_>, _>>()?;
    // a known texture that is undecided when its few slides have run out would mostly be decided by more of them
    let ended = |told: &&Outcome| {
        told.told != VerdictKind::Undecided || told.slides >= Config::default().max_slides
    };
    let told = || told.iter().flatten();
    let known = told().skip(1).step_by(2).filter(ended);
    let [new, known] = [told().step_by(2).collect(), known.collect()]
        .map(|told: Vec<&Outcome>| Verdicts::of(told.iter().map(|told| (told.told, true))));
    let among = all.min(textures) as f64;
    Ok(Some(OpenSet {
        known_flagged: wilson(1.0 - known.right, among),
        new_noticed: wilson(new.new, among),
        new_named: wilson(new.right, among),
    }))
}

/// Explorations of a texture that the table is learned without, and, every second one, of a known one.
fn told(
    table: Table<'_>,
    expected: &Expected,
    taught: &Taught,
    [new, known]: [usize; 2],
    seed: u64,
) -> Result<Vec<Outcome>, TableError> {
    let Contents::Fused(set, _) = table.contents() else {
        return Ok(Vec::new());
    };
    let movements: Vec<_> = table.movements().collect();
    let mut names: Vec<String> = table.names().map(str::to_owned).collect();
    let presented = [new, known].map(|texture| names[texture].clone());
    let (kept, held) = divide(&taught[known], &mut ChaCha8Rng::seed_from_u64(seed));
    let rows = taught.iter().map(|row| select(row, |s| s.learned));
    let mut slides: Vec<_> = rows.collect();
    slides[known] = kept;
    slides.remove(new);
    names.remove(new);
    let method = Method::Fused;
    let learned = learn_for(
        expected,
        method.method(),
        Some(set),
        &names,
        &movements,
        &slides,
    )?;
    let config = Config {
        method: method.method(),
        strategy: method.strategy(),
        open: true,
        ..Config::default()
    };
    let new = spare(&taught[new]).unwrap_or_else(|| select(&taught[new], |_| true));
    let shown = vec![new, held];
    let measured = measured(&shown);
    let shown = Experiment::shown(presented.into(), movements, shown, seed).each_slide_once();
    let mut explorer = explorer(&learned, measured, config, None)?;
    let runs = (0..2 * RUNS).map(|run| play(&mut explorer, config.strategy, shown.run_alone(run)));
    Ok(runs.collect())
}

/// The parts of a texture's slides that it was learned from.
fn parts(row: &[Vec<TaughtSlide>]) -> Vec<&[String; 2]> {
    let learned = row.iter().flatten().filter(|slide| slide.learned);
    learned.map(|slide| &slide.part).collect()
}

/// Slides that were not learned from, of other runs and sessions if there are any; `None`: there are too few.
fn spare(row: &[Vec<TaughtSlide>]) -> Option<Vec<Vec<Observation>>> {
    let parts = parts(row);
    let elsewhere = |s: &TaughtSlide| !s.learned && !parts.contains(&&s.part);
    let kinds = [&elsewhere as &dyn Fn(&TaughtSlide) -> bool, &|s| !s.learned];
    let mut spare = kinds.iter().map(|is| select(row, is));
    spare.find(|spare| spare.iter().all(|slides| slides.len() >= 3))
}

/// The slides of a known texture to learn from, and those to present: what it was not learned from, or else some of
/// those learned from, of one run if there are more.
fn divide(
    row: &[Vec<TaughtSlide>],
    random: &mut ChaCha8Rng,
) -> (Vec<Vec<Observation>>, Vec<Vec<Observation>>) {
    if let Some(spare) = spare(row) {
        return (select(row, |s| s.learned), spare);
    }
    let mut parts = parts(row);
    parts.shuffle(random);
    let part = parts.first().copied();
    let cells = row.iter().map(|slides| {
        let mut learned: Vec<&TaughtSlide> = slides.iter().filter(|s| s.learned).collect();
        learned.shuffle(random);
        learned.sort_by_key(|slide| Some(&slide.part) != part);
        let of_part = learned.iter().filter(|slide| Some(&slide.part) == part);
        let of_part = Some(of_part.count()).filter(|n| *n < learned.len());
        let held = of_part.unwrap_or(learned.len() / 4).max(2);
        let kept = learned.split_off(held.min(learned.len().saturating_sub(1)));
        let slides = |of: Vec<&TaughtSlide>| of.into_iter().map(|s| s.slide.clone()).collect();
        (slides(kept), slides(learned))
    });
    cells.unzip()
}

/// The share among so many, with Wilson's interval of 95 %.
fn wilson(share: f64, of: f64) -> Share {
    let z2 = 1.96 * 1.96 / of;
    let middle = (share + z2 / 2.0) / (1.0 + z2);
    let half = (z2 * (share * (1.0 - share) + z2 / 4.0)).sqrt() / (1.0 + z2);
    Share {
        share: share as f32,
        low: (middle - half).clamp(0.0, share) as f32,
        high: (middle + half).clamp(share, 1.0) as f32,
    }
}

/// The figures in a sentence.
pub fn in_words(figures: &OpenSet) -> String {
    let share = |of: &Share| {
        let [share, low, high] = [of.share, of.low, of.high].map(|share| 100.0 * share);
        format!("{share:.0} % ({low:.0} to {high:.0} %)")
    };
    let so = match figures.may_name() {
        true => "",
        false => {
            ": too many, so it says \"most like X\" in place of \"X\", unless --closed says that nothing new can come"
        }
    };
    format!(
        "With textures and slides left out it flags {} of the known textures, notices {} of the new ones, and is sure \
         of a wrong name for {} of these{so}.",
        share(&figures.known_flagged),
        share(&figures.new_noticed),
        share(&figures.new_named)
    )
}

/// The same sentence in lines for a terminal.
pub fn in_lines(figures: &OpenSet) -> String {
    in_words(figures).replace(", ", ",\n  ")
}

/// A sentence on what the figures do not say, as all slides are of one session.
pub fn not_known(taught: &Taught) -> Option<&'static str> {
    let mut sessions = taught
        .iter()
        .flatten()
        .flatten()
        .map(|slide| &slide.part[0]);
    let first = sessions.next()?;
    let is_one = sessions.all(|session| session == first);
    is_one.then_some("One session: another day is not in these figures.")
}
