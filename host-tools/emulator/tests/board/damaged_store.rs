//! Stores that are damaged. Each begins as the golden store of `tests/core/formats.rs`: a table of the factory, a newer
//! one, and a record of each kind.

use std::ops::RangeInclusive;
use std::path::Path;

use embassy_futures::block_on;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::probe::teach::put_in_force;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::store::Store;
use tactus_core::table::{Change, Table, TableError, amend};
use tactus_core::wire::{Event, Failure, MemoryError, Status};
use tactus_emulator::board::Options;
use tactus_emulator::host::talk::{TIMEOUT_S, Talk};
use tactus_emulator::host::under_finger::mounted;
use tactus_lab::sim::collection::Collection;
use tactus_lab::sim::flash::{RamFlash, SECTOR};
use tactus_link::{PushTable, ReadTable, Request};

use crate::broken_code::{Instead, break_code};
use crate::common::{crc32, elf, unpacked};

fn store() -> Vec<u8> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    unpacked(&here.join("../../tests/golden/store.bin.gz"))
}

/// The contents of the golden store.
struct Held {
    /// Where the newest table begins.
    newest_at: usize,
    /// That table with what the probe learned by itself.
    in_force: Vec<u8>,
    calibration: RigCalibration,
}

fn held() -> Held {
    block_on(async {
        let mut store = Store::open(RamFlash::<SECTOR>::of(store())).await.unwrap();
        let newest_at = store.table().unwrap().offset as usize;
        let calibration = store.calibration().await.unwrap().unwrap();
        let (mut buffer, mut in_force) = (vec![0; SECTOR], vec![0; SECTOR]);
        let table = store.read_table(&mut buffer).await.unwrap().unwrap();
        let length = put_in_force(&table, Some(&mut store), &mut in_force).await;
        in_force.truncate(length.unwrap());
        assert!(in_force != table.as_bytes());
        Held {
            newest_at,
            in_force,
            calibration,
        }
    })
}

fn table(talk: &mut Talk) -> Vec<u8> {
    talk.run(ReadTable::default(), TIMEOUT_S, |_, _| ())
        .unwrap()
}

/// A board on this store, and what it says until it has homed.
fn troubles(elf: &Path, store: Vec<u8>) -> (Talk, Vec<Failure>) {
    let options = Options {
        store: Some(store),
        ..Options::default()
    };
    let world = Collection::new(3, Vec::new(), 0);
    let mut talk = Talk::new(mounted(&world, 31, 9).start(elf, options).unwrap());
    let mut told = Vec::new();
    let ready = talk.ready(|_, report| {
        if let Some(Event::Trouble(why)) = report.map(|report| &report.event) {
            told.push(why.clone());
        }
    });
    assert_eq!(ready.unwrap(), None);
    (talk, told)
}

#[test]
fn changed_bits_of_a_header_and_of_a_record_are_put_right() {
    let Some(elf) = elf() else { return };
    let held = held();
    let mut changed = store();
    changed[held.newest_at - 32 + 9] ^= 0x10;
    // the calibration, a byte behind its head
    let calibration = held.calibration.to_bytes();
    let mut places = changed.windows(calibration.len());
    let at = places.position(|bytes| *bytes == calibration).unwrap();
    changed[at + 20] ^= 0x81;
    let (mut talk, told) = troubles(&elf, changed);
    assert_eq!(told, []);
    assert_eq!(table(&mut talk), held.in_force);
    let kept = talk.run(Request::read_calibration(), TIMEOUT_S, |_, _| ());
    assert_eq!(kept.unwrap(), held.calibration);
}

#[test]
#[ignore = "long"]
fn a_damaged_table_is_reported_and_not_replaced_in_silence() {
    let Some(elf) = elf() else { return };
    let whole = store();
    let (mut talk, told) = troubles(&elf, whole.clone());
    assert_eq!(told, []);
    let newest = table(&mut talk);
    drop(talk);
    let newest_at = held().newest_at;
    let older_at = (newest_at + (16 << 10)) % (32 << 10);
    // a bit of the newest one: the one before it is in force
    let mut damaged = whole;
    damaged[newest_at + 100] ^= 0x10;
    let (mut talk, told) = troubles(&elf, damaged.clone());
    assert!(
        matches!(
            told[..],
            [Failure::Memory(MemoryError::NewestTable(
                TableError::Crc { .. }
            ))]
        ),
        "{told:?}"
    );
    let older = table(&mut talk);
    let status = talk.run(Request::status(), TIMEOUT_S, |_, _| ()).unwrap();
    assert!(older != newest && !status.factory);
    drop(talk);
    // and one of that: the firmware's is
    damaged[older_at + 100] ^= 0x10;
    let (mut talk, told) = troubles(&elf, damaged);
    assert!(
        matches!(
            told[..],
            [Failure::Memory(MemoryError::StoredTable(
                TableError::Crc { .. }
            ))]
        ),
        "{told:?}"
    );
    let status = talk.run(Request::status(), TIMEOUT_S, |_, _| ()).unwrap();
    assert!(status.factory);
    // whatever is stored next ends it
    talk.run(PushTable::new(&older).unwrap(), TIMEOUT_S, |_, _| ())
        .unwrap();
    let store = talk.board().store().unwrap();
    drop(talk);
    let (mut talk, told) = troubles(&elf, store);
    assert_eq!((table(&mut talk), told), (older, Vec::new()));
}

/// A table of nonsense with a right checksum: far too many textures, or bytes of `good` that are others.
fn nonsense(random: &mut ChaCha8Rng, good: &[u8]) -> Vec<u8> {
    let mut table = if random.random() {
        let textures = random.random_range(129..2700_u16);
        let mut table = b"TACT\x01\0\0\x07\0\0\0\0".to_vec();
        table.extend(textures.to_le_bytes());
        // a movement of 0.5 N and 25 mm/s
        table.extend([1, 0, 0xf4, 0x01, 0xa8, 0x61, 0, 0]);
        let many = usize::from(textures);
        // a mean and a standard deviation for each property, and two trials
        table.extend([1, 0, 0, 4].repeat(3 * many));
        table.extend([2].repeat(many));
        table.extend([0; 4]);
        for number in 0..textures {
            table.extend(number.to_le_bytes());
            table.extend([2, 0, 0]);
        }
        for number in 0..textures {
            table.push(4);
            table.extend(format!("{number:04}").into_bytes());
        }
        table
    } else {
        let mut table = good[..good.len() - 4].to_vec();
        for _ in 0..random.random_range(1..9) {
            let at = random.random_range(6..table.len());
            table[at] = random.random();
        }
        table
    };
    let length = table.len() as u32 + 4;
    table[8..12].copy_from_slice(&length.to_le_bytes());
    let checksum = crc32(&table);
    table.extend(checksum);
    table
}

/// The store with this table as the newest one, as if it had been committed.
fn holding(table: &[u8]) -> Vec<u8> {
    let mut store = store();
    // the first of the sectors that are larger
    let at = 4 * (16 << 10);
    let mut slot = b"SLOT\x01\0\0\0\xff\xff\0\0".to_vec();
    slot.extend((table.len() as u32).to_le_bytes());
    slot.extend(&table[table.len() - 4..]);
    slot.extend(crc32(&slot));
    slot.extend([0xff; 4]);
    slot.extend(b"COMM");
    slot.extend(table);
    store[at..at + slot.len()].copy_from_slice(&slot);
    store
}

/// A board on this store as it answers, with some table: what it is then, and the resets by itself before.
fn answers(elf: &Path, store: Vec<u8>, hangs: bool) -> (Talk, Status, usize) {
    let options = Options {
        store: Some(store),
        ..Options::default()
    };
    let world = Collection::new(3, Vec::new(), 0);
    let board = mounted(&world, 31, 9).start(elf, options).unwrap();
    let mut talk = Talk::new(board).look_every(20);
    if hangs {
        break_code(talk.board(), "tactus_stored_table", Instead::Hangs);
    }
    loop {
        let resets = talk.board().resets().unwrap();
        assert!(talk.now_ns() < 30_000_000_000, "no answer; {resets:?}");
        match talk.run(Request::status(), TIMEOUT_S, |_, _| ()) {
            Ok(status) if status.textures > 0 => return (talk, status, resets.len()),
            _ => talk.board().run_ms(100).unwrap(),
        }
    }
}

fn boots_whatever_is_stored(seeds: RangeInclusive<u64>) {
    let Some(elf) = elf() else { return };
    let held = held();
    let good = store();
    let length = u32::from_le_bytes(good[held.newest_at + 8..][..4].try_into().unwrap());
    let good = &good[held.newest_at..][..length as usize];
    // the store takes what lies there for a table: a good one is in force
    let mut other = vec![0; SECTOR];
    let rename = Change::Rename {
        texture: 0,
        name: "another",
    };
    let other = amend(&mut other, &Table::read(good).unwrap(), rename).unwrap();
    let (mut talk, ..) = answers(&elf, holding(other.as_bytes()), false);
    let in_force = table(&mut talk);
    let in_force = Table::read(&in_force).unwrap();
    assert!(in_force.names().any(|name| name == "another"));
    for seed in seeds {
        let table = nonsense(&mut ChaCha8Rng::seed_from_u64(seed), good);
        let (_, _, resets) = answers(&elf, holding(&table), false);
        assert!(resets <= 1, "seed {seed}: {resets}");
    }
}

/// Whatever it is in a stored table that its reading never ends by: it is read once.
#[test]
fn a_stored_table_whose_reading_hangs_costs_one_reset() {
    let Some(elf) = elf() else { return };
    let (_, whole, none) = answers(&elf, store(), false);
    assert_eq!((whole.factory, none), (false, 0));
    let (_, status, resets) = answers(&elf, store(), true);
    assert_eq!((status.factory, resets), (true, 1));
}

#[test]
fn a_stored_table_of_nonsense_costs_one_reset_at_most() {
    boots_whatever_is_stored(1..=4);
}

#[test]
#[ignore = "long"]
fn no_stored_table_of_500_costs_more_than_one_reset() {
    boots_whatever_is_stored(1..=500);
}
