//! Tables that know speeds against the recipe.

use super::drift::{Agreement, drift_of, world};
use super::*;
use crate::table::tests::slopes::paced;
use crate::table::tests::whitening::Noise;
use crate::table::{Drift, Pace, Slope};

#[test]
fn means_go_with_the_speed_known_and_unknown_as_by_the_recipe() {
    let (mut noise, mut agreement) = (Noise(23), Agreement::default());
    for number in 0..60 {
        let (mut recipe, bytes) = world(&mut noise, drift_of(number), number % 3 > 0);
        let (textures, movements, d) = (recipe.known.len(), recipe.known[0].len(), recipe.d);
        let mut slope = |sd: f64| {
            let mut slope = Slope::default();
            slope[..d].fill_with(|| (256.0 * sd * noise.normal()) as i16);
            slope
        };
        recipe.paces = (0..movements)
            .map(|at| Pace {
                mean: [0, 40, -70, 15][at],
                variance: 0.0625,
                pooled: slope(2.0),
            })
            .collect();
        recipe.slopes = (0..textures * movements).map(|_| slope(4.0)).collect();
        let bytes = paced(&bytes, &recipe.paces, &recipe.slopes);
        recipe.compare(&bytes, &mut noise, (1e-2, 0.05, 5e-3), &mut agreement);
    }
    std::println!("{agreement:?}");
    let Agreement {
        all,
        same,
        partly,
        right,
        ..
    } = agreement;
    assert!(f64::from(same) > 0.99 * f64::from(all));
    assert!(all > 2000 && partly > 100);
    assert!(right[0] > right[1]);
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
