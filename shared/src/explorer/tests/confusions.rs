//! Degrees of confusion that are kept: what they promise is what is promised without them, to the bit.

use super::*;

fn kept<const N: usize>(explorer: &Explorer<'_, N>) -> Confusions<Vec<Degrees>> {
    let room = Confusions::<Vec<Degrees>>::room(explorer);
    // whatever was there before
    Confusions::new(explorer, vec![[f32::NAN; 4]; room]).unwrap()
}

/// Fails where an outlook differs in any bit.
pub(super) fn promise_the_same<const N: usize>(
    explorer: &Explorer<'_, N>,
    confusions: &Confusions<Vec<Degrees>>,
) {
    let bits = |o: &Outlook| (o.action, o.uncertainty.to_bits(), o.benefit.to_bits());
    let computed = explorer.outlook();
    let by_kept = explorer.outlook_by(confusions);
    assert!(by_kept.iter().map(bits).eq(computed.iter().map(bits)));
}

/// As [`promise_the_same`], with those of this explorer.
pub(super) fn promise_the_same_as_kept<const N: usize>(explorer: &Explorer<'_, N>) {
    promise_the_same(explorer, &kept(explorer));
}

proptest! {
    #![proptest_config(fixed(100))]

    /// Any number of textures, of which some are no candidates; every way of comparing properties.
    #[test]
    fn kept_degrees_promise_what_computed_ones_do(
        cells in proptest::collection::vec([(-1f32..1.0, 0.1f32..0.9), (-1f32..1.0, 0.1f32..0.9), (-1f32..1.0, 0.1f32..0.9)], 4..60),
        few in 2usize..30,
        slides in proptest::collection::vec((any::<prop::sample::Index>(), -1f32..1.0), 1..6),
    ) {
        let rows: Vec<Vec<_>> = cells.chunks_exact(2).map(<[_]>::to_vec).collect();
        let bytes = table_of_cells(&rows);
        let table = Table::read(&bytes).unwrap();
        for method in [Method::Paper, Method::Student, Method::StudentAll] {
            let config = Config { method, ..Config::default() };
            let candidates = (0..table.textures()).filter(|t| usize::from(*t) % few != 1);
            let mut explorer = Explorer::<30>::among(table, PropertySet::ALL, config, candidates).unwrap();
            let confusions = kept(&explorer);
            promise_the_same(&explorer, &confusions);
            for (at, x) in &slides {
                let actions: Vec<Action> = explorer.outlook().iter().map(|o| o.action).collect();
                explorer.observe(*at.get(&actions), &all(*x)).unwrap();
                promise_the_same(&explorer, &confusions);
            }
            // they may be computed at any time
            promise_the_same_as_kept(&explorer);
        }
    }
}

#[test]
fn memory_of_another_size_is_refused() {
    let bytes = plain(&[0.0, 0.2, 0.4], 2);
    let explorer = explorer(&bytes, Strategy::Bayesian);
    // six actions, four to a matrix
    let room = Confusions::<Vec<Degrees>>::room(&explorer);
    assert_eq!(room, 2 * 3 * 3);
    for wrong in [0, room - 1, room + 1] {
        assert!(Confusions::new(&explorer, vec![Degrees::default(); wrong]).is_none());
    }
}
