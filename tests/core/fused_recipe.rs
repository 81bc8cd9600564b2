//! A fused table's limits and verdicts beside the recipe in f64.

#[path = "oracle/verdicts.rs"]
mod verdicts;

use verdicts::{Drift, Judge, VerdictKind};

use crate::oracle;

/// Features as `[texture][slide][feature]`; one movement.
type Session = Vec<Vec<Vec<f64>>>;

/// SplitMix64.
struct Random(u64);

impl Random {
    fn new(seed: u64, run: u64) -> Self {
        let mut random = Self(seed ^ run.wrapping_mul(0xd134_2543_de82_ef95));
        random.next();
        random
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }
}

/// A table that the product learns has the limits of the recipe, as far as draws go, and tells the same.
#[test]
fn a_learned_table_is_calibrated_as_the_recipe_says() {
    use tactus_core::explorer::{Config, Explorer, Method, VerdictKind as Product};
    use tactus_core::features::{Movement, Observation, Properties, PropertySet};
    use tactus_core::table::Table;
    let (textures, d) = (19, 13);
    let mut random = Random::new(11, 0);
    let mut normals =
        |sd: f64| -> Vec<f64> { (0..d).map(|_| sd * verdicts::normal(&mut random)).collect() };
    let means: Vec<Vec<f64>> = (0..textures).map(|_| normals(0.5)).collect();
    // neighbouring bands scatter together
    let mut slide = |texture: usize, off: f64| -> Vec<f64> {
        let (own, away) = (normals(0.12), normals(off));
        let of = |i: usize| own[i] + 0.8 * own[i.saturating_sub(1)] + away[i] + means[texture][i];
        let x: Vec<f64> = (0..d).map(of).collect();
        let traction = 0.7 + 0.2 * x[0];
        let x = std::iter::once(traction).chain(x[1..].iter().copied());
        x.map(|x| (x * 1024.0).round() / 1024.0).collect()
    };
    let observed = |x: &Vec<f64>| Observation {
        properties: Properties::new([Some(x[0] as f32), None, None]),
        bands: x[1..].iter().map(|x| (x * 1024.0) as i16).collect(),
        pressure: None,
        pace: None,
    };
    let training: Session = (0..textures)
        .map(|texture| (0..5).map(|_| slide(texture, 0.0)).collect())
        .collect();
    let judge = Judge::learn(&training, Drift::USUAL);
    let slides: Vec<Vec<Vec<Observation>>> = training
        .iter()
        .map(|slides| vec![slides.iter().map(observed).collect()])
        .collect();
    let names: Vec<String> = (0..textures).map(|t| t.to_string()).collect();
    let movements = [Movement::FOR_TRACTION];
    let bytes = tactus_lab::eval::learn::learn(Method::Fused, None, &names, &movements, &slides);
    let bytes = bytes.unwrap();
    let table = Table::read(&bytes).unwrap();
    let limits = table.limits().unwrap();
    for (which, tails) in [limits.drifted, limits.same].into_iter().enumerate() {
        for (tail, [begin, excess]) in tails.into_iter().zip(judge.limits[which]) {
            let limit = f64::from(tail.begin) + f64::from(tail.excess) * 10f64.ln();
            let expected = begin + excess * 10f64.ln();
            println!("limit {limit:.2}, the recipe's {expected:.2}");
            // both scatter by 0.15 or so
            assert!((limit - expected).abs() < 0.9, "{limit} {expected}");
        }
    }
    let config = Config {
        method: Method::Fused,
        open: true,
        // alpha is half of what comes
        false_alarm: Some(0.02),
        ..Config::default()
    };
    let mut explorer = Explorer::<32>::new(table, PropertySet::ALL, config).unwrap();
    let action = explorer.choose(&explorer.expected_outcomes(), 0);
    let (mut same, mut all, mut kinds) = (0, 0, [0; 4]);
    for run in 0..600 {
        let off = [0.0, 0.1, 0.25, 0.6][run % 4];
        explorer.restart();
        let mut mean = vec![0.0; d];
        for k in 1..=3 {
            let x = slide(run % textures, off);
            explorer.observe(action, &observed(&x)).unwrap();
            for (mean, z) in mean.iter_mut().zip(judge.z(&x)) {
                *mean += (z - *mean) / k as f64;
            }
            let (told, best) = judge.tell(&mean, k, 0.01);
            let here = explorer.best();
            let kind = match here.kind() {
                Product::New => VerdictKind::New,
                Product::Changed => VerdictKind::Changed,
                Product::Sure => VerdictKind::Sure,
                Product::MostLike => unreachable!("the table has no figures"),
                Product::Undecided => VerdictKind::Undecided,
            };
            kinds[kind as usize] += 1;
            all += 1;
            let named = matches!(told, VerdictKind::New) || usize::from(here.texture) == best;
            same += usize::from(kind == told && named);
        }
    }
    println!("{same} of {all} told alike, {kinds:?}");
    assert!(same as f64 >= 0.95 * all as f64, "{same} of {all}");
    // a name that fits and has changed all the same is rare
    let [new, changed, sure, undecided] = kinds;
    assert!(
        new.min(sure).min(undecided) > 100 && changed > 2,
        "{kinds:?}"
    );
}

/// Canonical variates are the recipe's whitened features, turned: all distances are the same.
#[test]
fn slides_are_whitened_by_the_recipe() {
    use tactus_core::features::{FeatureSet, Vector};
    use tactus_core::table::{Drift, Scatter, whiten_drifting};
    for (seed, (textures, movements, d, each)) in (1..).zip([
        (20, 3, 13, 5),
        (117, 3, 14, 5),
        (3, 1, 13, 2),
        (1, 2, 13, 2),
        (5, 4, 3, 4),
        (6, 2, 1, 3),
        (10, 36, 5, 15),
    ]) {
        let mut random = Random::new(seed, 0);
        let mut normals = |n: usize, sd: f64| -> Vec<f64> {
            (0..n).map(|_| sd * verdicts::normal(&mut random)).collect()
        };
        // neighbours scatter together, not the same at every movement
        let mixing: Vec<Vec<f64>> = (0..movements).map(|_| normals(d, 0.4)).collect();
        let mut slide = |movement: usize, mean: &[f64]| -> Vec<f64> {
            let own = normals(d, 0.3);
            let of = |i: usize| mean[i] + own[i] + mixing[movement][i] * own[i.saturating_sub(1)];
            (0..d).map(|i| (of(i) * 1024.0).round() / 1024.0).collect()
        };
        let mut slides: oracle::Training = Vec::new();
        for texture in 0..textures {
            let mean: Vec<f64> = (0..d)
                .map(|i| ((texture * 7 + i * 3) % 11) as f64 / 4.0)
                .collect();
            let of = |m| -> Vec<Vec<f64>> { (0..each).map(|_| slide(m, &mean)).collect() };
            slides.push((0..movements).map(of).collect());
        }
        let trained = oracle::Trained::train(&slides);
        let steps = |x: &Vec<f64>| -> Vector { x.iter().map(|x| (x * 1024.0) as i16).collect() };
        let mut scatters = vec![Scatter::new(d); movements];
        for row in &slides {
            for (scatter, slides) in scatters.iter_mut().zip(row) {
                let slides: Vec<Vector> = slides.iter().map(steps).collect();
                scatter.push(&slides).unwrap();
            }
        }
        let learned = whiten_drifting(&scatters, FeatureSet::Bands, Drift::NONE).unwrap();
        assert_eq!(learned.len(), movements);
        for (m, ((whitening, _), recipe)) in learned.iter().zip(&trained.movements).enumerate() {
            let of_movement: Vec<_> = slides.iter().flat_map(|row| &row[m]).collect();
            for pair in of_movement.windows(2) {
                let [z, other] = [pair[0], pair[1]].map(|x| whitening.apply(&steps(x)));
                let apart = z
                    .iter()
                    .zip(&other)
                    .map(|(a, b)| f64::from(*a) - f64::from(*b));
                let found = apart.map(|z| z * z).sum::<f64>().sqrt();
                let [z, other] = [pair[0], pair[1]].map(|x| recipe.z(x));
                let apart = z.iter().zip(&other).map(|(a, b)| 256.0 * (a - b));
                let distance = apart.map(|z| z * z).sum::<f64>().sqrt();
                let bound = 2.0 * (d as f64).sqrt() + 1e-3 * distance;
                assert!(
                    (found - distance).abs() <= bound,
                    "{seed}: {found} {distance}"
                );
            }
        }
    }
}
