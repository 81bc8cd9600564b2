//! The explorer against the paper's equations, written out in f64.

mod drift;
mod early;
mod fused;
mod paced;
mod rules;
mod student;

use super::*;
use crate::features::{FeatureSet, Observation, Properties, Property, PropertySet, Vector};
use crate::table::tests::{around, fixed, table_of};
use crate::table::{Action, Gaussian, Table};
use proptest::prelude::{any, prop, prop_assert, prop_assert_eq, prop_assert_ne, proptest};
use proptest::strategy::Strategy as _;
use std::collections::BTreeMap;
use std::vec;
use std::vec::Vec;

/// The paper's equations as printed, on what the table holds.
struct Paper {
    /// Mean and standard deviation of every candidate by action.
    known: Vec<BTreeMap<usize, (f64, f64)>>,
    /// P(T_i).
    p: Vec<f64>,
    made: BTreeMap<usize, u32>,
}

impl Paper {
    fn new(table: Table<'_>, candidates: &[u16]) -> Self {
        let row = |&texture: &u16| {
            let cell = |a: Action| Some((index(a), table.gaussian(texture, a)?));
            table
                .actions()
                .filter_map(cell)
                .map(|(at, g)| (at, (g.mean.into(), g.sd.into())))
                .collect()
        };
        Self {
            known: candidates.iter().map(row).collect(),
            p: vec![1.0 / candidates.len() as f64; candidates.len()],
            made: BTreeMap::new(),
        }
    }

    /// Eq. 3 with the densities of eq. 4.
    fn observe(&mut self, action: Action, x: f64) {
        let likely: Vec<f64> = (0..self.p.len())
            .map(|i| density(x, self.known[i][&index(action)]) * self.p[i])
            .collect();
        let sum: f64 = likely.iter().sum();
        self.p = likely.iter().map(|p| p / sum).collect();
        *self.made.entry(index(action)).or_default() += 1;
    }

    /// Eq. 11.
    fn uncertainty(&self, action: Action) -> f64 {
        let textures = 0..self.p.len();
        let known = |i: usize| self.known[i][&index(action)];
        let term = |i: usize| {
            let sum: f64 = textures
                .clone()
                .map(|j| eq7(known(i), known(j)) * self.p[j])
                .sum();
            if sum > 0.0 {
                self.p[i] * self.p[i] / sum
            } else {
                0.0
            }
        };
        1.0 - textures.clone().map(term).sum::<f64>()
    }

    /// Eq. 12.
    fn benefit(&self, action: Action) -> f64 {
        let n = f64::from(self.made.get(&index(action)).copied().unwrap_or(0));
        1.0 - self.uncertainty(action).max(0.0).powf(1.0 / (n + 1.0))
    }
}

/// Eq. 4.
fn density(x: f64, (mean, sd): (f64, f64)) -> f64 {
    (-(x - mean).powi(2) / (2.0 * sd * sd)).exp() / (2.0 * std::f64::consts::PI * sd * sd).sqrt()
}

/// Eq. 7.
fn eq7((mi, si): (f64, f64), (mj, sj): (f64, f64)) -> f64 {
    let variances = si * si + sj * sj;
    (2.0 * si * sj / variances).sqrt() * (-(mi - mj).powi(2) / (4.0 * variances)).exp()
}

/// Eq. 6, summed up in small steps from ten standard deviations below to ten above.
fn eq6(a: (f64, f64), b: (f64, f64)) -> f64 {
    let low = (a.0 - 10.0 * a.1).min(b.0 - 10.0 * b.1);
    let high = (a.0 + 10.0 * a.1).max(b.0 + 10.0 * b.1);
    let step = a.1.min(b.1) / 20.0;
    let steps = ((high - low) / step) as usize;
    (0..=steps)
        .map(|n| low + n as f64 * step)
        .map(|x| (density(x, a) * density(x, b)).sqrt())
        .sum::<f64>()
        * step
}

fn config(strategy: Strategy) -> Config {
    Config {
        strategy,
        ..Config::default()
    }
}

type Eight<'t> = Explorer<'t, 8>;

fn explorer(bytes: &[u8], strategy: Strategy) -> Eight<'_> {
    Explorer::new(
        Table::read(bytes).unwrap(),
        PropertySet::ALL,
        config(strategy),
    )
    .unwrap()
}

fn only(property: Property) -> PropertySet {
    [property].into_iter().collect()
}

fn act(movement: u8, property: Property) -> Action {
    let property = Some(property);
    Action { movement, property }
}

/// Place among a table's actions.
fn index(action: Action) -> usize {
    usize::from(action.movement) * 3 + action.property.map_or(0, Property::index)
}

fn all(x: f32) -> Observation {
    Properties::new([Some(x); 3]).into()
}

/// A slide with a value of one property only.
fn slide(action: Action, x: f32) -> Observation {
    let mut values = [None; 3];
    values[action.property.unwrap().index()] = Some(x);
    Properties::new(values).into()
}

/// A table of cells, all trained with two trials.
fn table_of_cells(cells: &[Vec<[(f32, f32); 3]>]) -> Vec<u8> {
    let trials: Vec<Vec<_>> = cells
        .iter()
        .map(|row| row.iter().map(|&cell| around(cell)).collect())
        .collect();
    table_of(PropertySet::ALL, &trials)
}

/// The same mean in each property at every movement, sd 0.1.
fn plain(means: &[f32], movements: usize) -> Vec<u8> {
    let row = |&mean: &f32| vec![[(mean, 0.1); 3]; movements];
    table_of_cells(&means.iter().map(row).collect::<Vec<_>>())
}

fn any_cells() -> impl proptest::strategy::Strategy<Value = Vec<Vec<[(f32, f32); 3]>>> {
    let cell = || (-1f32..1.0, 0.1f32..0.6);
    (1usize..5).prop_flat_map(move |movements| {
        let cells = [cell(), cell(), cell()];
        proptest::collection::vec(proptest::collection::vec(cells, movements), 2..9)
    })
}

/// The state of an explorer.
fn state<const N: usize>(
    explorer: &mut Explorer<'_, N>,
) -> (
    Vec<f32>,
    Vec<ExpectedOutcome>,
    u8,
    Option<Verdict>,
    Vec<Action>,
) {
    let (outcomes, each) = (
        explorer.expected_outcomes().to_vec(),
        explorer.turns().collect(),
    );
    (
        explorer.posterior().to_vec(),
        outcomes,
        explorer.slides(),
        explorer.verdict(),
        each,
    )
}

proptest! {
    #![proptest_config(fixed(400))]

    /// Every step of an exploration by the paper's equations: posterior, uncertainty, benefit and choice.
    #[test]
    fn explores_by_the_papers_equations(
        cells in any_cells(),
        pick in any::<prop::sample::Selector>(),
        few in 2usize..9,
        truth in any::<prop::sample::Index>(),
        noise in proptest::collection::vec(-2.5f64..2.5, 10),
    ) {
        let bytes = table_of_cells(&cells);
        let table = Table::read(&bytes).unwrap();
        let mut candidates: Vec<u16> = (0..table.textures()).collect();
        while candidates.len() > few {
            let &out = pick.select(&candidates);
            candidates.retain(|&t| t != out);
        }
        let mut explorer = Eight::among(table, PropertySet::ALL, Config::default(), candidates.clone()).unwrap();
        let mut paper = Paper::new(table, &candidates);
        let truth = truth.index(candidates.len());
        let mut done = 0;
        while explorer.verdict().is_none() {
            let outcomes = explorer.expected_outcomes();
            prop_assert!(outcomes.iter().map(|o| o.action).eq(table.actions()));
            // the logarithm of each slide's likelihood is 1.7e-4 off at most
            for o in &outcomes {
                prop_assert!((f64::from(o.uncertainty) - paper.uncertainty(o.action)).abs() < 1e-4, "{o:?}");
                prop_assert!((f64::from(o.benefit) - paper.benefit(o.action)).abs() < 2e-4, "{o:?}");
            }
            let chosen = explorer.choose(&outcomes, 0);
            let most = table.actions().map(|a| paper.benefit(a)).fold(0.0, f64::max);
            let first = table.actions().find(|&a| paper.benefit(a) == most);
            prop_assert!(first == Some(chosen) || most - paper.benefit(chosen) < 2e-4);
            let (mean, sd) = paper.known[truth][&index(chosen)];
            let x = (mean + sd * noise[done]) as f32;
            explorer.observe(chosen, &slide(chosen, x)).unwrap();
            paper.observe(chosen, x.into());
            done += 1;
            prop_assert_eq!(usize::from(explorer.slides()), done);
            for (&t, &p) in candidates.iter().zip(&paper.p) {
                prop_assert!((f64::from(explorer.posterior()[usize::from(t)]) - p).abs() < 1e-4);
            }
            let sum: f32 = explorer.posterior().iter().sum();
            prop_assert!((sum - 1.0).abs() < 1e-6, "those that are no candidates stay at 0");
        }
        prop_assert!(done <= 10);
        let best = (0..candidates.len()).max_by(|&i, &j| paper.p[i].total_cmp(&paper.p[j])).unwrap();
        let verdict = explorer.verdict().unwrap();
        let off = (paper.p[best] - f64::from(verdict.probability)).abs();
        prop_assert!(verdict.texture == candidates[best] || off < 1e-4);
        prop_assert_eq!(verdict.sure, verdict.probability > 0.99);
    }

    #[test]
    fn confusion_is_the_overlap_of_two_densities(a in (-3f32..3.0, 0.05f32..2.0), b in (-3f32..3.0, 0.05f32..2.0)) {
        let gaussian = |(mean, sd)| Gaussian { mean, sd };
        let wide = |(mean, sd): (f32, f32)| (f64::from(mean), f64::from(sd));
        let c = f64::from(confusion(gaussian(a), gaussian(b)));
        prop_assert!((c - eq7(wide(a), wide(b))).abs() < 1e-6);
        prop_assert!((c - eq6(wide(a), wide(b))).abs() < 1e-6);
        prop_assert_eq!(confusion(gaussian(b), gaussian(a)), c as f32);
        prop_assert!((confusion(gaussian(a), gaussian(a)) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn benefit_is_eq_12(uncertainty in 0f32..1.0, made in any::<u8>()) {
        let alpha = 1.0 / (f64::from(made) + 1.0);
        let expected = 1.0 - f64::from(uncertainty).powf(alpha);
        prop_assert!((f64::from(benefit(uncertainty, made)) - expected).abs() < 1e-6);
    }

    #[test]
    fn the_order_of_the_slides_does_not_matter(
        cells in any_cells(),
        slides in proptest::collection::vec((any::<prop::sample::Index>(), -1.5f32..1.5), 2..7)
    ) {
        let bytes = table_of_cells(&cells);
        let (mut there, mut back) = (explorer(&bytes, Strategy::Bayesian), explorer(&bytes, Strategy::Bayesian));
        let actions: Vec<Action> = there.table().actions().collect();
        let mut slides: Vec<(Action, f32)> = slides.iter().map(|(at, x)| (*at.get(&actions), *x)).collect();
        for &(action, x) in &slides {
            there.observe(action, &all(x)).unwrap();
        }
        slides.reverse();
        for &(action, x) in &slides {
            back.observe(action, &all(x)).unwrap();
        }
        for (a, b) in there.posterior().iter().zip(back.posterior()) {
            prop_assert!((a - b).abs() < 1e-4, "{a} {b}");
        }
    }

    #[test]
    fn after_a_restart_it_is_as_new(
        cells in any_cells(),
        slides in proptest::collection::vec((any::<prop::sample::Index>(), -9f32..9.0), 1..12)
    ) {
        let bytes = table_of_cells(&cells);
        let mut used = Eight::among(Table::read(&bytes).unwrap(), PropertySet::ALL, Config::default(), [1, 0]).unwrap();
        let mut new = used.clone();
        let actions: Vec<Action> = used.table().actions().collect();
        for (at, x) in &slides {
            used.observe(*at.get(&actions), &all(*x)).unwrap();
        }
        prop_assert_ne!(state(&mut used), state(&mut new));
        used.restart();
        prop_assert_eq!(state(&mut used), state(&mut new));
        for (at, x) in &slides {
            used.observe(*at.get(&actions), &all(*x)).unwrap();
            new.observe(*at.get(&actions), &all(*x)).unwrap();
            prop_assert_eq!(state(&mut used), state(&mut new));
        }
    }

    #[test]
    fn a_pair_is_explored_as_if_the_table_had_no_other(
        cells in any_cells(),
        x in proptest::collection::vec(-1f32..1.0, 4)
    ) {
        let last = cells.len() - 1;
        let alone = table_of_cells(&[cells[0].clone(), cells[last].clone()]);
        let bytes = table_of_cells(&cells);
        let mut alone = explorer(&alone, Strategy::Bayesian);
        let (table, config) = (Table::read(&bytes).unwrap(), Config::default());
        let mut pair = Eight::among(table, PropertySet::ALL, config, [last as u16, 0, 0]).unwrap();
        for x in x {
            let outcomes = alone.expected_outcomes();
            prop_assert_eq!(&pair.expected_outcomes(), &outcomes);
            let action = alone.choose(&outcomes, 0);
            alone.observe(action, &all(x)).unwrap();
            pair.observe(action, &all(x)).unwrap();
            let posterior = pair.posterior();
            prop_assert_eq!(posterior[0], alone.posterior()[0]);
            prop_assert_eq!(posterior[last], alone.posterior()[1]);
            prop_assert!(posterior[1..last].iter().all(|&p| p == 0.0));
            prop_assert_eq!(pair.best().probability, alone.best().probability);
        }
    }
}
