//! A person of made-up words who does what the probe prompts.

use super::*;
use crate::dsp::Plan;
use crate::probe::explore::Random;
use crate::rig::weigh::ForceScale;
use crate::sensor::pressure::{Calibration, Channel, Counts};
use crate::wire::Again;
use embassy_futures::block_on;
use std::string::{String, ToString as _};
use std::vec::Vec as List;

/// Counts of P_DC in the air.
const AIR: f32 = 2610.0;

const UNMEASURED: RigCalibration = RigCalibration {
    pressure: Calibration::PAPER,
    unloaded_a: (0.0, 0.0),
    newton_per_ampere: 1.0,
    date: 0,
    air_known: false,
    turned: 0,
    serial: [0; 16],
};

struct Obedient {
    random: Random,
    slot: u32,
    /// Words that are still to come in this tick.
    due: u32,
    listens: bool,
    prompt: Option<Prompt>,
    /// Ticks since it changed.
    since: u32,
    /// Contact force of this person's press, mN.
    presses_mn: f32,
    /// mN of a count of this finger.
    mn_per_count: f32,
    told: List<Event>,
    shown: List<String>,
    /// The button is pressed from this tick on, and the host stops at that one.
    gives_up: Option<u32>,
    stops: Option<u32>,
    ticks: u32,
    streams: bool,
    /// Another weight that is put on instead of this one, mN.
    wrong: Option<u16>,
    /// Readings at 1 g and at 0 g, counts.
    g: (f32, f32),
}

impl Obedient {
    fn new() -> Self {
        Self {
            random: Random::new(3),
            slot: 0,
            due: 0,
            listens: false,
            prompt: None,
            since: 0,
            presses_mn: 500.0,
            mn_per_count: 11.5,
            told: List::new(),
            shown: List::new(),
            gives_up: None,
            stops: None,
            ticks: 0,
            streams: false,
            wrong: None,
            g: (1024.6, 0.0),
        }
    }

    /// Force and vibration at this moment.
    fn does(&self) -> (f32, f32) {
        match self.prompt {
            Some(Prompt::Press) => (self.presses_mn, 0.0),
            Some(Prompt::Slide) if self.since < 30 => (self.presses_mn, 0.0),
            Some(Prompt::Slide) => (self.presses_mn, 40.0),
            Some(Prompt::Weigh(mn)) if self.wrong == Some(mn) => (1177.0, 0.0),
            Some(Prompt::Weigh(mn)) => (mn.into(), 0.0),
            _ => (0.0, 0.0),
        }
    }
}

impl Hand for Obedient {
    fn feels_gravity(&self) -> bool {
        true
    }

    fn gravity(&self) -> Option<f32> {
        let (g, zero) = self.g;
        let way = match self.prompt {
            // it takes a while
            Some(Prompt::TurnOver | Prompt::Button) if self.since > 40 => -1.0,
            _ => 1.0,
        };
        let trembles = if self.ticks.is_multiple_of(2) {
            6.0
        } else {
            -6.0
        };
        self.listens.then_some(way * g + zero + trembles)
    }

    async fn wait(&mut self) {
        self.ticks += 1;
        self.since += 1;
        self.due = if self.listens { 44 } else { 0 };
    }

    fn word(&mut self) -> Option<Option<Pressure>> {
        self.due = self.due.checked_sub(1)?;
        let channel = Channel::PATTERN[self.slot as usize % 2];
        self.slot += 1;
        let (mn, rms) = self.does();
        let mut noise = || (self.random.next_f32() - 0.5) * 12f32.sqrt();
        let value = match channel {
            Channel::Pac => 2041.0 + 1.5 * noise() + rms * noise(),
            Channel::Pdc => AIR + mn / self.mn_per_count + 0.3 * noise(),
        };
        Some(Some(Pressure {
            channel,
            counts: Counts::from_low_bits(value.round().clamp(0.0, 4095.0) as u16),
        }))
    }

    fn is_pressed(&mut self) -> bool {
        self.gives_up.is_some_and(|at| self.ticks >= at)
    }

    fn listen(&mut self, on: bool) {
        self.listens = on;
    }

    fn sound(&mut self, _: Option<u16>) {}

    fn show(&mut self, screen: &Screen<'_>) {
        let words = std::format!("{screen:?}");
        let word = words.split([' ', '(']).next().unwrap().to_string();
        if self.shown.last() != Some(&word) {
            self.shown.push(word);
        }
    }

    fn about(&self) -> About {
        About::default()
    }

    fn publish(&mut self, _: &RigState) {}

    fn is_stopped(&self) -> bool {
        self.stops.is_some_and(|at| self.ticks >= at)
    }

    fn streams(&self) -> bool {
        self.streams
    }

    fn tell(&mut self, event: Event) {
        if let Event::Prompt(prompt) = event
            && self.prompt != Some(prompt)
        {
            (self.prompt, self.since) = (Some(prompt), 0);
        }
        self.told.push(event);
    }
}

type Held<'p> = ByHand<'p, Obedient>;

fn held(plan: &Plan) -> Held<'_> {
    ByHand {
        serves: true,
        ..ByHand::new(Obedient::new(), Handheld::new(plan, 4), UNMEASURED)
    }
}

fn prompts(rig: &Held<'_>) -> List<Prompt> {
    let told = rig.hand.told.iter();
    let mut prompts: List<Prompt> = told
        .filter_map(|event| match event {
            Event::Prompt(prompt) => Some(*prompt),
            _ => None,
        })
        .collect();
    prompts.dedup();
    prompts
}

#[test]
fn a_person_makes_the_slide_that_is_asked_for_and_its_samples_are_the_hosts() {
    let plan = Plan::new();
    let mut rig = held(&plan);
    rig.hand.streams = true;
    let mut slide = Slide::new(&plan, MOVEMENT);
    block_on(rig.perform(&mut slide)).unwrap();
    block_on(rig.lifted()).unwrap();
    let measured = slide.finish().unwrap();
    let expected = [Prompt::Lift, Prompt::Press, Prompt::Slide, Prompt::Lift];
    assert_eq!(prompts(&rig), expected);
    assert_eq!(rig.hand.shown, ["Press", "Slide", "Lift"]);
    // the same slide, from the streamed samples
    let mut streamed = Slide::new(&plan, MOVEMENT);
    let (mut pdc, mut steady) = (List::new(), 0..0);
    for event in &rig.hand.told {
        match event {
            Event::Block(block) => {
                if block.number == 0 {
                    streamed = Slide::new(&plan, MOVEMENT);
                    pdc.clear();
                }
                if let Some((from, to)) = block.steady {
                    steady = from as usize..to as usize;
                }
                streamed.take(block);
            }
            Event::Pdc(counts) => pdc.extend_from_slice(counts),
            _ => {}
        }
    }
    streamed.push_pdc(&pdc[steady]);
    assert_eq!(streamed.finish().unwrap(), measured);
    let phases = rig.hand.told.iter().filter_map(|event| match event {
        Event::Phase(phase) => Some(*phase),
        _ => None,
    });
    use crate::wire::Phase::{Background, Lifting, Pressing, Ready, Sliding};
    let phases: List<_> = phases.collect();
    let expected = [Ready, Pressing, Background, Sliding, Lifting, Ready];
    assert_eq!(phases, expected);
}

#[test]
fn a_slide_that_is_no_good_is_asked_for_again_with_the_reason() {
    let plan = Plan::new();
    let mut rig = held(&plan);
    rig.hand.presses_mn = 1600.0;
    rig.hand.stops = Some(600);
    let mut slide = Slide::new(&plan, MOVEMENT);
    assert_eq!(block_on(rig.perform(&mut slide)), Err(RigError::Stopped));
    assert!(prompts(&rig).contains(&Prompt::Again(Again::TooHard)));
    // nothing is wanted any more
    assert_eq!(rig.handheld.prompt(), None);
}

#[test]
fn nobody_there_a_person_who_gives_up_and_another_movement_end_it() {
    let plan = Plan::new();
    let ends = |mut rig: Held<'_>, movement| {
        let mut slide = Slide::new(&plan, movement);
        let done = block_on(rig.perform(&mut slide));
        assert_eq!(rig.handheld.prompt(), None);
        (done.unwrap_err(), rig.hand.ticks)
    };
    let mut rig = held(&plan);
    rig.hand.presses_mn = 0.0;
    let (why, ticks) = ends(rig, MOVEMENT);
    assert_eq!(why, RigError::NobodyThere);
    assert!((60 * TICKS_HZ..62 * TICKS_HZ).contains(&ticks), "{ticks}");
    let mut rig = held(&plan);
    rig.hand.gives_up = Some(40);
    let (why, ticks) = ends(rig, MOVEMENT);
    assert_eq!(why, RigError::Stopped);
    assert!(ticks < 150, "{ticks}");
    let other = crate::features::Movement::FOR_TRACTION;
    assert_eq!(ends(held(&plan), other), (RigError::NotByHand, 0));
}

#[test]
fn the_host_is_reminded_every_second_that_a_person_is_waited_for() {
    let plan = Plan::new();
    let mut rig = held(&plan);
    rig.hand.presses_mn = 0.0;
    rig.hand.stops = Some(10 * TICKS_HZ);
    let mut slide = Slide::new(&plan, MOVEMENT);
    let _ = block_on(rig.perform(&mut slide));
    let told = rig.hand.told.iter();
    let prompts = told.filter(|event| matches!(event, Event::Prompt(_)));
    assert!((10..=12).contains(&prompts.count()));
}

#[test]
fn weights_and_the_air_give_the_calibration_that_forces_are_shown_by() {
    let plan = Plan::new();
    let mut rig = held(&plan);
    // a finger that gives way more than the paper's
    rig.hand.mn_per_count = 14.0;
    let calibration = block_on(rig.calibrate()).unwrap();
    let air = calibration.pressure.pdc_no_contact;
    assert!((air - AIR).abs() < 0.2, "{air}");
    assert_eq!(prompts(&rig), [Prompt::Lift]);
    let points = [490, 980, 1470].map(|mn| {
        let counts = block_on(rig.weigh(mn)).unwrap();
        assert!((counts - f32::from(mn) / 14.0).abs() < 0.5, "{counts}");
        (counts, f32::from(mn))
    });
    let mut kept = calibration;
    kept.pressure.force_mn_per_count = ForceScale::of(&points).unwrap().mn_per_count;
    block_on(rig.set_calibration(kept)).unwrap();
    // 0.5 N of this finger is 0.5 N now, and can be slid with
    let mut slide = Slide::new(&plan, MOVEMENT);
    block_on(rig.perform(&mut slide)).unwrap();
    let force_mn = rig.state().force_mn;
    assert!((force_mn - 500.0).abs() < 15.0, "{force_mn}");
    // no weight at all: the wait ends without result
    rig.hand.prompt = None;
    rig.hand.stops = Some(rig.hand.ticks + 200);
    rig.hand.mn_per_count = 1e6;
    let why = block_on(rig.weigh(490)).unwrap_err();
    assert_eq!(why, Failure::Rig(RigError::Stopped));
}

#[test]
fn a_person_turns_the_finger_over_for_a_host() {
    let plan = Plan::new();
    let mut rig = held(&plan);
    // 3 % less than the data sheet's, and 60 counts off
    rig.hand.g = (994.0, 60.0);
    let turned = block_on(rig.turn_over()).unwrap();
    assert!((turned.g_counts / 994.0 - 1.0).abs() < 1e-3, "{turned:?}");
    assert!((turned.offset_counts - 60.0).abs() < 1.0, "{turned:?}");
    assert_eq!(prompts(&rig), [Prompt::Still, Prompt::TurnOver]);
    // it lies on its side until the wait is over
    rig.hand.g = (0.0, 0.0);
    let why = block_on(rig.turn_over()).unwrap_err();
    assert_eq!(why, Failure::Rig(RigError::NobodyThere));
}
