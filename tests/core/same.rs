//! "The same as this one?", asked of a probe in the simulated world, which knows what really lies under its finger.

use std::cell::RefCell;

use embassy_futures::block_on;
use tactus_core::dsp::Plan;
use tactus_core::explorer::{Answer, ExplorerError, Method, Strategy};
use tactus_core::probe::TableInUse;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::table::{Limits, Table};
use tactus_core::wire::{Command, Event, Failure, Identify};
use tactus_lab::sim::collection::{Collection, calibrated};
use tactus_lab::sim::flash::{RamFlash, TABLE};
use tactus_lab::sim::probe::{Host, switch_off_and_on, switch_on};
use tactus_lab::sim::rig::SimRig;

fn world() -> Collection {
    Collection::new(5, Collection::spread(47, 8), 5)
}

/// The host's reports, the levels of the output, and the false alarms of the table in force.
#[derive(Default)]
struct Heard {
    events: Vec<Event>,
    go: Vec<bool>,
    false_alarm: Option<f32>,
}

impl Host for Heard {
    fn tell(&mut self, event: Event) {
        self.events.push(event);
    }

    fn table(&mut self, table: TableInUse) {
        self.false_alarm = table.false_alarm;
    }

    fn go(&mut self, on: bool) {
        self.go.push(on);
    }
}

fn verify(texture: usize, seed: u32) -> Command {
    Command::Verify(Identify {
        among: std::iter::once(texture as u16).collect(),
        strategy: Strategy::Cycling,
        seed,
        ..Identify::default()
    })
}

/// What a probe over this texture says to commands, with its table and the trial of its rig; and the output's levels.
fn ask(
    known: &(RigCalibration, Vec<u8>),
    under_finger: u8,
    trial: u64,
    commands: &[Command],
) -> Vec<(Result<(), Failure>, Heard)> {
    let mut rig = SimRig::new(world().setup(under_finger, trial));
    rig.control().calibrate(known.0).unwrap();
    rig.home().unwrap();
    let heard = RefCell::new(Heard::default());
    let (mut buffer, plan) = (vec![0; TABLE], Plan::new());
    let flash = RamFlash::blank();
    let probe = switch_on(rig, flash, &known.1, &mut buffer, &plan, &heard);
    let mut probe = probe.unwrap();
    let asked = commands.iter().map(|command| {
        *heard.borrow_mut() = Heard::default();
        let done = block_on(probe.perform(command)).map(drop);
        (done, heard.take())
    });
    asked.collect()
}

fn answers(heard: &Heard) -> Vec<(u8, Answer)> {
    let events = heard.events.iter();
    let verified = events.filter_map(|event| match event {
        Event::Verified { slides, now, .. } => {
            assert_eq!(now.answer == Answer::Different, now.score > now.limit);
            Some((*slides, now.answer))
        }
        _ => None,
    });
    verified.collect()
}

#[test]
fn a_probe_says_whether_it_is_the_texture_asked_for() {
    let calibration = calibrated(world().setup(10, 0)).unwrap();
    let table = world().learn(Method::Fused, calibration, || ()).unwrap();
    let known = (calibration, table);
    let textures = world().textures;
    let (mut same, mut different, mut wrong) = (0, 0, Vec::new());
    for (at, &texture) in textures.iter().enumerate() {
        let other = (at + 1) % textures.len();
        let commands = [
            verify(other, 1),
            verify(at, 2),
            Command::Identify(Identify::default()),
            verify(other, 3),
        ];
        let [first, second, between, third]: [_; 4] =
            ask(&known, texture, 1, &commands).try_into().ok().unwrap();
        for (done, heard) in [&first, &second, &between, &third] {
            assert_eq!(*done, Ok(()));
            let verdict = |event: &Event| matches!(event, Event::Verdict(_));
            let told = heard.events.iter().any(verdict);
            assert_eq!(told, answers(heard).is_empty());
        }
        // low when it begins, and what the answer says when it is over; an exploration leaves it as it is
        assert!(between.1.go.is_empty());
        for ((_, heard), truth) in [(first, false), (second, true), (third, false)] {
            let told = answers(&heard);
            let (slides, answer) = *told.last().unwrap();
            let go = answer == Answer::Same;
            assert_eq!(heard.go, [false, go]);
            // one after the other, and none after the answer
            assert_eq!(usize::from(slides), told.len());
            let unsure = &told[..told.len() - 1];
            assert!(unsure.iter().all(|(_, answer)| *answer == Answer::Unsure));
            match (answer, truth) {
                (Answer::Same, true) => same += 1,
                (Answer::Different, false) => different += 1,
                _ => wrong.push((texture, truth, told)),
            }
        }
    }
    println!("{same} the same, {different} different, wrong or unsure: {wrong:?}");
    // of 8 and 16; at the limits that the table has, one in 50 of its own slides would be called different
    assert!(same >= 7 && different >= 15, "{wrong:?}");
    let called_same = |wrong: &(u8, bool, Vec<(u8, Answer)>)| {
        !wrong.1 && wrong.2.last().unwrap().1 == Answer::Same
    };
    assert!(!wrong.iter().any(called_same), "{wrong:?}");
}

#[test]
fn what_a_probe_cannot_verify_it_refuses_and_the_output_is_low() {
    let calibration = calibrated(world().setup(10, 0)).unwrap();
    let world = Collection {
        trials: 2,
        ..world()
    };
    let fused = world.learn(Method::Fused, calibration, || ()).unwrap();
    let paper = world.learn(Method::Paper, calibration, || ()).unwrap();
    assert!(Table::read(&fused).unwrap().limits().is_some());
    assert_eq!(Table::read(&paper).unwrap().limits(), None::<Limits>);
    let refused = |table: &Vec<u8>, texture| {
        let asked = ask(&(calibration, table.clone()), 47, 1, &[verify(texture, 1)]);
        let (done, heard) = asked.into_iter().next().unwrap();
        assert!(heard.events.is_empty(), "{:?}", heard.events);
        assert_eq!(heard.go, [false]);
        done.unwrap_err()
    };
    let unknown = Failure::Explorer(ExplorerError::Candidates);
    assert_eq!(refused(&fused, 8), unknown);
    assert_eq!(refused(&paper, 0), Failure::NoLimits);
}

/// Number of the table's textures, and of some that it does not have, that are told as new within two slides.
fn told_new(known: &(RigCalibration, Vec<u8>), set: Option<f32>) -> usize {
    let known_ones = world().textures;
    let others = (1..=117).filter(|texture| !known_ones.contains(texture));
    let others = others.step_by(2).take(48);
    let is_new = |texture: &u8| {
        let identify = Identify {
            // one slide makes only what is far new, whatever the share
            max_slides: 2,
            seed: 4,
            ..Identify::default()
        };
        let commands = [Command::SetFalseAlarm(set), Command::Identify(identify)];
        let asked = ask(known, *texture, 1, &commands);
        assert!(asked.iter().all(|(done, _)| *done == Ok(())));
        let events = &asked[1].1.events;
        events
            .iter()
            .any(|event| matches!(event, Event::Verdict(verdict) if verdict.unknown))
    };
    known_ones
        .iter()
        .copied()
        .chain(others)
        .filter(is_new)
        .count()
}

#[test]
fn a_probe_set_to_more_false_alarms_calls_more_textures_new() {
    let calibration = calibrated(world().setup(10, 0)).unwrap();
    let fused = world().learn(Method::Fused, calibration, || ()).unwrap();
    let known = (calibration, fused);
    let [strict, own, loose] = [Some(0.001), None, Some(0.2)].map(|set| told_new(&known, set));
    println!("new: {strict} at 0.1 %, {own} at the table's own 2 %, {loose} at 20 %");
    assert!(strict < loose && strict <= own && own <= loose);
    // kept without power
    let rig = SimRig::new(world().setup(47, 1));
    let heard = RefCell::new(Heard::default());
    let (mut buffer, plan) = (vec![0; TABLE], Plan::new());
    let flash = RamFlash::blank();
    let mut probe = switch_on(rig, flash, &known.1, &mut buffer, &plan, &heard).unwrap();
    for set in [None, Some(0.005), Some(0.1), None] {
        block_on(probe.perform(&Command::SetFalseAlarm(set))).unwrap();
        assert_eq!(heard.borrow().false_alarm, set);
        heard.borrow_mut().false_alarm = Some(0.2);
        probe = switch_off_and_on(probe).unwrap();
        assert_eq!(heard.borrow().false_alarm, set);
    }
    for share in [0.0, 0.5, f32::NAN] {
        let asked = ask(&known, 47, 1, &[Command::SetFalseAlarm(Some(share))]);
        assert_eq!(asked[0].0, Err(Failure::FalseAlarm));
    }
}
