//! A table's notes on samples: read back, carried over by a probe that learns, renames and deletes, and no part of a
//! decision.

use super::damage::read_all;
use super::sections::{changed, full};
use super::*;
use crate::sensor::{FingerCode, FingerName};

const NOTES: [Option<bool>; 4] = [Some(true), Some(false), None, Some(true)];

fn noted() -> Vec<u8> {
    let bytes = full();
    let mut out = vec![0; bytes.len() + 24];
    let table = Table::read(&bytes).unwrap();
    let noted = with_moved(&mut out, &table, |texture| NOTES[usize::from(texture)]);
    noted.unwrap().as_bytes().to_vec()
}

fn said(table: &Table<'_>) -> Vec<Option<bool>> {
    (0..table.textures()).map(|t| table.moved(t)).collect()
}

#[test]
fn it_is_read_back_and_the_rest_stays_to_the_bit() {
    let (plain, noted) = (full(), noted());
    let table = Table::read(&noted).unwrap();
    assert_eq!(said(&table), NOTES);
    assert_eq!(table.check_samples(), Ok(()));
    // three of 5 bytes, and kind and length
    assert_eq!(noted.len(), plain.len() + 4 + 15);
    let without = Table::read(&plain).unwrap();
    assert_eq!(
        (without.check_samples(), said(&without)),
        (Ok(()), vec![None; 4])
    );
    assert_eq!(
        (table.drift(), table.limits()),
        (without.drift(), without.limits())
    );
    assert_eq!(table.drifts, without.drifts);
    assert_eq!(table.novelty, without.novelty);
    let cells = table.layout().cells..table.layout().lineage;
    assert_eq!(noted[cells.clone()], plain[cells]);
    // nothing known: nothing written
    let mut out = vec![0; noted.len()];
    let none = with_moved(&mut out, &table, |_| None).unwrap();
    assert_eq!(none.as_bytes().len(), plain.len());
    assert_eq!(none.lineage(), without.crc());
    // a table of Gaussians can have it, too
    let small = small();
    let table = Table::read(&small).unwrap();
    let mut out = vec![0; small.len() + 24];
    let noted = with_moved(&mut out, &table, |_| Some(false)).unwrap();
    assert!(said(&noted).iter().all(|moved| *moved == Some(false)));
    assert_eq!(noted.experience(0, 0), table.experience(0, 0));
}

#[test]
fn a_probe_that_learns_and_deletes_carries_it_over() {
    let bytes = noted();
    let table = Table::read(&bytes).unwrap();
    let rename = Change::Rename {
        texture: 1,
        name: "x",
    };
    let [n0, n1, n2, n3] = NOTES;
    for (change, notes) in [
        // nobody said it of a new one
        (put("new"), &[n0, n1, n2, n3, None][..]),
        (put(table.name(1).unwrap()), &NOTES),
        (Change::Forget(0), &NOTES[1..]),
        // another name: nothing is claimed of it, and the others keep theirs
        (rename, &[n0, None, n2, n3]),
    ] {
        let bytes = amended(&bytes, change);
        assert_eq!(said(&Table::read(&bytes).unwrap()), notes);
    }
    let mut told = bytes.clone();
    retell(&mut told, 1, 0, &NEW[0], Tally::default()).unwrap();
    assert_eq!(said(&Table::read(&told).unwrap()), NOTES);
    recentre(&mut told, 0, &[5, 6]).unwrap();
    assert_eq!(said(&Table::read(&told).unwrap()), NOTES);
    // a texture with the number of a deleted one does not get its note
    let more = amended(&amended(&bytes, Change::Forget(3)), put("new"));
    let more = Table::read(&more).unwrap();
    assert_eq!((more.number(3), more.moved(3)), (table.number(3), None));
}

#[test]
fn what_is_damaged_says_nothing_and_is_reported_to_who_looks() {
    let section = |contents: &[u8]| {
        changed(|bytes, _| {
            bytes.extend([3, 0]);
            bytes.extend((contents.len() as u16).to_le_bytes());
            bytes.extend(contents);
        })
    };
    for contents in [&[1, 2, 3][..], &[0, 0, 1, 2, 3], &[0, 0, 1, 2, 2, 9]] {
        let bytes = section(contents);
        let table = Table::read(&bytes).unwrap();
        assert_eq!(table.check_samples(), Err(TableError::Section(3)));
        assert_eq!(said(&table), [None; 4]);
        read_all(&bytes);
    }
}

#[test]
fn the_finger_stays_when_a_table_learns_and_a_table_without_one_is_a_biotacs() {
    let plain = table_of(
        PropertySet::ALL,
        &[vec![around([(1.0, 0.1); 3])], vec![around([(2.0, 0.1); 3])]],
    );
    let old = Table::read(&plain).unwrap();
    assert_eq!((old.finger(), old.calibrated()), (FingerCode::BIOTAC, 0));
    // one of a later day, too
    for finger in [FingerCode::MEMS, FingerCode(200)] {
        let mut buffers = [[0; 400]; 4];
        let [named, moved, amended, back] = &mut buffers;
        let named = with_finger(named, &old, finger, 20_261_124, "").unwrap();
        let moved = with_moved(moved, &named, |_| Some(true)).unwrap();
        let amended = amend(amended, &moved, Change::Forget(0)).unwrap();
        for table in [named, moved, amended] {
            assert_eq!((table.finger(), table.calibrated()), (finger, 20_261_124));
            assert_eq!(
                table.of_finger(finger).map(|table| table.crc()),
                Ok(table.crc())
            );
            let probe = FingerCode::of(FingerName::Analog);
            let refused = table.of_finger(probe).map(|table| table.crc());
            let why = TableError::Finger {
                table: finger,
                probe,
            };
            assert_eq!(refused, Err(why));
            let why = why.to_string();
            assert!(
                why.contains(&finger.to_string())
                    && why.contains("Use a table that was learned with analog"),
                "{why}"
            );
        }
        let back = with_finger(back, &moved, FingerCode::BIOTAC, 0, "").unwrap();
        assert_eq!(
            (back.finger(), back.moved(1)),
            (FingerCode::BIOTAC, Some(true))
        );
    }
}
