//! The paper's observations of textures: Table 2, Table 3, figs. 6 and 7.

use rayon::prelude::*;

use super::bench::{Properties, correlation, deviation, mean, sample, slide};
use crate::finger::Finger;

/// The ten textures of Table 2.
const TEN: [u8; 10] = [2, 10, 30, 43, 45, 46, 47, 84, 87, 100];
/// Those that fig. 6 shows rising.
const COARSE: [u8; 4] = [10, 30, 87, 100];
/// Trials of each movement (PAPER).
const TRIALS: u64 = 6;
/// Worlds over which an observation is averaged.
const WORLDS: u64 = 3;

/// Trials of one movement on each texture in one world.
fn trials(
    textures: &[u8],
    force_n: f64,
    speed: f64,
    trials: u64,
    world: u64,
) -> Vec<Vec<Properties>> {
    let mut finger = Finger::new(world);
    let on = |number: &u8| {
        let surface = sample(*number, world);
        (0..trials)
            .map(|trial| {
                slide(
                    &mut finger,
                    &surface,
                    force_n,
                    speed,
                    1000 * u64::from(*number) + trial,
                )
                .properties()
            })
            .collect()
    };
    textures.iter().map(on).collect()
}

fn level(trials: &[Properties], property: fn(&Properties) -> f64) -> f64 {
    mean(trials.iter().map(property))
}

fn traction(p: &Properties) -> f64 {
    p.traction
}

fn roughness(p: &Properties) -> f64 {
    p.roughness
}

fn fineness(p: &Properties) -> f64 {
    p.fineness
}

#[test]
fn centroid_rises_with_speed_for_coarse_textures_only() {
    // fig. 6: six speeds at 0.2 N
    let speeds: Vec<f64> = (0..6)
        .map(|i| 10.0 * 10_f64.powf(f64::from(i) / 5.0))
        .collect();
    let worlds: Vec<Vec<Vec<f64>>> = (1..=WORLDS)
        .into_par_iter()
        .map(|world| {
            let at = |speed: &f64| {
                trials(&TEN, 0.2, *speed, 3, world)
                    .iter()
                    .map(|t| level(t, fineness))
                    .collect()
            };
            speeds.iter().map(at).collect()
        })
        .collect();
    for (i, number) in TEN.iter().enumerate() {
        let rise: Vec<f64> = (0..6)
            .map(|v| mean(worlds.iter().map(|w| w[v][i])).exp())
            .collect();
        let consistent = rise.windows(2).all(|w| w[1] > 0.98 * w[0]);
        let ratio = rise[5] / rise[0];
        if COARSE.contains(number) {
            assert!(consistent && ratio > 1.3, "T{number}: {rise:.0?}");
        } else {
            assert!(ratio < 1.2, "T{number}: {rise:.0?}");
        }
    }
}

#[test]
fn ten_textures_are_as_the_paper_describes_them() {
    // Table 2 and Results, at the best movement of each property
    let worlds: Vec<[Vec<f64>; 3]> = (1..=WORLDS)
        .into_par_iter()
        .map(|world| {
            let of = |force, speed, property: fn(&Properties) -> f64| {
                trials(&TEN, force, speed, 3, world)
                    .iter()
                    .map(|t| level(t, property))
                    .collect::<Vec<_>>()
            };
            [
                of(1.26, 10.0, traction),
                of(0.2, 63.1, roughness),
                of(0.5, 25.1, fineness),
            ]
        })
        .collect();
    let at = |values: &[f64], number: u8| values[TEN.iter().position(|t| *t == number).unwrap()];
    let rank =
        |values: &[f64], number: u8| values.iter().filter(|v| **v > at(values, number)).count();
    for [traction, roughness, fineness] in &worlds {
        // graphite has the lowest traction, polished aluminum and rubber the highest with foam
        assert_eq!(rank(traction, 43), 9);
        assert!(rank(traction, 46) <= 2 && rank(traction, 47) <= 2);
        // polished aluminum is the least rough, rubber smooth
        assert!(rank(roughness, 46) >= 8 && rank(roughness, 47) >= 7);
        // graphite and satin have higher centroids than burlap and velcro, and than textures without features
        for fine in [43, 84] {
            assert!(
                [10, 100, 46, 47]
                    .iter()
                    .all(|t| at(fineness, fine) > at(fineness, *t))
            );
        }
    }
    // foam, satin, rayon and burlap are the roughest, over the worlds
    let roughness: Vec<f64> = (0..TEN.len())
        .map(|i| mean(worlds.iter().map(|w| w[1][i])))
        .collect();
    assert!(
        [30, 84, 87, 100].iter().all(|t| rank(&roughness, *t) < 4),
        "{roughness:.1?}"
    );
}

/// Uncertainty that one measurement leaves among textures (eq. 7 and 11, equal priors).
fn uncertainty(textures: &[Vec<Properties>], property: fn(&Properties) -> f64) -> f64 {
    let normal = |trials: &Vec<Properties>| {
        let values: Vec<f64> = trials.iter().map(property).collect();
        (mean(values.iter().copied()), deviation(&values))
    };
    let normals: Vec<(f64, f64)> = textures.iter().map(normal).collect();
    let confusion = |a: &(f64, f64), b: &(f64, f64)| {
        let variances = a.1 * a.1 + b.1 * b.1;
        (2.0 * a.1 * b.1 / variances).sqrt() * (-(a.0 - b.0).powi(2) / (4.0 * variances)).exp()
    };
    1.0 - mean(
        normals
            .iter()
            .map(|a| 1.0 / normals.iter().map(|b| confusion(a, b)).sum::<f64>()),
    )
}

#[test]
fn traction_is_best_felt_slow_and_heavy_and_roughness_fast_and_light() {
    // fig. 7, every second force and speed of its grid without those that wear the skin most
    const FORCES: [f64; 3] = [0.2, 0.5, 1.26];
    const SPEEDS: [f64; 3] = [10.0, 25.1, 63.1];
    let uncertainties: Vec<[[f64; 3]; 9]> = (1..=WORLDS)
        .into_par_iter()
        .map(|world| {
            std::array::from_fn(|i| {
                let trials = trials(&TEN, FORCES[i / 3], SPEEDS[i % 3], TRIALS, world);
                [traction, roughness, fineness].map(|property| uncertainty(&trials, property))
            })
        })
        .collect();
    let grid = |property: usize| -> [f64; 9] {
        std::array::from_fn(|i| mean(uncertainties.iter().map(|u| u[i][property])))
    };
    let [traction, roughness] = [grid(0), grid(1)];
    let row = |g: &[f64; 9], i: usize| mean(g[3 * i..3 * i + 3].iter().copied());
    let column = |g: &[f64; 9], i: usize| mean((0..3).map(|k| g[3 * k + i]));
    // traction: slow is better than fast, heavy better than light
    assert!(column(&traction, 0) < column(&traction, 2) && row(&traction, 2) < row(&traction, 0));
    assert!(traction[6] < traction[2] - 0.08);
    // roughness: light is better than heavy, and light and fast than heavy and slow
    assert!(row(&roughness, 0) < row(&roughness, 2));
    assert!(roughness[2] < roughness[6] - 0.08);
    assert!(roughness[2] < roughness[0] + 0.01);
}

#[test]
fn rougher_textures_have_less_traction() {
    // Table 3: correlations over all textures, by movement: traction and roughness, traction and fineness, roughness
    // and fineness
    const MOVEMENTS: [(f64, f64); 3] = [(1.26, 10.0), (0.5, 25.1), (0.2, 63.1)];
    const PAPER: [[f64; 3]; 3] = [
        [-0.5564, -0.3560, 0.2183],
        [-0.4916, -0.5100, 0.3981],
        [-0.4019, -0.5472, 0.5581],
    ];
    let all: Vec<u8> = (1..=117).collect();
    let mut ours = [[0.0; 3]; 3];
    for (m, (force, speed)) in MOVEMENTS.into_iter().enumerate() {
        let worlds: Vec<[f64; 3]> = (1..=WORLDS)
            .into_par_iter()
            .map(|world| {
                let trials = trials(&all, force, speed, 1, world);
                let of = |property: fn(&Properties) -> f64| {
                    trials.iter().map(|t| property(&t[0])).collect::<Vec<_>>()
                };
                let (t, r, f) = (of(traction), of(roughness), of(fineness));
                [
                    correlation(&t, &r),
                    correlation(&t, &f),
                    correlation(&r, &f),
                ]
            })
            .collect();
        ours[m] = std::array::from_fn(|i| mean(worlds.iter().map(|w| w[i])));
    }
    for (ours, paper) in ours.iter().zip(PAPER) {
        assert!((ours[0] - paper[0]).abs() < 0.2, "{ours:.2?}");
        // the others: the paper's signs, weaker
        assert!(ours[1] < -0.1 && ours[2] > -0.1, "{ours:.2?}");
    }
    let mean_of_movements = mean(ours.iter().map(|o| o[0]));
    assert!(
        (-0.6..-0.4).contains(&mean_of_movements),
        "{mean_of_movements:.2}"
    );
}
