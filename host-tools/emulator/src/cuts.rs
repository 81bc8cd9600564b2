//! The power is cut while the real firmware stores something: what it makes of the flash that is left.
//!
//! The firmware stores once without a cut, and every word that it programs and every sector that it erases is noted. For a cut,
//! the flash is made as it is after a part of them, with the last one torn, and the firmware boots on it: it must hold the state from before
//! or the one from after, and say so before it has found its switches.

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use tactus::collection::Collection;
use tactus::link::{Found, Question, ReadTable};
use tactus::sim::world::{Setup, World};
use tactus_core::explorer::{Method, Strategy};
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::wire::{Identify, Name, Reset, Tell};

use crate::board::Options;
use crate::exploration::{ExploreError, explore};
use crate::flash::{FlashWrite, SECTOR};
use crate::lessons::{self, Known, LessonError, Unknown};
use crate::talk::{PATIENCE_S, Talk, TalkError};

/// The texture under the finger, which the table has.
const TEXTURE: u8 = 47;
/// Textures of the table: few, so that every word of it can be cut.
const AMONG: u8 = 4;
/// The probe learns from visits that it is certain of: one of so many.
const VISITS: u64 = 8;
/// More calibrations than a page of settings holds.
const CALIBRATIONS: u32 = 400;
/// The firmware has its store open by then: two erases and the lever's way up, virtual s.
const OPEN_S: f64 = 20.0;
/// Nothing here is as quick as the line.
const LOOK_MS: u64 = 10;
/// Places at power-up among which the highest is looked for.
const TRIALS: u64 = 100;
/// After so many cuts of an operation the probe homes and identifies as well.
const PROBED: usize = 2;

/// Why there are no cuts to judge.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CutError {
    /// The firmware did not do what it was asked for.
    #[error(transparent)]
    Talk(#[from] TalkError),
    /// It did not explore.
    #[error(transparent)]
    Explore(#[from] ExploreError),
    /// The world cannot be learned.
    #[error(transparent)]
    Lesson(#[from] LessonError),
    /// What was to be cut did not happen.
    #[error("the firmware did not {0}: nothing to cut")]
    Nothing(&'static str),
    /// What was noted is not what the flash has.
    #[error("{0}: the noted writes do not give the flash that the firmware left")]
    Noted(&'static str),
    /// It does not hold what it had told of.
    #[error("{0}: without a cut the firmware does not keep what it held: {1:?}, {2:?}")]
    Kept(&'static str, Box<Held>, Box<Held>),
}

impl From<crate::board::Error> for CutError {
    fn from(why: crate::board::Error) -> Self {
        Self::Talk(why.into())
    }
}

/// What the firmware holds, by its own account.
#[derive(Clone, PartialEq, Debug)]
pub struct Held {
    /// Checksum and bytes of the table in force, with what the probe has taught itself.
    pub table: (u32, u32),
    /// Its textures.
    pub textures: u16,
    /// It came with the firmware.
    pub factory: bool,
    /// Constants of the rig.
    pub calibration: [u8; RigCalibration::BYTES],
    /// Work that the skin has seen, mJ, and that part of it that wears.
    pub skin_mj: (u32, u32),
}

/// What is left by a cut.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Left {
    /// The state from before.
    Old,
    /// One of several records is stored.
    Between,
    /// The state from after.
    New,
}

/// Which of the states, the oldest first, was found; `None` is neither.
pub fn judge(states: &[Held], found: &Held) -> Option<Left> {
    let last = states.len().checked_sub(1)?;
    // where nothing changed, it is old and new
    match states.iter().rposition(|state| state == found)? {
        at if at == last => Some(Left::New),
        0 => Some(Left::Old),
        _ => Some(Left::Between),
    }
}

/// Something that the firmware stores.
#[derive(Clone, Debug)]
pub struct Operation {
    /// What it is.
    pub name: &'static str,
    /// The store before it.
    pub before: Vec<u8>,
    /// What the firmware does to it.
    pub writes: Vec<FlashWrite>,
    /// What may be held after a cut, the oldest first.
    pub states: Vec<Held>,
}

/// How a write is torn.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Torn {
    /// It had not begun.
    Nothing,
    /// The lower half of the word; the sector's first part is erased.
    Begin,
    /// The upper half; the sector's last part.
    End,
    /// Any bits of the word; any words of the sector, and any bits of others.
    Bits,
}

impl Torn {
    const ALL: [Self; 4] = [Self::Nothing, Self::Begin, Self::End, Self::Bits];
}

/// The power is off in this write of an operation.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Cut {
    /// Writes before it.
    pub at: usize,
    /// What is left of it.
    pub torn: Torn,
    /// For the bits.
    pub seed: u64,
}

fn word(store: &mut [u8], at: usize, change: impl FnOnce(u32) -> u32) {
    if let Some(bytes) = store.get_mut(at..).and_then(|rest| rest.first_chunk_mut()) {
        *bytes = change(u32::from_le_bytes(*bytes)).to_le_bytes();
    }
}

fn apply(store: &mut [u8], write: FlashWrite) {
    match write {
        FlashWrite::Program { at, word: new } => word(store, at, |_| new),
        FlashWrite::Erase { sector } => {
            if let Some(sector) = store.chunks_mut(SECTOR).nth(sector) {
                sector.fill(0xFF);
            }
        }
    }
}

fn tear(store: &mut [u8], write: FlashWrite, cut: Cut) {
    let mut random = ChaCha8Rng::seed_from_u64(cut.seed);
    match write {
        FlashWrite::Program { at, word: new } => {
            let kept: u32 = match cut.torn {
                Torn::Nothing => u32::MAX,
                Torn::Begin => 0xFFFF_0000,
                Torn::End => 0x0000_FFFF,
                Torn::Bits => random.random(),
            };
            // programming only clears bits
            word(store, at, |old| old & (new | kept));
        }
        FlashWrite::Erase { sector } => {
            let Some(sector) = store.chunks_mut(SECTOR).nth(sector) else {
                return;
            };
            let part = random.random_range(0..SECTOR / 4) * 4;
            match cut.torn {
                Torn::Nothing => {}
                Torn::Begin => sector[..part].fill(0xFF),
                Torn::End => sector[part..].fill(0xFF),
                Torn::Bits => {
                    for at in (0..SECTOR).step_by(4) {
                        let erased: u32 = match random.random_range(0..3) {
                            0 => 0,
                            1 => u32::MAX,
                            _ => random.random(),
                        };
                        word(sector, at, |old| old | erased);
                    }
                }
            }
        }
    }
}

/// The flash after some writes and a cut.
pub fn left_by(before: &[u8], writes: &[FlashWrite], cut: Cut) -> Vec<u8> {
    let mut store = before.to_vec();
    for write in writes.iter().take(cut.at) {
        apply(&mut store, *write);
    }
    if let Some(write) = writes.get(cut.at) {
        tear(&mut store, *write, cut);
    }
    store
}

/// What is cut, and in what world.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// A teaching and an update on the go, to be cut at every word, and an update that turns a page.
    pub operations: Vec<Operation>,
    unknown: Unknown,
}

/// Has the firmware store all that is to be cut, each once and whole; `each` hears what it does.
///
/// # Errors
/// See [`CutError`].
pub fn prepare(elf: &Path, seed: u64, mut each: impl FnMut(&str)) -> Result<Prepared, CutError> {
    each("learning a table");
    let collection = Collection {
        seed,
        textures: Collection::spread(TEXTURE, AMONG),
        trials: lessons::TRIALS,
    };
    let known = lessons::simulated(&collection, Method::Fused, || ())?;
    let unknown = lessons::mounted(&collection, TEXTURE, 1 + seed);
    each("a board finds its switches");
    let mut talk = boot(elf, &unknown, None)?;
    talk.ready(|_, _| ())?;
    let Known { calibration, table } = &known;
    talk.teach(calibration, table, |_, _| ())?;
    each("it learns by itself");
    let update = noted_update("update", &mut talk, &unknown, |_| true)?;
    each("it is taught");
    visit(&mut talk, &unknown, 1, false)?;
    let name = Name::try_from("taught").unwrap_or_default();
    let (before, held) = begin(&mut talk)?;
    talk.run(Question::answer(name), PATIENCE_S, |_, _| ())?;
    let teach = noted("teach", &mut talk, before, held, |before, after| {
        vec![before, after]
    })?;
    each("a page of settings fills up");
    let full = fill(&mut talk, calibration)?;
    drop(talk);
    each("another board finds its switches");
    let mut talk = boot(elf, &unknown, Some(full))?;
    talk.ready(|_, _| ())?;
    each("it learns by itself, and the page turns");
    let turned = noted_update("sector change", &mut talk, &unknown, |writes| {
        erases(writes).next().is_some()
    })?;
    Ok(Prepared {
        operations: vec![teach, update, turned],
        unknown: lifted(unknown),
    })
}

/// The same with the finger as high as it may be when the power comes: it was lifted when it was cut, and every boot lifts it first.
fn lifted(unknown: Unknown) -> Unknown {
    let setups = (0..TRIALS).map(|trial_seed| Setup {
        trial_seed,
        ..unknown.setup
    });
    let height = |setup: &Setup| World::new(*setup).truth().tip_mm;
    let highest = setups.max_by(|a, b| height(a).total_cmp(&height(b)));
    Unknown {
        setup: highest.unwrap_or(unknown.setup),
        ..unknown
    }
}

fn erases(writes: &[FlashWrite]) -> impl Iterator<Item = usize> {
    let erase =
        |(at, write): (usize, &FlashWrite)| matches!(write, FlashWrite::Erase { .. }).then_some(at);
    writes.iter().enumerate().filter_map(erase)
}

fn boot(elf: &Path, unknown: &Unknown, store: Option<Vec<u8>>) -> Result<Talk, CutError> {
    let options = Options {
        store,
        ..Options::default()
    };
    Ok(Talk::new(unknown.start(elf, options)?).look_every(LOOK_MS))
}

fn visit(talk: &mut Talk, unknown: &Unknown, seed: u32, learn: bool) -> Result<Found, CutError> {
    let table = talk.run(ReadTable::default(), PATIENCE_S, |_, _| ())?;
    let identify = Identify {
        among: Default::default(),
        threshold: 0.99,
        max_slides: 10,
        method: None,
        strategy: Strategy::default(),
        open: true,
        learn,
        seed,
    };
    let explored = explore(talk, &table, identify, &unknown.name, |_, _| ())?;
    Ok(explored.found)
}

/// The store and what is held, before something is stored.
fn begin(talk: &mut Talk) -> Result<(Vec<u8>, Held), CutError> {
    talk.board().store_writes()?;
    Ok((talk.board().store()?, held(talk)?))
}

/// What was stored since.
fn noted(
    name: &'static str,
    talk: &mut Talk,
    before: Vec<u8>,
    held_before: Held,
    states: impl FnOnce(Held, Held) -> Vec<Held>,
) -> Result<Operation, CutError> {
    let writes = talk.board().store_writes()?;
    let whole = Cut {
        at: writes.len(),
        torn: Torn::Nothing,
        seed: 0,
    };
    if left_by(&before, &writes, whole) != talk.board().store()? {
        return Err(CutError::Noted(name));
    }
    Ok(Operation {
        name,
        before,
        writes,
        states: states(held_before, held(talk)?),
    })
}

/// Visits until the probe learns by itself, and stores what `wanted` is.
fn noted_update(
    name: &'static str,
    talk: &mut Talk,
    unknown: &Unknown,
    wanted: impl Fn(&[FlashWrite]) -> bool,
) -> Result<Operation, CutError> {
    for seed in 1..=VISITS {
        let (before, held_before) = begin(talk)?;
        let found = visit(talk, unknown, seed as u32, true)?;
        // first the skin is kept, then what was learned
        let update = noted(name, talk, before, held_before, |before, after| {
            let between = Held {
                skin_mj: after.skin_mj,
                ..before.clone()
            };
            vec![before, between, after]
        })?;
        if found.learned > 0 && wanted(&update.writes) {
            return Ok(update);
        }
    }
    Err(CutError::Nothing("learn by itself as it should"))
}

/// Stores calibrations until a page turns; the store from before the one that turned it.
fn fill(talk: &mut Talk, calibration: &RigCalibration) -> Result<Vec<u8>, CutError> {
    for number in 1..=CALIBRATIONS {
        let before = talk.board().store()?;
        talk.board().store_writes()?;
        // nothing that the rig goes by
        let mut next = *calibration;
        for (byte, digit) in next.serial.iter_mut().zip(format!("{number:016}").bytes()) {
            *byte = digit;
        }
        let write = Question::write_calibration(&next).map_err(TalkError::from)?;
        talk.run(write, PATIENCE_S, |_, _| ())?;
        if erases(&talk.board().store_writes()?).next().is_some() {
            return Ok(before);
        }
    }
    Err(CutError::Nothing("turn a page"))
}

/// What the firmware holds now.
fn held(talk: &mut Talk) -> Result<Held, CutError> {
    let status = talk.run(Question::status(), PATIENCE_S, |_, _| ())?;
    let calibration = talk.run(Question::read_calibration(), PATIENCE_S, |_, _| ())?;
    Ok(Held {
        table: (status.table_crc, status.table_bytes),
        textures: status.textures,
        factory: status.factory,
        calibration: calibration.to_bytes(),
        skin_mj: status.skin_mj,
    })
}

/// Boots the firmware on a flash until it holds something.
fn reboot(elf: &Path, unknown: &Unknown, store: Vec<u8>) -> Result<(Talk, Held), String> {
    let text = |why: CutError| why.to_string();
    let mut talk = boot(elf, unknown, Some(store)).map_err(text)?;
    let reset = talk.wait(
        1.0,
        |_, _| (),
        |tell| match tell {
            Tell::Booted { reset, .. } => Some(Ok(*reset)),
            _ => None,
        },
    );
    match reset.map_err(|why| text(why.into()))? {
        Reset::Power => {}
        reset => return Err(format!("it says that it started by {reset:?}")),
    }
    while talk.now_ns() < (OPEN_S * 1e9) as u64 {
        let found = held(&mut talk).map_err(text)?;
        // no table is in force before the store is open
        if found.textures > 0 {
            return Ok((talk, found));
        }
        talk.board().run_ms(10).map_err(|why| text(why.into()))?;
    }
    Err(format!("no table in {OPEN_S} virtual s"))
}

/// What became of the cuts of an operation.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// What was stored.
    pub name: &'static str,
    /// Words that the firmware programmed and sectors that it erased.
    pub writes: usize,
    /// See [`Outcome::writes`].
    pub erases: usize,
    /// Cuts by what was left.
    pub old: usize,
    /// See [`Outcome::old`].
    pub between: usize,
    /// See [`Outcome::old`].
    pub new: usize,
    /// Cuts in what the firmware repaired after the first cut; they are among the others.
    pub in_recovery: usize,
    /// After so many of them the probe homed and identified what lay under its finger.
    pub probed: usize,
    /// What was neither, or did not work.
    pub wrong: Vec<String>,
}

impl Outcome {
    /// All cuts.
    pub fn cuts(&self) -> usize {
        self.old + self.between + self.new + self.wrong.len()
    }

    /// For programs.
    pub fn json(&self) -> Value {
        json!({
            "stored": self.name,
            "words_programmed": self.writes - self.erases,
            "sectors_erased": self.erases,
            "cuts": self.cuts(),
            "old": self.old,
            "between": self.between,
            "new": self.new,
            "in_recovery": self.in_recovery,
            "probed": self.probed,
            "wrong": self.wrong,
        })
    }
}

/// A cut that is to be made.
struct Task {
    operation: usize,
    cut: Cut,
    probed: bool,
}

/// The cuts of all operations: every word of those that turn no page, and as many seeded ones of those that do.
fn tasks(operations: &[Operation], turned: usize, seed: u64) -> Vec<Task> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut tasks = Vec::new();
    for (number, operation) in operations.iter().enumerate() {
        let length = operation.writes.len();
        let all = operation.name != "sector change";
        let count = if all { length } else { turned };
        let erases: Vec<usize> = erases(&operation.writes).collect();
        for index in 0..count {
            let near = erases.get(index / 2 % erases.len().max(1));
            let at = match near {
                _ if all => index,
                // every other one in the erase and in what marks it
                Some(erase) if index % 2 == 0 => {
                    (erase + random.random_range(0..5)).saturating_sub(2)
                }
                _ => random.random_range(0..length),
            };
            let way = random.random_range(0..Torn::ALL.len());
            tasks.push(Task {
                operation: number,
                cut: Cut {
                    at,
                    torn: Torn::ALL[way],
                    seed: random.random(),
                },
                probed: index * PROBED / count != (index + 1) * PROBED / count,
            });
        }
    }
    tasks
}

/// How many cuts [`run`] makes.
pub fn count(prepared: &Prepared, turned: usize) -> usize {
    tasks(&prepared.operations, turned, 0).len()
}

/// Makes the cuts, as many at once as there are cores; `done` hears of each. `turned` of them are seeded ones of the sector
/// change.
///
/// # Errors
/// [`CutError::Kept`]: an operation is not kept without a cut.
pub fn run(
    elf: &Path,
    prepared: &Prepared,
    turned: usize,
    seed: u64,
    done: impl Fn() + Sync,
) -> Result<Vec<Outcome>, CutError> {
    let operations = &prepared.operations;
    for operation in operations {
        kept(elf, &prepared.unknown, operation)?;
    }
    let tasks = tasks(operations, turned, seed);
    let outcomes: Vec<Outcome> = operations
        .iter()
        .map(|operation| Outcome {
            name: operation.name,
            writes: operation.writes.len(),
            erases: erases(&operation.writes).count(),
            ..Outcome::default()
        })
        .collect();
    let outcomes = Mutex::new(outcomes);
    let next = AtomicUsize::new(0);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..cores.min(tasks.len()) {
            scope.spawn(|| {
                while let Some(task) = tasks.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let operation = &operations[task.operation];
                    let results = one(elf, &prepared.unknown, operation, task);
                    let mut outcomes = outcomes.lock().unwrap_or_else(|e| e.into_inner());
                    let outcome = &mut outcomes[task.operation];
                    outcome.in_recovery += results.len() - 1;
                    outcome.probed += usize::from(task.probed && results[0].is_ok());
                    for result in results {
                        match result {
                            Ok(Left::Old) => outcome.old += 1,
                            Ok(Left::Between) => outcome.between += 1,
                            Ok(Left::New) => outcome.new += 1,
                            Err(why) => outcome.wrong.push(format!("{:?}: {why}", task.cut)),
                        }
                    }
                    done();
                }
            });
        }
    });
    Ok(outcomes.into_inner().unwrap_or_else(|e| e.into_inner()))
}

/// Without a cut, what was held before and afterwards is held after a restart.
fn kept(elf: &Path, unknown: &Unknown, operation: &Operation) -> Result<(), CutError> {
    let ends = [
        (0, operation.states.first()),
        (usize::MAX, operation.states.last()),
    ];
    for (at, state) in ends {
        let cut = Cut {
            at,
            torn: Torn::Nothing,
            seed: 0,
        };
        let store = left_by(&operation.before, &operation.writes, cut);
        let booted = reboot(elf, unknown, store);
        let (_, found) = booted.map_err(|_| CutError::Nothing("start without a cut"))?;
        if let Some(state) = state
            && *state != found
        {
            let (state, found) = (Box::new(state.clone()), Box::new(found));
            return Err(CutError::Kept(operation.name, state, found));
        }
    }
    Ok(())
}

/// One cut, and one in the recovery from it if there is any; what was left by each.
fn one(
    elf: &Path,
    unknown: &Unknown,
    operation: &Operation,
    task: &Task,
) -> Vec<Result<Left, String>> {
    let store = left_by(&operation.before, &operation.writes, task.cut);
    let judged = |found: &Held| {
        judge(&operation.states, found).ok_or_else(|| format!("neither old nor new: {found:?}"))
    };
    let (mut talk, found) = match reboot(elf, unknown, store.clone()) {
        Ok(booted) => booted,
        Err(why) => return vec![Err(why)],
    };
    let repaired = talk.board().store_writes().unwrap_or_default();
    let mut first = judged(&found);
    if task.probed && first.is_ok() {
        let identified = talk.ready(|_, _| ()).map_err(CutError::from);
        match identified.and_then(|_| visit(&mut talk, unknown, 1, false)) {
            // what was taught last is the same texture
            Ok(found)
                if !found.unknown
                    && [unknown.name.as_str(), "taught"].contains(&found.name.as_str()) => {}
            Ok(found) => first = Err(format!("it identifies {found:?}")),
            Err(why) => first = Err(format!("it does not identify: {why}")),
        }
    }
    drop(talk);
    let mut results = vec![first];
    if !repaired.is_empty() {
        let mut random = ChaCha8Rng::seed_from_u64(task.cut.seed ^ 1);
        let cut = Cut {
            at: random.random_range(0..repaired.len()),
            ..task.cut
        };
        let again = reboot(elf, unknown, left_by(&store, &repaired, cut));
        results.push(again.and_then(|(_, found)| judged(&found)));
    }
    results
}

/// Whether the judge objects to a firmware that erases first and copies afterwards: what it must be able to see.
pub fn planted_is_seen(elf: &Path, prepared: &Prepared) -> bool {
    let unknown = &prepared.unknown;
    prepared.operations.iter().all(|operation| {
        let sector = operation.writes.iter().find_map(|write| match write {
            // the slots of tables are erased first: nothing valid is in them
            FlashWrite::Erase { sector } if *sector >= 2 => Some(*sector),
            _ => None,
        });
        let Some(sector) = sector else {
            return true;
        };
        let cut = Cut {
            at: 1,
            torn: Torn::Nothing,
            seed: 0,
        };
        let store = left_by(&operation.before, &[FlashWrite::Erase { sector }], cut);
        let booted = reboot(elf, unknown, store);
        booted.is_ok_and(|(_, found)| judge(&operation.states, &found).is_none())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held(table: u32, skin: u32) -> Held {
        Held {
            table: (table, 100),
            textures: 4,
            factory: false,
            calibration: [1; RigCalibration::BYTES],
            skin_mj: (skin, 0),
        }
    }

    const CUT: Cut = Cut {
        at: 1,
        torn: Torn::Nothing,
        seed: 3,
    };

    #[test]
    fn new_but_half_is_wrong() {
        let states = [held(1, 1), held(1, 2), held(2, 2)];
        assert_eq!(judge(&states, &held(1, 1)), Some(Left::Old));
        assert_eq!(judge(&states, &held(1, 2)), Some(Left::Between));
        assert_eq!(judge(&states, &held(2, 2)), Some(Left::New));
        // what is stored last is there, and what comes before is not
        assert_eq!(judge(&states, &held(2, 1)), None);
        let uncalibrated = Held {
            calibration: [0; RigCalibration::BYTES],
            ..held(2, 2)
        };
        assert_eq!(judge(&states, &uncalibrated), None);
        let factory = Held {
            factory: true,
            ..held(1, 1)
        };
        assert_eq!(judge(&states, &factory), None);
    }

    #[test]
    fn a_torn_word_only_loses_bits_and_a_torn_erase_only_gains_them() {
        let before = vec![0xF0; 4 * SECTOR];
        let writes = [
            FlashWrite::Program {
                at: 4,
                word: 0x1010_1010,
            },
            FlashWrite::Program {
                at: 8,
                word: 0x0000_0000,
            },
            FlashWrite::Erase { sector: 2 },
        ];
        for torn in Torn::ALL {
            let left = left_by(&before, &writes, Cut { torn, ..CUT });
            assert_eq!(left[4..8], [0x10; 4], "whole, before the cut");
            assert_eq!(left[8..12] == [0xF0; 4], torn == Torn::Nothing);
            assert!(left[8..12].iter().all(|byte| byte & !0xF0 == 0));
            assert_eq!(left[12..], before[12..]);
            let left = left_by(&before, &writes, Cut { at: 2, torn, ..CUT });
            assert_eq!(left[8..12], [0; 4]);
            let sector = &left[2 * SECTOR..3 * SECTOR];
            assert!(sector.iter().all(|byte| byte & 0xF0 == 0xF0));
            assert_eq!(sector == [0xF0; SECTOR], torn == Torn::Nothing);
            assert!(sector.contains(&0xF0), "not all of it");
        }
        let whole = left_by(&before, &writes, Cut { at: 3, ..CUT });
        assert_eq!(whole[2 * SECTOR..3 * SECTOR], [0xFF; SECTOR]);
    }

    #[test]
    fn every_word_is_cut_and_the_erase_of_a_sector_change_often() {
        let program = |at| FlashWrite::Program { at, word: 0 };
        let mut writes: Vec<FlashWrite> = (0..50).map(|n| program(4 * n)).collect();
        let operation = |name, writes: &[FlashWrite]| Operation {
            name,
            before: vec![0xFF; 4 * SECTOR],
            writes: writes.to_vec(),
            states: vec![held(1, 1), held(2, 2)],
        };
        let teach = operation("teach", &writes);
        writes.insert(30, FlashWrite::Erase { sector: 2 });
        let turned = operation("sector change", &writes);
        let tasks = tasks(&[teach, turned], 100, 1);
        let of = |number| tasks.iter().filter(move |task| task.operation == number);
        let words: Vec<usize> = of(0).map(|task| task.cut.at).collect();
        assert_eq!(words, (0..50).collect::<Vec<_>>());
        assert_eq!(of(1).count(), 100);
        assert!(of(1).all(|task| task.cut.at < 51));
        assert!(of(1).filter(|task| task.cut.at == 30).count() >= 5);
        assert_eq!(of(1).filter(|task| task.probed).count(), PROBED);
    }
}
