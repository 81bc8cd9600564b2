//! Tables that know speeds against the recipe in f64: matrices inverted as they are.

use super::drift::{NU, Recipe, inverse, ln_gamma, world};
use super::*;
use crate::table::tests::slopes::paced;
use crate::table::tests::whitening::Noise;
use crate::table::{Against, Drift, Pace, Slope};

/// Slides of an episode at a movement: their whitened mean, and ln(speed) of each.
type Slides = (Vec<f64>, Vec<Option<f64>>);

/// Slopes over ln(speed) in a world.
struct Paces {
    recipe: Recipe,
    paces: Vec<Pace>,
    slopes: Vec<Slope>,
}

impl Paces {
    fn slope(&self, slope: &Slope) -> Vec<f64> {
        let numbers = slope.iter().take(self.recipe.d);
        numbers.map(|b| f64::from(*b) / 256.0).collect()
    }

    /// Mean of ln(speed) and the variance of what of it is unknown.
    fn pace(&self, movement: usize, paces: &[Option<f64>]) -> (f64, f64) {
        let (k, usual) = (paces.len() as f64, &self.paces[movement]);
        let each = paces
            .iter()
            .map(|u| u.unwrap_or(f64::from(usual.mean) / 1024.0));
        let unknown = paces.iter().filter(|u| u.is_none()).count() as f64;
        (
            each.sum::<f64>() / k,
            f64::from(usual.variance) * unknown / (k * k),
        )
    }

    /// As [`Recipe::decide`].
    fn decide(&self, episode: &BTreeMap<usize, Slides>, drifting: bool) -> (Vec<f64>, f64) {
        let Recipe {
            d, known, drifts, ..
        } = &self.recipe;
        let background: BTreeMap<usize, f64> = episode
            .iter()
            .map(|(&movement, (z, paces))| {
                let (u, _) = self.pace(movement, paces);
                let pooled = self.slope(&self.paces[movement].pooled);
                let slowed: Vec<f64> = z.iter().zip(&pooled).map(|(z, b)| z - b * u).collect();
                let k = paces.len() as f64;
                (movement, self.recipe.background(movement, k, &slowed))
            })
            .collect();
        let of = |(texture, row): (usize, &Vec<(f64, Vec<f64>)>)| {
            let (mut t, mut ln, mut p, mut elsewhere) = (0.0, 0.0, 0.0, 0.0);
            for (&movement, (z, paces)) in episode {
                let (n, mean) = &row[movement];
                if *n == 0.0 {
                    elsewhere += background[&movement];
                    continue;
                }
                p += *d as f64;
                let (u, variance) = self.pace(movement, paces);
                let slope = self.slope(&self.slopes[texture * row.len() + movement]);
                let v = |i: usize, j: usize| {
                    let own = 1.0 / paces.len() as f64 + 1.0 / n;
                    let drift = if drifting { drifts[movement][i] } else { 0.0 };
                    let own = if i == j { own + drift } else { 0.0 };
                    own + variance * slope[i] * slope[j]
                };
                let matrix: Vec<Vec<f64>> = (0..*d)
                    .map(|i| (0..*d).map(|j| v(i, j)).collect())
                    .collect();
                let (inverse, ln_v) = inverse(&matrix);
                let r: Vec<f64> = (0..*d).map(|i| z[i] - mean[i] - slope[i] * u).collect();
                ln += ln_v;
                for i in 0..*d {
                    t += (0..*d).map(|j| r[i] * inverse[i][j] * r[j]).sum::<f64>();
                }
            }
            let half = (NU + p) / 2.0;
            ln_gamma(half)
                - ln_gamma(NU / 2.0)
                - p / 2.0 * (NU / 2.0).ln()
                - 0.5 * ln
                - half * (1.0 + t / NU).ln()
                + elsewhere
        };
        let likelihoods = known.iter().enumerate().map(of).collect();
        (likelihoods, background.values().sum())
    }
}

#[test]
fn means_go_with_the_speed_known_and_unknown_as_by_the_recipe() {
    let mut noise = Noise(23);
    let config = Config {
        method: Method::Fused,
        max_slides: 254,
        open: true,
        ..Config::default()
    };
    let (mut all, mut same, mut right, mut partly) = (0, 0, [0; 2], 0);
    for number in 0..60 {
        let drift = if number % 4 == 0 {
            Drift::NONE
        } else {
            Drift::default()
        };
        let (recipe, bytes) = world(&mut noise, drift, number % 3 > 0);
        let (textures, movements, d) = (recipe.known.len(), recipe.known[0].len(), recipe.d);
        let mut slope = |sd: f64| {
            let mut slope = Slope::default();
            slope[..d].fill_with(|| (256.0 * sd * noise.normal()) as i16);
            slope
        };
        let paces: Vec<Pace> = (0..movements)
            .map(|at| Pace {
                mean: [0, 40, -70, 15][at],
                variance: 0.0625,
                pooled: slope(2.0),
            })
            .collect();
        let slopes: Vec<Slope> = (0..textures * movements).map(|_| slope(4.0)).collect();
        let bytes = paced(&bytes, &paces, &slopes);
        let table = Table::read(&bytes).unwrap();
        let world = Paces {
            recipe,
            paces,
            slopes,
        };
        let mut explorer = Explorer::<20>::new(table, PropertySet::ALL, config).unwrap();
        for presented in 0..textures {
            explorer.restart();
            let mut episode: BTreeMap<usize, Slides> = BTreeMap::new();
            // with a sensor of speed, without, and one that loses track now and then
            let sensor = presented % 3;
            for slides in 1..=4u8 {
                let movement = (usize::from(slides) * 5 + presented) % movements;
                let u = 0.25 * noise.normal();
                let slope = world.slope(&world.slopes[presented * movements + movement]);
                let mean = &world.recipe.known[presented][movement].1;
                let x: Vec<i16> = mean
                    .iter()
                    .zip(&slope)
                    .map(|(m, b)| ((m + b * u + noise.normal()) * 1024.0).round() as i16)
                    .collect();
                let is_known = sensor == 0 || sensor == 2 && slides % 2 == 0;
                let pace = is_known.then_some((u * 1024.0).round() as i16);
                let slide = Observation {
                    bands: x.iter().copied().collect(),
                    pace,
                    ..Observation::default()
                };
                let action = Action {
                    movement: movement as u8,
                    property: None,
                };
                if explorer.observe(action, &slide).is_err() {
                    break;
                }
                let white = table.whiten(movement as u8, &x).unwrap();
                let (mean, paces) = episode
                    .entry(movement)
                    .or_insert_with(|| (vec![0.0; d], Vec::new()));
                paces.push(pace.map(|u| f64::from(u) / 1024.0));
                for (mean, z) in mean.iter_mut().zip(&white) {
                    *mean += (f64::from(*z) / 256.0 - *mean) / paces.len() as f64;
                }
                partly += i32::from(paces.iter().any(Option::is_some) && paces.contains(&None));
                let (likelihoods, background) = world.decide(&episode, true);
                let most = likelihoods.iter().copied().fold(f64::MIN, f64::max);
                let sum: f64 = likelihoods.iter().map(|l| (l - most).exp()).sum();
                for (found, l) in explorer.posterior().iter().zip(&likelihoods) {
                    let p = (l - most).exp() / sum;
                    assert!((f64::from(*found) - p).abs() < 1e-2, "{found} {p}");
                }
                let limit = |against| f64::from(world.recipe.limits.limit(against, slides, None));
                let over = background - most - limit(Against::Drifted);
                let found = f64::from(explorer.log_odds().unwrap());
                assert!(
                    (found - over).abs() < 0.05 + 5e-3 * over.abs(),
                    "{found} {over}"
                );
                let (likelihoods, background) = world.decide(&episode, false);
                let most = likelihoods.iter().copied().fold(f64::MIN, f64::max);
                let changed = background - most > limit(Against::Same) && !drift.is_none();
                let best = explorer.best();
                all += 1;
                let told = (over > 0.0, over <= 0.0 && changed);
                same += i32::from(told == (best.unknown, best.changed));
                if slides == 1 && sensor < 2 {
                    right[sensor] += i32::from(usize::from(best.texture) == presented);
                }
            }
        }
    }
    std::println!("{same} of {all}, {partly} of mixed speeds, right {right:?}");
    assert!(f64::from(same) > 0.99 * f64::from(all), "{same} of {all}");
    assert!(all > 2000 && partly > 100, "{all} {partly}");
    assert!(right[0] > right[1], "{right:?}");
}

/// The probe learns by itself what the texture is at the movement's speed.
#[test]
fn what_is_learned_is_at_the_speed_of_the_movement() {
    let mut noise = Noise(5);
    let (recipe, bytes) = world(&mut noise, Drift::default(), true);
    let (textures, movements) = (recipe.known.len(), recipe.known[0].len());
    let mut pace = Pace {
        mean: 100,
        variance: 0.0625,
        pooled: Slope::default(),
    };
    pace.pooled[0] = 512;
    let mut own = Slope::default();
    own[1] = -1024;
    let paces = vec![pace; movements];
    let bytes = paced(&bytes, &paces, &vec![own; textures * movements]);
    let table = Table::read(&bytes).unwrap();
    // ln(speed) of a half: two standard deviations along the slope, one along that of all
    let own = table.at_movement_speed(Some(1), 0, &[7, 7], 512);
    assert_eq!(own[..], [7, 7 + 512]);
    let new = table.at_movement_speed(None, 0, &[7, 7], 512);
    assert_eq!(new[..], [7 - 256, 7]);
    let slide = |pace| Observation {
        bands: (0..recipe.d).map(|_| 0).collect(),
        pace,
        ..Observation::default()
    };
    assert_eq!(table.pace_of(0, &slide(Some(-3))), -3);
    assert_eq!(table.pace_of(0, &slide(None)), 100);
    let config = Config {
        method: Method::Fused,
        ..Config::default()
    };
    let mut explorer = Explorer::<20>::new(table, PropertySet::ALL, config).unwrap();
    let action = Action {
        movement: 0,
        property: None,
    };
    for pace in [Some(300), None] {
        explorer.observe(action, &slide(pace)).unwrap();
    }
    assert_eq!(explorer.paces().collect::<Vec<_>>(), [200]);
}
