//! The power is cut while the real firmware stores something: what it makes of the flash that is left.
//!
//! The firmware stores once without a cut, and every word that it programs and every sector that it erases is noted.
//! For a cut, the flash is made as it is after a part of them, with the last one torn, and the firmware boots on it: it
//! must hold the state from before or the one from after, and say so before it has found its switches.

use std::path::Path;

use clap::Args as Arguments;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use tactus_core::explorer::Method;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::table::Name;
use tactus_core::wire::{Event, Identify, Reset, Verdict};
use tactus_lab::sim::collection::Collection;
use tactus_link::{ReadTable, Request};
use tactus_world::world::{Setup, World};

use super::error::RunError;
use crate::board::{self, FlashWrite, Options};
use crate::host::args::Firmware;
use crate::host::exploration::{Exploration, ExploreError, explore};
use crate::host::power_cut::{Cut, Torn, left_by};
use crate::host::progress;
use crate::host::talk::{TIMEOUT_S, Talk, TalkError};
use crate::host::under_finger::{self, FirmwareData, UnderFingerError, Unknown};

/// Cuts the power at every word that the firmware programs when a texture is labelled and when the probe learns by
/// itself, and at seeded moments of an update that turns a page of its settings.
///
/// It boots on what is left of the flash, in which the last word or erase is torn, and must hold the old or the new;
/// where it repairs the flash first, the power is cut in that too. The exit code is 1 if a cut loses anything.
#[derive(Arguments)]
pub(crate) struct Args {
    #[command(flatten)]
    firmware: Firmware,
    /// Cuts of the update that turns a page
    #[arg(long, value_name = "N", default_value_t = 100)]
    cuts: usize,
    /// Another seed is another world and other cuts
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// The texture under the finger, which the table has.
const TEXTURE: u8 = 47;
/// Textures of the table: few, so that every word of it can be cut.
const AMONG: u8 = 4;
/// The probe learns only from episodes that it is certain of: at least one in so many.
const EPISODES: u64 = 8;
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
pub(crate) enum CutError {
    #[error(transparent)]
    Talk(#[from] TalkError),
    #[error(transparent)]
    Explore(#[from] ExploreError),
    #[error(transparent)]
    Known(#[from] UnderFingerError),
    #[error("the firmware did not {0}: nothing to cut")]
    Nothing(&'static str),
    #[error("{0}: the noted writes do not give the flash that the firmware left")]
    Noted(&'static str),
    #[error("{0}: without a cut the firmware does not keep what it held: {1:?}, {2:?}")]
    Kept(&'static str, Box<Held>, Box<Held>),
    #[error("it says that it started by {0:?}")]
    Started(Reset),
    #[error("no table in {0} virtual s")]
    NoTable(f64),
    #[error("neither old nor new: {0:?}")]
    Neither(Box<Held>),
    #[error("it identifies {0:?}")]
    Identifies(Box<Verdict>),
}

impl From<board::Error> for CutError {
    fn from(why: board::Error) -> Self {
        Self::Talk(why.into())
    }
}

/// What the firmware holds, by its own account.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Held {
    /// Checksum and bytes of the table in force, with what the probe has learned by itself.
    table: (u32, u32),
    /// Its textures.
    textures: u16,
    /// It came with the firmware.
    factory: bool,
    /// Constants of the rig.
    calibration: Vec<u8>,
    /// Work that the skin has seen, mJ, and that part of it that wears.
    skin_mj: (u32, u32),
}

/// What is left by a cut.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Left {
    /// The state from before.
    Old,
    /// One of several records is stored.
    Between,
    /// The state from after.
    New,
}

/// Which of the states, the oldest first, was found; `None` is neither.
fn judge(states: &[Held], found: &Held) -> Option<Left> {
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
struct Operation {
    /// What it is.
    name: &'static str,
    /// The store before it.
    before: Vec<u8>,
    /// What the firmware does to it.
    writes: Vec<FlashWrite>,
    /// What may be held after a cut, the oldest first.
    states: Vec<Held>,
}

/// What is cut, and in what world.
#[derive(Clone, Debug)]
struct Prepared {
    /// A label from the user and an update by the probe itself, to be cut at every word, and an update that turns a
    /// page.
    operations: Vec<Operation>,
    unknown: Unknown,
}

/// Has the firmware store all that is to be cut, each once and whole; `each` hears what it does.
fn prepare(
    elf: &Path,
    seed: u64,
    mut each: impl FnMut(&'static str),
) -> Result<Prepared, CutError> {
    each("learning a table");
    let collection = Collection {
        seed,
        textures: Collection::spread(TEXTURE, AMONG),
        trials: under_finger::TRIALS,
    };
    let known = under_finger::simulated(&collection, Method::Fused, || ())?;
    let unknown = under_finger::mounted(&collection, TEXTURE, 1 + seed);
    each("a board finds its switches");
    let mut talk = boot(elf, &unknown, None)?;
    talk.ready(|_, _| ())?;
    let FirmwareData { calibration, table } = &known;
    talk.teach(calibration, table, |_, _| ())?;
    each("it learns by itself");
    let update = noted_update("update", &mut talk, &unknown, |_| true)?;
    each("a texture is trained");
    run_episode(&mut talk, &unknown, 1, false)?;
    let name = Name::try_from("trained").unwrap_or_default();
    let (before, held) = begin(&mut talk)?;
    talk.run(Request::label(name), TIMEOUT_S, |_, _| ())?;
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

/// The same with the finger as high as it may be when the power comes: it was lifted when it was cut, and every boot
/// lifts it first.
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

fn run_episode(
    talk: &mut Talk,
    unknown: &Unknown,
    seed: u32,
    learn: bool,
) -> Result<Exploration, CutError> {
    let table = talk.run(ReadTable::default(), TIMEOUT_S, |_, _| ())?;
    let identify = Identify {
        learn,
        seed,
        ..Identify::default()
    };
    Ok(explore(talk, &table, identify, &unknown.name, |_, _| ())?)
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

/// Explores until the probe learns by itself with writes that are `wanted`.
fn noted_update(
    name: &'static str,
    talk: &mut Talk,
    unknown: &Unknown,
    wanted: impl Fn(&[FlashWrite]) -> bool,
) -> Result<Operation, CutError> {
    for seed in 1..=EPISODES {
        let (before, held_before) = begin(talk)?;
        let explored = run_episode(talk, unknown, seed as u32, true)?;
        // first the skin is kept, then what was learned
        let update = noted(name, talk, before, held_before, |before, after| {
            let between = Held {
                skin_mj: after.skin_mj,
                ..before.clone()
            };
            vec![before, between, after]
        })?;
        if explored.learned > 0 && wanted(&update.writes) {
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
        let write = Request::write_calibration(&next).map_err(TalkError::from)?;
        talk.run(write, TIMEOUT_S, |_, _| ())?;
        if erases(&talk.board().store_writes()?).next().is_some() {
            return Ok(before);
        }
    }
    Err(CutError::Nothing("turn a page"))
}

/// What the firmware holds now.
fn held(talk: &mut Talk) -> Result<Held, CutError> {
    let status = talk.run(Request::status(), TIMEOUT_S, |_, _| ())?;
    let calibration = talk.run(Request::read_calibration(), TIMEOUT_S, |_, _| ())?;
    Ok(Held {
        table: (status.table_crc, status.table_bytes),
        textures: status.textures,
        factory: status.factory,
        calibration: calibration.to_bytes().to_vec(),
        skin_mj: status.skin_mj,
    })
}

/// Boots the firmware on a flash until it holds something.
fn reboot(elf: &Path, unknown: &Unknown, store: Vec<u8>) -> Result<(Talk, Held), CutError> {
    let mut talk = boot(elf, unknown, Some(store))?;
    let booted = |event: &Event| match event {
        Event::Booted { reset, .. } => Some(Ok(*reset)),
        _ => None,
    };
    match talk.wait(1.0, |_, _| (), booted)? {
        Reset::Power => {}
        reset => return Err(CutError::Started(reset)),
    }
    while talk.now_ns() < (OPEN_S * 1e9) as u64 {
        let found = held(&mut talk)?;
        // no table is in force before the store is open
        if found.textures > 0 {
            return Ok((talk, found));
        }
        talk.board().run_ms(10)?;
    }
    Err(CutError::NoTable(OPEN_S))
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

/// Prepares and makes the cuts; true if none loses anything.
pub(crate) fn run(args: &Args) -> Result<bool, RunError> {
    let elf = &args.firmware.elf;
    args.firmware.show(false)?;
    let bar = progress::spinner("");
    let prepared = prepare(elf, args.seed, |what| bar.set_message(what))?;
    bar.finish_and_clear();
    let Prepared {
        operations,
        unknown,
    } = &prepared;
    for operation in operations {
        kept(elf, unknown, operation)?;
    }
    let tasks = tasks(operations, args.cuts, args.seed);
    let bar = progress::bar("cutting", tasks.len() as u64, ", {eta} left");
    let made = tasks.into_par_iter().map(|task| {
        let results = one(elf, unknown, &operations[task.operation], &task);
        bar.inc(1);
        (task, results)
    });
    let made: Vec<_> = made.collect();
    bar.finish_and_clear();
    let (mut all, mut lost) = (0, 0);
    for (number, operation) in operations.iter().enumerate() {
        let of = made.iter().filter(|(task, _)| task.operation == number);
        let results: Vec<_> = of
            .flat_map(|(task, results)| results.iter().map(|result| (task.cut, result)))
            .collect();
        let count = |left| {
            results
                .iter()
                .filter(|(_, r)| r.as_ref().ok() == Some(&left))
                .count()
        };
        println!(
            "  {}, {} writes: {} cuts left {} old, {} between, {} new",
            operation.name,
            operation.writes.len(),
            results.len(),
            count(Left::Old),
            count(Left::Between),
            count(Left::New)
        );
        for (cut, why) in results
            .iter()
            .filter_map(|(cut, r)| Some((cut, r.as_ref().err()?)))
        {
            println!("  WRONG: {cut:?}: {why}");
            lost += 1;
        }
        all += results.len();
    }
    let planted = planted_is_seen(elf, &prepared);
    if !planted {
        println!("  WRONG: a flash that was erased before it was copied is taken for a good one");
    }
    println!("{all} cuts, {lost} of them lost something");
    Ok(lost == 0 && planted)
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
        let (_, found) = reboot(elf, unknown, store)?;
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
) -> Vec<Result<Left, CutError>> {
    let store = left_by(&operation.before, &operation.writes, task.cut);
    let judged = |found: Held| {
        judge(&operation.states, &found).ok_or_else(|| CutError::Neither(Box::new(found)))
    };
    let (mut talk, found) = match reboot(elf, unknown, store.clone()) {
        Ok(booted) => booted,
        Err(why) => return vec![Err(why)],
    };
    let repaired = talk.board().store_writes().unwrap_or_default();
    let mut first = judged(found);
    if task.probed && first.is_ok() {
        first = first.and_then(|left| identifies(&mut talk, unknown).map(|()| left));
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
        results.push(again.and_then(|(_, found)| judged(found)));
    }
    results
}

/// It homes, and finds out what lies under its finger.
fn identifies(talk: &mut Talk, unknown: &Unknown) -> Result<(), CutError> {
    talk.ready(|_, _| ())?;
    let found = run_episode(talk, unknown, 1, false)?.found;
    // what was trained last is the same texture
    let names = [unknown.name.as_str(), "trained"];
    if found.unknown || !names.contains(&found.name.as_str()) {
        return Err(CutError::Identifies(Box::new(found)));
    }
    Ok(())
}

/// Whether the judge objects to a firmware that erases first and copies afterwards: what it must be able to see.
fn planted_is_seen(elf: &Path, prepared: &Prepared) -> bool {
    let unknown = &prepared.unknown;
    prepared.operations.iter().all(|operation| {
        let sector = operation.writes.iter().find_map(|write| match write {
            // the slots of tables are erased first: nothing valid is in them
            FlashWrite::Erase { sector } if matches!(sector, 2 | 3) => Some(*sector),
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
            calibration: vec![1],
            skin_mj: (skin, 0),
        }
    }

    #[test]
    fn new_but_half_is_wrong() {
        let states = [held(1, 1), held(1, 2), held(2, 2)];
        assert_eq!(judge(&states, &held(1, 1)), Some(Left::Old));
        assert_eq!(judge(&states, &held(1, 2)), Some(Left::Between));
        assert_eq!(judge(&states, &held(2, 2)), Some(Left::New));
        // what is stored last is there, and what comes before is not
        assert_eq!(judge(&states, &held(2, 1)), None);
        let uncalibrated = Held {
            calibration: vec![0],
            ..held(2, 2)
        };
        assert_eq!(judge(&states, &uncalibrated), None);
        let factory = Held {
            factory: true,
            ..held(1, 1)
        };
        assert_eq!(judge(&states, &factory), None);
    }
}
