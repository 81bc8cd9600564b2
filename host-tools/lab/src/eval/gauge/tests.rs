use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::*;

/// Three operators, ten parts, three trials: the example of the AIAG's manual. Rows are trials.
#[rustfmt::skip]
const PUBLISHED: [[[f64; 10]; 3]; 3] = [
    [
        [0.29, -0.56, 1.34, 0.47, -0.80, 0.02, 0.59, -0.31, 2.26, -1.36],
        [0.41, -0.68, 1.17, 0.50, -0.92, -0.11, 0.75, -0.20, 1.99, -1.25],
        [0.64, -0.58, 1.27, 0.64, -0.84, -0.21, 0.66, -0.17, 2.01, -1.31],
    ],
    [
        [0.08, -0.47, 1.19, 0.01, -0.56, -0.20, 0.47, -0.63, 1.80, -1.68],
        [0.25, -1.22, 0.94, 1.03, -1.20, 0.22, 0.55, 0.08, 2.12, -1.62],
        [0.07, -0.68, 1.34, 0.20, -1.28, 0.06, 0.83, -0.34, 2.19, -1.50],
    ],
    [
        [0.04, -1.38, 0.88, 0.14, -1.46, -0.29, 0.02, -0.46, 1.77, -1.49],
        [-0.11, -1.13, 1.09, 0.20, -1.07, -0.67, 0.01, -0.56, 1.45, -1.77],
        [-0.15, -0.96, 0.67, 0.11, -1.45, -0.49, 0.21, -0.49, 1.87, -2.16],
    ],
];

fn reading(part: usize, operator: &str, slide: usize, value: f64) -> Reading {
    Reading {
        part: format!("part {part}"),
        operator: operator.to_owned(),
        slide: slide as u32,
        value,
    }
}

fn published() -> Vec<Reading> {
    let mut readings = Vec::new();
    for (operator, trials) in ["A", "B", "C"].into_iter().zip(PUBLISHED) {
        for (slide, parts) in trials.into_iter().enumerate() {
            let values = parts.into_iter().enumerate();
            readings.extend(values.map(|(part, value)| reading(part, operator, slide, value)));
        }
    }
    readings
}

#[track_caller]
fn near(a: f64, b: f64, by: f64) {
    assert!((a - b).abs() <= by, "{a} is not {b}");
}

#[test]
fn the_published_example_has_its_published_variances() {
    let study = study(&published()).unwrap();
    // variances, as the manual and statistics programs print them; the interaction is pooled
    near(study.sd.repeatability.powi(2), 0.03997, 5e-6);
    near(study.sd.operator.unwrap().powi(2), 0.05146, 5e-6);
    near(study.sd.operator_by_part.unwrap(), 0.0, 0.0);
    near(study.sd.gauge.powi(2), 0.09143, 5e-6);
    near(study.sd.part.powi(2), 1.08645, 5e-6);
    near(study.gauge_share, 0.2786, 5e-5);
    assert_eq!(study.distinct_categories, Some(4));
}

/// Readings whose four standard deviations are known; cells have 2 to 4 of them.
fn drawn(sds: [f64; 4], parts: usize, operators: usize, seed: u64) -> Vec<Reading> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = |sd: f64| {
        // twelve of variance 1/12 are nearly normal
        let twelve = (0..12).map(|_| random.random::<f64>()).sum::<f64>();
        sd * (twelve - 6.0)
    };
    let of_operators: Vec<f64> = (0..operators).map(|_| draw(sds[1])).collect();
    let mut readings = Vec::new();
    for part in 0..parts {
        let of_part = draw(sds[3]);
        for (operator, of_operator) in of_operators.iter().enumerate() {
            let of_both = draw(sds[2]);
            for slide in 0..2 + (part + operator) % 3 {
                let value = of_part + of_operator + of_both + draw(sds[0]);
                readings.push(reading(part, &operator.to_string(), slide, value));
            }
        }
    }
    readings
}

#[test]
fn known_variances_are_found_again_whatever_the_numbers_of_repetitions() {
    let sds = [0.5, 1.0, 0.8, 2.0];
    let mut found = [0.0; 4];
    for seed in 0..50 {
        let sd = study(&drawn(sds, 20, 12, seed)).unwrap().sd;
        let all = [
            sd.repeatability,
            sd.operator.unwrap(),
            sd.operator_by_part.unwrap(),
            sd.part,
        ];
        for (found, sd) in found.iter_mut().zip(all) {
            *found += sd * sd / 50.0;
        }
    }
    // of 50 studies with 12 operators and 20 parts the mean variance is good to a few percent
    for (found, sd) in found.iter().zip(sds) {
        near(found.sqrt(), sd, 0.08 * sd);
    }
}

#[test]
fn one_operator_has_no_variance_between_operators() {
    let readings: Vec<Reading> = published()
        .into_iter()
        .filter(|r| r.operator == "B")
        .collect();
    let study = study(&readings).unwrap();
    assert_eq!((study.sd.operator, study.sd.operator_by_part), (None, None));
    assert_eq!(study.sd.gauge, study.sd.repeatability);
    // one-way: between parts (ms - within)/3
    near(study.sd.repeatability.powi(2), 0.09105, 5e-6);
}

#[test]
fn operators_who_touched_other_parts_are_not_compared() {
    let mut readings = published();
    readings.retain(|r| r.operator != "C" || r.part != "part 3");
    assert_eq!(study(&readings).unwrap().sd.operator, None);
}

#[test]
fn a_slide_that_went_wrong_is_outside() {
    let mut readings = drawn([0.1, 0.1, 0.0, 1.0], 8, 3, 1);
    assert!(study(&readings).unwrap().outside.is_empty());
    let limit = study(&readings).unwrap().control_limit;
    // the third of four: of two, the outlier is undecidable
    let of = |n: usize| (readings[n].part.clone(), readings[n].operator.clone());
    let third = (1..readings.len() - 2).find(|&n| of(n - 1) == of(n + 2));
    let third = third.unwrap() + 1;
    readings[third].value += 2.0 * limit;
    assert_eq!(study(&readings).unwrap().outside, [third]);
}

#[test]
fn what_cannot_be_compared_is_told() {
    let one: Vec<Reading> = published()
        .into_iter()
        .filter(|r| r.part == "part 1")
        .collect();
    assert_eq!(study(&one), Err(ONE_PART));
    let once: Vec<Reading> = published().into_iter().filter(|r| r.slide == 0).collect();
    assert_eq!(study(&once), Err(NO_REPETITION));
    let same = (0..6)
        .map(|n| reading(n / 3, "A", n, 1.0))
        .collect::<Vec<_>>();
    let same = study(&same).unwrap();
    assert_eq!((same.gauge_share, same.distinct_categories), (0.0, None));
}
