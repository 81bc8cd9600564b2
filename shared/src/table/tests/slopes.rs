//! The section of slopes over speed: what it holds, what becomes of it when textures change, what is refused.

use super::damage::read_all;
use super::sections::{full, sealed};
use super::*;
use crate::table::{Drifts, Pace, Population, Sections, Slope, Slopes, with_sections};

/// A table with drift and limits that knows speeds besides.
pub(crate) fn paced(bytes: &[u8], paces: &[Pace], slopes: &[Slope]) -> Vec<u8> {
    let table = Table::read(bytes).unwrap();
    let drifts: Vec<Drifts> = (0..paces.len() as u8)
        .map(|movement| {
            let mut drifts = Drifts::default();
            let variances = table.drifts(movement).into_iter().flatten();
            drifts
                .iter_mut()
                .zip(variances)
                .for_each(|(to, from)| *to = from);
            drifts
        })
        .collect();
    let populations = table.populations().unwrap();
    let populations: &[Population] = &populations;
    let sections = Sections {
        drift: (table.drift().unwrap(), &drifts),
        novelty: Some((table.limits().unwrap(), populations)),
        slopes: Some(Slopes { paces, slopes }),
    };
    let mut out = vec![0; bytes.len() + 60_000];
    let paced = with_sections(&mut out, &table, &sections).unwrap();
    paced.as_bytes().to_vec()
}

/// Two features, as [`full`] has.
fn slope(of: i16) -> Slope {
    let mut slope = Slope::default();
    slope[..2].copy_from_slice(&[of, -3 * of]);
    slope
}

fn pace(at: i16) -> Pace {
    Pace {
        mean: 10 * at - 5,
        variance: 0.04 + f32::from(at),
        pooled: slope(1000 + at),
    }
}

/// [`full`] with slopes: four textures, two movements.
fn with_slopes() -> Vec<u8> {
    let slopes: Vec<Slope> = (0..8).map(slope).collect();
    paced(&full(), &[pace(0), pace(1)], &slopes)
}

#[test]
fn slopes_read_back_and_follow_their_textures() {
    let bytes = with_slopes();
    assert_eq!(bytes.len(), full().len() + 4 + 2 * (6 + 4) + 8 * 4);
    let table = Table::read(&bytes).unwrap();
    assert!(table.is_paced() && !Table::read(&full()).unwrap().is_paced());
    for movement in 0..2 {
        let view = table.slopes_at(movement).unwrap();
        let expected = pace(movement.into());
        assert_eq!(
            (view.mean, view.variance),
            (expected.mean, expected.variance)
        );
        assert_eq!(table.slope(None, movement), expected.pooled);
        for texture in 0..4 {
            let own = slope((texture * 2 + u16::from(movement)) as i16);
            assert_eq!(table.slope(Some(texture), movement), own);
            let [low, high, ..] = *view.column.mean(texture.into()) else {
                panic!()
            };
            assert_eq!(i16::from_le_bytes([low, high]), own[0]);
        }
        assert_eq!(table.slope(Some(4), movement), expected.pooled);
    }
    assert!(table.slopes_at(2).is_none());
    assert_eq!(
        Table::read(&full()).unwrap().slope(Some(0), 0),
        Slope::default()
    );

    let of = |bytes: &[u8]| -> Vec<Slope> {
        let table = Table::read(bytes).unwrap();
        let textures = 0..table.textures();
        textures.map(|t| table.slope(Some(t), 1)).collect()
    };
    let [s0, s1, s2, s3] = [1, 3, 5, 7].map(slope);
    let forgotten = amended(&bytes, Change::Forget(1));
    assert_eq!(of(&forgotten), [s0, s2, s3]);
    let added = amended(&forgotten, put("new"));
    assert_eq!(of(&added), [s0, s2, s3, pace(1).pooled]);
    let name = "x";
    for change in [
        put(table.name(2).unwrap()),
        Change::Rename { texture: 0, name },
    ] {
        assert_eq!(of(&amended(&bytes, change)), [s0, s1, s2, s3]);
    }
    // all but the slopes are as they were, and so is what a probe learns
    let added = Table::read(&added).unwrap();
    assert_eq!(
        (added.drift(), added.limits()),
        (table.drift(), table.limits())
    );
    assert_eq!(
        (added.textures(), added.populations().unwrap().len()),
        (4, 2)
    );
}

#[test]
fn damaged_slopes_are_refused() {
    let whole = with_slopes();
    // kind, length, contents
    let at = whole.len() - CRC_BYTES - (4 + 2 * (6 + 4) + 8 * 4);
    assert_eq!(whole[at..at + 4], [4, 0, 52, 0]);
    let damaged = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = whole[..whole.len() - CRC_BYTES].to_vec();
        change(&mut bytes);
        let bytes = sealed(bytes);
        Table::read(&bytes).map(|_| ())
    };
    assert_eq!(damaged(&|_| ()), Ok(()));
    for variance in [f32::NAN, -0.1, 4.1] {
        let set = |bytes: &mut Vec<u8>| {
            bytes[at + 6..at + 10].copy_from_slice(&variance.to_le_bytes());
        };
        assert_eq!(damaged(&set), Err(TableError::Section(4)), "{variance}");
    }
    let short = |bytes: &mut Vec<u8>| {
        bytes.truncate(bytes.len() - 2);
        bytes[at + 2] = 50;
    };
    assert_eq!(damaged(&short), Err(TableError::Section(4)));
    let twice = |bytes: &mut Vec<u8>| bytes.extend_from_within(at..);
    assert_eq!(damaged(&twice), Err(TableError::Section(4)));
    for length in 0..whole.len() {
        assert!(Table::read(&whole[..length]).is_err());
    }
    read_all(&whole);
}
