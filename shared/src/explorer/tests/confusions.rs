//! Degrees of confusion that are kept: the expected outcomes computed from them equal those computed afresh, to the bit.

use super::*;

fn kept<const N: usize>(explorer: &Explorer<'_, N>) -> Confusions<Vec<Degrees>> {
    let needed = Confusions::<Vec<Degrees>>::len_for(explorer);
    // whatever was there before
    Confusions::new(explorer, vec![[f32::NAN; 4]; needed]).unwrap()
}

/// Fails where an expected outcome differs in any bit.
pub(super) fn expect_the_same<const N: usize>(
    explorer: &Explorer<'_, N>,
    confusions: &Confusions<Vec<Degrees>>,
) {
    let bits = |o: &ExpectedOutcome| (o.action, o.uncertainty.to_bits(), o.benefit.to_bits());
    let computed = explorer.expected_outcomes();
    let by_kept = explorer.expected_outcomes_by(confusions);
    assert!(by_kept.iter().map(bits).eq(computed.iter().map(bits)));
}

/// As [`expect_the_same`], with the degrees of confusion of this explorer.
pub(super) fn expect_the_same_as_kept<const N: usize>(explorer: &Explorer<'_, N>) {
    expect_the_same(explorer, &kept(explorer));
}

proptest! {
    #![proptest_config(fixed(100))]

    /// Any number of textures, of which some are no candidates; every way of comparing properties.
    #[test]
    fn kept_degrees_give_the_outcomes_of_computed_ones(
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
            expect_the_same(&explorer, &confusions);
            for (at, x) in &slides {
                let actions: Vec<Action> = explorer.expected_outcomes().iter().map(|o| o.action).collect();
                explorer.observe(*at.get(&actions), &all(*x)).unwrap();
                expect_the_same(&explorer, &confusions);
            }
            // they may be computed at any time
            expect_the_same_as_kept(&explorer);
        }
    }
}

#[test]
fn memory_of_another_size_is_refused() {
    let bytes = plain(&[0.0, 0.2, 0.4], 2);
    let explorer = explorer(&bytes, Strategy::Bayesian);
    // six actions, four to a matrix, which has one row more than textures
    let needed = Confusions::<Vec<Degrees>>::len_for(&explorer);
    assert_eq!(needed, 2 * 3 * 4);
    for wrong in [0, needed - 1, needed + 1] {
        assert!(Confusions::new(&explorer, vec![Degrees::default(); wrong]).is_none());
    }
}
