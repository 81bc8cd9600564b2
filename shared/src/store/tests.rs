//! The store against a flash that loses its power at every word and in every erase.

mod cuts;
mod heads;
pub(crate) mod ram;
mod rot;
mod self_learned;
mod wear;

use super::*;
use crate::features::Movement;
use crate::rig::calibration::RigCalibration;
use crate::rig::skin::SkinCare;
use crate::sensor::FingerCode;
use crate::sensor::pressure::Calibration;
use crate::table::Name;
use crate::table::tests::{around, table_of};
use crate::table::{Experience, FINGER_LENGTH, Table, TableError, TrainingStats, with_finger};
use embassy_futures::block_on;
use ram::{Ram, SECTOR};
use std::vec;
use std::vec::Vec;

type Outcome<T> = Result<T, StoreError>;

/// A small table, unlike that of every other `n`; lengths of every remainder of 4.
fn table(n: u8) -> Vec<u8> {
    let trials = vec![vec![around([(f32::from(n) * 0.01, 0.1); 3])]; 1 + usize::from(n) % 3];
    let mut bytes = table_of(crate::features::PropertySet::ALL, &trials);
    assert!(Table::read(&bytes).is_ok());
    // names of other lengths
    if n % 2 == 1 {
        let movements = [Movement::FOR_TRACTION];
        let experience = [Table::read(&bytes).unwrap().experience(0, 0)];
        let name = &"a longer name"[..1 + usize::from(n) % 13];
        let texture = (name, &experience[..]);
        let mut out = vec![0; 1000];
        let all = crate::features::PropertySet::ALL;
        let encoded = crate::table::encode(&mut out, all, &movements, [texture].into_iter());
        bytes = encoded.unwrap().as_bytes().to_vec();
    }
    bytes
}

/// A table that fits only into the larger slots, unlike that of every other `n`.
fn large(n: u8) -> Vec<u8> {
    let cells = [(f32::from(n) * 0.01, 0.1); 3];
    let bytes = table_of(
        crate::features::PropertySet::ALL,
        &vec![vec![around(cells); 3]; 21 + usize::from(n) % 3],
    );
    assert!(bytes.len() > SECTOR - 32 && Table::read(&bytes).is_ok());
    bytes
}

/// Small ones and large ones, two by two.
fn any_table(n: u8) -> Vec<u8> {
    if n % 4 < 2 { table(n) } else { large(n) }
}

fn open(ram: Ram) -> Store<Ram> {
    block_on(async {
        let mut store = Store::open(ram).await.unwrap();
        store.mend().await.unwrap();
        store
    })
}

async fn push(store: &mut Store<Ram>, bytes: &[u8], part: usize) -> Outcome<()> {
    store.begin_table(bytes.len()).await?;
    for (index, some) in bytes.chunks(part).enumerate() {
        store.write_table(index * part, some).await?;
    }
    let mut buffer = [0; 4 * SECTOR];
    let (stored, table) = store.commit_table(None, &mut buffer).await?;
    assert_eq!((table.as_bytes(), table.crc()), (bytes, stored.crc));
    Ok(())
}

/// The table in use.
fn used(store: &mut Store<Ram>) -> Option<Vec<u8>> {
    let mut buffer = [0; 4 * SECTOR];
    let table = block_on(store.read_table(&mut buffer)).unwrap()?;
    let bytes = table.as_bytes().to_vec();
    let stored = store.table().unwrap();
    assert_eq!((stored.crc, stored.length), (table.crc(), bytes.len()));
    let mapped = &store.flash.bytes[stored.offset as usize..][..stored.length];
    assert_eq!(mapped, bytes, "where it lies in the memory");
    Some(bytes)
}

fn calibration(n: u8) -> RigCalibration {
    RigCalibration {
        pressure: Calibration::PAPER,
        unloaded_a: (0.1, f32::from(n) * 1e-3),
        newton_per_ampere: 8.0,
        date: 20_261_121,
        air_known: true,
        turned: 0,
        serial: [b'0'; 16],
    }
}

fn experience(trials: u8) -> Experience {
    let mut experience = Experience::default();
    for n in 0..trials {
        let trial = crate::features::Properties::new([Some(f32::from(n)); 3]);
        let all = crate::features::PropertySet::ALL;
        experience.learn(all, &trial).unwrap();
    }
    experience
}

fn stats(trials: u8) -> TrainingStats {
    TrainingStats::Gaussians(experience(trials))
}

fn training_record(
    name: &str,
    movement: Movement,
    table: Option<u32>,
    trials: u8,
) -> super::TrainingRecord {
    super::TrainingRecord {
        name: Name::try_from(name).unwrap(),
        movement,
        table,
        stats: stats(trials),
    }
}

#[test]
fn a_blank_flash_is_an_empty_store() {
    let mut store = open(Ram::new());
    assert_eq!(used(&mut store), None);
    assert_eq!(store.settings(), Ok(()));
    assert_eq!(block_on(store.calibration()), Ok(None));
    assert_eq!(block_on(store.skin()), Ok(SkinCare::default()));
    let none = block_on(store.training_record("felt", Movement::FOR_TRACTION, None));
    assert_eq!(none, Ok(None));
    assert_eq!(store.close().operations, 0, "looking writes nothing");
    let mut short = Ram::<SECTOR>::new();
    short.bytes.truncate(15 * SECTOR);
    assert_eq!(
        block_on(Store::open(short)).err(),
        Some(StoreError::NoSpace(15 * SECTOR))
    );
}

#[test]
fn tables_come_in_parts_of_any_size_and_the_newest_counts() {
    let mut store = open(Ram::new());
    for n in 0..20 {
        block_on(push(&mut store, &any_table(n), 1 + usize::from(n))).unwrap();
        assert_eq!(used(&mut store), Some(any_table(n)));
        store = open(store.close().again());
        assert_eq!(used(&mut store), Some(any_table(n)));
        assert_eq!(store.table().unwrap().generation, u32::from(n) + 1);
    }
    block_on(store.factory_table()).unwrap();
    assert_eq!(store.table(), None);
    store = open(store.close().again());
    assert_eq!(store.table(), None);
    block_on(push(&mut store, &table(3), 7)).unwrap();
    store = open(store.close().again());
    assert_eq!(used(&mut store), Some(table(3)));
}

#[test]
fn a_table_that_is_not_whole_is_refused_and_the_former_one_stays() {
    let mut store = open(Ram::new());
    let (old, new) = (table(1), table(2));
    block_on(push(&mut store, &old, 16)).unwrap();
    let mut buffer = [0; 4 * SECTOR];
    let part = |offset, wanted| Err(StoreError::Part { offset, wanted });
    block_on(async {
        assert_eq!(store.write_table(0, &new).await, Err(StoreError::NoTable));
        assert_eq!(
            store.commit_table(None, &mut buffer).await.err(),
            Some(StoreError::NoTable)
        );
        let too_long = StoreError::TooLong {
            length: 4 * SECTOR - 31,
            capacity: 4 * SECTOR - 32,
        };
        assert_eq!(store.begin_table(4 * SECTOR - 31).await, Err(too_long));
        store.begin_table(new.len()).await.unwrap();
        assert_eq!(store.write_table(4, &new).await, part(4, 0));
        store.write_table(0, &new[..7]).await.unwrap();
        assert_eq!(store.write_table(0, &new[..7]).await, part(0, 7));
        assert_eq!(store.write_table(7, &new).await, part(7, 7));
        let unfinished = StoreError::Unfinished {
            got: 7,
            wanted: new.len(),
        };
        assert_eq!(
            store.commit_table(None, &mut buffer).await.err(),
            Some(unfinished)
        );
        store.write_table(7, &new[7..]).await.unwrap();
        let small = store
            .commit_table(None, &mut buffer[..new.len() - 1])
            .await
            .err();
        assert_eq!(small, Some(StoreError::Buffer(new.len())));
        store.commit_table(None, &mut buffer).await.unwrap();
        // a damaged one
        let mut damaged = old.clone();
        damaged[30] ^= 1;
        store.begin_table(damaged.len()).await.unwrap();
        store.write_table(0, &damaged).await.unwrap();
        assert!(matches!(
            store.commit_table(None, &mut buffer).await,
            Err(StoreError::Table(TableError::Crc { .. }))
        ));
        // one with something behind it
        let mut longer = old.clone();
        longer.push(0);
        store.begin_table(longer.len()).await.unwrap();
        let length = TableError::Length {
            header: old.len(),
            contents: longer.len(),
        };
        let refused = store.write_table(0, &longer).await;
        assert_eq!(refused, Err(StoreError::Table(length)));
        assert!(matches!(
            store.commit_table(None, &mut buffer).await,
            Err(StoreError::NoTable)
        ));
    });
    assert_eq!(used(&mut store), Some(new.clone()));
    let mut store = open(store.close().again());
    assert_eq!(used(&mut store), Some(new));
}

#[test]
fn a_table_of_another_finger_is_refused_and_the_former_one_stays() {
    let mut store = open(Ram::new());
    let old = table(1);
    block_on(push(&mut store, &old, 16)).unwrap();
    let [mems, biotac] = [FingerCode::MEMS, FingerCode::BIOTAC];
    let mut other = vec![0; old.len() + FINGER_LENGTH];
    let named = with_finger(
        &mut other,
        &Table::read(&old).unwrap(),
        mems,
        20_261_124,
        "",
    )
    .unwrap();
    assert_eq!((named.finger(), named.calibrated()), (mems, 20_261_124));
    let commit = |store: &mut Store<Ram<SECTOR>>, finger| {
        let mut buffer = [0; SECTOR];
        block_on(async {
            store.begin_table(other.len()).await.unwrap();
            store.write_table(0, &other).await.unwrap();
            let committed = store.commit_table(Some(finger), &mut buffer).await;
            committed.map(|(_, table)| table.finger())
        })
    };
    let refused = StoreError::Table(TableError::Finger {
        table: mems,
        probe: biotac,
    });
    assert_eq!(commit(&mut store, biotac), Err(refused));
    assert_eq!(used(&mut store), Some(old.clone()));
    let mut store = open(store.close().again());
    assert_eq!(used(&mut store), Some(old));
    assert_eq!(commit(&mut store, mems), Ok(mems));
    assert_eq!(used(&mut store), Some(other));
}

#[test]
fn a_table_goes_to_the_smallest_sector_that_it_fits_into() {
    let mut store = open(Ram::new());
    let header = |length: usize| {
        let mut header = table(0)[..16].to_vec();
        header[8..12].copy_from_slice(&(length as u32).to_le_bytes());
        header
    };
    for (length, worn) in [
        (SECTOR - 32, [1, 0, 0, 0, 0, 0]),
        (SECTOR - 31, [1, 0, 0, 0, 1, 0]),
        (4 * SECTOR - 32, [1, 0, 0, 0, 2, 0]),
    ] {
        block_on(store.begin_table(length)).unwrap();
        block_on(store.write_table(0, &header(length))).unwrap();
        assert_eq!(store.flash.worn, worn, "{length}");
    }
    // in turn, once they are committed; small ones go to a large sector where both small ones are kept
    for n in [2, 3, 6, 0, 1, 4] {
        block_on(push(&mut store, &any_table(n), 64)).unwrap();
    }
    assert_eq!(store.flash.worn, [2, 1, 0, 0, 4, 2]);
}

/// Whatever sectors they are in: the one before the newest is in use where that is damaged, and so on to the first.
#[test]
fn the_tables_before_the_newest_one_stay_until_their_slot_is_wanted() {
    // in which order tables are pushed; which are left, newest first
    for (pushed, left) in [
        (&[0, 2][..], &[2, 0][..]),
        (&[2, 0], &[0, 2]),
        (&[0, 1, 2, 3], &[3, 2, 1, 0]),
        (&[2, 0, 3, 1], &[1, 3, 0, 2]),
        // the oldest one gives way, never one of the newest two unless all are large
        (&[0, 1, 2, 4], &[4, 2, 1]),
        (&[0, 1, 4], &[4, 1, 0]),
        (&[0, 1, 4, 5], &[5, 4, 1]),
        (&[0, 2, 3, 6], &[6, 3, 0]),
        (&[0, 2, 3, 1, 4], &[4, 1, 3, 2]),
    ] {
        let mut store = open(Ram::new());
        for &n in pushed {
            block_on(push(&mut store, &any_table(n), 64)).unwrap();
        }
        for (at, &n) in left.iter().enumerate() {
            store = open(store.close().again());
            assert_eq!(used(&mut store), Some(any_table(n)), "{pushed:?}");
            assert_eq!(store.damaged_table().is_some(), at > 0, "{pushed:?} {at}");
            let offset = store.table().unwrap().offset as usize;
            store.flash.bytes[offset + 40] ^= 1;
        }
        store = open(store.close().again());
        assert_eq!(store.table(), None, "{pushed:?}");
        assert!(store.damaged_table().is_some());
        // all of them are given up together
        block_on(store.factory_table()).unwrap();
        store = open(store.close().again());
        assert_eq!((store.damaged_table(), store.table()), (None, None));
    }
}

#[test]
fn a_damaged_table_is_never_used() {
    let mut store = open(Ram::new());
    let (old, new) = (table(2), table(4));
    block_on(push(&mut store, &old, 64)).unwrap();
    block_on(push(&mut store, &new, 64)).unwrap();
    let stored = store.table().unwrap();
    let ram = store.close();
    let start = stored.offset as usize - 32;
    for bit in 8 * start..8 * (start + 32 + stored.length) {
        let mut ram = ram.clone().again();
        ram.bytes[bit / 8] ^= 1 << (bit % 8);
        // a header is put right
        let is_header = bit / 8 - start < 32;
        let expected = if is_header { &new } else { &old };
        let mut store = open(ram);
        assert_eq!(used(&mut store).as_ref(), Some(expected), "bit {bit}");
        let told = matches!(store.damaged_table(), Some(TableError::Crc { .. }));
        assert_eq!(told, !is_header, "bit {bit}");
    }
}

#[test]
fn that_the_only_table_is_damaged_is_told_until_another_takes_its_place() {
    let mut store = open(Ram::new());
    block_on(push(&mut store, &table(2), 64)).unwrap();
    let ram = store.close();
    for at in 0..32 + table(2).len() {
        let mut ram = ram.clone().again();
        ram.bytes[at] ^= 0x55;
        let mut store = open(open(ram).close().again());
        // four bytes of the header are free, and without the commit word there was no table
        let told = !(24..32).contains(&at);
        assert_eq!(store.damaged_table().is_some(), told, "byte {at}");
        assert_eq!(store.table().is_none(), !(24..28).contains(&at));
        block_on(push(&mut store, &table(4), 64)).unwrap();
        assert_eq!(store.damaged_table(), None);
        let mut store = open(store.close().again());
        assert_eq!(store.damaged_table(), None);
        assert_eq!(used(&mut store), Some(table(4)));
    }
}

#[test]
fn settings_are_kept_over_many_rounds_of_the_pages() {
    let mut store = open(Ram::new());
    let mut skin = SkinCare::default();
    block_on(async {
        store.set_calibration(&calibration(7)).await.unwrap();
        let mut one = training_record("felt", Movement::FOR_TRACTION, Some(5), 3);
        store.set_training_record(&one).await.unwrap();
        for n in 0..200u8 {
            skin = SkinCare::after(f32::from(n), f32::from(n) * 1.5);
            store.set_skin(&skin).await.unwrap();
            one.stats = stats(n);
            one.table = None;
            store.set_training_record(&one).await.unwrap();
        }
    });
    let ram = store.close();
    assert!(ram.erases >= 4, "{} erases", ram.erases);
    let mut store = open(ram.again());
    let at = |table| (Movement::FOR_TRACTION, table);
    block_on(async {
        assert_eq!(store.calibration().await, Ok(Some(calibration(7))));
        assert_eq!(store.skin().await, Ok(skin));
        for (name, (movement, table), trials) in [
            ("felt", at(None), Some(199)),
            ("felt", at(Some(5)), Some(3)),
            ("felt", at(Some(6)), None),
            ("wool", at(None), None),
            ("felt", (Movement::FOR_ROUGHNESS, None), None),
        ] {
            let found = store.training_record(name, movement, table).await.unwrap();
            assert_eq!(found, trials.map(stats), "{name}");
        }
        store.delete_training_records("felt").await.unwrap();
        let (movement, table) = at(None);
        assert_eq!(
            store.training_record("felt", movement, table).await,
            Ok(None)
        );
        assert_eq!(store.high_force().await, Ok(false));
        for allow in [true, false, true] {
            store.set_high_force(allow).await.unwrap();
            store = Store::open(store.close().again()).await.unwrap();
            assert_eq!(store.high_force().await, Ok(allow));
        }
        let unusable = RigCalibration {
            newton_per_ampere: 0.0,
            ..calibration(1)
        };
        let refused = store.set_calibration(&unusable).await;
        assert!(matches!(refused, Err(StoreError::Calibration(_))));
    });
}

#[test]
fn progress_on_top_of_a_former_table_gives_way() {
    let mut store = open(Ram::new());
    block_on(async {
        // 1 KB holds about nine
        let mut stored = 0;
        let full = loop {
            let name = std::format!("{stored:040}");
            match store
                .set_training_record(&training_record(&name, Movement::FOR_TRACTION, Some(1), 2))
                .await
            {
                Ok(()) => stored += 1,
                Err(why) => break why,
            }
        };
        assert_eq!(full, StoreError::Settings(SettingsError::Full));
        assert!(stored >= 8, "{stored}");
        // what there is can still be read, and deleted
        for n in 0..stored {
            let name = std::format!("{n:040}");
            let found = store
                .training_record(&name, Movement::FOR_TRACTION, Some(1))
                .await;
            assert_eq!(found, Ok(Some(stats(2))), "{n}");
            store.delete_training_records(&name).await.unwrap();
        }
        let one = training_record("felt", Movement::FOR_TRACTION, Some(1), 2);
        store.set_training_record(&one).await.unwrap();
    });
}

#[test]
fn damaged_settings_are_reported_and_erased_without_the_tables() {
    for damage in 0..3 {
        let mut store = open(Ram::new());
        block_on(push(&mut store, &table(5), 64)).unwrap();
        block_on(store.set_calibration(&calibration(7))).unwrap();
        let mut ram = store.close().again();
        let expected = match damage {
            // both pages closed: no sequence of operations leaves that
            0 => {
                for at in [2 * SECTOR, 3 * SECTOR - 20, 3 * SECTOR, 4 * SECTOR - 20] {
                    ram.bytes[at..at + 4].fill(0);
                }
                SettingsError::Corrupt
            }
            // the schema is the first record; its damage is a missing schema
            1 => {
                ram.bytes[2 * SECTOR + 4..][..12].fill(0);
                SettingsError::Corrupt
            }
            _ => {
                let mut erasures = 0;
                let mut pages = super::pages::Pages(&mut ram, &mut erasures);
                block_on(pages.wipe()).unwrap();
                let mut map = sequential_storage::map::MapStorage::<u8, _, _>::new(
                    pages,
                    sequential_storage::map::MapConfig::new(0..2 * (SECTOR as u32 - 16)),
                    sequential_storage::cache::Cache::new_uncached(),
                );
                let newer: &[u8] = &[9];
                block_on(map.store_item(&mut [0; 32], &0, &newer)).unwrap();
                SettingsError::Schema(9)
            }
        };
        let mut store = open(ram.again());
        assert_eq!(store.settings(), Err(expected), "{damage}");
        let told = StoreError::Settings(expected);
        assert_eq!(block_on(store.calibration()), Err(told));
        assert_eq!(block_on(store.set_skin(&SkinCare::default())), Err(told));
        assert_eq!(
            block_on(store.training_record("felt", Movement::FOR_TRACTION, None)),
            Err(told)
        );
        assert_eq!(used(&mut store), Some(table(5)));
        block_on(store.erase_settings()).unwrap();
        assert_eq!(store.settings(), Ok(()));
        assert_eq!(block_on(store.calibration()), Ok(None));
        block_on(store.set_calibration(&calibration(8))).unwrap();
        assert_eq!(used(&mut store), Some(table(5)));
    }
}
