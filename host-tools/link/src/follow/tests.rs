use std::cell::RefCell;
use std::sync::OnceLock;
use tactus_core::explorer::{Config, Method, Strategy};
use tactus_core::features::{Blocks, SlideError};
use tactus_core::probe::event_of;
use tactus_core::probe::explore::{ExplorationStep, explore};
use tactus_core::rig::{Fault, Rig};
use tactus_core::table::Name;
use tactus_core::wire::{self, Failure, MAX_FRAME, Receiver, Rejection, Report};

use super::*;
use tactus_lab::sim::collection::{Collection, calibrated};
use tactus_lab::sim::rig::{SimError, SimRig};

const UNKNOWN: u8 = 47;

/// Reports as the probe does, through frames.
#[derive(Default)]
struct Events(RefCell<Vec<Event>>);

impl Events {
    fn push(&self, event: Event) {
        let mut buffer = [0; MAX_FRAME + 1];
        let report = Report {
            number: 0,
            at_ms: 0,
            event,
        };
        let mut receiver = Receiver::default();
        for &byte in wire::encode(&report, &mut buffer).unwrap() {
            if let Some(got) = receiver.push::<Report>(byte) {
                self.0.borrow_mut().push(got.unwrap().event);
            }
        }
    }
}

/// The simulated rig, which reports its samples in blocks.
struct Streamed<'a> {
    rig: SimRig,
    events: &'a Events,
}

impl Rig for Streamed<'_> {
    type Error = SimError;

    fn measures(&self) -> PropertySet {
        PropertySet::ALL
    }

    async fn perform(&mut self, slide: &mut Slide<'_>) -> Result<(), SimError> {
        if self.rig.control().phase() == tactus_core::rig::Phase::Parked {
            self.rig.home()?;
        }
        let movement = slide.movement();
        let mut take = |block: Block| {
            slide.take(&block);
            self.events.push(Event::Block(block));
        };
        let mut blocks = Blocks::default();
        self.rig.slide(movement, 0.5, |outputs, _| {
            let (phase, pac) = (&outputs.sample_phase, &outputs.pac);
            if let Some(block) = blocks.put(phase, pac, outputs.shear_mn) {
                take(block);
            }
        })?;
        take(blocks.end(0));
        Ok(())
    }
}

fn asked() -> Identify {
    Identify {
        among: Default::default(),
        threshold: 1.0,
        max_slides: 4,
        method: None,
        strategy: Strategy::Bayesian,
        open: true,
        learn: false,
        seed: 1,
        false_alarm: None,
    }
}

/// A fused table of three textures, and what a probe reports of an exploration with it.
fn explored() -> &'static (Vec<u8>, Vec<Event>) {
    static EXPLORED: OnceLock<(Vec<u8>, Vec<Event>)> = OnceLock::new();
    EXPLORED.get_or_init(|| exploration(Method::Fused))
}

fn exploration(method: Method) -> (Vec<u8>, Vec<Event>) {
    let world = Collection::new(5, vec![10, UNKNOWN, 100], 3);
    let calibration = calibrated(world.setup(10, 0)).unwrap();
    let bytes = world.learn(method, calibration, || ()).unwrap();
    let table = Table::read(&bytes).unwrap();
    let events = Events::default();
    let mut rig = Streamed {
        rig: SimRig::new(world.setup(UNKNOWN, 100)),
        events: &events,
    };
    rig.rig.control().calibrate(calibration).unwrap();
    let config = Config {
        method,
        open: asked().open,
        threshold: asked().threshold,
        max_slides: asked().max_slides,
        strategy: asked().strategy,
        ..Config::default()
    };
    let mut explorer = Explorer::<8>::new(table, PropertySet::ALL, config).unwrap();
    let (mut slide, plan) = (1, Plan::new());
    let exploration = explore(
        &mut rig,
        &mut explorer,
        &plan,
        || 0,
        |step| {
            events.push(event_of(&step, table, &config, slide).expect("no slide is rejected"));
            slide += u8::from(matches!(step, ExplorationStep::Measured(..)));
        },
    );
    embassy_futures::block_on(exploration).unwrap();
    let events = events.0.into_inner();
    (bytes, events)
}

/// Follows these reports; how well they agree, and what could not be compared.
fn follow(events: &[Event]) -> (Agreement, Vec<FollowError>) {
    follow_with(&explored().0, &asked(), events)
}

fn follow_with(table: &[u8], asked: &Identify, events: &[Event]) -> (Agreement, Vec<FollowError>) {
    let plan = Plan::new();
    let table = Table::read(table).unwrap();
    let mut follower = Follower::new(table, PropertySet::ALL, asked, &plan).unwrap();
    let errors = events.iter().filter_map(|event| follower.hear(event).err());
    let errors = errors.collect();
    (follower.agreement().clone(), errors)
}

/// Follows the exploration with the first report changed that `change` knows.
fn changed(change: impl FnMut(&mut Event) -> bool) -> (Agreement, Vec<FollowError>) {
    let mut events = explored().1.clone();
    assert!(events.iter_mut().any(change));
    follow(&events)
}

/// The `nth` report (from 0) that `is` knows.
fn place(nth: usize, is: impl Fn(&Event) -> bool) -> usize {
    let mut places = explored().1.iter().enumerate().filter(|(_, t)| is(t));
    places.nth(nth).unwrap().0
}

#[test]
fn an_exploration_is_followed_to_the_bit() {
    let (agreement, errors) = follow(&explored().1);
    assert_eq!(errors, []);
    let exact = Agreement {
        slides: 4,
        posteriors: 4,
        choices: 4,
        verdicts: 1,
        ..Agreement::default()
    };
    assert_eq!(agreement, exact);
    assert!(agreement.agrees());
    // so is one by the paper's method, if it was asked for
    let (table, events) = exploration(Method::Paper);
    let asked = Identify {
        method: Some(Method::Paper),
        ..asked()
    };
    assert_eq!(follow_with(&table, &asked, &events), (exact, vec![]));
}

#[test]
fn a_changed_sample_is_found() {
    // in the middle of the steady part of the first slide
    let at = place(60, |t| matches!(t, Event::Block(b) if !b.still));
    let mut events = explored().1.clone();
    let Event::Block(block) = &mut events[at] else {
        panic!()
    };
    block.pac[7] += 40;
    let (agreement, errors) = follow(&events);
    assert_eq!((errors, agreement.slides), (vec![], 4));
    assert!(agreement.properties > 0.0 && agreement.signal > 0.0);
    assert_eq!((agreement.posterior, agreement.expected), (0.0, 0.0));
}

#[test]
fn a_changed_posterior_property_or_outcome_is_found() {
    let (agreement, _) = changed(|event| match event {
        Event::SlideReport {
            slide: 2,
            posterior,
            ..
        } => {
            posterior[1] += 2e-4;
            true
        }
        _ => false,
    });
    assert!((agreement.posterior - 2e-4).abs() < 1e-6 && !agreement.agrees());
    let (agreement, _) = changed(|event| match event {
        Event::SlideReport {
            slide: 1, observed, ..
        } => {
            observed.properties[0] = None;
            true
        }
        _ => false,
    });
    assert_eq!(agreement.properties, f32::INFINITY);
    let (agreement, _) = changed(|event| match event {
        Event::Chosen {
            slide: 3, expected, ..
        } => {
            expected[0].benefit -= 1e-3;
            true
        }
        _ => false,
    });
    assert!((agreement.expected - 1e-3).abs() < 1e-6 && !agreement.agrees());
    let (agreement, _) = changed(|event| match event {
        Event::Verdict(Verdict { sure, .. }) => {
            *sure = !*sure;
            true
        }
        _ => false,
    });
    assert_eq!(agreement.other_verdicts, 1);
    let (agreement, _) = changed(|event| match event {
        Event::Verdict(Verdict { unknown, .. }) => {
            *unknown = !*unknown;
            true
        }
        _ => false,
    });
    assert_eq!(agreement.other_verdicts, 1);
    let (agreement, _) = changed(|event| match event {
        Event::Verdict(Verdict { log_odds, .. }) => {
            *log_odds = log_odds.map(|odds| odds + 0.5);
            true
        }
        _ => false,
    });
    assert!((agreement.posterior - 0.5).abs() < 1e-3, "{agreement:?}");
    let (agreement, _) = changed(|event| match event {
        Event::SlideReport {
            slide: 1, observed, ..
        } => {
            observed.bands[3] += 1;
            true
        }
        _ => false,
    });
    assert!(agreement.signal >= 1.0 / FEATURE_STEPS && !agreement.agrees());
}

#[test]
fn another_choice_is_found() {
    let (agreement, errors) = changed(|event| match event {
        Event::Chosen {
            slide: 1,
            action,
            expected,
            ..
        } => {
            *action = expected.last().unwrap().action;
            true
        }
        _ => false,
    });
    assert_eq!(errors, []);
    assert_eq!(agreement.other_choices.len(), 1);
    assert_eq!(agreement.other_choices[0].slide, 1);
    assert!(!agreement.agrees());
}

#[test]
fn a_missing_report_is_said_and_the_rest_followed() {
    let without = |at: usize| {
        let mut events = explored().1.clone();
        events.remove(at);
        follow(&events)
    };
    let (agreement, errors) = without(place(40, |t| matches!(t, Event::Block(_))));
    let says = |error: &FollowError, part| assert!(error.0.starts_with(part), "{error}");
    assert_eq!(errors.len(), 1);
    says(&errors[0], "slide 1: block 40 is missing, block 41 came");
    assert_eq!((agreement.slides, agreement.posteriors), (3, 4));
    // a report of a slide is lost: nothing after it can be compared
    let (agreement, errors) = without(place(1, |t| matches!(t, Event::SlideReport { .. })));
    says(&errors[0], "slide 3 came where slide 2 was due");
    assert_eq!(agreement.posteriors, 1);
    // streaming was off
    let silent: Vec<Event> = explored().1.clone();
    let silent: Vec<Event> = silent
        .into_iter()
        .filter(|t| !matches!(t, Event::Block(_)))
        .collect();
    let (agreement, errors) = follow(&silent);
    assert_eq!(errors.len(), 4);
    says(&errors[3], "slide 4: no samples came");
    assert!(agreement.slides == 0 && !agreement.agrees());
}

#[test]
fn lost_samples_are_no_slide_here_either() {
    let at = place(0, |t| matches!(t, Event::SlideReport { .. }));
    let mut events = explored().1[..at].to_vec();
    let rejected = Event::Rejected {
        slide: 1,
        why: Failure::Slide(Rejection::Slide(SlideError::Gap(3))),
    };
    let (agreement, errors) = follow(&[&events[..], std::slice::from_ref(&rejected)].concat());
    assert_eq!((agreement.rejected, agreement.rejected_only_there), (1, 1));
    assert_eq!(errors, []);
    let Some(Event::Block(last)) = events.last_mut() else {
        panic!()
    };
    last.lost = 3;
    let (agreement, _) = follow(&[&events[..], &[rejected]].concat());
    assert_eq!((agreement.rejected, agreement.rejected_only_there), (1, 0));
}

#[test]
fn an_exploration_that_was_cut_short_is_followed() {
    let (bytes, whole) = explored();
    let second = place(1, |event| matches!(event, Event::SlideReport { .. }));
    let mut events = whole[..=second].to_vec();
    // what is known after these two slides, by an explorer of its own
    let config = Config {
        method: Method::Fused,
        open: true,
        threshold: 1.0,
        max_slides: 4,
        ..Config::default()
    };
    let table = Table::read(bytes).unwrap();
    let mut explorer = Explorer::<8>::new(table, PropertySet::ALL, config).unwrap();
    for event in &events {
        if let Event::SlideReport {
            action, observed, ..
        } = event
        {
            explorer.observe(*action, &observed.observation()).unwrap();
        }
    }
    assert_eq!(explorer.verdict(), None);
    let known = explorer.best();
    let rejected = Event::Rejected {
        slide: 3,
        why: Failure::Slide(Rejection::Rig(Fault::LeverSlips.into())),
    };
    // the third choice twice; it slips both times, and another movement is chosen, which slips as well
    let third = place(2, |event| matches!(event, Event::Chosen { .. }));
    let Event::Chosen { action, .. } = whole[third] else {
        panic!()
    };
    events.extend([whole[third].clone(), rejected.clone()]);
    events.extend([whole[third].clone(), rejected.clone()]);
    assert!(explorer.reject(action) && explorer.reject(action));
    let expected = explorer.expected_outcomes();
    let other = explorer.choose(&expected, 0);
    assert_ne!(other.movement, action.movement);
    events.push(Event::Chosen {
        slide: 3,
        movement: table.movement(other.movement).unwrap(),
        action: other,
        expected: expected
            .iter()
            .copied()
            .take(MAX_EXPECTED_OUTCOMES)
            .collect(),
    });
    events.push(rejected);
    let verdict = |wants_label| {
        Event::Verdict(Verdict {
            texture: known.texture,
            name: Name::try_from(table.name(known.texture).unwrap()).unwrap(),
            probability: known.probability,
            sure: known.sure,
            unknown: known.unknown,
            log_odds: known.log_odds,
            slides: 2,
            wants_label,
            changed: known.changed,
            most_like: known.most_like,
        })
    };
    let followed = |wants_label| follow(&[&events[..], &[verdict(wants_label)]].concat());
    let (agreement, errors) = followed(false);
    assert_eq!(
        (errors, agreement.agrees()),
        (vec![], true),
        "{agreement:?}"
    );
    assert_eq!((agreement.rejected, agreement.choices), (3, 5));
    let (agreement, _) = followed(true);
    assert_eq!(agreement.other_verdicts, 1, "no label is asked for");
}
