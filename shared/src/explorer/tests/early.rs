//! Looks at the first part of a slide: against explorers that know no other slides, and against the paper's equations.

use super::*;
use crate::table::tests::{fused_of, known, straight};
use crate::table::{Drift, Drifts};
use crate::table::{
    Limits, Population, Sections, Shorter, Tail, Whitened, with_lengths, with_sections,
};

type Fused<'t> = Explorer<'t, 8>;

/// Statistics of five textures at two movements, `by` apart from others.
fn textures(by: f64) -> Vec<Vec<Whitened>> {
    let row = |t: f64| {
        let first = known(5, &[7.0 * t + by, 5.0 * (t % 2.0) - by]);
        vec![first, known(5, &[5.0 * (t % 3.0), 6.0 * t + by])]
    };
    (0..5).map(|t| row(f64::from(t))).collect()
}

/// With drift and limits.
fn fused(known: &[Vec<Whitened>], begin: f32) -> Vec<u8> {
    let plain = fused_of(FeatureSet::Bands, &[straight(2), straight(2)], known);
    let population = |m: usize| {
        let means = known.iter().map(|row| (row[m].slides, &row[m].mean[..]));
        Population::new(2, means).unwrap()
    };
    let tails = [Tail { begin, excess: 1.0 }; 3];
    let limits = Limits {
        false_alarm: 0.02,
        drifted: tails,
        same: tails,
    };
    let mut drifts = Drifts::default();
    drifts[0] = 0.05;
    let sections = Sections {
        drift: (Drift::default(), &[drifts, drifts]),
        novelty: Some((limits, &[population(0), population(1)])),
        slopes: None,
    };
    let mut out = vec![0; 8000];
    let table = with_sections(&mut out, &Table::read(&plain).unwrap(), &sections);
    table.unwrap().as_bytes().to_vec()
}

fn with_length(whole: &[u8], short: &[u8], movements: u64) -> Vec<u8> {
    let [whole, table] = [whole, short].map(|bytes| Table::read(bytes).unwrap());
    let shorter = Shorter {
        ms: 1000,
        table,
        movements,
    };
    let mut out = vec![0; 20_000];
    let table = with_lengths(&mut out, &whole, &[shorter]).unwrap();
    table.as_bytes().to_vec()
}

fn slide(z: [f64; 2]) -> Observation {
    // straight whitenings take features of the same size
    Observation {
        bands: z.iter().map(|z| (z * 1024.0).round() as i16).collect(),
        ..Observation::default()
    }
}

fn config(method: Method) -> Config {
    Config {
        method,
        open: true,
        ..Config::default()
    }
}

const AT: [Action; 2] = [
    Action {
        movement: 0,
        property: None,
    },
    Action {
        movement: 1,
        property: None,
    },
];

#[test]
fn a_first_look_is_what_an_explorer_of_that_length_says() {
    let (whole, short) = (fused(&textures(0.0), 3.0), fused(&textures(0.7), 2.0));
    let both = with_length(&whole, &short, 3);
    let config = config(Method::Fused);
    let explorer = |bytes| Fused::new(Table::read(bytes).unwrap(), PropertySet::ALL, config);
    let (mut both, mut only) = (explorer(&both).unwrap(), explorer(&short).unwrap());
    let (mut known_ones, mut new_ones) = (0, 0);
    for n in 0..400 {
        let z = [f64::from(n % 20) * 1.5 - 1.0, f64::from(n / 20) - 4.0];
        let action = AT[n as usize % 2];
        both.restart();
        only.restart();
        let look = both.look(action, 1, &slide(z)).unwrap().unwrap();
        only.observe(action, &slide(z)).unwrap();
        let best = only.best();
        assert_eq!(look.texture, best.texture);
        assert!((f64::from(look.doubt) - (1.0 - f64::from(best.probability))).abs() < 2e-6);
        // the limits of this length are the lower ones: they decide
        assert_eq!(look.known, best.kind() == VerdictKind::Sure, "{z:?}");
        known_ones += i32::from(look.known);
        new_ones += i32::from(best.unknown);
        // nothing has happened
        assert_eq!((both.slides(), both.log_odds()), (0, None));
        assert!(both.posterior().iter().all(|p| *p == 0.2));
        // and then it ends there
        assert!(both.observe_early(action, 1, &slide(z)).unwrap());
        assert_eq!(both.posterior(), only.posterior());
        assert_eq!(both.log_odds(), only.log_odds());
        assert_eq!((both.best(), both.slides()), (only.best(), 1));
        assert_eq!(both.observed().count(), 0, "no whole slide to learn from");
    }
    assert!(known_ones > 20 && new_ones > 20, "{known_ones} {new_ones}");
}

#[test]
fn a_look_leaves_the_exploration_as_it_was() {
    let (whole, short) = (fused(&textures(0.0), 3.0), fused(&textures(0.7), 2.0));
    let both = with_length(&whole, &short, 3);
    let config = config(Method::Fused);
    let explorer = |bytes| Fused::new(Table::read(bytes).unwrap(), PropertySet::ALL, config);
    let (mut looking, mut plain) = (explorer(&both).unwrap(), explorer(&whole).unwrap());
    for (n, action) in [AT[0], AT[1], AT[0], AT[0]].into_iter().enumerate() {
        let z = [3.0 + 0.1 * n as f64, 1.2];
        let early = slide([2.0, 2.0]);
        let first = looking.look(action, 1, &early).unwrap();
        assert!(first.is_some());
        assert_eq!(first, looking.look(action, 1, &early).unwrap());
        looking.observe(action, &slide(z)).unwrap();
        plain.observe(action, &slide(z)).unwrap();
        assert_eq!(looking.posterior(), plain.posterior());
        assert_eq!(looking.best(), plain.best());
        assert!(looking.observed().eq(plain.observed()));
    }
    // a slide without these features is refused, and nothing has changed
    let nothing = Observation::default();
    assert!(looking.look(AT[0], 1, &nothing).is_err());
    assert!(looking.observe_early(AT[0], 1, &nothing).is_err());
    assert_eq!(looking.posterior(), plain.posterior());
    assert_eq!(looking.slides(), 4);
}

#[test]
fn nobody_looks_where_a_length_is_not_known_of_all() {
    let (whole, short) = (fused(&textures(0.0), 3.0), fused(&textures(0.7), 2.0));
    let both = with_length(&whole, &short, 1);
    let table = Table::read(&both).unwrap();
    let z = slide([3.0, 1.0]);
    let fused = config(Method::Fused);
    let mut explorer = Fused::new(table, PropertySet::ALL, fused).unwrap();
    assert!(explorer.look(AT[0], 1, &z).unwrap().is_some());
    assert_eq!(
        explorer.look(AT[1], 1, &z).unwrap(),
        None,
        "slides are not longer"
    );
    assert_eq!(explorer.look(AT[0], 0, &z).unwrap(), None);
    assert_eq!(explorer.look(AT[0], 2, &z).unwrap(), None);
    assert!(!explorer.observe_early(AT[1], 1, &z).unwrap());
    let mut alone = Fused::among(table, PropertySet::ALL, fused, [2]).unwrap();
    assert_eq!(
        alone.look(AT[0], 1, &z).unwrap(),
        None,
        "nothing to tell it from"
    );
    // one that was taught from whole slides
    let new = textures(1.0).remove(2);
    let put = crate::table::Change::Put {
        name: "new",
        known: crate::table::TextureStats::Fused(&new),
        tally: crate::table::Tally::default(),
    };
    let mut out = vec![0; 20_000];
    let taught = crate::table::amend(&mut out, &table, put).unwrap();
    let mut explorer = Fused::new(taught, PropertySet::ALL, fused).unwrap();
    assert_eq!(explorer.look(AT[0], 1, &z).unwrap(), None);
}

#[test]
fn the_papers_look_is_eq_3_with_the_gaussians_of_that_length() {
    let row = |t: f32, by: f32| vec![around([(t + by, 0.3), (2.0 * t, 0.4 + by), (t - by, 0.2)])];
    let of = |by: f32| -> Vec<u8> {
        let rows: Vec<_> = (0..4).map(|t| row(t as f32 * 0.5, by)).collect();
        table_of(PropertySet::ALL, &rows)
    };
    let (whole, short) = (of(0.0), of(0.2));
    let both = with_length(&whole, &short, 1);
    let tables = [&whole, &short, &both].map(|bytes| Table::read(bytes).unwrap());
    let [whole, short, both] = tables;
    let mut explorer = Fused::new(both, PropertySet::ALL, config(Method::Paper)).unwrap();
    let mut oracle = Paper::new(whole, &[0, 1, 2, 3]);
    let of_length = Paper::new(short, &[0, 1, 2, 3]);
    for (property, x) in [
        (Property::Traction, 0.6),
        (Property::Fineness, 0.4),
        (Property::Roughness, 1.3),
    ] {
        let action = Action::of(0, property);
        let slide = Observation::from(Properties::new([Some(x); 3]));
        let look = explorer.look(action, 1, &slide).unwrap().unwrap();
        let density = |i: usize| density(x.into(), of_length.known[i][&index(action)]);
        let likely: Vec<f64> = (0..4).map(|i| density(i) * oracle.p[i]).collect();
        let sum: f64 = likely.iter().sum();
        let most = likely.iter().copied().fold(0.0, f64::max);
        assert!((likely[usize::from(look.texture)] - most).abs() < 1e-12);
        assert!((f64::from(look.doubt) - (1.0 - most / sum)).abs() < 2e-4);
        assert_eq!(look.known, look.doubt < 0.01);
        explorer.observe(action, &slide).unwrap();
        oracle.observe(action, x.into());
        for (p, expected) in explorer.posterior().iter().zip(&oracle.p) {
            assert!((f64::from(*p) - expected).abs() < 2e-4);
        }
    }
}

#[test]
fn a_slide_ends_when_the_others_are_improbable_enough() {
    let look = |doubt, known| Look {
        texture: 1,
        doubt,
        known,
    };
    assert!(look(0.001, true).is_enough(0.001));
    assert!(!look(0.0011, true).is_enough(0.001));
    assert!(!look(0.0, false).is_enough(0.5));
    let by_default = [Method::Paper, Method::Student, Method::StudentAll].map(most_doubt);
    assert_eq!(by_default, [None; 3]);
}
