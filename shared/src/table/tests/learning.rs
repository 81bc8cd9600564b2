//! Learning, against statistics in two passes.

use super::*;
use crate::features::Properties;

proptest! {
    #![proptest_config(fixed(128))]

    #[test]
    fn learning_is_the_mean_and_deviation(
        trials in proptest::collection::vec([-8f32..8.0, -16f32..16.0, 5.99f32..6.0], 2..255)) {
        let experience = learned(&trials);
        prop_assert_eq!(usize::from(experience.trials()), trials.len());
        for property in Property::ALL {
            let gaussian = experience.gaussian(property).unwrap();
            let (mean, sd) = two_passes(&column(&trials, property));
            prop_assert!((f64::from(gaussian.mean) - mean).abs() <= 2e-5, "{} {mean}", gaussian.mean);
            prop_assert!((f64::from(gaussian.sd) - sd).abs() <= 1e-4 * sd + 1e-6, "{} {sd}", gaussian.sd);
        }
    }

    #[test]
    fn learning_goes_on_from_a_table(before in proptest::collection::vec([-2f32..2.0, -2f32..2.0, -2f32..2.0], 1..9),
        after in proptest::collection::vec([-2f32..2.0, -2f32..2.0, -2f32..2.0], 1..9)) {
        let bytes = encoded(&[("felt", vec![Experience::default(), learned(&before)])]).unwrap();
        let mut experience = Table::read(&bytes).unwrap().experience(0, 1);
        for trial in &after {
            experience.learn(PropertySet::ALL, &Properties::new(trial.map(Some))).unwrap();
        }
        let all = [before, after].concat();
        prop_assert_eq!(usize::from(experience.trials()), all.len());
        for property in Property::ALL {
            let gaussian = experience.gaussian(property).unwrap();
            let (mean, sd) = two_passes(&column(&all, property));
            let step = f64::from(mean_step(property));
            prop_assert!((f64::from(gaussian.mean) - mean).abs() <= step);
            prop_assert!((f64::from(gaussian.sd) - sd).abs() <= step, "{} {sd}", gaussian.sd);
        }
    }
}

#[test]
fn a_trial_without_the_property_is_not_used() {
    let before = learned(&[[1.0, 2.0, 3.0], [2.0, 2.5, 4.0]]);
    for (at, property) in (0..).zip(Property::ALL) {
        for value in [
            None,
            Some(f32::NAN),
            Some(f32::INFINITY),
            Some(f32::NEG_INFINITY),
        ] {
            let mut trial = [Some(1.5); 3];
            trial[at] = value;
            let mut experience = before;
            assert_eq!(
                experience.learn(PropertySet::ALL, &Properties::new(trial)),
                Err(property)
            );
            assert_eq!(experience, before);
        }
    }
    // a rig that does not measure traction does not need it
    let measured: PropertySet = [Property::Roughness, Property::Fineness]
        .into_iter()
        .collect();
    let mut experience = before;
    let trial = Properties::new([None, Some(3.0), Some(5.0)]);
    assert_eq!(experience.learn(measured, &trial), Ok(()));
    assert_eq!((experience.trials(), experience.mean), (3, [1.5, 2.5, 4.0]));
}

#[test]
fn one_trial_has_a_mean_and_no_deviation() {
    assert_eq!(Experience::default().gaussian(Property::Traction), None);
    let once = learned(&[[1.0, 2.0, 3.0]]);
    assert_eq!(
        (once.trials(), once.gaussian(Property::Traction)),
        (1, None)
    );
    let twice = learned(&[[1.0, 2.0, 3.0], [1.0, 4.0, 3.0]]);
    assert_eq!(
        twice.gaussian(Property::Traction),
        Some(Gaussian { mean: 1.0, sd: 0.0 })
    );
    assert_eq!(
        twice.gaussian(Property::Roughness),
        Some(Gaussian {
            mean: 3.0,
            sd: 2f32.sqrt()
        })
    );
}

/// A cell without trials may hold anything; it must not count.
#[test]
fn learning_begins_anew_where_there_is_no_trial() {
    let bytes = wrong(|bytes| bytes[40..52].fill(0x15));
    assert_eq!(
        Table::read(&bytes).unwrap().experience(0, 1),
        Experience::default()
    );
}

/// Beyond 255 trials every new one has weight 1/255, and those before lose that much together.
#[test]
fn old_trials_are_forgotten_after_255() {
    let mut x = 1u32;
    let mut noise = || {
        x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (x >> 8) as f32 / 16_777_216.0 - 0.5
    };
    for count in [255usize, 256, 400, 2000] {
        let trials: Vec<[f32; 3]> = (0..count)
            .map(|n| {
                [
                    noise(),
                    5.0 + 3.0 * noise(),
                    if n < 300 { 1.0 } else { 2.0 },
                ]
            })
            .collect();
        let experience = learned(&trials);
        assert_eq!(experience.trials(), 255);
        for property in Property::ALL {
            let weight = |n: usize| (254f64 / 255.0).powi((count - n.max(254) - 1) as i32) / 255.0;
            let x = column(&trials, property);
            let weighted = |f: &dyn Fn(f64) -> f64| {
                x.iter()
                    .enumerate()
                    .map(|(n, &x)| weight(n) * f(x))
                    .sum::<f64>()
            };
            assert!((weighted(&|_| 1.0) - 1.0).abs() < 1e-9);
            let mean = weighted(&|x| x);
            // the sum of squares of 255 trials
            let sd = (weighted(&|x| (x - mean).powi(2)) * 255.0 / 254.0).sqrt();
            let gaussian = experience.gaussian(property).unwrap();
            assert!(
                (f64::from(gaussian.mean) - mean).abs() < 1e-4,
                "{count} {} {mean}",
                gaussian.mean
            );
            assert!(
                (f64::from(gaussian.sd) - sd).abs() < 1e-4,
                "{count} {} {sd}",
                gaussian.sd
            );
        }
    }
}
