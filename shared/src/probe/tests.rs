//! Explorations and trainings on a scripted rig.

mod bounds;
mod dispatch;

use super::explore::Random;
use super::identify::best;
use super::*;
use crate::dsp::Plan;
use crate::explorer::{ExpectedOutcome, Method};
use crate::features::{Block, FeatureSet, Movement, Observation, Property, PropertySet, Slide};
use crate::rig::{Rig, RigError};
use crate::store::tests::ram::Ram;
use crate::store::{SelfLearnedRecord, Store};
use crate::table::tests::{around, fused_of, known, straight, table_of};
use crate::table::{Action, Name, Table};
use crate::wire::{Event, Identify, MAX_EXPECTED_OUTCOMES, Text, Train, Verdict, text};
use embassy_futures::block_on;
use heapless::Vec;
use std::string::String;
use std::{format, vec};

/// A rig on which every texture has the traction that comes next, in mN; none is a slide without samples.
struct Script(std::collections::VecDeque<Option<i16>>);

impl Rig for Script {
    type Error = RigError;

    fn measures(&self) -> PropertySet {
        [Property::Traction].into_iter().collect()
    }

    async fn perform(&mut self, slide: &mut Slide<'_>) -> Result<(), Self::Error> {
        let Some(traction) = self.0.pop_front().ok_or(RigError::Hangs)? else {
            return Ok(());
        };
        slide.set_background(2.0);
        let pac = core::array::from_fn::<i16, 600, _>(|n| ((n * 37) % 101) as i16);
        for block in Block::cut(&[], 0..600, &pac, &[traction; 10]) {
            slide.take(&block);
        }
        Ok(())
    }
}

fn table() -> vec::Vec<u8> {
    let row = |mean| vec![around([(mean, 0.3); 3])];
    table_of(PropertySet::ALL, &[row(1.0), row(2.0), row(3.0)])
}

fn wanted(among: &[u16]) -> Identify {
    Identify {
        among: Vec::from_slice(among).unwrap(),
        threshold: 0.99,
        max_slides: 3,
        method: Some(Method::Paper),
        strategy: crate::explorer::Strategy::Bayesian,
        open: false,
        learn: false,
        seed: 1,
        false_alarm: None,
    }
}

fn identified(slides: &[Option<i16>], wanted: &Identify) -> (Result<(), Text>, vec::Vec<String>) {
    let bytes = table();
    let mut told = vec::Vec::new();
    let result = block_on(identify(
        wanted,
        wanted.config(Table::read(&bytes).unwrap().contents()),
        &mut Script(slides.iter().copied().collect()),
        Table::read(&bytes).unwrap(),
        &Plan::new(),
        |tell| {
            told.push(match tell {
                Event::Chosen {
                    slide, expected, ..
                } => {
                    format!("chosen {slide} of {}", expected.len())
                }
                Event::SlideReport {
                    slide, posterior, ..
                } => format!("measured {slide} {posterior:.2?}"),
                Event::Rejected { slide, why } => format!("rejected {slide}: {why}"),
                Event::Verdict(Verdict {
                    name, sure, slides, ..
                }) => format!("{name} {sure} {slides}"),
                other => format!("{other:?}"),
            });
        },
    ));
    (result.map(|_| ()).map_err(text), told)
}

#[test]
fn an_exploration_is_reported_from_beginning_to_end() {
    let (result, told) = identified(&[None, Some(2100), Some(2000)], &wanted(&[]));
    assert_eq!(result, Ok(()));
    assert_eq!(
        told,
        [
            "chosen 1 of 1",
            "rejected 1: the slide never reached its steady part",
            "chosen 1 of 1",
            "measured 1 [0.00, 0.99, 0.01]",
            "chosen 2 of 1",
            "measured 2 [0.00, 1.00, 0.00]",
            "t1 true 2",
        ]
    );
}

#[test]
fn of_a_pair_only_one_can_be_the_answer() {
    let (result, told) = identified(&[Some(2000); 3], &wanted(&[0, 2]));
    assert_eq!(result, Ok(()));
    assert!(told.iter().all(|line| !line.starts_with("t1")), "{told:?}");
    assert!(told[1].ends_with("0.00, 0.50]"), "{told:?}");
}

#[test]
fn what_goes_wrong_is_said() {
    assert_eq!(
        identified(&[], &wanted(&[])).0.unwrap_err(),
        "the movement does not end: home the rig"
    );
    let error = identified(&[], &wanted(&[7])).0.unwrap_err();
    assert!(error.contains("not textures of the table"), "{error}");
}

#[test]
fn random_numbers_are_spread() {
    for seed in [0, 1, u32::MAX] {
        let mut random = Random::new(seed);
        let mut bins = [0; 10];
        for _ in 0..10_000 {
            let x = random.next_f32();
            assert!((0.0..1.0).contains(&x));
            bins[(x * 10.0) as usize] += 1;
        }
        // 1000 with a standard deviation of 30
        assert!(bins.iter().all(|n| (850..1150).contains(n)), "{bins:?}");
    }
}

/// Four textures whose tractions lie ten standard deviations apart; the third one's bands are those of the script's
/// slides.
fn fused_table() -> vec::Vec<u8> {
    let bands = {
        let plan = Plan::new();
        let mut slide = Slide::new(&plan, Movement::FOR_TRACTION);
        block_on(Script([Some(0)].into()).perform(&mut slide)).unwrap();
        Observation::from(&slide.finish().unwrap()).bands
    };
    let row = |traction: f64, apart: f64| {
        let bands = bands.iter().map(|b| f64::from(*b) / 1024.0 + apart);
        let mean: vec::Vec<f64> = core::iter::once(traction).chain(bands).collect();
        vec![known(5, &mean)]
    };
    let rows = [
        row(-10.0, -4.0),
        row(0.0, 4.0),
        row(10.0, 0.0),
        row(20.0, 8.0),
    ];
    fused_of(FeatureSet::Force, &[straight(1 + bands.len())], &rows)
}

#[test]
fn a_fused_exploration_says_whether_it_is_certain() {
    let bytes = fused_table();
    let explored = |slides: &[Option<i16>], open, learn| {
        let mut told = vec::Vec::new();
        let wanted = Identify {
            method: None,
            open,
            learn,
            ..wanted(&[])
        };
        let (episode, found) = block_on(identify(
            &wanted,
            wanted.config(Table::read(&bytes).unwrap().contents()),
            &mut Script(slides.iter().copied().collect()),
            Table::read(&bytes).unwrap(),
            &Plan::new(),
            |tell| told.push(tell),
        ))
        .unwrap();
        let leading = found.leading.first().map(|(texture, _)| *texture);
        assert_eq!(leading, Some(found.verdict.texture));
        (episode, told.pop().unwrap())
    };
    let (episode, verdict) = explored(&[Some(10_000)], true, false);
    let Event::Verdict(Verdict {
        texture: 2,
        sure: true,
        unknown: false,
        wants_label: false,
        slides: 1,
        log_odds,
        ..
    }) = verdict
    else {
        panic!("{verdict:?}");
    };
    assert!(log_odds.unwrap() < -2.0);
    let table = Table::read(&bytes).unwrap();
    assert_eq!(
        (episode.table, episode.texture, episode.certain),
        (table.crc(), 2, false)
    );
    let (movement, slides, mean) = &episode.observed[0];
    assert_eq!((episode.observed.len(), *movement, *slides), (1, 0, 1));
    let mean = mean.iter().zip(table.white_mean(2, 0));
    assert!(mean.clone().count() == 27 && mean.clone().all(|(a, b)| a.abs_diff(b) <= 1));
    // to learn from it takes one more
    let (episode, verdict) = explored(&[Some(10_000), Some(10_100)], true, true);
    assert!(matches!(verdict, Event::Verdict(Verdict { slides: 2, .. })));
    assert!(episode.certain && episode.observed[0].1 == 2);
    // far from all
    let (episode, verdict) = explored(&[Some(-32_000), Some(-32_000)], true, true);
    let Event::Verdict(Verdict {
        texture: 0,
        sure: false,
        unknown: true,
        wants_label: true,
        slides: 2,
        ..
    }) = verdict
    else {
        panic!("{verdict:?}");
    };
    assert!(!episode.certain);
    assert_eq!(episode.observed[0].1, 2);
    let (episode, verdict) = explored(&[Some(-32_000), Some(-32_000)], false, true);
    let Event::Verdict(Verdict {
        texture: 0,
        sure: true,
        unknown: false,
        wants_label: true,
        ..
    }) = verdict
    else {
        panic!("{verdict:?}");
    };
    assert!(
        !episode.certain,
        "closed, and not to be learned from all the same"
    );
}

/// The user trains a texture of which the probe had learned something by itself: the user's training replaces it.
#[test]
fn training_a_fused_texture_ends_in_the_store() {
    let bytes = fused_table();
    let table = Table::read(&bytes).unwrap();
    for (name, tractions) in [("elm", [31_000, 29_000]), ("t2", [11_000, 13_000])] {
        let mut store = block_on(Store::open(Ram::<16_384>::new())).unwrap();
        let movements = Vec::from_slice(&[(0, 3, known(9, &[1.0; 13]))]).unwrap();
        // number 4 is the next one's
        for number in [1, 2, 4] {
            let record = SelfLearnedRecord {
                lineage: table.lineage(),
                number,
                movements: movements.clone(),
            };
            block_on(store.set_self_learned(&record)).unwrap();
        }
        let known_before = table.find(name).map_or(0, |t| table.trials(t, 0));
        let wanted = Train {
            name: Name::try_from(name).unwrap(),
            trials: known_before + 2,
            pilot: false,
            seed: 1,
        };
        let mut rig = Script([None, Some(tractions[0]), Some(tractions[1])].into());
        let mut buffer = vec![0; 8192];
        let mut told = vec::Vec::new();
        block_on(train(
            &wanted,
            &mut rig,
            (&mut store, table, &mut buffer),
            &Plan::new(),
            |tell| told.push(tell),
        ))
        .unwrap();
        assert!(matches!(
            told[..],
            [
                Event::Rejected { slide: 1, .. },
                Event::TrainingSlide { left: 1, .. },
                Event::TrainingSlide { left: 0, .. }
            ]
        ));
        let mut buffer = vec![0; 8192];
        let new = block_on(store.read_table(&mut buffer)).unwrap().unwrap();
        let texture = new.find(name).unwrap();
        assert_eq!(new.trials(texture, 0), known_before + 2);
        let mean = new.white_mean(texture, 0).next().unwrap();
        let before = if known_before > 0 { 5.0 * 10.0 } else { 0.0 };
        let sum = before + tractions.map(f64::from).iter().sum::<f64>() / 1000.0;
        let expected = sum / f64::from(known_before + 2) * 256.0;
        assert!(
            (f64::from(mean) - expected).abs() <= 1.0,
            "{mean} {expected}"
        );
        assert_eq!((new.tally(texture).user, new.lineage()), (2, table.crc()));
        let number = new.number(texture);
        let mut left = vec::Vec::new();
        block_on(store.self_learned(table.lineage(), &mut |r| left.push(r.number))).unwrap();
        assert!(!left.contains(&number) && left.contains(&1), "{left:?}");
        let unfinished = block_on(store.training_record(name, table.movement(0).unwrap(), None));
        assert_eq!(unfinished, Ok(None));
    }
}

#[test]
fn expected_outcomes_are_the_best_first_and_fit() {
    let mut random = Random::new(5);
    for length in [0, 1, 5, MAX_EXPECTED_OUTCOMES, 50] {
        let expected: vec::Vec<ExpectedOutcome> = (0..length)
            .map(|n| ExpectedOutcome {
                action: Action {
                    movement: n as u8,
                    property: None,
                },
                uncertainty: random.next_f32(),
                // some are equal
                benefit: (random.next_u32() % 20) as f32,
            })
            .collect();
        let mut sorted = expected.clone();
        sorted.sort_by(|a, b| b.benefit.total_cmp(&a.benefit));
        let told = best(&expected);
        assert_eq!(told.len(), length.min(MAX_EXPECTED_OUTCOMES));
        for (told, sorted) in told.iter().zip(&sorted) {
            assert_eq!((told.action, told.benefit), (sorted.action, sorted.benefit));
            assert_eq!(told.uncertainty, sorted.uncertainty);
        }
    }
}
