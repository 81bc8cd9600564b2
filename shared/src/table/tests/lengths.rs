//! The sections of shorter slides: what they hold, what becomes of them when textures change, what is refused.

use super::damage::read_all;
use super::sections::{full, sealed};
use super::*;

/// [`full`] with other means, as slides of another length have.
fn of_length(by: i16) -> Vec<u8> {
    let mut bytes = full();
    for texture in 0..4 {
        for movement in 0..2 {
            let mut cell = Table::read(&bytes).unwrap().whitened(texture, movement);
            cell.mean[0] += by;
            retell(&mut bytes, texture, movement, &cell, Tally::default()).unwrap();
        }
    }
    bytes
}

/// [`full`], and two lengths, of which movement 1 has the first only: four textures, two movements, two features.
fn with_two() -> Vec<u8> {
    let (short, long) = (of_length(100), of_length(-100));
    let shorter =
        [(1000, &short, 0b11), (2500, &long, 0b01)].map(|(ms, bytes, movements)| Shorter {
            ms,
            table: Table::read(bytes).unwrap(),
            movements,
        });
    let mut out = vec![0; 8000];
    let whole = full();
    let table = with_lengths(&mut out, &Table::read(&whole).unwrap(), &shorter).unwrap();
    table.as_bytes().to_vec()
}

fn same_cells(table: &Table<'_>, at: u8, of: &Table<'_>, movement: u8) {
    for texture in 0..of.textures() {
        assert_eq!(table.whitened(texture, at), of.whitened(texture, movement));
    }
    let features = [700, -900];
    assert_eq!(table.whiten(at, &features), of.whiten(movement, &features));
    assert_eq!(table.limits_at(at), of.limits());
    let [own, others] = [(table, at), (of, movement)].map(|(t, m)| t.drifts(m).unwrap());
    assert!(own.eq(others));
    let [own, others] = [(table, at), (of, movement)].map(|(t, m)| t.population(m).unwrap());
    assert!(own.variances.eq(others.variances));
    let z = [300, 20];
    assert_eq!(own.axes.apply(&z), others.axes.apply(&z));
}

#[test]
fn shorter_slides_are_further_movements() {
    let bytes = with_two();
    let (whole, short, long) = (full(), of_length(100), of_length(-100));
    let [whole, short, long] = [&whole, &short, &long].map(|b| Table::read(b).unwrap());
    let table = Table::read(&bytes).unwrap();
    assert!(table.lengths_ms().eq([1000, 2500]));
    assert_eq!(table.movements().len(), 2);
    for movement in 0..2 {
        same_cells(&table, movement, &whole, movement);
        same_cells(&table, 2 + movement, &short, movement);
    }
    same_cells(&table, 4, &long, 0);
    assert_eq!([table.trials(0, 4), table.trials(0, 5)], [5, 0]);
    assert_eq!(table.trials(0, 6), 0, "there is no third length");
    let at = [(0, 0), (0, 1), (1, 2), (2, 1)].map(|(m, n)| table.at_length(m, n));
    assert_eq!(at, [None, Some(2), Some(5), None]);
    assert_eq!(
        table.lineage(),
        table.crc(),
        "it was made so, not learned later"
    );
    // without them it is what it was
    let mut out = vec![0; 8000];
    let without = with_lengths(&mut out, &table, &[]).unwrap();
    assert_eq!(without.as_bytes(), whole.as_bytes());
    read_all(&bytes);
}

#[test]
fn other_textures_are_known_by_whole_slides_only() {
    let bytes = with_two();
    let table = Table::read(&bytes).unwrap();
    let name = "x";
    let renamed = amended(&bytes, Change::Rename { texture: 0, name });
    let renamed = Table::read(&renamed).unwrap();
    assert!(renamed.lengths_ms().eq([1000, 2500]));
    for movement in 0..6 {
        same_cells(&renamed, movement, &table, movement);
    }
    // whatever else changes, it is as if the table had never known shorter slides
    for change in [Change::Forget(1), put("new"), put(table.name(2).unwrap())] {
        let [amended, expected] = [&bytes, &full()].map(|bytes| amended(bytes, change));
        let of_both = Table::read(&amended).unwrap();
        assert_eq!(of_both.lineage(), table.lineage());
        let lineage = of_both.layout().lineage;
        let but_lineage = |bytes: &[u8]| {
            let end = bytes.len() - CRC_BYTES;
            [bytes[..lineage].to_vec(), bytes[lineage + 4..end].to_vec()]
        };
        assert_eq!(but_lineage(&amended), but_lineage(&expected));
    }

    // a movement whose features have moved is known of whole slides only
    let mut moved = bytes.clone();
    recentre(&mut moved, 0, &[5, 6]).unwrap();
    let moved = Table::read(&moved).unwrap();
    for texture in 0..4 {
        let trials = [0, 1, 2, 3, 4, 5].map(|m| moved.trials(texture, m));
        assert_eq!(trials, [5, 4, 0, 4, 0, 0]);
    }
}

#[test]
fn properties_of_shorter_slides_are_read_too() {
    let cell = |mean: f32| around([(mean, 0.5), (mean, 0.25), (mean, 1.0)]);
    let of = |by: f32| -> Vec<u8> {
        let row = |t: f32| vec![cell(by + t), cell(by - t)];
        table_of(PropertySet::ALL, &[row(1.0), row(2.0), row(0.5)])
    };
    let (whole, short) = (of(0.0), of(0.125));
    let [whole, short] = [&whole, &short].map(|bytes| Table::read(bytes).unwrap());
    let shorter = Shorter {
        ms: 700,
        table: short,
        movements: 0b11,
    };
    let mut out = vec![0; 8000];
    let table = with_lengths(&mut out, &whole, &[shorter]).unwrap();
    for action in whole.actions() {
        let movement = action.movement + 2;
        for texture in 0..3 {
            let action_at = Action { movement, ..action };
            assert_eq!(
                table.gaussian(texture, action),
                whole.gaussian(texture, action)
            );
            assert_eq!(
                table.gaussian(texture, action_at),
                short.gaussian(texture, action)
            );
            let all = table.gaussians(action_at);
            assert_eq!(all.get(texture.into()), short.gaussian(texture, action));
        }
    }
}

#[test]
fn lengths_of_another_table_are_no_lengths_of_this_one() {
    let whole = full();
    let whole = Table::read(&whole).unwrap();
    let mut out = vec![0; 8000];
    let name = "x";
    let other = amended(whole.as_bytes(), Change::Rename { texture: 1, name });
    let other = Table::read(&other).unwrap();
    let shorter = |ms, table| Shorter {
        ms,
        table,
        movements: 3,
    };
    let wrong = with_lengths(&mut out, &whole, &[shorter(1000, other)]).unwrap_err();
    assert_eq!(wrong, EncodeError::Contents);
    // the shortest first, each once, and none of no length
    for two in [[1000, 1000], [2000, 1000], [0, 1000]] {
        let shorter = two.map(|ms| shorter(ms, whole));
        let wrong = with_lengths(&mut out, &whole, &shorter).unwrap_err();
        let invalid = EncodeError::Invalid(TableError::Section(6));
        assert_eq!(wrong, invalid, "{two:?}");
    }
}

#[test]
fn damaged_lengths_are_refused() {
    let whole = with_two();
    let length = |at: usize| usize::from(u16::from_le_bytes([whole[at + 2], whole[at + 3]]));
    let first = full().len() - CRC_BYTES;
    let second = first + 4 + length(first);
    assert_eq!((whole[first], whole[second]), (6, 6));
    assert_eq!(second + 4 + length(second), whole.len() - CRC_BYTES);
    let damaged = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = whole[..whole.len() - CRC_BYTES].to_vec();
        change(&mut bytes);
        Table::read(&sealed(bytes)).map(|_| ())
    };
    let refused = Err(TableError::Section(6));
    assert_eq!(damaged(&|_| ()), Ok(()));
    // magic, version, contents, textures, movements and features are those of the table; so is every movement
    let header = first + 4 + 2;
    for at in [0, 4, 6, 7, 12, 14, 15, 16, 19, 27] {
        assert_eq!(damaged(&|bytes| bytes[header + at] ^= 1), refused, "{at}");
    }
    // what nobody reads of it
    assert_eq!(damaged(&|bytes| bytes[header + 8] ^= 1), Ok(()));
    // binary places of a row
    let places = header + 16 + 2 * 6 + 2 * 2;
    assert_eq!(damaged(&|bytes| bytes[places] = 31), refused);
    // a length that is not longer
    assert_eq!(
        damaged(&|bytes| bytes[second + 4..second + 6].fill(0)),
        refused
    );
    // variances of the drift, and a variance of the population
    let drift = second - (52 + 2 * (14 + 8)) - 8;
    for at in [drift, second - 4] {
        let nan = f32::NAN.to_le_bytes();
        let change = |bytes: &mut Vec<u8>| bytes[at..at + 4].copy_from_slice(&nan);
        assert_eq!(damaged(&change), refused, "{at}");
    }
    let short = |bytes: &mut Vec<u8>| {
        bytes.truncate(bytes.len() - 2);
        let less = (length(second) - 2) as u16;
        bytes[second + 2..second + 4].copy_from_slice(&less.to_le_bytes());
    };
    assert_eq!(damaged(&short), refused);
    let none = |bytes: &mut Vec<u8>| {
        bytes.truncate(second);
        bytes.extend([6, 0, 0, 0]);
    };
    assert_eq!(damaged(&none), refused);
    assert_eq!(
        damaged(&|bytes| bytes.extend_from_within(second..)),
        refused,
        "twice"
    );
    let slopes = |bytes: &mut Vec<u8>| {
        let length = crate::table::slopes::length(2, 4, 2);
        bytes.extend([4, 0, length as u8, 0]);
        bytes.resize(bytes.len() + length, 0);
    };
    assert_eq!(damaged(&slopes), refused, "slopes, too");
    assert_eq!(damaged(&|bytes| bytes.truncate(first)), Ok(()));
    for length in 0..whole.len() {
        assert!(Table::read(&whole[..length]).is_err());
    }
}

proptest! {
    #![proptest_config(fixed(256))]

    #[test]
    fn no_damage_of_lengths_makes_it_panic(changes in proptest::collection::vec((0usize..4000, any::<u8>()), 1..5)) {
        let mut bytes = with_two();
        let (first, end) = (full().len() - CRC_BYTES, bytes.len() - CRC_BYTES);
        for (at, byte) in changes {
            bytes[first + at % (end - first)] = byte;
        }
        bytes.truncate(end);
        let bytes = sealed(bytes);
        read_all(&bytes);
        let Ok(table) = Table::read(&bytes) else {
            return Ok(());
        };
        for movement in 2..7 {
            let _ = table.whitened(3, movement);
            let _ = table.whiten(movement, &[i16::MIN; 2]);
            let _ = table.limits_at(movement);
        }
        let amended = amended(&bytes, Change::Forget(0));
        prop_assert_eq!(Table::read(&amended).unwrap().lengths_ms().count(), 0);
        let mut moved = bytes.clone();
        recentre(&mut moved, 1, &[1, 2]).unwrap();
        prop_assert!(Table::read(&moved).is_ok());
    }
}
