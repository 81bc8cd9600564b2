//! The real ELF of the handheld probe with a sensor of motion, a PAA5100JE on SPI4: judged by what the hand means to
//! do, and by the PC, which computes each decision again.

use std::path::PathBuf;

use tactus_core::dsp::Plan;
use tactus_core::explorer::Method;
use tactus_core::features::Property;
use tactus_core::handheld::{FEATURES, MOVEMENT};
use tactus_core::table::Table;
use tactus_core::wire::{Command, Event, Identify};
use tactus_emulator::board::Emulator;
use tactus_emulator::host::talk::TIMEOUT_S;
use tactus_lab::eval::learn::learn;
use tactus_lab::sim::collection::Collection;
use tactus_lab::sim::handheld::slides;
use tactus_link::Request;
use tactus_link::follow::Follower;
use tactus_world::person::Manner;

use crate::common::elf_of;
use crate::handheld_link::Held;

/// Longest exploration, virtual seconds.
const LONG_S: f64 = 120.0;

fn elf() -> Option<PathBuf> {
    elf_of("TACTUS_HANDHELD_ELF")
}

/// A hand that holds its pace and the probe level.
const LEVEL: Manner = Manner {
    tremor: 0.005,
    wander: 0.04,
    uneven: 0.0,
    force_spread: 0.1,
    pace_spread: 0.25,
    tilt_mm: Some(0.0),
};

/// A table of some textures that knows how they go with the speed.
fn paced_table() -> Vec<u8> {
    let collection = Collection::new(1, vec![10, 47, 64, 80, 100], 8);
    let known: Vec<_> = collection
        .textures
        .iter()
        .map(|&texture| {
            let made = slides(collection.setup(texture, 0), LEVEL, collection.trials);
            vec![made.unwrap().0]
        })
        .collect();
    let names = collection.names();
    let table = learn(Method::Fused, Some(FEATURES), &names, &[MOVEMENT], &known).unwrap();
    assert!(Table::read(&table).unwrap().is_paced());
    table
}

/// An exploration at a pace: the speeds that the probe measured, in parts of the movement's, and what it took the
/// texture for. The PC agrees.
fn explore(held: &mut Held, table: &[u8], pace_mm_s: f64) -> (Vec<f64>, String) {
    held.person.slide_at(pace_mm_s);
    let wanted = Identify::default();
    let found = held.run(Request::identify(wanted.clone()), LONG_S).unwrap();
    let plan = Plan::new();
    let measured = [Property::Roughness, Property::Fineness];
    let table = Table::read(table).unwrap();
    let measured = measured.into_iter().collect();
    let mut follower = Follower::new(table, measured, &wanted, &plan).unwrap();
    let mut speeds = Vec::new();
    for report in &held.reports {
        follower.hear(&report.event).unwrap();
        if let Event::SlideReport { observed, .. } = &report.event {
            speeds.extend(observed.pace.map(|pace| (f64::from(pace) / 1024.0).exp()));
        }
    }
    let agreement = follower.agreement();
    assert!(agreement.agrees(), "{agreement:?}");
    (speeds, found.verdict.name.as_str().to_owned())
}

fn stream(held: &mut Held) {
    let on = Request::command(Command::Stream(true));
    held.run(on, TIMEOUT_S).unwrap();
}

/// Its timing was kept, and the maker's list was written.
fn is_well_treated(board: &mut Emulator) {
    let mut rig = board.rig();
    let flow = rig.motion().flow().unwrap();
    assert_eq!(flow.refused(), 0);
    assert!(flow.is_set_up());
}

#[test]
#[ignore = "long"]
fn the_speed_of_each_slide_is_measured_and_used_as_on_a_pc() {
    let Some(elf) = elf() else { return };
    let table = paced_table();
    let mut held = Held::with(&elf, "burlap", LEVEL, None);
    held.push(&table);
    stream(&mut held);
    for mm_s in [18.0, 25.0, 32.0] {
        let (speeds, found) = explore(&mut held, &table, mm_s);
        assert_eq!(found, "Burlap");
        assert!(!speeds.is_empty());
        let meant = mm_s / f64::from(MOVEMENT.speed_mm_s());
        for speed in speeds {
            assert!((speed / meant - 1.0).abs() < 0.03, "{speed} {meant}");
        }
    }
    is_well_treated(held.talk.board());
    held.end();
}
