//! Bits of the flash that change by themselves: to ones and to zeros in what was written, to zeros where nothing was.
//! Flash without ECC says nothing of it, and a word that is written afterwards keeps the zeros.

use super::cuts::Model;
use super::ram::SECTOR;
use super::*;
use crate::table::tests::fixed;
use core::ops::Range;
use proptest::prelude::*;

/// Stores of different pasts: how many rounds of settings they have seen, and how many tables.
const PASTS: [(u8, u8); 8] = [
    (0, 0),
    (1, 1),
    (6, 2),
    (11, 3),
    (14, 2),
    (3, 4),
    (40, 5),
    (5, 7),
];

/// Where bits change.
const REGIONS: usize = 8;
/// Where the slots of tables begin.
const SLOTS: [usize; 4] = [0, SECTOR, 4 * SECTOR, 8 * SECTOR];

/// The flash, and where its tables lie, the last one last.
fn stored(rounds: u8, tables: u8) -> (Ram, Vec<Range<usize>>) {
    let mut store = open(Ram::new());
    let mut places = Vec::new();
    block_on(async {
        for n in 0..tables {
            push(&mut store, &any_table(n), 64).await.unwrap();
            let table = store.table().unwrap();
            let at = table.offset as usize;
            places.push(at..at + table.length);
        }
        for n in 0..rounds {
            if n % 5 == 0 {
                let share = f32::from(n + 1) * 1e-3;
                store.set_calibration(&calibration(n)).await.unwrap();
                store.set_false_alarm(Some(share)).await.unwrap();
                store.set_high_force(n % 10 == 0).await.unwrap();
                let felt = training_record("felt", Movement::FOR_FINENESS, None, n + 1);
                store.set_training_record(&felt).await.unwrap();
                let learned = super::cuts::self_learned(n % 2, n);
                store.set_self_learned(&learned).await.unwrap();
            }
            let skin = SkinCare::after(n.into(), n.into());
            store.set_skin(&skin).await.unwrap();
        }
    });
    (store.close().again(), places)
}

/// The newest table that no bit of has changed, and whether it is the last one.
fn newest_whole(places: &[Range<usize>], changed: &[usize]) -> (Option<Vec<u8>>, bool) {
    let is_left = |n: usize| {
        let newer = &places[n + 1..];
        newer.iter().all(|newer| newer.start != places[n].start)
    };
    let is_whole = |n: usize| !changed.iter().any(|bit| places[n].contains(&(bit / 8)));
    let newest = (0..places.len()).rev().find(|&n| is_left(n) && is_whole(n));
    let is_last = newest.is_none_or(|n| n + 1 == places.len());
    (
        newest.map(|n| any_table(n as u8)),
        is_last && (newest.is_some() || places.is_empty()),
    )
}

/// Where the settings end that were written: the last word of each page that is not blank, in front of its end mark.
fn written(ram: &Ram, sector: usize) -> usize {
    let page = &ram.bytes[sector * SECTOR..][..SECTOR - 20];
    let last = page.iter().rposition(|byte| *byte != 0xFF);
    last.map_or(0, |last| (last + 4) / 4 * 4)
}

/// A bit of a region, as `any` chooses it.
fn bit(ram: &Ram, region: usize, any: u32) -> usize {
    let any = any as usize;
    let settings = if written(ram, 2) > written(ram, 3) {
        2
    } else {
        3
    };
    let end = written(ram, settings);
    let (from, length) = match region {
        // a slot's header and commit word, and its table
        0 => (SLOTS[any / 7 % 4], 32),
        1 => match any / 7 % 4 {
            small @ 0..2 => (SLOTS[small] + 32, table(1).len()),
            slot => (SLOTS[slot] + 32, large(2).len()),
        },
        // records, the first ones, what follows on them, the blank rest of the page
        2 => (settings * SECTOR + 4, end.saturating_sub(4).max(4)),
        3 => (settings * SECTOR + 4, 12),
        4 => (settings * SECTOR + end, 40.min(SECTOR - end)),
        5 => (settings * SECTOR + end, SECTOR - end),
        // the marks of the pages
        6 => match any / 7 % 4 {
            page @ 0..2 => ((2 + page) * SECTOR, 4),
            page => ((1 + page) * SECTOR - 20, 20),
        },
        _ => (0, 4 * SECTOR),
    };
    8 * from + (any >> 8) % (8 * length)
}

/// The store's account of itself.
fn said(store: &Store<Ram>) -> (bool, Option<SettingsError>, Result<(), SettingsError>) {
    let table = store.damaged_table().is_some();
    (table, store.damaged_record(), store.settings())
}

proptest! {
    #![proptest_config(fixed(6000))]
    #[test]
    fn changed_bits_are_put_right_or_told_and_nothing_else_is_lost(
        past in 0..PASTS.len(),
        region in 0..REGIONS,
        bits in prop::collection::vec(any::<u32>(), 1..=3)
    ) {
        let (rounds, tables) = PASTS[past];
        let (ram, places) = stored(rounds, tables);
        let mut whole = open(ram.clone());
        let (before, share) = (Model::of(&mut whole), block_on(whole.false_alarm()).unwrap());
        let high_force = block_on(whole.high_force()).unwrap();
        let mut changed: Vec<usize> = bits.iter().map(|any| bit(&ram, region, *any)).collect();
        changed.sort_unstable();
        changed.dedup();
        let mut ram = ram;
        ram.rotten = true;
        for bit in &changed {
            ram.bytes[bit / 8] ^= 1 << (bit % 8);
        }
        let mut store = open(ram);
        let told = said(&store);
        let (is_table_damaged, lost, settings) = told;
        // two bits of a record are put right, and three of a header
        if changed.len() < 3 {
            prop_assert_eq!((lost, settings), (None, Ok(())));
        }
        let (wanted, is_last) = newest_whole(&places, &changed);
        prop_assert_eq!(is_table_damaged, !is_last);
        let mut found = Model::damaged(&mut store);
        if is_table_damaged {
            prop_assert_eq!(&found.table, &wanted);
            found.table.clone_from(&before.table);
        }
        if settings.is_ok() {
            let same_share = block_on(store.false_alarm()).unwrap() == share;
            let losses = found.differences(&before) + usize::from(!same_share);
            // whatever is lost, nobody is pressed harder than was set
            let now = block_on(store.high_force()).unwrap();
            prop_assert_eq!(now, high_force && lost.is_none(), "{:?}, told {:?}", changed, lost);
            prop_assert!(losses <= usize::from(lost.is_some()), "{} lost, told {:?}: {:?}, \
             {:?}", losses, lost, changed, [&before, &found]);
        }
        // the next boot finds the same and says the same
        let mut ram = store.close().again();
        ram.rotten = true;
        let mut store = open(ram);
        prop_assert_eq!(said(&store), told);
        let mut again = Model::damaged(&mut store);
        if is_table_damaged {
            again.table.clone_from(&before.table);
        }
        prop_assert_eq!(&again, &found);
        // it goes on from there
        block_on(async {
            if store.settings().is_err() {
                store.erase_settings().await.unwrap();
            }
            for n in 50..60 {
                push(&mut store, &any_table(n), 64).await.unwrap();
                store.set_calibration(&calibration(n)).await.unwrap();
                store.set_skin(&SkinCare::after(n.into(), 1.0)).await.unwrap();
            }
        });
        let mut ram = store.close().again();
        ram.rotten = true;
        let mut store = open(ram);
        let mut after = Model::of(&mut store);
        prop_assert_eq!(after.table.take(), Some(any_table(59)));
        prop_assert_eq!(after.calibration.take(), Some(calibration(59)));
        prop_assert_eq!(after.skin, SkinCare::after(59.0, 1.0));
        if settings.is_ok() {
            let rest = Model { table: None, calibration: None, skin: after.skin, ..found };
            prop_assert_eq!(after, rest);
        }
    }
}

/// A bit in each of two records: the page turns while the first one is stored again, and leaves out what is damaged.
#[test]
fn two_records_are_put_right_at_once_wherever_the_page_ends() {
    let mut turns = 0;
    // a short record more moves the end of the page
    let all = (0..100).flat_map(|rounds| {
        let (ram, _) = stored(rounds, 5);
        (0..6).scan(open(ram), move |store, _| {
            let ram = store.flash.clone().again();
            block_on(store.set_high_force(rounds % 10 == 0)).unwrap();
            Some((rounds, ram))
        })
    });
    for (rounds, ram) in all {
        if written(&ram, 2).max(written(&ram, 3)) < SECTOR - 150 {
            continue;
        }
        let worn = ram.erases;
        let before = Model::of(&mut open(ram.clone()));
        for any in 0..100 {
            let mut ram = ram.clone();
            ram.rotten = true;
            for any in [(any * 71) << 8, (any * 71 + 900) << 8] {
                let bit = bit(&ram, 2, any);
                ram.bytes[bit / 8] ^= 1 << (bit % 8);
            }
            let mut store = open(ram);
            turns += store.flash.erases - worn;
            for _ in 0..2 {
                assert_eq!(said(&store), (false, None, Ok(())), "{rounds} {any}");
                assert_eq!(Model::damaged(&mut store), before, "{rounds} {any}");
                store = open(store.close().again());
            }
        }
    }
    assert!(turns > 100, "{turns}");
}
