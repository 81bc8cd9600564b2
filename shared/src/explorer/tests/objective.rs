//! Movements chosen for bits per second, against the definition written out in f64.

use super::*;
use crate::features::Movement;

/// Slides of the reference rig, and so much overhead.
fn slides_with(overhead_s: f32) -> SlideTime {
    SlideTime {
        longest_mm: 60.0,
        longest_s: 3.0,
        overhead_s,
    }
}

fn hurried(bytes: &[u8], time: SlideTime) -> Eight<'_> {
    let config = Config {
        objective: Objective::BitsPerSecond(time),
        ..Config::default()
    };
    Explorer::new(Table::read(bytes).unwrap(), PropertySet::ALL, config).unwrap()
}

#[test]
fn a_slide_takes_its_distance_or_the_longest_time_and_its_overhead() {
    let time = slides_with(4.0);
    let seconds = |speed| time.seconds(Movement::from_si(0.5, speed).unwrap());
    assert_eq!(seconds(10.0), 7.0, "30 mm in 3 s");
    assert_eq!(seconds(60.0), 5.0, "60 mm in 1 s");
    assert_eq!(seconds(100.0), 4.6);
}

#[test]
fn of_two_movements_that_tell_as_much_the_shorter_one_is_chosen() {
    // 10, 15.8, 25.1, 39.8 mm/s: the first two slide for 3 s
    let bytes = plain(&[0.0, 0.3, 0.6], 4);
    let chosen = |explorer: &Eight<'_>| {
        let action = explorer.choose(&explorer.expected_outcomes(), 0);
        (action.movement, action.property)
    };
    let first = Some(Property::ALL[0]);
    assert_eq!(chosen(&explorer(&bytes, Strategy::Bayesian)), (0, first));
    assert_eq!(chosen(&hurried(&bytes, slides_with(0.0))), (3, first));
}

#[test]
fn a_long_overhead_makes_the_choice_that_of_the_bits() {
    // the slow movement tells a little more
    let cell = |mean, sd| [(mean, sd); 3];
    let rows: Vec<Vec<_>> = [0.0f32, 0.3, 0.6]
        .map(|mean| [0.1, 0.12, 0.12, 0.12].map(|sd| cell(mean, sd)).to_vec())
        .to_vec();
    let bytes = table_of_cells(&rows);
    let chosen = |overhead| {
        let explorer = hurried(&bytes, slides_with(overhead));
        explorer.choose(&explorer.expected_outcomes(), 0).movement
    };
    assert_eq!((chosen(0.0), chosen(1000.0)), (3, 0));
}

#[test]
fn what_is_left_out_is_not_chosen_and_certainty_has_a_choice() {
    let bytes = plain(&[0.0, 7.0], 4);
    let mut explorer = hurried(&bytes, slides_with(0.0));
    let choose = |explorer: &Eight<'_>| explorer.choose(&explorer.expected_outcomes(), 0);
    let first = choose(&explorer);
    assert_eq!(first.movement, 3);
    explorer.reject(first);
    explorer.reject(first);
    assert_eq!(choose(&explorer).movement, 2);
    explorer.observe(choose(&explorer), &all(0.0)).unwrap();
    assert_eq!(explorer.posterior(), [1.0, 0.0]);
    // nothing is left to be gained: the first of equals
    assert_eq!(choose(&explorer).movement, 0);
}

proptest! {
    #![proptest_config(fixed(200))]

    #[test]
    fn the_choice_has_the_greatest_rate_of_the_f64_oracle(
        cells in any_cells(),
        overhead in 0f32..10.0,
        slides in proptest::collection::vec((any::<prop::sample::Index>(), -1f32..1.0), 0..5),
    ) {
        let bytes = table_of_cells(&cells);
        let table = Table::read(&bytes).unwrap();
        let candidates: Vec<u16> = (0..table.textures()).collect();
        let mut paper = Paper::new(table, &candidates);
        let time = slides_with(overhead);
        let mut explorer = hurried(&bytes, time);
        let actions: Vec<Action> = table.actions().collect();
        for (at, x) in &slides {
            let action = *at.get(&actions);
            explorer.observe(action, &all(*x)).unwrap();
            paper.observe(action, (*x).into());
        }
        let now: f64 = paper.p.iter().map(|p| p * (1.0 - p)).sum();
        // later nothing but rounding tells the actions apart
        if now < 1e-3 {
            return Ok(());
        }
        let rate = |action: Action| {
            let speed = f64::from(table.movement(action.movement).unwrap().speed_mm_s());
            let made = f64::from(paper.made.get(&index(action)).copied().unwrap_or(0));
            let bits = (now / paper.uncertainty(action)).log2().max(0.0) / (made + 1.0);
            bits / ((60.0 / speed).min(3.0) + f64::from(overhead))
        };
        let chosen = rate(explorer.choose(&explorer.expected_outcomes(), 0));
        let best = actions.iter().map(|a| rate(*a)).fold(0.0, f64::max);
        prop_assert!(chosen >= 0.99 * best - 1e-3, "{} of {}", chosen, best);
    }
}
