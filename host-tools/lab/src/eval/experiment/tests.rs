//! Which slides are learned from and which are tested, told by marks that each slide carries.

use std::collections::{BTreeMap, BTreeSet};

use tactus_core::features::Properties;

use super::*;
use crate::data::recordings::RecordingSet;
use crate::data::replay::measure_all;

/// Texture, session, and number of a slide.
type Mark = [u32; 3];

/// Slides of textures, a list of (movement, session, run, how many) for each.
fn slides(of: &[&[(usize, u32, u32, u32)]]) -> (Vec<String>, Vec<Vec<MeasuredSlide>>) {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/simulated");
    let set = RecordingSet::open(folder.as_ref()).unwrap();
    let movements = set.movements();
    let any = measure_all(&set, |_| ()).unwrap()[0][0].clone();
    let mut number = 0;
    let mut texture = |(texture, rows): (usize, &&[(usize, u32, u32, u32)])| {
        let mut slides = Vec::new();
        for (movement, session, run, count) in *rows {
            for _ in 0..*count {
                let mut slide = any.clone();
                number += 1;
                let mark = [texture as u32, *session, number].map(|x| Some(x as f32));
                slide.number = number;
                slide.movement = movements[*movement];
                slide.measurement.properties = Properties::new(mark);
                slide.marks = [0, 0, 0, 0, (number >> 8) as u8, number as u8].into();
                slide.session = [session, run].map(|n| {
                    if *n == 0 {
                        String::new()
                    } else {
                        format!("s{n}")
                    }
                });
                slides.push(slide);
            }
        }
        slides
    };
    let slides: Vec<_> = of.iter().enumerate().map(&mut texture).collect();
    let names = (0..of.len()).map(|n| format!("t{n}")).collect();
    (names, slides)
}

fn mark(slide: &Observation) -> Mark {
    use tactus_core::features::Property::{Fineness, Roughness, Traction};
    [Traction, Roughness, Fineness].map(|p| slide.properties.get(p).unwrap() as u32)
}

/// Marks of all slides that a run learns from, and of those that it shows until there are no more.
fn used(experiment: &Experiment, run: u64) -> (Vec<Mark>, Vec<Mark>) {
    let mut run = experiment.run(run);
    let training = run.training();
    let learned = training.iter().flatten().flatten().map(mark).collect();
    let mut shown = Vec::new();
    for movement in 0..experiment.movements.len() {
        while let Some(slide) = run.slide(movement) {
            let name = format!("t{}", mark(slide)[0]);
            assert_eq!(name, experiment.names[run.unknown]);
            shown.push(mark(slide));
        }
    }
    (learned, shown)
}

const THREE_DAYS: &[(usize, u32, u32, u32)] = &[
    (0, 1, 1, 4),
    (0, 2, 2, 5),
    (0, 3, 3, 4),
    (1, 1, 1, 3),
    (1, 2, 2, 3),
    (1, 3, 3, 4),
];
/// Absent on the second day, and not at every movement on the third.
const TWO_DAYS: &[(usize, u32, u32, u32)] =
    &[(0, 1, 1, 5), (0, 3, 3, 6), (1, 1, 1, 6), (1, 3, 4, 5)];

#[test]
fn no_session_is_learned_from_and_tested() {
    let (names, slides) = slides(&[THREE_DAYS, TWO_DAYS, THREE_DAYS]);
    let of = |protocol| {
        let all = Experiment::recorded(names.clone(), &slides, None, protocol, 3, 1).unwrap();
        all.each_slide_once()
    };
    let experiment = of(Protocol::LeaveOneSessionOut);
    assert!(experiment.notes.concat().contains("3 parts, s1, s2, s3"));
    let mut tested: BTreeMap<(u32, u32), BTreeSet<u32>> = BTreeMap::new();
    // a round for each day: of three textures, of two, of three
    for run in 0..80 {
        let (learned, shown) = used(&experiment, run);
        assert_eq!(learned.len(), 3 * 2 * 3);
        let days: BTreeSet<u32> = shown.iter().map(|mark| mark[1]).collect();
        assert_eq!(days.len(), 1, "one session at a time");
        assert!(
            learned.iter().all(|mark| !days.contains(&mark[1])),
            "run {run}"
        );
        for [texture, day, number] in shown {
            tested.entry((texture, day)).or_default().insert(number);
        }
    }
    // every slide of every texture and day, and of the runs of a round each is unknown once
    let counts: Vec<usize> = tested.values().map(BTreeSet::len).collect();
    assert_eq!(counts, [7, 8, 8, 11, 11, 7, 8, 8]);
    assert_eq!(experiment.rounds(10), [0..3, 3..5, 5..8, 8..10]);
    let unknowns: Vec<usize> = (0..8).map(|run| experiment.run(run).unknown).collect();
    assert_eq!(unknowns, [0, 1, 2, 0, 2, 0, 1, 2]);
    // the runs of a round learn from the same slides
    assert_eq!(used(&experiment, 3).0, used(&experiment, 4).0);
    assert_ne!(used(&experiment, 0).0, used(&experiment, 8).0);

    // of the third day, one run has a movement only: that day is learned from while its other run is tested
    let experiment = of(Protocol::LeaveOneRunOut);
    let mut same_day = 0;
    for run in 0..80 {
        let (learned, shown) = used(&experiment, run);
        let numbers: BTreeSet<u32> = learned.iter().map(|mark| mark[2]).collect();
        assert!(shown.iter().all(|mark| !numbers.contains(&mark[2])));
        let days: BTreeSet<u32> = shown.iter().map(|mark| mark[1]).collect();
        same_day += usize::from(learned.iter().any(|mark| days.contains(&mark[1])));
    }
    assert!(same_day > 0);
}

#[test]
fn what_is_short_of_slides_is_named_and_left_out_or_all_learn_from_fewer() {
    let many: &[_] = &[(0, 0, 0, 8)];
    let recorded = |of: &[&[(usize, u32, u32, u32)]], wanted| {
        let (names, slides) = slides(of);
        Experiment::recorded(names, &slides, None, Protocol::Interleaved, wanted, 1)
    };
    let all = recorded(&[many; 4], 5).unwrap();
    assert_eq!((all.train_slides, all.notes.len()), (5, 0));
    // one of four
    let one = recorded(&[many, &[(0, 0, 0, 5)], many, many], 5).unwrap();
    let one = one.each_slide_once();
    assert_eq!(
        (&one.names[..], one.train_slides),
        (&["t0", "t2", "t3"].map(str::to_owned)[..], 5)
    );
    assert_eq!(one.notes, ["Left out, with too few slides: t1."]);
    assert_eq!(
        used(&one, 1).1[0][0],
        2,
        "the second of those that are left"
    );
    // half of them
    let few: &[_] = &[(0, 0, 0, 4)];
    let half = recorded(&[few, many, few, many], 5).unwrap();
    assert_eq!((half.names.len(), half.train_slides), (4, 3));
    assert_eq!(
        half.notes,
        ["Learned from 3 slides in place of 5: half of the textures or more have no more."]
    );
    // a movement that one texture alone was touched with
    let odd: &[_] = &[(0, 0, 0, 8), (1, 0, 0, 8)];
    let odd = recorded(&[many, odd, many], 5).unwrap();
    assert_eq!((odd.names.len(), odd.movements.len()), (3, 1));
    assert!(odd.notes[0].starts_with("Left out, as few textures have slides there: "));
    let two: &[_] = &[(0, 0, 0, 2)];
    let none = recorded(&[two; 3], 5).unwrap_err();
    assert!(none.to_string().contains("record more of each"), "{none}");
}

#[test]
fn without_sessions_an_error_says_what_to_do() {
    let why = |of: &[(usize, u32, u32, u32)], protocol| {
        let (names, slides) = slides(&[of, of]);
        Experiment::recorded(names, &slides, None, protocol, 2, 1)
            .unwrap_err()
            .to_string()
    };
    let (by_session, by_run) = (Protocol::LeaveOneSessionOut, Protocol::LeaveOneRunOut);
    let none = why(&[(0, 0, 0, 9)], by_session);
    assert!(
        none.contains("slide 1 of t0 is of no session: write it into the column session"),
        "{none}"
    );
    let none = why(&[(0, 1, 1, 9), (0, 2, 0, 1)], by_run);
    assert!(
        none.contains("slide 10 of t0 is of no run: write it into the column run"),
        "{none}"
    );
    let one = why(&[(0, 1, 1, 9)], by_session);
    assert!(
        one.contains("all slides are of one session, s1: record another session"),
        "{one}"
    );
    let (names, slides) = slides(&[THREE_DAYS]);
    let test = Some((&names[..], &slides[..]));
    let both = Experiment::recorded(names.clone(), &slides, test, by_session, 2, 1);
    assert!(both.unwrap_err().to_string().contains("leave out --test"));
}

#[test]
fn of_a_second_folder_no_slide_is_tested_that_the_first_has_too() {
    let (names, slides) = slides(&[&[(0, 0, 0, 9)], &[(0, 0, 0, 9)]]);
    let tested = |protocol, first: usize| {
        let of = |slides: &Vec<MeasuredSlide>| slides.iter().take(first).cloned().collect();
        let train: Vec<Vec<MeasuredSlide>> = slides.iter().map(of).collect();
        let test = Some((&names[..], &slides[..]));
        let experiment = Experiment::recorded(names.clone(), &train, test, protocol, 3, 1);
        let experiment = experiment.unwrap().each_slide_once();
        let note = experiment.notes.concat();
        let (learned, shown) = used(&experiment, 0);
        let shown: BTreeSet<Mark> = shown.into_iter().collect();
        assert!(learned.iter().all(|mark| !shown.contains(mark)));
        (shown.len(), note)
    };
    let left_out = |n| format!("Left out of the test, as they may be learned from: {n} slides.");
    assert_eq!(tested(Protocol::Interleaved, 6), (3, left_out(12)));
    // the first three are learned from, and the other ones not
    assert_eq!(tested(Protocol::Drift, 9), (6, left_out(6)));
}
