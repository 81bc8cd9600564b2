//! The image of a probe on somebody else's arm: it identifies with the simulator's arm at its link, and stops one that
//! misbehaves.

use std::path::Path;

use tactus_core::explorer::Method;
use tactus_core::features::FeatureSet;
use tactus_core::rig::Fault;
use tactus_core::sensor::FingerName;
use tactus_core::wire::{Command, Event, Identify, Verdict};
use tactus_emulator::board::Options;
use tactus_emulator::host::arm::OnTheLine;
use tactus_emulator::host::talk::{Talk, TalkError};
use tactus_emulator::host::under_finger::mounted;
use tactus_lab::sim::collection::{Collection, calibrated, texture_name};
use tactus_link::Request;
use tactus_world::arm_program::Misbehaves;

use crate::common::elf_of;

const TEXTURE: u8 = 60;
/// The finger must never feel more, N.
const MOST_N: f64 = 2.2;

/// A board on an arm that knows some textures, and what it came to: how the exploration ended, its verdict, its faults,
/// the largest force by the world, N, and whether the line of permission is high.
struct Explored {
    done: Result<(), TalkError>,
    verdict: Option<Verdict>,
    faults: Vec<Fault>,
    slides: u32,
    force_max_n: f64,
}

fn explore(elf: &Path, max_slides: u8, how: Option<Misbehaves>) -> Explored {
    let world = Collection {
        seed: 1,
        textures: Collection::spread(TEXTURE, 4),
        trials: 2,
    };
    let calibration = calibrated(world.setup(TEXTURE, 0)).unwrap();
    let (finger, movements) = (FingerName::Biotac, &Collection::MOVEMENTS);
    let bands = (Method::Fused, Some(FeatureSet::Bands));
    let table = world
        .learn_with(finger, movements, bands, calibration, || ())
        .unwrap();
    let unknown = mounted(&world, TEXTURE, 3);
    let mut talk = Talk::new(unknown.start(elf, Options::default()).unwrap());
    let mut arm = OnTheLine::new(talk.board(), 1);
    // it is parked, until somebody asks for a slide
    let booted = |event: &Event| matches!(event, Event::Booted { .. }).then_some(Ok(()));
    let booted = talk.wait(1.0, |board, report| arm.follow(board, report), booted);
    booted.unwrap();
    talk.teach(&calibration, &table, |board, report| {
        arm.follow(board, report);
    })
    .unwrap();
    arm.program().misbehave(how);
    talk.board().rig().world().reset_extremes();
    let (mut verdict, mut faults, mut slides) = (None, Vec::new(), 0);
    let identify = Command::Identify(Identify {
        max_slides,
        ..Identify::default()
    });
    let done = talk.run(Request::command(identify), 300.0, |board, report| {
        arm.follow(board, report);
        match report.map(|report| &report.event) {
            Some(Event::Verdict(told)) => verdict = Some(told.clone()),
            Some(Event::Fault(fault)) => faults.push(*fault),
            Some(Event::SlideReport { .. }) => slides += 1,
            _ => {}
        }
    });
    let force_max_n = talk.board().rig().world().truth().force_max_n;
    assert_eq!(talk.board().resets().unwrap(), []);
    assert_eq!(talk.board().violations().unwrap(), []);
    Explored {
        done,
        verdict,
        faults,
        slides,
        force_max_n,
    }
}

#[test]
fn a_board_on_an_arm_identifies() {
    let Some(elf) = elf_of("TACTUS_ARM_ELF") else {
        return;
    };
    let explored = explore(&elf, 4, None);
    explored.done.unwrap();
    assert_eq!(explored.faults, []);
    let verdict = explored.verdict.unwrap();
    let name = texture_name(TEXTURE);
    assert!(verdict.sure && verdict.name == name, "{verdict:?}");
    assert!(explored.force_max_n < 1.6, "{}", explored.force_max_n);
}

fn stops(how: Misbehaves, fault: Fault) {
    let Some(elf) = elf_of("TACTUS_ARM_ELF") else {
        return;
    };
    let explored = explore(&elf, 1, Some(how));
    assert!(explored.done.is_err());
    assert_eq!(explored.faults, [fault], "{how:?}");
    assert_eq!(explored.slides, 0);
    assert!(explored.force_max_n < MOST_N, "{}", explored.force_max_n);
}

#[test]
fn a_board_stops_an_arm_that_presses_too_hard() {
    let how = Misbehaves::ComesDown {
        mm_s: 1.0,
        stops_ms: 20,
    };
    stops(how, Fault::ForceHigh);
}

#[test]
#[ignore = "long"]
fn a_board_names_an_arm_that_is_silent() {
    stops(Misbehaves::Silent(300), Fault::ArmSilent);
}
