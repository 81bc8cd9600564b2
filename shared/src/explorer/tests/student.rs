//! Student's t with shrunk variances, and its product over properties, against their definitions in f64.

use super::*;
use crate::table::tests::whitening::Noise;

/// Derivative of ln Gamma: the recurrence far up, then three terms.
fn digamma(x: f64) -> f64 {
    if x < 200.0 {
        return digamma(x + 1.0) - 1.0 / x;
    }
    x.ln() - 1.0 / (2.0 * x) - 1.0 / (12.0 * x * x)
}

fn trigamma(x: f64) -> f64 {
    if x < 200.0 {
        return trigamma(x + 1.0) + 1.0 / (x * x);
    }
    1.0 / x + 1.0 / (2.0 * x * x) + 1.0 / (6.0 * x * x * x)
}

/// Mean, shrunk variance, degrees of freedom and number of trials of every texture for one action (Smyth 2004).
fn shrunk(table: &Table<'_>, action: Action) -> Vec<(f64, f64, f64, f64)> {
    let of: Vec<(f64, f64, f64)> = (0..table.textures())
        .map(|t| {
            let g = table.gaussian(t, action).unwrap();
            let n = f64::from(table.trials(t, action.movement));
            (f64::from(g.mean), f64::from(g.sd).powi(2), n)
        })
        .collect();
    let count = of.len() as f64;
    let half = |n: f64| (n - 1.0) / 2.0;
    let e: Vec<f64> = of
        .iter()
        .map(|&(_, s2, n)| s2.ln() - digamma(half(n)) + half(n).ln())
        .collect();
    let mean = e.iter().sum::<f64>() / count;
    let scatter = e.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    let noise = of.iter().map(|&(.., n)| trigamma(half(n))).sum::<f64>() / count;
    let excess = scatter - noise;
    let d0 = if excess <= trigamma(500.0) {
        1000.0
    } else {
        // Newton on 1/trigamma, as Smyth does it
        let mut x = 0.5 + 1.0 / excess;
        for _ in 0..100 {
            let slope = (trigamma(x + 1e-5) - trigamma(x - 1e-5)) / 2e-5;
            x += trigamma(x) * (1.0 - trigamma(x) / excess) / slope;
        }
        2.0 * x
    };
    let s0 = (mean + digamma(d0 / 2.0) - (d0 / 2.0).ln()).exp();
    of.iter()
        .map(|&(mean, s2, n)| {
            let nu = n - 1.0;
            (mean, (d0 * s0 + nu * s2) / (d0 + nu), d0 + nu, n)
        })
        .collect()
}

/// ln of Student's t about `mean`, with the variance of a mean of `k` slides about one of n.
fn log_t(x: f64, k: f64, (mean, s2, freedom, n): (f64, f64, f64, f64)) -> f64 {
    let scale2 = s2 * (1.0 / k + 1.0 / n);
    libm::lgamma((freedom + 1.0) / 2.0)
        - libm::lgamma(freedom / 2.0)
        - 0.5 * (freedom * scale2).ln()
        - (freedom + 1.0) / 2.0 * ((x - mean).powi(2) / (freedom * scale2)).ln_1p()
}

fn normalised(l: &[f64]) -> Vec<f64> {
    let top = l.iter().copied().fold(f64::MIN, f64::max);
    let sum: f64 = l.iter().map(|l| (l - top).exp()).sum();
    l.iter().map(|l| (l - top).exp() / sum).collect()
}

fn near(posterior: &[f32], expected: &[f64]) {
    for (p, e) in posterior.iter().zip(expected) {
        assert!(
            (f64::from(*p) - e).abs() < 1e-3,
            "{posterior:?} {expected:?}"
        );
    }
}

/// Textures of 2 to 6 trials each at up to three movements; their standard deviations differ by `differ`.
fn world(noise: &mut Noise, same_trials: bool, differ: f64) -> Vec<u8> {
    let (textures, movements) = (2 + noise.below(7), 1 + noise.below(3));
    let each = 2 + noise.below(5);
    let trials: Vec<Vec<Vec<[f32; 3]>>> = (0..textures)
        .map(|_| {
            (0..movements)
                .map(|_| {
                    let n = if same_trials {
                        each
                    } else {
                        2 + noise.below(5)
                    };
                    let mean: [f64; 3] = core::array::from_fn(|_| noise.normal());
                    let sd: [f64; 3] =
                        core::array::from_fn(|_| 0.3 * (differ * noise.normal()).exp());
                    let mut trial = || {
                        core::array::from_fn(|p| {
                            (mean[p] + sd[p] * noise.normal()).clamp(-7.9, 7.9) as f32
                        })
                    };
                    (0..n).map(|_| trial()).collect()
                })
                .collect()
        })
        .collect();
    table_of(PropertySet::ALL, &trials)
}

fn begin(table: Table<'_>, measured: PropertySet, method: Method) -> Eight<'_> {
    let config = Config {
        method,
        ..Config::default()
    };
    Eight::new(table, measured, config).unwrap()
}

/// Equation 11 of these Gaussians per property, for the probabilities `p`.
fn uncertainty(known: &[Vec<(f64, f64)>], p: &[f64]) -> f64 {
    let confusion = |i: usize, j: usize| -> f64 {
        let pairs = known.iter().map(|of| eq7(of[i], of[j]));
        pairs.product()
    };
    let term = |i: usize| {
        let sum: f64 = (0..p.len()).map(|j| confusion(i, j) * p[j]).sum();
        if sum > 0.0 { p[i] * p[i] / sum } else { 0.0 }
    };
    1.0 - (0..p.len()).map(term).sum::<f64>()
}

fn expected(table: &Table<'_>, action: Action) -> Vec<(f64, f64)> {
    let known = shrunk(table, action).into_iter();
    known
        .map(|(mean, s2, _, n)| (mean, (s2 * (1.0 + 1.0 / n)).sqrt()))
        .collect()
}

#[test]
fn explores_by_students_t() {
    for seed in 0..200 {
        let noise = &mut Noise(seed);
        let bytes = world(
            noise,
            seed % 2 == 0,
            [0.0, 0.3, 1.0, 2.0][seed as usize % 4],
        );
        let table = Table::read(&bytes).unwrap();
        let mut explorer = begin(table, PropertySet::ALL, Method::Student);
        let mut log = vec![0.0; table.textures().into()];
        for _ in 0..8 {
            let outcomes = explorer.expected_outcomes();
            assert!(outcomes.iter().map(|o| o.action).eq(table.actions()));
            let p: Vec<f64> = explorer.posterior().iter().map(|p| f64::from(*p)).collect();
            for o in &outcomes {
                let u = uncertainty(&[expected(&table, o.action)], &p);
                assert!(
                    (f64::from(o.uncertainty) - u).abs() < 1e-4,
                    "{seed} {o:?} {u}"
                );
            }
            let action = explorer.choose(&outcomes, 0);
            let x = (1.5 * noise.normal()) as f32;
            explorer.observe(action, &slide(action, x)).unwrap();
            for (log, known) in log.iter_mut().zip(shrunk(&table, action)) {
                *log += log_t(x.into(), 1.0, known);
            }
            near(explorer.posterior(), &normalised(&log));
        }
    }
}

/// All properties of a slide; the mean of the slides of a movement is looked at anew.
#[test]
fn explores_by_the_product_of_all_properties() {
    for seed in 0..200 {
        let noise = &mut Noise(1000 + seed);
        let bytes = world(
            noise,
            seed % 2 == 0,
            [0.0, 0.3, 1.0, 2.0][seed as usize % 4],
        );
        let table = Table::read(&bytes).unwrap();
        let measured = [0b111, 0b110, 0b001][seed as usize % 3];
        let measured = PropertySet::from_bits(measured).unwrap();
        let mut explorer = begin(table, measured, Method::StudentAll);
        let movements = table.movements().len() as u8;
        let mut slides: BTreeMap<u8, Vec<[f32; 3]>> = BTreeMap::new();
        for _ in 0..8 {
            let outcomes = explorer.expected_outcomes();
            let everything = |movement| Action {
                movement,
                property: None,
            };
            assert!(
                outcomes
                    .iter()
                    .map(|o| o.action)
                    .eq((0..movements).map(everything))
            );
            let p: Vec<f64> = explorer.posterior().iter().map(|p| f64::from(*p)).collect();
            for o in &outcomes {
                let of = measured
                    .iter()
                    .map(|p| expected(&table, act(o.action.movement, p)));
                let u = uncertainty(&of.collect::<Vec<_>>(), &p);
                assert!(
                    (f64::from(o.uncertainty) - u).abs() < 1e-4,
                    "{seed} {o:?} {u}"
                );
                let made = slides.get(&o.action.movement).map_or(0, Vec::len) as u8;
                assert_eq!(o.benefit, benefit(o.uncertainty, made));
            }
            let action = explorer.choose(&outcomes, 0);
            let x: [f32; 3] = core::array::from_fn(|_| (1.5 * noise.normal()) as f32);
            // what is not measured need not be there
            let values = Property::ALL.map(|p| measured.contains(p).then_some(x[p.index()]));
            explorer
                .observe(action, &Properties::new(values).into())
                .unwrap();
            slides.entry(action.movement).or_default().push(x);
            let mut log = vec![0.0; table.textures().into()];
            for (&movement, slides) in &slides {
                let k = slides.len() as f64;
                for property in measured.iter() {
                    let x = slides.iter().map(|x| f64::from(x[property.index()]));
                    let mean = x.sum::<f64>() / k;
                    let known = shrunk(&table, act(movement, property));
                    for (log, known) in log.iter_mut().zip(known) {
                        *log += log_t(mean, k, known);
                    }
                }
            }
            near(explorer.posterior(), &normalised(&log));
            assert_eq!(explorer.log_odds(), None);
            assert!(!explorer.is_certain() && !explorer.best().unknown);
        }
    }
}

#[test]
fn a_slide_without_one_of_the_properties_is_not_used() {
    let bytes = plain(&[0.0, 0.5, 1.0], 2);
    let table = Table::read(&bytes).unwrap();
    let mut explorer = begin(table, PropertySet::ALL, Method::StudentAll);
    let look = |movement| Action {
        movement,
        property: None,
    };
    explorer.observe(look(0), &all(0.4)).unwrap();
    let before = state(&mut explorer);
    for property in Property::ALL {
        for value in [None, Some(f32::NAN), Some(f32::INFINITY)] {
            let mut values = [Some(0.4); 3];
            values[property.index()] = value;
            let none = explorer.observe(look(1), &Properties::new(values).into());
            assert_eq!(none, Err(ObserveError::Missing(property)));
        }
    }
    assert_eq!(state(&mut explorer), before);
    for _ in 0..3 {
        explorer.observe(look(0), &all(0.4)).unwrap();
    }
    explorer.restart();
    let mut new = begin(table, PropertySet::ALL, Method::StudentAll);
    assert_eq!(state(&mut explorer), state(&mut new));
    explorer.observe(look(0), &all(0.4)).unwrap();
    assert_eq!(
        state(&mut explorer),
        before,
        "nothing is left of the last one"
    );
}

/// Far away all are alike, and numbers stay numbers.
#[test]
fn far_off_values_neither_overflow_nor_stick() {
    let bytes = plain(&[0.0, 0.5, 7.0], 1);
    let table = Table::read(&bytes).unwrap();
    for method in [Method::Student, Method::StudentAll] {
        for x in [f32::MAX, f32::MIN, 1e4, -32.0] {
            let mut explorer = begin(table, PropertySet::ALL, method);
            for _ in 0..600 {
                let outcomes = explorer.expected_outcomes();
                explorer.observe(outcomes[0].action, &all(x)).unwrap();
                let posterior = explorer.posterior();
                let sum: f32 = posterior.iter().sum();
                assert!((sum - 1.0).abs() < 1e-5, "{method:?} {x}: {posterior:?}");
            }
        }
    }
}
