use super::*;
use crate::explorer::ObserveError;
use crate::explorer::{Config, Explorer, Strategy};
use crate::features::SlideError;
use crate::features::{Block, Movement, Property, PropertySet};
use crate::table::Table;
use crate::table::tests::{around, table_of};
use embassy_futures::block_on;
use std::cell::RefCell;
use std::format;
use std::string::String;
use std::vec;
use std::vec::Vec;

/// The next stimulus of the finger.
#[derive(Clone, Copy)]
enum Stimulus {
    /// A slide with this tangential force in mN.
    Traction(i16),
    /// A slide without force sensing.
    NoForce,
    /// A slide that never reaches its steady part.
    Stuck,
    /// The movement fails; the rig gets over what is called `SLIPS`.
    Fault(&'static str),
}
use Stimulus::{Fault, NoForce, Stuck, Traction};

const SLIPS: &str = "lever slips";

/// A rig that feels one thing after the other, and notes its movements.
struct Script {
    stimuli: Vec<Stimulus>,
    made: Vec<Movement>,
}

impl Rig for Script {
    type Error = &'static str;

    fn measures(&self) -> PropertySet {
        [Property::Traction].into_iter().collect()
    }

    async fn perform(&mut self, slide: &mut Slide<'_>) -> Result<(), Self::Error> {
        let stimuli = self
            .stimuli
            .get(self.made.len())
            .copied()
            .unwrap_or(Fault("script over"));
        self.made.push(slide.movement());
        let shear_mn = match stimuli {
            Fault(why) => return Err(why),
            Stuck => return Ok(()),
            Traction(mn) => vec![mn; 10],
            NoForce => vec![],
        };
        slide.set_background(2.0);
        let sample = |n: usize| ((n * 37) % 101) as i16;
        let pac: Vec<i16> = (0..600).map(sample).collect();
        for block in Block::cut(&[], 0..600, &pac, &shear_mn) {
            slide.take(&block);
        }
        Ok(())
    }

    async fn recover(&mut self, failed: &Self::Error) -> bool {
        *failed == SLIPS
    }
}

/// Two textures, tractions 1 N and 2 N, told apart better at the second of two movements.
fn bytes() -> Vec<u8> {
    let row = |mean, wide, narrow| vec![around([(mean, wide); 3]), around([(mean, narrow); 3])];
    table_of(PropertySet::ALL, &[row(1.0, 0.8, 0.4), row(2.0, 0.8, 0.4)])
}

type Outcome = Result<Verdict, ExploreError<&'static str>>;

/// Explores by this script; returns the outcome, the steps reported, and the movements made.
fn explored(stimuli: &[Stimulus], config: Config) -> (Outcome, Vec<String>, Vec<Movement>) {
    let bytes = bytes();
    let mut rig = Script {
        stimuli: stimuli.to_vec(),
        made: Vec::new(),
    };
    let table = Table::read(&bytes).unwrap();
    let mut explorer = Explorer::<'_, 2>::new(table, rig.measures(), config).unwrap();
    let mut told = Vec::new();
    let mut random = [0, u32::MAX].into_iter().cycle();
    let outcome = block_on(explore(
        &mut rig,
        &mut explorer,
        &Plan::new(),
        || random.next().unwrap(),
        |event| {
            told.push(match event {
                ExplorationStep::Decided { .. }
                | ExplorationStep::Verified(..)
                | ExplorationStep::Early(_) => return,
                ExplorationStep::Chosen(action, expected) => {
                    assert!(expected.iter().any(|o| o.action == action));
                    format!("{} {}", action.what(), action.movement)
                }
                ExplorationStep::Measured(action, slide, posterior) => {
                    let x = slide.properties.get(action.property.unwrap()).unwrap();
                    format!("measured {} {x:.1}: {:.2}", action.movement, posterior[1])
                }
                ExplorationStep::Rejected(action, why) => {
                    format!("rejected {}: {why}", action.movement)
                }
                ExplorationStep::CutShort(known, slides) => {
                    assert!(!known.sure);
                    format!("cut short after {slides}: {:.2}", known.probability)
                }
            });
        },
    ));
    (outcome, told, rig.made)
}

fn config(threshold: f32, max_slides: u8) -> Config {
    Config {
        threshold,
        max_slides,
        ..Config::default()
    }
}

const STUCK: Rejection<&str> = Rejection::Slide(SlideError::NotStarted);

#[test]
fn explores_until_it_is_sure() {
    let stimuli = [1900, 2000, 2000, 2000].map(Traction);
    let (outcome, told, made) = explored(&stimuli, config(0.99, 10));
    let verdict = outcome.unwrap();
    assert_eq!((verdict.texture, verdict.sure), (1, true));
    // by hand: log odds +2.5, +0.78 and +3.125; uncertainty after the first 0.128 at the first movement and 0.098 at
    // the second, which was made once: 0.098^(1/2)
    assert_eq!(
        told,
        [
            "traction 1",
            "measured 1 1.9: 0.92",
            "traction 0",
            "measured 0 2.0: 0.96",
            "traction 1",
            "measured 1 2.0: 1.00"
        ]
    );
    let grid: Vec<Movement> = Movement::grid().take(2).collect();
    assert_eq!(made, [grid[1], grid[0], grid[1]]);
    let odds = (2.5f32 + 0.78125 + 3.125).exp();
    assert!((verdict.probability - odds / (1.0 + odds)).abs() < 1e-4);
}

/// A rig whose finger is down after a slide until somebody waits for it; what happens is noted.
struct Slow<'a>(Script, &'a RefCell<Vec<&'static str>>);

impl Rig for Slow<'_> {
    type Error = &'static str;

    fn measures(&self) -> PropertySet {
        self.0.measures()
    }

    async fn perform(&mut self, slide: &mut Slide<'_>) -> Result<(), Self::Error> {
        self.1.borrow_mut().push("performed");
        self.0.perform(slide).await
    }

    async fn lifted(&mut self) -> Result<(), Self::Error> {
        let jams = self.0.stimuli.len() == self.0.made.len();
        self.1.borrow_mut().push("lifted");
        if jams { Err("it jams") } else { Ok(()) }
    }
}

#[test]
fn a_slide_is_judged_while_the_finger_is_lifted() {
    let outcome = |stimuli: &[Stimulus], config| {
        let (bytes, noted) = (bytes(), RefCell::default());
        let script = Script {
            stimuli: stimuli.to_vec(),
            made: Vec::new(),
        };
        let mut rig = Slow(script, &noted);
        let table = Table::read(&bytes).unwrap();
        let mut explorer = Explorer::<'_, 2>::new(table, rig.measures(), config).unwrap();
        let plan = Plan::new();
        let exploration = explore(
            &mut rig,
            &mut explorer,
            &plan,
            || 0,
            |event| {
                noted.borrow_mut().push(match event {
                    ExplorationStep::Chosen(..) => "chosen",
                    ExplorationStep::Measured(..) => "measured",
                    ExplorationStep::Rejected(..) => "rejected",
                    ExplorationStep::Decided { slides, .. } => {
                        assert_eq!(slides, 2);
                        "decided"
                    }
                    ExplorationStep::CutShort(..) => "cut short",
                    ExplorationStep::Verified(..) => "verified",
                    ExplorationStep::Early(_) => "early",
                });
            },
        );
        let outcome = block_on(exploration);
        (outcome.map(|verdict| verdict.texture), noted.into_inner())
    };
    let all = [
        "chosen",
        "lifted",
        "performed",
        "measured",
        "chosen",
        "lifted",
        "performed",
        "measured",
        "decided",
        "lifted",
    ];
    let stimuli = [Traction(1900), Traction(2000), Traction(0)];
    assert_eq!(outcome(&stimuli, config(1.0, 2)), (Ok(1), all.to_vec()));
    // the answer stands and is reported; that the finger is down is reported as well
    let (failed, noted) = outcome(&stimuli[..2], config(1.0, 2));
    assert_eq!(
        (failed, noted),
        (Err(ExploreError::Rig("it jams")), all.to_vec())
    );
    // when no movement is left, the finger is up at the end
    let (failed, noted) = outcome(&[Stuck; 5], config(1.0, 2));
    assert_eq!(failed, Err(ExploreError::Rejected(STUCK)));
    assert_eq!(noted.last(), Some(&"lifted"));
}

#[test]
fn names_the_best_after_the_last_slide() {
    let (outcome, told, made) = explored(
        &[Traction(1900), Traction(1400), Traction(1700)],
        config(1.0, 3),
    );
    let verdict = outcome.unwrap();
    assert_eq!((verdict.texture, verdict.sure), (1, false));
    assert_eq!((told.len(), made.len()), (6, 3));
    assert!(told[5].starts_with("measured"));
    let (outcome, told, made) = explored(&[], config(1.0, 0));
    assert_eq!(outcome.unwrap().probability, 0.5, "without a slide");
    assert!(told.is_empty() && made.is_empty());
}

#[test]
fn a_rejected_slide_is_repeated_and_not_used() {
    let straight = explored(&[Traction(1900), Traction(2000)], config(0.99, 2));
    let (outcome, told, made) = explored(
        &[Stuck, Traction(1900), NoForce, Traction(2000)],
        config(0.99, 2),
    );
    assert_eq!(outcome, straight.0);
    assert_eq!(made.len(), 4);
    assert_eq!(
        told,
        [
            "traction 1",
            "rejected 1: the slide never reached its steady part",
            "traction 1",
            "measured 1 1.9: 0.92",
            "traction 0",
            "rejected 0: the slide did not give a value of traction",
            "traction 0",
            "measured 0 2.0: 0.96",
        ]
    );
}

#[test]
fn a_movement_is_tried_twice_and_then_another_until_none_is_left() {
    let stimuli = [Stuck, NoForce, Stuck, NoForce, Traction(1900)];
    let (outcome, told, made) = explored(&stimuli, config(0.99, 10));
    let missing = Rejection::Observe(ObserveError::Missing(Property::Traction));
    assert_eq!(outcome, Err(ExploreError::Rejected(missing)));
    assert_eq!(made.len(), 4);
    let chosen: Vec<&String> = told.iter().step_by(2).collect();
    assert_eq!(
        chosen,
        ["traction 1", "traction 1", "traction 0", "traction 0"]
    );
}

#[test]
fn what_is_known_when_it_cannot_go_on_is_told() {
    let stimuli = [Traction(1900), Stuck, Fault(SLIPS), Stuck, Stuck];
    for strategy in [Strategy::Bayesian, Strategy::Cycling, Strategy::Random] {
        let config = Config {
            strategy,
            ..config(0.99, 10)
        };
        let (outcome, told, made) = explored(&stimuli, config);
        assert!(
            matches!(outcome, Err(ExploreError::Rejected(_))),
            "{strategy:?}"
        );
        assert!(
            told.last().unwrap().starts_with("cut short after 1: "),
            "{told:?}"
        );
        assert_eq!(made.len(), 5);
    }
}

#[test]
fn a_good_slide_in_between_resets_the_count() {
    let bad = [Stuck, Traction(1500), Stuck, Traction(1500)];
    let stimuli: Vec<Stimulus> = bad.into_iter().cycle().take(40).collect();
    let (outcome, told, made) = explored(&stimuli, config(1.0, 20));
    assert!(!outcome.unwrap().sure);
    assert_eq!((told.len(), made.len()), (80, 40));
}

#[test]
fn a_movement_that_failed_is_made_again_and_then_another() {
    let stimuli = [
        Fault(SLIPS),
        Traction(1900),
        Fault(SLIPS),
        Fault(SLIPS),
        Traction(2000),
        Traction(2000),
    ];
    let (outcome, told, _) = explored(&stimuli, config(0.99, 10));
    let verdict = outcome.unwrap();
    assert_eq!((verdict.texture, verdict.sure), (1, true));
    assert_eq!(
        told,
        [
            "traction 1",
            "rejected 1: lever slips",
            "traction 1",
            "measured 1 1.9: 0.92",
            "traction 0",
            "rejected 0: lever slips",
            "traction 0",
            "rejected 0: lever slips",
            "traction 1",
            "measured 1 2.0: 1.00",
        ]
    );
}

#[test]
fn a_fault_of_the_rig_ends_it() {
    let (outcome, told, made) =
        explored(&[Stuck, Fault("e-stop"), Traction(2000)], config(0.99, 10));
    assert_eq!(outcome, Err(ExploreError::Rig("e-stop")));
    assert_eq!((told.len(), made.len()), (3, 2));
    assert_eq!(
        told[2], "traction 1",
        "nothing is told of the slide that failed"
    );
}

#[test]
fn a_random_choice_takes_what_it_is_given() {
    let random = Config {
        strategy: Strategy::Random,
        ..config(1.0, 4)
    };
    let (outcome, told, made) = explored(&[Traction(1500); 4], random);
    assert_eq!(outcome.unwrap().probability, 0.5);
    let grid: Vec<Movement> = Movement::grid().take(2).collect();
    assert_eq!(made, [grid[0], grid[1], grid[0], grid[1]]);
    assert_eq!(
        (told[0].as_str(), told[2].as_str()),
        ("traction 0", "traction 1")
    );
}
