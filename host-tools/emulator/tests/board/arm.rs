//! The image of a probe on somebody else's arm: it identifies with the simulator's arm at its link, and stops one that
//! misbehaves.

use std::path::Path;

use tactus_core::explorer::Method;
use tactus_core::features::FeatureSet;
use tactus_core::rig::Fault;
use tactus_core::wire::{
    self, Command, Event, Identify, MAX_FRAME, Report, Request as Frame, Verdict,
};
use tactus_emulator::board::{Emulator, Options};
use tactus_emulator::host::talk::{Talk, TalkError};
use tactus_emulator::host::under_finger::mounted;
use tactus_lab::sim::collection::{Collection, calibrated, texture_name};
use tactus_link::Request;
use tactus_world::arm::Arm;
use tactus_world::arm_program::{ArmProgram, Misbehaves};

use crate::common::elf_of;

const TEXTURE: u8 = 60;
/// Ids of requests that no session of a host comes to while one is tested.
const FIRST_ID: u16 = 0x8000;
/// The finger must never feel more, N.
const MOST_N: f64 = 2.2;

/// The simulator's program at an arm, and its place on the line beside a host.
#[derive(Debug)]
struct OnTheLine {
    program: ArmProgram,
    id: u16,
    now_ms: u64,
}

impl OnTheLine {
    /// A program that waits for orders; the finger is put on its arm.
    fn new(board: &mut Emulator, seed: u64) -> Self {
        board.rig().world().mount_on(Arm::new(seed));
        Self {
            program: ArmProgram::new(seed),
            id: FIRST_ID,
            now_ms: board.now_ns() / 1_000_000,
        }
    }

    /// The program.
    fn program(&mut self) -> &mut ArmProgram {
        &mut self.program
    }

    /// Takes a report of the probe.
    fn hear(&mut self, report: &Report) {
        match &report.event {
            Event::Arm(order) => self.program.ask(*order),
            Event::Live(live) => self.program.force(f64::from(live.force_mn) * 1e-3),
            _ => {}
        }
    }

    /// Takes each report, and `None` after each look, of a [`Talk`].
    fn follow(&mut self, board: &mut Emulator, report: Option<&Report>) {
        match report {
            Some(report) => self.hear(report),
            None => self.look(board),
        }
    }

    /// Goes on to the board's time: to be called every ms.
    fn look(&mut self, board: &mut Emulator) {
        let now_ms = board.now_ns() / 1_000_000;
        while self.now_ms < now_ms {
            self.now_ms += 1;
            let reports = match board.rig().world().arm() {
                Some(arm) => self.program.tick(arm),
                None => return,
            };
            for report in reports {
                let command = Command::Arm(report);
                let mut buffer = [0; MAX_FRAME + 1];
                self.id = self.id.wrapping_add(1) | FIRST_ID;
                let request = Frame {
                    id: self.id,
                    command,
                };
                if let Ok(frame) = wire::encode(&request, &mut buffer) {
                    board.send(frame);
                }
            }
        }
    }
}

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
    let world = Collection::new(1, Collection::spread(TEXTURE, 4), 2);
    let calibration = calibrated(world.setup(TEXTURE, 0)).unwrap();
    let movements = &Collection::MOVEMENTS;
    let bands = (Method::Fused, Some(FeatureSet::Bands));
    let table = world
        .learn_at(movements, bands, &[], calibration, || ())
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
