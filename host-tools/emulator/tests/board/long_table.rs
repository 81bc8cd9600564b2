//! A table that does not fit into the 16 KB sectors: read in place from a larger one, added to, and given up when it is
//! damaged for the one before it, whatever sector that is in.

use std::path::Path;

use tactus_core::explorer::Method;
use tactus_core::features::Movement;
use tactus_core::table::{Change, Name, Table, amend};
use tactus_core::wire::{Command, Forget, Identify, PART, Train};
use tactus_emulator::board::FlashWrite;
use tactus_emulator::host::talk::{TIMEOUT_S, Talk};
use tactus_emulator::host::under_finger::{self, FirmwareData, Unknown};
use tactus_lab::sim::collection::{Collection, calibrated};
use tactus_link::{PushTable, ReadTable, Request};

use crate::changed_cuts::reboot;
use crate::common::{boot, elf};
use crate::power_cut::{Cut, Torn, left_by};

/// The texture under the finger, which the tables have.
const TEXTURE: u8 = 47;
/// Bytes of the longest table in a sector of 16 KB, and in the larger ones.
const SHORT: usize = (16 << 10) - 32;
const LONG: usize = (64 << 10) - 32;
/// Longest exploration or training, virtual seconds.
const LONG_S: f64 = 300.0;

fn world() -> Collection {
    Collection::new(3, Collection::spread(TEXTURE, 4), 5)
}

fn under_finger() -> Unknown {
    under_finger::mounted(&world(), TEXTURE, 9)
}

/// Tables of 24 movements, and of the usual three.
fn tables() -> (FirmwareData, Vec<u8>) {
    let short = under_finger::simulated(&world(), Method::Fused, &[], || ()).unwrap();
    let movements: Vec<Movement> = Movement::grid().take(24).collect();
    let calibration = calibrated(world().setup(world().textures[0], 0)).unwrap();
    let fused = (Method::Fused, None);
    let long = world().learn_at(&movements, fused, &[], calibration, || ());
    let long = long.unwrap();
    assert!(short.table.len() <= SHORT && long.len() > SHORT && long.len() < LONG);
    (short, long)
}

fn table(talk: &mut Talk) -> Vec<u8> {
    talk.run(ReadTable::default(), TIMEOUT_S, |_, _| ())
        .unwrap()
}

/// Does something, and gives the sectors of tables that were erased for it.
fn erased(talk: &mut Talk, what: impl FnOnce(&mut Talk)) -> Vec<usize> {
    talk.board().store_writes().unwrap();
    what(talk);
    let writes = talk.board().store_writes().unwrap();
    let erases = writes.iter().filter_map(|write| match write {
        FlashWrite::Erase { sector } if !matches!(sector, 2 | 3) => Some(*sector),
        _ => None,
    });
    erases.collect()
}

fn push(talk: &mut Talk, table: &[u8]) {
    talk.run(PushTable::new(table).unwrap(), TIMEOUT_S, |_, _| ())
        .unwrap();
}

fn name(name: &str) -> Name {
    Name::try_from(name).unwrap()
}

/// Boots on what a board has stored.
fn again(elf: &Path, mut talk: Talk) -> Talk {
    let store = talk.board().store().unwrap();
    drop(talk);
    boot(elf, &under_finger(), Some(store))
}

fn identify(seed: u32, learn: bool) -> Identify {
    Identify {
        seed,
        learn,
        ..Identify::default()
    }
}

#[test]
#[ignore = "long"]
fn a_long_table_is_used_and_learned_on() {
    let Some(elf) = elf() else { return };
    let (short, long) = tables();
    let unknown = under_finger();
    let mut talk = boot(&elf, &unknown, None);
    talk.teach(&short.calibration, &short.table, |_, _| ())
        .unwrap();
    assert_eq!(erased(&mut talk, |talk| push(talk, &long)), [4]);
    assert_eq!(table(&mut talk), long);
    let mut talk = again(&elf, talk);
    assert_eq!(table(&mut talk), long);
    // it is told what lies under the finger, learns of it by itself, and keeps that
    let found = talk.run(Request::identify(identify(5, true)), LONG_S, |_, _| ());
    let verdict = found.unwrap().verdict;
    assert!(
        verdict.sure && verdict.name.as_str() == unknown.name,
        "{verdict:?}"
    );
    let learned = table(&mut talk);
    assert_ne!(learned, long);
    let mut talk = again(&elf, talk);
    assert_eq!(table(&mut talk), learned);
    talk.run(Request::forget(Forget::SelfLearned), TIMEOUT_S, |_, _| ())
        .unwrap();
    assert_eq!(table(&mut talk), long);
    // from a label, by training, and another name; each writes the table into the other large sector
    talk.run(Request::identify(identify(6, false)), LONG_S, |_, _| ())
        .unwrap();
    let label = |talk: &mut Talk| {
        talk.run(Request::label(name("my own")), TIMEOUT_S, |_, _| ())
            .unwrap();
    };
    assert_eq!(erased(&mut talk, label), [5]);
    let rename = |talk: &mut Talk| {
        let rename = Request::rename(name("my own"), name("mine"));
        talk.run(rename, TIMEOUT_S, |_, _| ()).unwrap();
    };
    assert_eq!(erased(&mut talk, rename), [4]);
    let train = |talk: &mut Talk| {
        let train = Train {
            name: name("mine"),
            trials: 2,
            pilot: false,
            seed: 2,
        };
        talk.run(Request::train(train), 4.0 * LONG_S, |_, _| ())
            .unwrap();
    };
    assert_eq!(erased(&mut talk, train), [5]);
    let taught = table(&mut talk);
    let mut talk = again(&elf, talk);
    assert_eq!(table(&mut talk), taught);
    let read = Table::read(&taught).unwrap();
    assert_eq!((read.textures(), read.movements().len()), (5, 24));
    let mine = read.find("mine").unwrap();
    assert!((0..24).all(|movement| read.trials(mine, movement) >= 2));
    // what fits into the small sectors goes there again, and the firmware's own table gives all up
    let back = |talk: &mut Talk| push(talk, &short.table);
    assert_eq!(erased(&mut talk, back), [1]);
    let mut talk = again(&elf, talk);
    assert_eq!(table(&mut talk), short.table);
    talk.send(Command::FactoryTable, TIMEOUT_S, |_, _| ())
        .unwrap();
    let mut talk = again(&elf, talk);
    let status = talk.run(Request::status(), TIMEOUT_S, |_, _| ()).unwrap();
    assert!(status.factory);
}

/// The erase of each of the larger sectors, and the words behind it: one table or the other is in force, nothing is
/// complained about, and the push can be made again.
#[test]
#[ignore = "long"]
fn a_push_of_a_long_table_is_cut() {
    let Some(elf) = elf() else { return };
    let (short, first) = tables();
    let mut second = vec![0; LONG];
    let read = Table::read(&first).unwrap();
    let rename = Change::Rename {
        texture: 0,
        name: "another name",
    };
    let second = amend(&mut second, &read, rename).unwrap().as_bytes();
    let mut talk = boot(&elf, &under_finger(), None);
    talk.teach(&short.calibration, &short.table, |_, _| ())
        .unwrap();
    // into sector 4 and 5, and over what is in 4
    let pushed = [&short.table[..], &first, second, &first];
    for tables in pushed.windows(2) {
        let [old, new] = tables else { return };
        talk.board().store_writes().unwrap();
        let before = talk.board().store().unwrap();
        push(&mut talk, new);
        let writes = talk.board().store_writes().unwrap();
        let last = writes.len() - 1;
        assert!(matches!(writes[0], FlashWrite::Erase { sector: 4 | 5 }));
        let cuts = [0, 1, last / 2, last - 1, last, last + 1];
        for (n, at) in cuts.into_iter().enumerate() {
            for (torn, seed) in Torn::ALL.into_iter().zip(n as u64..) {
                // what is torn of a word is known from the other tests
                if ![0, last].contains(&at) && torn != Torn::Bits {
                    continue;
                }
                let cut = Cut { at, torn, seed };
                let store = left_by(&before, &writes, cut);
                let (mut talk, found) = reboot(&elf, &under_finger(), store);
                assert!(found == *new || found == *old && at <= last, "{cut:?}");
                if torn == Torn::Bits {
                    push(&mut talk, new);
                    assert!(table(&mut talk) == *new, "{cut:?}");
                }
            }
        }
    }
}

/// The watchdog waits for 2 s, and the longest erase of the 128 KB takes as long: the tasks go on meanwhile, and the
/// probe says what it is doing.
#[test]
#[ignore = "long"]
fn no_erase_costs_the_watchdogs_patience() {
    let Some(elf) = elf() else { return };
    let (_, long) = tables();
    let mut talk = boot(&elf, &under_finger(), None);
    talk.board().slow_erases().unwrap();
    for sector in [4, 5] {
        let from_ns = talk.now_ns();
        // the first bytes say that a table comes: only then is anything erased
        let first = Command::WriteTable {
            offset: 0,
            bytes: long[..PART].iter().copied().collect(),
        };
        for command in [Command::BeginTable(long.len() as u32), first] {
            talk.send(command, TIMEOUT_S, |_, _| ()).unwrap();
        }
        let took_ms = (talk.now_ns() - from_ns) / 1_000_000;
        let wanted_ms = if sector == 4 { 1200 } else { 2000 };
        assert!((wanted_ms..wanted_ms + 300).contains(&took_ms), "{took_ms}");
        assert_eq!(erased(&mut talk, |talk| push(talk, &long)), [sector]);
        assert!(table(&mut talk) == long);
    }
    assert_eq!(talk.board().resets().unwrap(), []);
}
