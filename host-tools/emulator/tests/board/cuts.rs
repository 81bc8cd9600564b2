//! The power is cut while the real firmware stores something: what it makes of the flash that is left.
//!
//! The firmware stores once without a cut, and every word that it programs and every sector that it erases is noted.
//! For a cut, the flash is made as it is after a part of them, with the last one torn, and the firmware boots on it: it
//! must hold the state from before or the one from after, and say so before it has found its switches. Where it repairs
//! the flash first, the power is cut in that too.

use std::path::Path;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use tactus_core::explorer::Method;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::table::Name;
use tactus_core::wire::{Event, Identify, Reset};
use tactus_emulator::board::{FlashWrite, Options};
use tactus_emulator::host::exploration::{Exploration, explore};
use tactus_emulator::host::talk::{TIMEOUT_S, Talk};
use tactus_emulator::host::under_finger::{self, FirmwareData, Unknown};
use tactus_lab::sim::collection::Collection;
use tactus_link::{ReadTable, Request};
use tactus_world::world::{Setup, World};

use crate::common::{elf, ready};
use crate::power_cut::{Cut, Torn, left_by};

/// Another seed is another world and other cuts.
const SEED: u64 = 1;
/// Cuts of the update that turns a page; all others are cut at every word.
const TURNED: usize = 100;
/// The texture under the finger, which the table has, and textures of the table: few, so that every word of it can be
/// cut.
const TEXTURE: u8 = 47;
const AMONG: u8 = 4;
/// The probe learns only from episodes that it is certain of: at least one in so many.
const EPISODES: u32 = 8;
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

/// The firmware's contents, by its own account.
#[derive(Clone, PartialEq, Debug)]
struct Held {
    /// Checksum and bytes of the table in force, with what the probe has learned by itself.
    table: (u32, u32),
    textures: u16,
    /// It came with the firmware.
    factory: bool,
    calibration: Vec<u8>,
    /// Work that the skin has seen, mJ, and that part of it that wears.
    skin_mj: (u32, u32),
}

/// The state after a cut: that from before, one of several records, or that from after.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Left {
    Old,
    Between,
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
struct Operation {
    name: &'static str,
    /// The store before it, and what the firmware does to it.
    before: Vec<u8>,
    writes: Vec<FlashWrite>,
    /// States that are right after a cut, the oldest first.
    states: Vec<Held>,
    /// Cuts: every word, unless it turns a page.
    cuts: usize,
}

fn erases(writes: &[FlashWrite]) -> impl Iterator<Item = usize> {
    let erase =
        |(at, write): (usize, &FlashWrite)| matches!(write, FlashWrite::Erase { .. }).then_some(at);
    writes.iter().enumerate().filter_map(erase)
}

fn whole(at: usize) -> Cut {
    let torn = Torn::Nothing;
    Cut { at, torn, seed: 0 }
}

/// The boards of a run.
struct Bench<'e> {
    elf: &'e Path,
    unknown: Unknown,
}

impl Bench<'_> {
    fn boot(&self, store: Option<Vec<u8>>) -> Talk {
        let options = Options {
            store,
            ..Options::default()
        };
        Talk::new(self.unknown.start(self.elf, options).unwrap()).look_every(LOOK_MS)
    }

    fn episode(&self, talk: &mut Talk, seed: u32, learn: bool) -> Exploration {
        let table = talk.run(ReadTable::default(), TIMEOUT_S, |_, _| ());
        let identify = Identify {
            learn,
            seed,
            ..Identify::default()
        };
        let name = &self.unknown.name;
        explore(talk, &table.unwrap(), identify, name, |_, _| ()).unwrap()
    }

    /// Has the firmware store all that is to be cut, each once and whole: a label from the user and an update by the
    /// probe itself, and an update that turns a page.
    fn prepare(&self, known: &FirmwareData) -> Vec<Operation> {
        let mut talk = self.boot(None);
        ready(&mut talk);
        talk.teach(&known.calibration, &known.table, |_, _| ())
            .unwrap();
        let update = self.update("update", &mut talk, |_| true);
        self.episode(&mut talk, 1, false);
        let (before, held) = begin(&mut talk);
        let label = Request::label(Name::try_from("trained").unwrap());
        talk.run(label, TIMEOUT_S, |_, _| ()).unwrap();
        let teach = noted("teach", &mut talk, before, |after| vec![held, after]);
        let full = fill(&mut talk, &known.calibration);
        drop(talk);
        let mut talk = self.boot(Some(full));
        ready(&mut talk);
        let turned = self.update("sector change", &mut talk, |writes| {
            erases(writes).next().is_some()
        });
        let cuts = TURNED;
        vec![teach, update, Operation { cuts, ..turned }]
    }

    /// Explores until the probe learns by itself with writes that are `wanted`.
    fn update(
        &self,
        name: &'static str,
        talk: &mut Talk,
        wanted: impl Fn(&[FlashWrite]) -> bool,
    ) -> Operation {
        let mut updates = (1..=EPISODES).filter_map(|seed| {
            let (before, held) = begin(talk);
            let explored = self.episode(talk, seed, true);
            // first the skin is kept, then what was learned
            let update = noted(name, talk, before, |after| {
                let between = Held {
                    skin_mj: after.skin_mj,
                    ..held.clone()
                };
                vec![held, between, after]
            });
            (explored.learned > 0 && wanted(&update.writes)).then_some(update)
        });
        updates.next().expect("the probe learns by itself")
    }

    /// Boots the firmware on a flash until it holds something; why it does not.
    fn reboot(&self, store: Vec<u8>) -> Result<(Talk, Held), String> {
        let mut talk = self.boot(Some(store));
        let booted = |event: &Event| match event {
            Event::Booted { reset, .. } => Some(Ok(*reset)),
            _ => None,
        };
        match talk.wait(1.0, |_, _| (), booted) {
            Ok(Reset::Power) => {}
            other => return Err(format!("it starts by {other:?}")),
        }
        while talk.now_ns() < (OPEN_S * 1e9) as u64 {
            let found = held(&mut talk);
            // no table is in force before the store is open
            if found.textures > 0 {
                return Ok((talk, found));
            }
            talk.board().run_ms(10).unwrap();
        }
        Err(format!("no table in {OPEN_S} virtual s"))
    }

    /// One cut, and one in the recovery from it if there is any; what was left by each.
    fn cut(&self, operation: &Operation, cut: Cut, probed: bool) -> Vec<Result<Left, String>> {
        let store = left_by(&operation.before, &operation.writes, cut);
        let judged = |found: Held| {
            judge(&operation.states, &found)
                .ok_or_else(|| format!("neither old nor new: {found:?}"))
        };
        let (mut talk, found) = match self.reboot(store.clone()) {
            Ok(booted) => booted,
            Err(why) => return vec![Err(why)],
        };
        let repaired = talk.board().store_writes().unwrap();
        let mut results = vec![judged(found)];
        if probed {
            ready(&mut talk);
            let found = self.episode(&mut talk, 1, false).found;
            // what was trained last is the same texture
            let is_it = [self.unknown.name.as_str(), "trained"].contains(&found.name.as_str());
            if found.unknown || !is_it {
                results.push(Err(format!("it identifies {found:?}")));
            }
        }
        drop(talk);
        if !repaired.is_empty() {
            let mut random = ChaCha8Rng::seed_from_u64(cut.seed ^ 1);
            let at = random.random_range(0..repaired.len());
            let again = self.reboot(left_by(&store, &repaired, Cut { at, ..cut }));
            results.push(again.and_then(|(_, found)| judged(found)));
        }
        results
    }
}

/// The store and what is held, before something is stored.
fn begin(talk: &mut Talk) -> (Vec<u8>, Held) {
    talk.board().store_writes().unwrap();
    (talk.board().store().unwrap(), held(talk))
}

/// The records stored since.
fn noted(
    name: &'static str,
    talk: &mut Talk,
    before: Vec<u8>,
    states: impl FnOnce(Held) -> Vec<Held>,
) -> Operation {
    let writes = talk.board().store_writes().unwrap();
    let noted = left_by(&before, &writes, whole(writes.len()));
    assert!(noted == talk.board().store().unwrap(), "{name}");
    Operation {
        name,
        before,
        cuts: writes.len(),
        writes,
        states: states(held(talk)),
    }
}

/// Stores calibrations until a page turns; the store from before the one that turned it.
fn fill(talk: &mut Talk, calibration: &RigCalibration) -> Vec<u8> {
    for number in 1..=CALIBRATIONS {
        let before = talk.board().store().unwrap();
        talk.board().store_writes().unwrap();
        // nothing that the rig goes by
        let mut next = *calibration;
        for (byte, digit) in next.serial.iter_mut().zip(format!("{number:016}").bytes()) {
            *byte = digit;
        }
        let write = Request::write_calibration(&next).unwrap();
        talk.run(write, TIMEOUT_S, |_, _| ()).unwrap();
        if erases(&talk.board().store_writes().unwrap())
            .next()
            .is_some()
        {
            return before;
        }
    }
    panic!("no page is turned");
}

fn held(talk: &mut Talk) -> Held {
    let status = talk.run(Request::status(), TIMEOUT_S, |_, _| ()).unwrap();
    let calibration = talk.run(Request::read_calibration(), TIMEOUT_S, |_, _| ());
    Held {
        table: (status.table_crc, status.table_bytes),
        textures: status.textures,
        factory: status.factory,
        calibration: calibration.unwrap().to_bytes().to_vec(),
        skin_mj: status.skin_mj,
    }
}

/// The cuts of an operation, and whether the probe works afterwards, too: every word, or as many seeded ones.
fn cuts(operation: &Operation, random: &mut ChaCha8Rng) -> Vec<(Cut, bool)> {
    let (count, length) = (operation.cuts, operation.writes.len());
    let erases: Vec<usize> = erases(&operation.writes).collect();
    let cuts = (0..count).map(|index| {
        let at = match erases.get(index / 2 % erases.len().max(1)) {
            _ if count == length => index,
            // every other one in the erase and in what marks it
            Some(erase) if index % 2 == 0 => (erase + random.random_range(0..5)).saturating_sub(2),
            _ => random.random_range(0..length),
        };
        let torn = Torn::ALL[random.random_range(0..Torn::ALL.len())];
        let seed = random.random();
        let probed = index * PROBED / count != (index + 1) * PROBED / count;
        (Cut { at, torn, seed }, probed)
    });
    cuts.collect()
}

/// The same with the finger as high as it may be when the power comes: it was lifted when it was cut, and every boot
/// lifts it first.
fn lifted(unknown: Unknown) -> Unknown {
    let setups = (0..TRIALS).map(|trial_seed| Setup {
        trial_seed,
        ..unknown.setup
    });
    let height = |setup: &Setup| World::new(*setup).truth().tip_mm;
    let setup = setups.max_by(|a, b| height(a).total_cmp(&height(b)));
    let setup = setup.unwrap();
    Unknown { setup, ..unknown }
}

#[test]
#[ignore = "long"]
fn no_cut_loses_anything() {
    let Some(elf) = &elf() else { return };
    let collection = Collection::new(
        SEED,
        Collection::spread(TEXTURE, AMONG),
        under_finger::TRIALS,
    );
    let known = under_finger::simulated(&collection, Method::Fused, &[], || ()).unwrap();
    let unknown = under_finger::mounted(&collection, TEXTURE, 1 + SEED);
    let mut bench = Bench { elf, unknown };
    let operations = bench.prepare(&known);
    bench.unknown = lifted(bench.unknown);
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    for operation in &operations {
        let Operation {
            name,
            before,
            writes,
            states,
            ..
        } = operation;
        // without a cut, what was held before and afterwards is held after a restart
        for (at, state) in [(0, &states[0]), (usize::MAX, &states[states.len() - 1])] {
            let (_, found) = bench.reboot(left_by(before, writes, whole(at))).unwrap();
            assert_eq!(*state, found, "{name}");
        }
        let cut = cuts(operation, &mut random).into_par_iter();
        let cut = cut.flat_map_iter(|(cut, probed)| {
            let results = bench.cut(operation, cut, probed).into_iter();
            results.map(move |result| result.map_err(|why| format!("{cut:?}: {why}")))
        });
        let left: Vec<Result<Left, String>> = cut.collect();
        let lost: Vec<_> = left.iter().filter_map(|left| left.as_ref().err()).collect();
        assert!(lost.is_empty(), "{name}: {lost:#?}");
        let count = |wanted| left.iter().filter(|left| **left == Ok(wanted)).count();
        eprintln!(
            "{name}, {} writes: {} cuts left {} old, {} between, {} new",
            writes.len(),
            left.len(),
            count(Left::Old),
            count(Left::Between),
            count(Left::New)
        );
        // a firmware that erases a page of settings before it copied it must be seen; the slots of tables are erased
        // first, as nothing valid is in them
        let sector = writes.iter().find_map(|write| match write {
            FlashWrite::Erase {
                sector: page @ 2..=3,
            } => Some(*page),
            _ => None,
        });
        if let Some(sector) = sector {
            let planted = left_by(before, &[FlashWrite::Erase { sector }], whole(1));
            let (_, found) = bench.reboot(planted).unwrap();
            assert_eq!(judge(states, &found), None, "{name}: a planted loss");
        }
    }
}

#[test]
fn new_but_half_is_wrong() {
    let held = |table: u32, skin: u32| Held {
        table: (table, 100),
        textures: 4,
        factory: false,
        calibration: vec![1],
        skin_mj: (skin, 0),
    };
    let states = [held(1, 1), held(1, 2), held(2, 2)];
    assert_eq!(judge(&states, &held(1, 1)), Some(Left::Old));
    assert_eq!(judge(&states, &held(1, 2)), Some(Left::Between));
    assert_eq!(judge(&states, &held(2, 2)), Some(Left::New));
    // what is stored last is there, and what comes before is not
    assert_eq!(judge(&states, &held(2, 1)), None);
    let factory = Held {
        factory: true,
        ..held(1, 1)
    };
    assert_eq!(judge(&states, &factory), None);
}
