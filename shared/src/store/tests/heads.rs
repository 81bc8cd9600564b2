//! What a cut leaves of a record's head, and records behind it whose checksum can be taken for a length; words of the
//! flash that keep bits.

use super::ram::Torn;
use super::*;
use crate::store::records::{KEY_CALIBRATION, KEY_FALSE_ALARM, KEY_HIGH_FORCE, KEY_SKIN};

/// Where the page begins that a fresh store writes to.
const PAGE: usize = 2 * SECTOR;
/// Words of a record of the skin: a head of two, the key and two numbers.
const WORDS: usize = 5;

fn remainder(bytes: &[u8], first: u32, polynomial: u32) -> u32 {
    bytes.iter().fold(first, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            crc >> 1 ^ (polynomial & (crc & 1).wrapping_neg())
        })
    })
}

/// A worn skin whose record has the checksum of a head of so many bytes.
fn like_head(length: u16) -> SkinCare {
    const POLYNOMIAL: u32 = 0x82F6_3B78;
    let low = length.to_le_bytes();
    let sum = remainder(&low, 0xFFFF, 0x1A2E) as u16 ^ 0xFFFF;
    let [c, d] = sum.to_le_bytes();
    // the last four bytes of a record make its checksum any other
    let last = (0..32).fold(
        !u32::from_le_bytes([low[0], low[1], c, d]),
        |crc, _| match crc >> 31 {
            0 => crc << 1,
            _ => (crc ^ POLYNOMIAL) << 1 | 1,
        },
    );
    let forged = (1..10_000).find_map(|n| {
        let work = n as f32 * 0.5;
        let data: Vec<u8> = [2].into_iter().chain(work.to_le_bytes()).collect();
        let wear = f32::from_bits(last ^ remainder(&data, 0xEEEE_EEEE, POLYNOMIAL));
        (1e-9..1e9)
            .contains(&wear)
            .then(|| SkinCare::after(work, wear))
    });
    forged.unwrap()
}

/// Lengths of records, of none, up to the end of the page, and beyond; no checksum ends with 00 or FF.
const LENGTHS: [u16; 16] = [
    1, 2, 4, 9, 20, 63, 65, 106, 112, 113, 300, 700, 900, 990, 1020, 9000,
];

fn skin(work: f32) -> SkinCare {
    SkinCare::after(work, work)
}

/// A store with a calibration and a worn skin.
fn worn() -> Ram {
    let mut store = open(Ram::new());
    block_on(async {
        store.set_calibration(&calibration(3)).await.unwrap();
        store.set_skin(&skin(1.0)).await.unwrap();
    });
    store.close().again()
}

/// Stores this wear, and starts again: it is there, and so is all else.
fn keeps(ram: Ram, skin: SkinCare, why: &str) -> Ram {
    let mut store = open(ram);
    let calibrated = |store: &mut Store<Ram>| block_on(store.calibration()).unwrap();
    assert_eq!(calibrated(&mut store), Some(calibration(3)), "{why}");
    block_on(store.set_skin(&skin)).unwrap();
    assert_eq!(block_on(store.skin()), Ok(skin), "{why}");
    let mut store = open(store.close().again());
    assert_eq!(block_on(store.skin()), Ok(skin), "{why}");
    assert_eq!(calibrated(&mut store), Some(calibration(3)), "{why}");
    assert_eq!(
        (store.settings(), store.damaged_record()),
        (Ok(()), None),
        "{why}"
    );
    store.close().again()
}

/// A cut after every half of every word of a record, then every record whose checksum is like a length.
#[test]
fn a_record_is_never_hidden_by_what_a_cut_left_before_it() {
    let before = worn();
    let halves = [
        Torn::Nothing,
        Torn::Begin(0),
        Torn::End(0),
        Torn::Bits(77),
        Torn::All,
    ];
    for (at, torn) in (1..=WORDS).flat_map(|at| halves.map(|torn| (at, torn))) {
        let mut cut = before.clone();
        cut.cut = Some((at, torn));
        let mut store = open(cut);
        block_on(store.set_skin(&skin(2.0))).unwrap_err();
        let cut = store.close().again();
        for length in LENGTHS {
            let why = std::format!("cut in word {at}, {torn:?}, then like {length} bytes");
            let mut left = keeps(cut.clone(), like_head(length), &why);
            // on, until the page is full, and over to the other one
            for n in 0..if length == 112 { 60 } else { 2 } {
                left = keeps(left, skin(n as f32), &why);
            }
        }
    }
}

/// At each distance from the end of the page.
#[test]
fn a_torn_head_near_the_end_of_the_page_hides_nothing() {
    let mut ram = worn();
    for n in 0..120u8 {
        for at in 1..=WORDS {
            let mut cut = ram.clone();
            cut.cut = Some((at, Torn::Begin(0)));
            let mut store = open(cut);
            let _ = block_on(store.set_skin(&skin(2.0)));
            keeps(store.close().again(), skin(3.0), "cut");
        }
        // records of two lengths, so that all remainders come
        let mut store = open(ram);
        if n % 3 == 0 {
            block_on(store.set_false_alarm(Some(0.01))).unwrap();
        }
        ram = keeps(store.close().again(), skin(n.into()), "whole");
    }
}

/// A store that goes on after a write that failed, as one does whose future was dropped.
#[test]
fn what_a_failed_write_left_is_sealed_before_the_next_one() {
    for length in LENGTHS {
        let mut cut = worn();
        cut.cut = Some((2, Torn::Nothing));
        let mut store = open(cut);
        block_on(store.set_skin(&skin(2.0))).unwrap_err();
        let ram = core::mem::replace(&mut store.flash, Ram::new());
        store.flash = ram.again();
        block_on(store.set_skin(&like_head(length))).unwrap();
        let mut store = open(store.close().again());
        assert_eq!(block_on(store.skin()), Ok(like_head(length)));
        assert_eq!(block_on(store.calibration()), Ok(Some(calibration(3))));
    }
}

/// A flash in which a record was appended to a torn head and hides all: the others are back.
#[test]
fn a_head_longer_than_any_record_hides_no_setting() {
    let written = |ram: &Ram| {
        let page = &ram.bytes[PAGE..][..SECTOR - 20];
        PAGE + (page.iter().rposition(|byte| *byte != 0xFF).unwrap() + 4) / 4 * 4
    };
    for length in LENGTHS.into_iter().filter(|n| (113..800).contains(n)) {
        let mut store = open(worn());
        let end = written(&store.flash);
        block_on(store.set_skin(&like_head(length))).unwrap();
        let mut ram = store.close().again();
        // as if a torn head had been before it
        ram.bytes.copy_within(end..end + 4 * WORDS, end + 4);
        ram.bytes[end..end + 4].copy_from_slice(b"torn");
        let mut store = open(ram);
        assert_eq!(store.settings(), Ok(()));
        assert_eq!(block_on(store.calibration()), Ok(Some(calibration(3))));
        assert_eq!(block_on(store.skin()), Ok(skin(1.0)), "as before it");
        assert!(store.damaged_record().is_some(), "and it is told");
        keeps(store.close().again(), skin(4.0), "healed");
    }
}

/// Bits of a commit word that stay 1: the refused table is not in force after a power cycle.
#[test]
fn a_refused_table_is_not_in_force_after_the_next_start() {
    let (old, new) = (table(2), table(4));
    for keep in 1..=16 {
        let zeros = (0..32).filter(|bit| b"COMM"[bit / 8] >> (bit % 8) & 1 == 0);
        let stuck = zeros
            .take(keep)
            .map(|bit| (SECTOR + 28 + bit / 8, 1 << (bit % 8)));
        let mut store = open(Ram::new());
        block_on(push(&mut store, &old, 64)).unwrap();
        store.flash.stuck = stuck.collect();
        assert_eq!(
            block_on(push(&mut store, &new, 64)),
            Err(StoreError::Worn),
            "{keep}"
        );
        assert_eq!(used(&mut store), Some(old.clone()), "{keep}");
        let mut store = open(store.close().again());
        assert_eq!(used(&mut store), Some(old.clone()), "{keep}");
        assert_eq!(store.damaged_table(), None);
    }
    // and it can be pushed to another place
    let mut store = open(Ram::new());
    block_on(push(&mut store, &old, 64)).unwrap();
    store.flash.stuck = vec![(SECTOR + 28, 4)];
    block_on(push(&mut store, &new, 64)).unwrap_err();
    block_on(push(&mut store, &new, 64)).unwrap();
    assert_eq!(used(&mut open(store.close().again())), Some(new));
}

/// Whatever a host begins and does not end: the table in use stays, and the one before it for when that is damaged.
#[test]
fn the_table_before_the_newest_stays_until_a_new_one_is_whole() {
    for (first, second, begun) in [(0, 1, 4), (0, 1, 2), (0, 2, 1), (2, 0, 6), (2, 1, 5)] {
        let mut store = open(Ram::new());
        for n in [first, second] {
            block_on(push(&mut store, &any_table(n), 64)).unwrap();
        }
        let new = any_table(begun);
        block_on(store.begin_table(new.len())).unwrap();
        block_on(store.write_table(0, &new[..new.len() - 1])).unwrap();
        let mut store = open(store.close().again());
        assert_eq!(used(&mut store), Some(any_table(second)));
        let newest = store.table().unwrap().offset as usize;
        store.flash.bytes[newest + 40] ^= 1;
        let mut store = open(store.close().again());
        assert_eq!(
            used(&mut store),
            Some(any_table(first)),
            "{first} {second} {begun}"
        );
    }
}

/// A request to begin a table, and bytes that are none, erase nothing.
#[test]
fn nothing_is_erased_before_a_table_has_begun() {
    let mut store = open(Ram::new());
    for n in [2, 3] {
        block_on(push(&mut store, &any_table(n), 64)).unwrap();
    }
    let (erases, new) = (store.flash.erases, any_table(6));
    for _ in 0..50 {
        block_on(store.begin_table(new.len())).unwrap();
        block_on(store.write_table(0, &new[..15])).unwrap();
    }
    let mut other = new.clone();
    for at in [0, 4, 8, 13] {
        other[at] ^= 1;
        block_on(store.begin_table(new.len())).unwrap();
        let refused = block_on(store.write_table(0, &other));
        assert!(matches!(refused, Err(StoreError::Table(_))), "{at}");
        assert_eq!(
            block_on(store.write_table(0, &new)),
            Err(StoreError::NoTable)
        );
        other[at] ^= 1;
    }
    for length in [0, 1, 15] {
        assert!(matches!(
            block_on(store.begin_table(length)),
            Err(StoreError::Table(_))
        ));
    }
    assert_eq!(store.flash.erases, erases);
    assert_eq!(store.erasures() as usize, erases);
    assert_eq!(used(&mut store), Some(any_table(3)));
}

#[test]
fn the_factorys_table_is_in_force_or_it_is_told_that_it_is_not() {
    for keep in 0..=16 {
        let ones = (0..32).filter(|bit| b"COMM"[bit / 8] >> (bit % 8) & 1 == 1);
        let stuck: Vec<_> = ones
            .take(keep)
            .map(|bit| (28 + bit / 8, 1 << (bit % 8)))
            .collect();
        let mut store = open(Ram::new());
        block_on(push(&mut store, &table(2), 64)).unwrap();
        store.flash.stuck = stuck;
        let done = block_on(store.factory_table());
        assert_eq!((done, store.table()), (Ok(()), None), "{keep}");
        let store = open(store.close().again());
        assert_eq!(
            (store.table(), store.damaged_table()),
            (None, None),
            "{keep}"
        );
    }
}

/// Records with a right checksum that are none of their kind, as another program may have left them.
#[test]
fn a_record_of_another_kind_hides_no_other() {
    for key in [16, 64, 191] {
        let mut store = open(worn());
        let felt = training_record("felt", Movement::FOR_FINENESS, None, 3);
        block_on(store.set_training_record(&felt)).unwrap();
        block_on(store.store_checked(key, &[1, 200, 7])).unwrap();
        let mut store = open(store.close().again());
        let told = if key < 64 {
            Setting::Training
        } else {
            Setting::SelfLearned
        };
        assert_eq!(store.settings(), Ok(()));
        assert_eq!(
            store.damaged_record(),
            Some(SettingsError::Record(told)),
            "{key}"
        );
        assert_eq!(block_on(store.calibration()), Ok(Some(calibration(3))));
        assert_eq!(block_on(store.skin()), Ok(skin(1.0)));
        let felt = block_on(store.training_record("felt", Movement::FOR_FINENESS, None));
        assert_eq!(felt, Ok((key != 16).then(|| stats(3))), "{key}");
    }
}

/// A checksum that is right makes no value right: nothing that cannot be is believed, and a new value is taken.
#[test]
fn a_value_that_cannot_be_is_not_believed_and_can_be_replaced() {
    let work = |energy: f32, wear: f32| [energy.to_le_bytes(), wear.to_le_bytes()].concat();
    let share = |share: f32| [&[1][..], &share.to_le_bytes()].concat();
    let mut scale = calibration(3).to_bytes().to_vec();
    let bits = scale.len();
    scale[bits / 2..].fill(0xFF);
    let cases = [
        (KEY_SKIN, work(f32::NAN, 1.0)),
        (KEY_SKIN, work(1.0, f32::INFINITY)),
        (KEY_SKIN, work(-1.0, 0.0)),
        (KEY_SKIN, vec![1, 2, 3]),
        (KEY_FALSE_ALARM, share(f32::NAN)),
        (KEY_FALSE_ALARM, share(-0.1)),
        (KEY_FALSE_ALARM, share(2.0)),
        (KEY_FALSE_ALARM, vec![9]),
        (KEY_HIGH_FORCE, vec![7]),
        (KEY_HIGH_FORCE, vec![]),
        (KEY_CALIBRATION, vec![]),
        (KEY_CALIBRATION, vec![0xFF; bits]),
        (KEY_CALIBRATION, scale),
    ];
    for (key, bytes) in cases {
        let why = std::format!("{key}: {bytes:?}");
        let mut store = open(worn());
        block_on(store.store_checked(key, &bytes)).unwrap();
        let mut store = open(store.close().again());
        assert_eq!(store.settings(), Ok(()), "{why}");
        let found = block_on(store.skin());
        assert_eq!(found.ok(), (key != KEY_SKIN).then(|| skin(1.0)), "{why}");
        let found = block_on(store.calibration());
        let is_ours = found.is_ok_and(|found| found == Some(calibration(3)));
        assert_eq!(is_ours, key != KEY_CALIBRATION, "{why}");
        assert_eq!(block_on(store.false_alarm()).ok().flatten(), None, "{why}");
        assert_ne!(block_on(store.high_force()), Ok(true), "{why}");
        block_on(async {
            store.set_skin(&skin(2.0)).await.unwrap();
            store.set_calibration(&calibration(4)).await.unwrap();
            store.set_false_alarm(Some(0.05)).await.unwrap();
            store.set_high_force(true).await.unwrap();
        });
        let mut store = open(store.close().again());
        assert_eq!(block_on(store.skin()), Ok(skin(2.0)), "{why}");
        assert_eq!(
            block_on(store.calibration()),
            Ok(Some(calibration(4))),
            "{why}"
        );
        assert_eq!(block_on(store.false_alarm()), Ok(Some(0.05)), "{why}");
        assert_eq!(block_on(store.high_force()), Ok(true), "{why}");
    }
}
