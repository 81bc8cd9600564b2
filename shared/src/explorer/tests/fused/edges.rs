//! Far-off values, strategies, and tables or slides that do not suit.

use super::*;

#[test]
fn far_off_values_neither_overflow_nor_panic() {
    let ends = [i16::MAX, i16::MIN, 0, 1];
    let whole = |slides, mean| Whitened {
        slides,
        mean: [mean; 28],
    };
    let rows = [
        [whole(1, i16::MAX), whole(255, i16::MAX)],
        [whole(255, i16::MIN), whole(0, 0)],
        [whole(5, 0), whole(5, 1)],
        [whole(5, 0), whole(5, 1)],
    ];
    // the steepest whitening there is: it saturates
    let mut bytes = vec![0; 2 * 28 + 28];
    (0..28 * 28).for_each(|_| bytes.extend(i16::MAX.to_le_bytes()));
    let steep = Whitening::read(&bytes, 28).unwrap();
    for whitening in [straight(28), steep] {
        let rows: Vec<Vec<Whitened>> = rows.iter().map(|row| row.to_vec()).collect();
        let bytes = fused_of(FeatureSet::Pressure, &vec![whitening; 2], &rows);
        for x in ends {
            for y in ends {
                let mut explorer = fused(&bytes, OPEN);
                for n in 0..300 {
                    let slide = Observation {
                        pressure: Some([x, y]),
                        bands: heapless::Vec::from_slice(&[x; 26]).unwrap(),
                        ..Observation::default()
                    };
                    let movement = (n / 3 % 2) as u8;
                    explorer.observe(look(movement), &slide).unwrap();
                    let posterior = explorer.posterior();
                    let sum: f32 = posterior.iter().sum();
                    assert!((sum - 1.0).abs() < 1e-5, "{x} {y}: {posterior:?}");
                    assert!(posterior.iter().all(|p| (0.0..=1.0).contains(p)));
                    assert!(explorer.log_odds().is_some_and(f32::is_finite));
                    if n % 50 == 0 {
                        let mut outcomes = explorer.expected_outcomes().into_iter();
                        let within = |x: f32| (0.0..=1.0).contains(&x);
                        assert!(outcomes.all(|o| within(o.uncertainty) && within(o.benefit)));
                    }
                }
            }
        }
    }
}

#[test]
fn cycling_goes_through_the_movements_in_turn() {
    let row = |mean: f64| vec![known(5, &[mean]); 3];
    let bytes = straight_table(1, &[row(0.0), row(1.0)]);
    let config = Config {
        strategy: Strategy::Cycling,
        ..OPEN
    };
    let mut explorer = fused(&bytes, config);
    assert!(explorer.turns().eq([look(0), look(1), look(2)]));
    for slide in 0..7 {
        let outcomes = explorer.expected_outcomes();
        let action = explorer.choose(&outcomes, 99);
        assert_eq!(action, look(slide % 3));
        explorer.observe(action, &at(&[0.5])).unwrap();
    }
    let random = Config {
        strategy: Strategy::Random,
        ..OPEN
    };
    let explorer = fused(&bytes, random);
    let outcomes = explorer.expected_outcomes();
    let drawn = [0, u32::MAX / 2, u32::MAX].map(|random| explorer.choose(&outcomes, random));
    assert_eq!(drawn, [look(0), look(1), look(2)]);
}

#[test]
fn the_method_must_suit_the_table_and_the_rig_its_features() {
    let fused_bytes = axes();
    let gaussians = plain(&[0.0, 1.0], 1);
    fn begin(bytes: &[u8], method: Method, measured: PropertySet) -> Result<(), ExplorerError> {
        let config = Config { method, ..OPEN };
        Twenty::new(Table::read(bytes).unwrap(), measured, config).map(|_| ())
    }
    let all = PropertySet::ALL;
    for method in [Method::Paper, Method::Student, Method::StudentAll] {
        let error = begin(&fused_bytes, method, all).unwrap_err();
        assert_eq!(error, ExplorerError::Method(method));
        assert!(error.to_string().contains(method.name()), "{error}");
        assert_eq!(begin(&gaussians, method, all), Ok(()));
        assert!(method.suits(Table::read(&gaussians).unwrap().contents()));
    }
    let error = begin(&gaussians, Method::Fused, all).unwrap_err();
    assert_eq!(error, ExplorerError::Method(Method::Fused));
    assert!(error.to_string().contains("whitened features"), "{error}");
    for bytes in [&fused_bytes, &gaussians] {
        let contents = Table::read(bytes).unwrap().contents();
        assert!(Method::of(contents).suits(contents));
    }
    // bands need nothing but the sensor
    assert_eq!(
        begin(&fused_bytes, Method::Fused, PropertySet::default()),
        Ok(())
    );
    let no_force: PropertySet = [Property::Roughness, Property::Fineness]
        .into_iter()
        .collect();
    for (set, features, missing) in [
        (FeatureSet::Force, 13, true),
        (FeatureSet::Pressure, 14, false),
        (FeatureSet::Properties, 3, true),
    ] {
        let bytes = fused_of(set, &[straight(features)], &[vec![known(2, &[0.0])]]);
        let error = missing.then_some(ExplorerError::Features(set));
        assert_eq!(begin(&bytes, Method::Fused, no_force).err(), error);
        assert_eq!(begin(&bytes, Method::Fused, all), Ok(()));
        if let Some(error) = error {
            assert!(error.to_string().contains(set.name()), "{error}");
        }
    }
}

#[test]
fn a_slide_without_the_features_is_not_used() {
    let bytes = axes();
    let mut explorer = fused(&bytes, OPEN);
    explorer.observe(look(0), &at(&[5.0, 1.0, 0.0])).unwrap();
    let before = (
        state(&mut explorer),
        explorer.observed().collect::<Vec<_>>(),
    );
    let missing = ObserveError::Features(FeatureSet::Bands);
    for slide in [
        Observation::default(),
        all(1.0),
        at(&[1.0; 2]),
        at(&[1.0; 4]),
    ] {
        assert_eq!(explorer.observe(look(1), &slide), Err(missing));
    }
    assert!(missing.to_string().contains("band powers"), "{missing}");
    for action in [look(2), act(0, Property::Traction)] {
        let slide = at(&[5.0, 1.0, 0.0]);
        assert_eq!(
            explorer.observe(action, &slide),
            Err(ObserveError::Action(action))
        );
    }
    assert_eq!(
        (
            state(&mut explorer),
            explorer.observed().collect::<Vec<_>>()
        ),
        before
    );
    // and a new exploration knows nothing of the last one
    explorer.restart();
    let mut new = fused(&bytes, OPEN);
    assert_eq!(state(&mut explorer), state(&mut new));
    assert_eq!(
        (explorer.log_odds(), explorer.observed().count()),
        (None, 0)
    );
}
