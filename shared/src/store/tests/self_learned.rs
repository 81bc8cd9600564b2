//! What the probe has learned by itself, on the chip's own sectors: all of it, with all training.

use super::*;
use crate::features::MAX_FEATURES;
use crate::table::MAX_TEXTURES;
use crate::table::Whitened;

const CHIP: usize = 16 * 1024;

pub(super) type Chip = Store<Ram<CHIP>>;

pub(super) fn chip() -> Chip {
    block_on(Store::open(Ram::new())).unwrap()
}

fn again(store: Chip) -> Chip {
    block_on(Store::open(store.close().again())).unwrap()
}

/// So many movements with a mean of `features` features, all of this size.
pub(super) fn learned_record(
    lineage: u32,
    number: u16,
    movements: u8,
    features: usize,
    size: i16,
) -> SelfLearnedRecord {
    let mut whitened = Whitened {
        slides: 200,
        ..Whitened::default()
    };
    whitened.mean[..features].fill(size);
    SelfLearnedRecord {
        lineage,
        number,
        movements: (0..movements).map(|m| (m, 200, whitened)).collect(),
    }
}

/// All that is stored for this lineage, by number.
fn all(store: &mut Chip, lineage: u32) -> Vec<SelfLearnedRecord> {
    let mut all = Vec::new();
    block_on(store.self_learned(lineage, &mut |record| all.push(record))).unwrap();
    all.sort_by_key(|record| record.number);
    all
}

#[test]
fn records_are_replaced_and_forgotten_one_by_one() {
    let mut store = chip();
    assert_eq!(all(&mut store, 1), []);
    let record = |lineage, number, size| learned_record(lineage, number, 2, 13, size);
    block_on(async {
        for (lineage, number) in [(1, 7), (1, 9), (2, 7)] {
            store
                .set_self_learned(&record(lineage, number, 5))
                .await
                .unwrap();
        }
        store.set_self_learned(&record(1, 7, 6)).await.unwrap();
    });
    let mut store = again(store);
    assert_eq!(all(&mut store, 1), [record(1, 7, 6), record(1, 9, 5)]);
    assert_eq!(all(&mut store, 2), [record(2, 7, 5)]);
    assert_eq!(all(&mut store, 3), []);
    block_on(store.delete_self_learned(Some((1, 7)))).unwrap();
    block_on(store.delete_self_learned(Some((2, 9)))).unwrap();
    assert_eq!(all(&mut store, 1), [record(1, 9, 5)]);
    assert_eq!(all(&mut store, 2), [record(2, 7, 5)]);
    // its place is the next one's
    block_on(store.set_self_learned(&record(3, 1, 4))).unwrap();
    let mut store = again(store);
    assert_eq!(all(&mut store, 1), [record(1, 9, 5)]);
    assert_eq!(all(&mut store, 3), [record(3, 1, 4)]);
    block_on(store.delete_self_learned(None)).unwrap();
    let mut store = again(store);
    for lineage in 1..4 {
        assert_eq!(all(&mut store, lineage), []);
    }
}

#[test]
fn when_full_records_of_another_table_are_given_up() {
    let mut store = chip();
    let record = |lineage, number| learned_record(lineage, number, 1, 3, 50);
    let most = MAX_TEXTURES as u16;
    for number in 0..most {
        let lineage = if number < 2 { 1 } else { 2 };
        block_on(store.set_self_learned(&record(lineage, number))).unwrap();
    }
    // all places are taken: one of its own is replaced, not given up
    block_on(store.set_self_learned(&record(2, 5))).unwrap();
    assert_eq!(
        (all(&mut store, 1).len(), all(&mut store, 2).len()),
        (2, 126)
    );
    for (left, number) in [(1, 500), (0, 501)] {
        block_on(store.set_self_learned(&record(2, number))).unwrap();
        assert_eq!(all(&mut store, 1).len(), left);
    }
    let full = Err(StoreError::Settings(SettingsError::Full));
    assert_eq!(block_on(store.set_self_learned(&record(2, 502))), full);
    let mut store = again(store);
    let numbers: Vec<u16> = all(&mut store, 2).iter().map(|r| r.number).collect();
    assert_eq!(numbers, (2..most).chain([500, 501]).collect::<Vec<_>>());
    // a table of a new lineage has all the space
    block_on(store.set_self_learned(&record(3, 0))).unwrap();
    assert_eq!(
        (all(&mut store, 2).len(), all(&mut store, 3).len()),
        (127, 1)
    );
}

/// The longest name and means of a training, in every place.
fn all_training(store: &mut Chip, features: usize) -> Vec<super::super::TrainingRecord> {
    let mut whitened = Whitened {
        slides: 255,
        ..Whitened::default()
    };
    whitened.mean[..features].fill(i16::MIN);
    let records: Vec<_> = (0..MAX_RECORDS)
        .map(|n| super::super::TrainingRecord {
            name: Name::try_from(std::format!("{n:040}").as_str()).unwrap(),
            movement: Movement::FOR_ROUGHNESS,
            table: Some(u32::MAX),
            stats: TrainingStats::Fused(whitened),
        })
        .collect();
    for record in &records {
        block_on(store.set_training_record(record)).unwrap();
    }
    records
}

/// Thirteen features, up to 32 standard deviations off: 2 bytes each.
#[test]
fn all_training_and_all_that_was_learned_fit_into_a_page() {
    let mut store = chip();
    block_on(store.set_calibration(&calibration(1))).unwrap();
    let skin = SkinCare::after(1.0, 2.0);
    let training_record = all_training(&mut store, 14);
    let record = |number, size| learned_record(u32::MAX, number, 2, 13, size);
    // round after round, so that the pages turn with everything in them
    for size in [8191, -8192, 8000] {
        block_on(store.set_skin(&skin)).unwrap();
        for number in 0..MAX_TEXTURES as u16 {
            let stored = block_on(store.set_self_learned(&record(number, size)));
            assert_eq!(stored, Ok(()), "{size} {number}");
        }
        store = again(store);
        let expected: Vec<_> = (0..MAX_TEXTURES as u16).map(|n| record(n, size)).collect();
        assert_eq!(all(&mut store, u32::MAX), expected);
    }
    for one in &training_record {
        let found = block_on(store.training_record(&one.name, one.movement, one.table));
        assert_eq!(found, Ok(Some(one.stats)));
    }
    assert_eq!(block_on(store.calibration()), Ok(Some(calibration(1))));
    assert_eq!(block_on(store.skin()), Ok(skin));
}

/// Fourteen features that are all farther off than that do not fit all: it is said, and nothing is lost.
#[test]
fn what_does_not_fit_is_refused_and_nothing_is_lost() {
    let mut store = chip();
    let training_record = all_training(&mut store, MAX_FEATURES);
    let record = |number| learned_record(u32::MAX, number, 2, 14, i16::MIN);
    let mut stored = 0;
    let why = loop {
        if stored == MAX_TEXTURES as u16 {
            break Ok(());
        }
        match block_on(store.set_self_learned(&record(stored))) {
            Ok(()) => stored += 1,
            why => break why,
        }
    };
    std::println!("{stored} of the longest records beside all training");
    assert_eq!(why, Err(StoreError::Settings(SettingsError::Full)));
    assert!(stored >= 90, "{stored}");
    let mut store = again(store);
    let expected: Vec<_> = (0..stored).map(record).collect();
    assert_eq!(all(&mut store, u32::MAX), expected);
    for one in &training_record {
        let found = block_on(store.training_record(&one.name, one.movement, one.table));
        assert_eq!(found, Ok(Some(one.stats)));
    }
    // deleting makes space
    block_on(store.delete_training_records(&training_record[0].name)).unwrap();
    block_on(store.delete_self_learned(None)).unwrap();
    block_on(store.set_self_learned(&record(9))).unwrap();
    assert_eq!(all(&mut store, u32::MAX), [record(9)]);
}
