//! When to stop, what to leave out, whom to believe: the explorer's rules one by one.

use super::*;

#[test]
fn the_papers_settings() {
    let config = Config::default();
    assert_eq!(
        (config.strategy, config.threshold, config.max_slides),
        (Strategy::Bayesian, 0.99, 10)
    );
    assert_eq!(Config::PAIR_THRESHOLD, 0.999);
}

#[test]
fn benefit_stays_within_0_and_1() {
    assert_eq!((benefit(0.0, 0), benefit(1.0, 7)), (1.0, 0.0));
    // eq. 11 may leave 0 to 1 by rounding
    assert_eq!((benefit(-1e-7, 1), benefit(1.0 + 1e-6, 1)), (1.0, 0.0));
    assert_eq!(benefit(0.25, 1), 0.5);
}

#[test]
fn of_equal_actions_the_first_is_chosen() {
    // means that every property holds exactly
    let bytes = plain(&[0.0, 0.25, 0.5], 3);
    let mut explorer = explorer(&bytes, Strategy::Bayesian);
    let mut order = Vec::new();
    for _ in 0..11 {
        let outcomes = explorer.expected_outcomes();
        let action = explorer.choose(&outcomes, u32::MAX);
        order.push(index(action));
        // half-way between all: nothing is learned of the first two, the third is left out at once
        explorer.observe(action, &all(0.125)).unwrap();
    }
    assert_eq!(order, [0, 1, 2, 3, 4, 5, 6, 7, 8, 0, 1]);
    let both = &explorer.posterior()[..2];
    assert!((both[0] - both[1]).abs() < 1e-3 && both[0] > 0.4);
}

#[test]
fn the_answer_exceeds_the_threshold_or_is_the_best_after_the_last_slide() {
    let bytes = plain(&[0.0, 0.2, 0.4], 1);
    let table = Table::read(&bytes).unwrap();
    let with = |threshold, max_slides| {
        let config = Config {
            threshold,
            max_slides,
            ..Config::default()
        };
        Eight::new(table, PropertySet::ALL, config).unwrap()
    };
    let action = act(0, Property::Fineness);
    fn observed(mut explorer: Eight<'_>) -> Eight<'_> {
        explorer
            .observe(act(0, Property::Fineness), &all(0.27))
            .unwrap();
        explorer
    }
    let first = observed(with(0.99, 10));
    assert_eq!(first.verdict(), None);
    let best = first.best();
    assert_eq!((best.texture, best.sure), (1, false));
    assert_eq!(best.probability, first.posterior()[1]);
    // at the threshold is not above it
    assert_eq!(observed(with(best.probability, 10)).verdict(), None);
    let below = best.probability.next_down();
    let sure = Verdict { sure: true, ..best };
    assert_eq!((best.unknown, best.log_odds), (false, None));
    assert_eq!(observed(with(below, 10)).verdict(), Some(sure));
    // the last slide
    assert_eq!(observed(with(0.99, 1)).verdict(), Some(best));
    let mut second = observed(with(0.99, 2));
    assert_eq!(second.verdict(), None);
    second.observe(action, &all(0.27)).unwrap();
    assert_eq!(second.verdict(), Some(second.best()));
    // before the first slide all are equal, and the first is named
    let new = with(0.99, 10);
    assert_eq!((new.verdict(), new.best().texture), (None, 0));
    assert_eq!(new.posterior(), [1.0 / 3.0; 3]);
}

#[test]
fn cycling_takes_the_best_action_of_each_property_in_turn() {
    // traction tells best at movement 2, roughness at 1, fineness the same at 1 and 2
    let apart = |traction: f32, roughness: f32, fineness: f32| {
        [(traction, 0.1), (roughness, 0.1), (fineness, 0.1)]
    };
    let bytes = table_of_cells(&[
        vec![
            apart(0.0, 0.0, 0.0),
            apart(0.0, 0.0, 0.0),
            apart(0.0, 0.0, 0.0),
        ],
        vec![
            apart(0.1, 0.1, 0.0),
            apart(0.1, 0.3, 0.2),
            apart(0.2, 0.2, 0.2),
        ],
    ]);
    let each = [
        act(2, Property::Traction),
        act(1, Property::Roughness),
        act(1, Property::Fineness),
    ];
    let mut explorer = explorer(&bytes, Strategy::Cycling);
    assert_eq!(explorer.turns().collect::<Vec<_>>(), each);
    for turn in 0..8 {
        let outcomes = explorer.expected_outcomes();
        let action = explorer.choose(&outcomes, turn);
        assert_eq!(action, each[turn as usize % 3]);
        // a slide that is not used is no turn
        assert!(explorer.observe(action, &Observation::default()).is_err());
        assert_eq!(explorer.choose(&outcomes, turn), action);
        explorer.observe(action, &all(0.1)).unwrap();
        assert_eq!(explorer.turns().collect::<Vec<_>>(), each);
    }
    let two: PropertySet = [Property::Roughness, Property::Fineness]
        .into_iter()
        .collect();
    let mut explorer = Eight::new(explorer.table(), two, config(Strategy::Cycling)).unwrap();
    for turn in 0..4 {
        let outcomes = explorer.expected_outcomes();
        let action = explorer.choose(&outcomes, 0);
        assert_eq!(action, each[1 + turn % 2]);
        explorer.observe(action, &all(0.1)).unwrap();
    }
}

#[test]
fn random_takes_every_action_equally_often() {
    let bytes = plain(&[0.0, 0.2], 3);
    let explorer = explorer(&bytes, Strategy::Random);
    let outcomes = explorer.expected_outcomes();
    let mut count = BTreeMap::new();
    for n in 0..1u32 << 16 {
        let action = explorer.choose(&outcomes, n << 16);
        *count.entry(index(action)).or_insert(0u32) += 1;
    }
    assert!(count.keys().copied().eq(0..9));
    assert!(
        count.values().all(|&n| n.abs_diff((1 << 16) / 9) <= 1),
        "{count:?}"
    );
    assert_eq!(explorer.choose(&outcomes, 0), act(0, Property::Traction));
    assert_eq!(
        explorer.choose(&outcomes, u32::MAX),
        act(2, Property::Fineness)
    );
}

#[test]
fn what_the_rig_cannot_measure_is_never_chosen() {
    // traction alone tells the two apart
    let row = |traction| vec![[(traction, 0.1), (0.0, 0.1), (0.0, 0.1)]; 2];
    let bytes = table_of_cells(&[row(0.0), row(1.0)]);
    let table = Table::read(&bytes).unwrap();
    let two: PropertySet = [Property::Roughness, Property::Fineness]
        .into_iter()
        .collect();
    for strategy in [Strategy::Bayesian, Strategy::Cycling, Strategy::Random] {
        let mut explorer = Eight::new(table, two, config(strategy)).unwrap();
        for n in 0..20 {
            let outcomes = explorer.expected_outcomes();
            assert_eq!(outcomes.len(), 4);
            let action = explorer.choose(&outcomes, n * 214_748_364);
            assert_ne!(action.property, Some(Property::Traction));
            explorer.observe(action, &all(0.0)).unwrap();
        }
        let traction = act(0, Property::Traction);
        assert_eq!(
            explorer.observe(traction, &all(0.0)),
            Err(ObserveError::Action(traction))
        );
        assert_eq!(explorer.slides(), 20);
    }
    // nor what the table was not learned from
    let trials = [vec![around([(0.0, 0.1); 3])], vec![around([(1.0, 0.1); 3])]];
    let bytes = table_of(only(Property::Fineness), &trials);
    let explorer = explorer(&bytes, Strategy::Bayesian);
    assert!(
        explorer
            .expected_outcomes()
            .iter()
            .map(|o| o.action)
            .eq([act(0, Property::Fineness)])
    );
}

#[test]
fn movements_that_not_every_candidate_was_trained_at_are_left_out() {
    let twice = |mean: f32| around([(mean, 0.1); 3]);
    let once = vec![[2.0; 3]];
    let bytes = table_of(
        PropertySet::ALL,
        &[
            vec![twice(0.0), twice(0.0), once.clone()],
            vec![twice(1.0), twice(1.0), twice(1.0)],
            vec![twice(2.0), once, twice(2.0)],
        ],
    );
    let table = Table::read(&bytes).unwrap();
    let movements = |candidates: &[u16]| {
        let explorer = Eight::among(
            table,
            PropertySet::ALL,
            Config::default(),
            candidates.to_vec(),
        )?;
        let mut movements: Vec<u8> = explorer
            .expected_outcomes()
            .iter()
            .map(|o| o.action.movement)
            .collect();
        movements.dedup();
        Ok::<_, ExplorerError>(movements)
    };
    assert_eq!(movements(&[0, 1, 2]), Ok(vec![0]));
    assert_eq!(movements(&[0, 1]), Ok(vec![0, 1]));
    assert_eq!(movements(&[1, 2]), Ok(vec![0, 2]));
    assert_eq!(movements(&[1]), Ok(vec![0, 1, 2]));
    let mut explorer = explorer(&bytes, Strategy::Bayesian);
    let untrained = act(1, Property::Roughness);
    assert_eq!(
        explorer.observe(untrained, &all(1.0)),
        Err(ObserveError::Action(untrained))
    );
}

#[test]
fn the_whole_grid_fits() {
    let bytes = plain(&[0.0, 1.0], 36);
    let explorer = explorer(&bytes, Strategy::Random);
    let outcomes = explorer.expected_outcomes();
    assert_eq!(outcomes.len(), 108);
    assert_eq!(
        explorer.choose(&outcomes, u32::MAX),
        act(35, Property::Fineness)
    );
}

/// Far away from everything the widest distribution is the least improbable, and numbers stay numbers.
#[test]
fn far_off_values_neither_overflow_nor_stick() {
    let cell = |mean, sd| vec![[(mean, sd); 3]];
    let bytes = table_of_cells(&[
        cell(7.9, 0.001),
        cell(-7.9, 0.001),
        cell(0.0, 1.0),
        cell(0.5, 0.5),
    ]);
    let action = act(0, Property::Roughness);
    for x in [f32::MAX, f32::MIN, 1e10, 1000.0, -1000.0, 33.0, 32.0] {
        let mut explorer = explorer(&bytes, Strategy::Bayesian);
        for n in 1..=300u16 {
            explorer.observe(action, &all(x)).unwrap();
            let posterior = explorer.posterior();
            assert!(
                posterior.iter().all(|p| (0.0..=1.0).contains(p)),
                "{x} {posterior:?}"
            );
            assert_eq!(explorer.best().texture, 2);
            assert_eq!(u16::from(explorer.slides()), n.min(255));
        }
        assert!(
            explorer
                .expected_outcomes()
                .iter()
                .all(|o| (0.0..=1.0).contains(&o.benefit) && o.uncertainty >= 0.0)
        );
    }
    // beyond 32 all roughnesses are alike
    let after = |x| {
        let mut explorer = explorer(&bytes, Strategy::Bayesian);
        explorer.observe(action, &all(x)).unwrap();
        explorer.log.clone()
    };
    assert_eq!(after(32.0), after(1e10));
    assert_eq!(after(-32.0), after(-1e10));
    assert_ne!(after(31.0), after(32.0));
    // one outlier is outvoted
    let mut explorer = explorer(&bytes, Strategy::Bayesian);
    explorer.observe(action, &all(7.9)).unwrap();
    explorer.observe(action, &all(8.0)).unwrap();
    assert_eq!(explorer.best().texture, 2, "100 standard deviations off");
    for _ in 0..1000 {
        explorer.observe(action, &all(7.9)).unwrap();
    }
    assert_eq!(explorer.best().texture, 0);
}

#[test]
fn a_slide_without_the_property_is_not_used() {
    let bytes = plain(&[0.0, 0.2, 0.4], 2);
    let mut explorer = explorer(&bytes, Strategy::Bayesian);
    explorer
        .observe(act(0, Property::Traction), &all(0.1))
        .unwrap();
    let before = state(&mut explorer);
    for property in Property::ALL {
        for value in [
            None,
            Some(f32::NAN),
            Some(f32::INFINITY),
            Some(f32::NEG_INFINITY),
        ] {
            let mut values = [Some(0.1); 3];
            values[property.index()] = value;
            let slide = Properties::new(values).into();
            assert_eq!(
                explorer.observe(act(1, property), &slide),
                Err(ObserveError::Missing(property))
            );
        }
        let action = act(2, property);
        assert_eq!(
            explorer.observe(action, &all(0.1)),
            Err(ObserveError::Action(action))
        );
    }
    assert_eq!(state(&mut explorer), before);
}

/// Checks that left-out textures change the uncertainty by no more than twice their probability.
#[test]
fn negligible_textures_change_little() {
    let means: Vec<f32> = (0..8).map(|n| 0.06 * n as f32).collect();
    let bytes = plain(&means, 1);
    let table = Table::read(&bytes).unwrap();
    let mut explorer = explorer(&bytes, Strategy::Bayesian);
    let mut paper = Paper::new(table, &(0..8).collect::<Vec<_>>());
    let action = act(0, Property::Roughness);
    for n in 0..30 {
        let x = if n % 2 == 0 { -0.02 } else { 0.08 };
        explorer.observe(action, &all(x)).unwrap();
        paper.observe(action, x.into());
        let out: f64 = paper.p.iter().filter(|&&p| p < 1e-6).sum();
        for o in explorer.expected_outcomes() {
            let difference = (f64::from(o.uncertainty) - paper.uncertainty(o.action)).abs();
            // that of the logarithms: 1.7e-4 a slide
            assert!(difference < 2.0 * out + 1e-4, "{n}: {difference} {out}");
        }
    }
}

#[test]
fn without_room_candidates_or_properties_there_is_no_exploration() {
    let bytes = plain(&[0.0, 0.2, 0.4], 2);
    let table = Table::read(&bytes).unwrap();
    let small = Explorer::<'_, 2>::new(table, PropertySet::ALL, Config::default()).map(|_| ());
    assert_eq!(
        small,
        Err(ExplorerError::NoSpace {
            textures: 3,
            capacity: 2
        })
    );
    assert!(Explorer::<'_, 3>::new(table, PropertySet::ALL, Config::default()).is_ok());
    let among = |measured, candidates: &[u16]| {
        Eight::among(table, measured, Config::default(), candidates.to_vec()).map(|_| ())
    };
    assert_eq!(among(PropertySet::ALL, &[]), Err(ExplorerError::Candidates));
    assert_eq!(
        among(PropertySet::ALL, &[0, 3]),
        Err(ExplorerError::Candidates)
    );
    assert_eq!(among(PropertySet::ALL, &[0, 2]), Ok(()));
    assert_eq!(
        among(PropertySet::default(), &[0, 2]),
        Err(ExplorerError::NothingToMeasure)
    );
    let trials = [vec![around([(0.0, 0.1); 3])], vec![vec![[1.0; 3]]]];
    let bytes = table_of(PropertySet::ALL, &trials);
    let once = Eight::new(
        Table::read(&bytes).unwrap(),
        PropertySet::ALL,
        Config::default(),
    )
    .map(|_| ());
    assert_eq!(once, Err(ExplorerError::NothingToMeasure));
    let bytes = table_of(only(Property::Traction), &[vec![around([(0.0, 0.1); 3])]]);
    let other = Eight::new(
        Table::read(&bytes).unwrap(),
        only(Property::Fineness),
        Config::default(),
    )
    .map(|_| ());
    assert_eq!(other, Err(ExplorerError::NothingToMeasure));
}

/// The study's size, learned from five trials each: the paper's equations in f64 give the same explorations.
#[test]
fn single_precision_is_enough_for_117_textures() {
    let mut x = 1u32;
    let mut uniform = || {
        x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (x >> 8) as f32 / 16_777_216.0
    };
    // the sum of twelve is close to a standard normal number
    let mut normal = || (0..12).map(|_| uniform()).sum::<f32>() - 6.0;
    let world: Vec<Vec<[f32; 3]>> = (0..117)
        .map(|_| (0..3).map(|_| [normal(), normal(), normal()]).collect())
        .collect();
    let mut trial = |texture: usize, movement: usize| {
        world[texture][movement].map(|mean| mean + 0.15 * normal())
    };
    let trials: Vec<Vec<Vec<[f32; 3]>>> = (0..117)
        .map(|t| {
            (0..3)
                .map(|m| (0..5).map(|_| trial(t, m)).collect())
                .collect()
        })
        .collect();
    let bytes = table_of(PropertySet::ALL, &trials);
    let table = Table::read(&bytes).unwrap();
    let mut explorer =
        Explorer::<'_, 117>::new(table, PropertySet::ALL, Config::default()).unwrap();
    for truth in (0..117).step_by(6) {
        explorer.restart();
        let mut paper = Paper::new(table, &(0..117).collect::<Vec<_>>());
        // the sum of eq. 4's exponents: the densities themselves underflow even in f64
        let mut log = vec![0f64; 117];
        while explorer.verdict().is_none() {
            let outcomes = explorer.expected_outcomes();
            let action = explorer.choose(&outcomes, 0);
            for o in &outcomes {
                let difference = f64::from(o.uncertainty) - paper.uncertainty(o.action);
                assert!(difference.abs() < 1e-4, "{o:?} {difference}");
                assert!(paper.benefit(o.action) <= paper.benefit(action) + 1e-4);
            }
            let x = trial(truth, action.movement.into())[action.property.unwrap().index()];
            explorer.observe(action, &all(x)).unwrap();
            for (log, known) in log.iter_mut().zip(&paper.known) {
                let (mean, sd) = known[&index(action)];
                *log -= sd.ln() + ((f64::from(x) - mean) / sd).powi(2) / 2.0;
            }
            let top = log.iter().copied().fold(f64::MIN, f64::max);
            let sum: f64 = log.iter().map(|l| (l - top).exp()).sum();
            paper.p = log.iter().map(|l| (l - top).exp() / sum).collect();
            *paper.made.entry(index(action)).or_default() += 1;
            for (&p, &expected) in explorer.posterior().iter().zip(&paper.p) {
                assert!((f64::from(p) - expected).abs() < 1e-4);
            }
        }
    }
}

#[test]
fn even_a_single_candidate_is_touched_before_it_is_named() {
    let bytes = plain(&[0.5], 1);
    let mut explorer = explorer(&bytes, Strategy::Bayesian);
    assert!(explorer.best().sure);
    assert_eq!(explorer.verdict(), None);
    explorer
        .observe(act(0, Property::Traction), &all(0.5))
        .unwrap();
    assert_eq!(
        explorer.verdict().map(|v| (v.texture, v.sure)),
        Some((0, true))
    );
}
