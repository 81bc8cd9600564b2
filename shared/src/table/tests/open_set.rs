//! A table's own figures: read back, kept when the table changes, refused where they are none.

use super::sections::{changed, full};
use super::*;
use crate::table::{OpenSet, Share, with_open_set};

const FIGURES: OpenSet = OpenSet {
    known_flagged: Share {
        share: 0.02,
        low: 0.0,
        high: 0.17,
    },
    new_noticed: Share {
        share: 1.0,
        low: 0.5,
        high: 1.0,
    },
    new_named: Share {
        share: 0.0,
        low: 0.0,
        high: 0.0,
    },
};

#[test]
fn figures_are_read_back_and_stay_when_textures_change() {
    let plain = full();
    let table = Table::read(&plain).unwrap();
    assert_eq!(table.open_set(), None);
    let mut out = vec![0; plain.len() + OpenSet::LENGTH];
    let noted = with_open_set(&mut out, &table, &FIGURES).unwrap();
    assert_eq!(noted.as_bytes().len(), plain.len() + OpenSet::LENGTH);
    assert_eq!(noted.open_set(), Some(FIGURES));
    assert_eq!(
        (noted.limits(), noted.drift()),
        (table.limits(), table.drift())
    );
    let forgotten = amended(noted.as_bytes(), Change::Forget(1));
    assert_eq!(Table::read(&forgotten).unwrap().open_set(), Some(FIGURES));
    // in the place of those before, and never in a table of Gaussians
    let other = OpenSet {
        new_noticed: FIGURES.new_named,
        ..FIGURES
    };
    let mut again = vec![0; noted.as_bytes().len()];
    let again = with_open_set(&mut again, &noted, &other).unwrap();
    assert_eq!(again.open_set(), Some(other));
    let gaussians = small();
    let mut out = vec![0; 400];
    let refused = with_open_set(&mut out, &Table::read(&gaussians).unwrap(), &FIGURES);
    let wanted = EncodeError::Invalid(TableError::Section(7));
    assert_eq!(refused.map(|table| table.as_bytes().len()), Err(wanted));
}

proptest! {
    #[test]
    fn only_shares_within_their_intervals_are_figures(
        numbers in proptest::array::uniform9(prop_oneof![
            4 => 0.0f32..=1.0,
            1 => any::<f32>(),
            1 => Just(1.0 + f32::EPSILON),
        ]),
        sorted in any::<bool>(),
        bytes in prop_oneof![3 => Just(36), 1 => 0usize..60],
    ) {
        let mut numbers = numbers;
        if sorted {
            for of in numbers.chunks_mut(3) {
                of.sort_by(f32::total_cmp);
                of.swap(0, 1);
            }
        }
        let section = |times: usize| changed(|table, _| for _ in 0..times {
            table.extend([7, 0]);
            table.extend((bytes as u16).to_le_bytes());
            let numbers = numbers.iter().flat_map(|number| number.to_le_bytes());
            table.extend(numbers.chain([0; 60]).take(bytes));
        });
        let is_one = |of: &[f32]| of[1] >= 0.0 && of[1] <= of[0] && of[0] <= of[2] && of[2] <= 1.0;
        let are = bytes == 36 && numbers.chunks(3).all(is_one);
        let read = |times| Table::read(&section(times)).map(|table| table.open_set().is_some());
        prop_assert_eq!(read(1), if are { Ok(true) } else { Err(TableError::Section(7)) });
        prop_assert_eq!(read(2), Err(TableError::Section(7)));
    }
}
