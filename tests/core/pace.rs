//! Hands that do not hold their speed, with a sensor of it, without one, and with one that has lost track, in the
//! simulated world.

use rayon::prelude::*;
use tactus_core::explorer::Method;
use tactus_core::features::Observation;
use tactus_core::handheld::{ASK_AFTER, FEATURES, MOVEMENT, judge_at_most};
use tactus_core::table::Table;
use tactus_lab::eval::learn;
use tactus_lab::sim::collection::Collection;
use tactus_lab::sim::handheld::slides;
use tactus_tests::count;
use tactus_world::person::Manner;

/// Slides of each texture that a table is learned from, as the factory's.
const TRIALS: usize = 15;
/// Explorations of each texture.
const EXPLORED: usize = 2;

/// A hand with these deviations of ln(pace) and ln(force) from slide to slide, and a sensor of motion, which 1.25 mm of
/// height put off by 5 %.
fn hand(pace_spread: f64, force_spread: f64) -> Manner {
    Manner {
        pace_spread,
        force_spread,
        tilt_mm: Some(1.25),
        ..Manner::default()
    }
}

fn without_speed(slides: &[Observation]) -> Vec<Observation> {
    let each = slides.iter().cloned();
    each.map(|slide| Observation {
        pace: None,
        ..slide
    })
    .collect()
}

/// Explorations, and those of which the first slide was most like the right texture.
#[derive(Clone, Copy, Default)]
struct Counts {
    explored: usize,
    right: usize,
}

impl Counts {
    fn add(&mut self, other: Self) {
        self.explored += other.explored;
        self.right += other.right;
    }

    fn percent(&self) -> f64 {
        100.0 * self.right as f64 / self.explored as f64
    }
}

/// Explores one texture by one slide.
fn explore(table: Table<'_>, is: u16, slides: &[Observation]) -> Counts {
    let judged = judge_at_most(table, &slides[..1], None, None, ASK_AFTER).unwrap();
    Counts {
        explored: 1,
        right: (judged.0.leading[0].0 == is).into(),
    }
}

/// Explorations of these textures in a world: without a sensor of speed, with it, and without it by the table that was
/// learned with it.
fn world(seed: u64, textures: &[u8], manner: Manner) -> [Counts; 3] {
    let collection = Collection::new(seed, textures.to_vec(), TRIALS as u32);
    let wanted = (TRIALS + EXPLORED * ASK_AFTER) as u32;
    let felt = collection.textures.par_iter().zip(collection.names());
    // a texture that is too smooth to be noticed is left out
    let felt: Vec<(String, Vec<Observation>)> = felt
        .filter_map(|(&texture, name)| {
            let (good, _) = slides(collection.setup(texture, 0), manner, wanted).ok()?;
            Some((name, good))
        })
        .collect();
    let names: Vec<String> = felt.iter().map(|(name, _)| name.clone()).collect();
    let learned = |known: Vec<Vec<Vec<Observation>>>| {
        learn::learn(Method::Fused, Some(FEATURES), &names, &[MOVEMENT], &known).unwrap()
    };
    let training = felt.iter().map(|(_, slides)| &slides[..TRIALS]);
    let plain = learned(training.clone().map(|s| vec![without_speed(s)]).collect());
    let paced = learned(training.map(|slides| vec![slides.to_vec()]).collect());
    [(&plain, false), (&paced, true), (&paced, false)].map(|(table, sensor)| {
        let table = Table::read(table).unwrap();
        assert_eq!(table.is_paced(), *table.as_bytes() == paced);
        let mut counts = Counts::default();
        for (name, slides) in &felt {
            let is = table.find(name).unwrap();
            for slides in slides[TRIALS..].chunks(ASK_AFTER) {
                counts.add(if sensor {
                    explore(table, is, slides)
                } else {
                    explore(table, is, &without_speed(slides))
                });
            }
        }
        counts
    })
}

#[test]
fn a_sensor_of_speed_tells_more_and_its_loss_costs_nothing() {
    let textures: Vec<u8> = (1..=117).step_by(3).collect();
    let mut sums = [Counts::default(); 3];
    for seed in 1..=count(2, 1) {
        let counts = world(seed, &textures, hand(0.25, 0.20));
        sums.iter_mut().zip(counts).for_each(|(sum, c)| sum.add(c));
    }
    let [without, with, lost] = sums.map(|counts| counts.percent());
    println!(
        "right after one slide: {without:.1} %, {with:.1} % with the sensor, {lost:.1} % when lost"
    );
    assert!(with > without, "{without} {with}");
    assert!(lost > without - 2.0, "{without} {lost}");
}
