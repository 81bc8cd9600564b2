//! The rig's image with other fingers than a BioTac: it finds out which one is there, starts its parts, identifies with
//! them, and names what is wrong with them.

use tactus_core::explorer::Method;
use tactus_core::rig::Fault;
use tactus_core::sensor::{FingerCode, FingerName};
use tactus_core::wire::{Command, Event, Identify, Phase, Report};
use tactus_emulator::board::{Emulator, Options};
use tactus_emulator::host::exploration::explore;
use tactus_emulator::host::talk::Talk;
use tactus_emulator::host::under_finger::{mounted, simulated};
use tactus_lab::sim::collection::Collection;
use tactus_world::faults::Fault as Broken;
use tactus_world::parts::PartFault;
use tactus_world::world::Setup;

use crate::common::{elf, ready};
use crate::faults::identify;

/// By now RAM has its initial values, and no slot has begun: the finger is looked for after 100 ms.
const BEFORE_SLOTS_MS: u64 = 50;
/// The ADS1220's RDATA with the byte behind it, as a frame; and where a transaction has its frames and the mode.
const RDATA: u16 = 0x1000;
const FRAME_AT: u64 = 8;
const MODE_AT: u64 = 17;
const TRANSACTION_BYTES: u64 = 20;
/// The finger must never feel more, N.
const MOST_N: f64 = 2.2;

fn board(finger: FingerName) -> Option<Emulator> {
    let setup = Setup {
        texture: 60,
        finger,
        ..Setup::default()
    };
    Some(Emulator::start(&elf()?, setup, Options::default()).unwrap())
}

fn boots_and_identifies(finger: FingerName) {
    let Some(elf) = elf() else { return };
    let world = Collection::new(1, Collection::spread(60, 4), 2).touched_by(finger);
    let known = simulated(&world, Method::Fused, &[], || ()).unwrap();
    let unknown = mounted(&world, 60, 3);
    let mut talk = Talk::new(unknown.start(&elf, Options::default()).unwrap());
    let mut booted = None;
    let fault = talk.ready(|_, report| {
        if let Some(Event::Booted { finger, .. }) = report.map(|report| &report.event) {
            booted = Some(*finger);
        }
    });
    assert_eq!(fault.unwrap(), None);
    assert_eq!(booted, Some(FingerCode::of(finger)));
    talk.teach(&known.calibration, &known.table, |_, _| ())
        .unwrap();
    let identify = Identify {
        max_slides: 4,
        ..Identify::default()
    };
    let explored = explore(&mut talk, &known.table, identify, &unknown.name, |_, _| ()).unwrap();
    assert_eq!(explored.missed(), [""; 0]);
    assert!(explored.right(), "{:?}", explored.found);
    let mut rig = talk.board().rig();
    assert_eq!(rig.world().complaints(), 0);
    assert!(rig.world().truth().force_max_n < MOST_N);
}

#[test]
fn analog_boots_and_identifies() {
    boots_and_identifies(FingerName::Analog);
}

#[test]
fn mems_boots_and_identifies() {
    boots_and_identifies(FingerName::Mems);
}

/// Faults and sentences told in so long a time.
fn told(talk: &mut Talk, until_s: f64) -> (Vec<Fault>, Vec<String>) {
    let (mut faults, mut sentences) = (Vec::new(), Vec::new());
    while (talk.now_ns() as f64) < until_s * 1e9 {
        for Report { event, .. } in talk.step().unwrap() {
            match event {
                Event::Fault(fault) => faults.push(fault),
                Event::Trouble(why) => sentences.push(why.to_string()),
                _ => {}
            }
        }
    }
    (faults, sentences)
}

/// Plugs everything in, and has the rig home once the probe has noticed: it starts again for another finger than a
/// BioTac.
fn works_again(talk: &mut Talk) {
    talk.board().rig().world().clear();
    let now_s = talk.now_ns() as f64 * 1e-9;
    told(talk, now_s + 8.0);
    // that it has started again is still on the line
    let _ = talk.send(Command::Status, 1.0, |_, _| ());
    talk.send(Command::Home, 60.0, |_, _| ()).unwrap();
    assert!(talk.board().rig().world().truth().force_max_n < MOST_N);
}

#[test]
#[ignore = "long"]
fn a_finger_that_is_plugged_in_late_is_found() {
    for finger in FingerName::ALL {
        let Some(mut board) = board(finger) else {
            return;
        };
        board.inject(Broken::SensorUnplugged);
        let mut talk = Talk::new(board);
        let (faults, sentences) = told(&mut talk, 1.5);
        eprintln!("{finger}: {faults:?}, {sentences:?}");
        assert_eq!(faults.first(), Some(&Fault::SensorSilent));
        let named = |said: &String| said.contains("no finger answers");
        assert!(sentences.iter().any(named), "{sentences:?}");
        works_again(&mut talk);
        let resets = talk.board().resets().unwrap().len();
        assert_eq!(
            resets,
            usize::from(finger != FingerName::Biotac),
            "{finger}"
        );
    }
}

#[test]
#[ignore = "long"]
fn a_part_that_is_not_there_is_named_until_it_is() {
    let Some(board) = board(FingerName::Mems) else {
        return;
    };
    let fault = PartFault::AccelerometerUnplugged;
    board.rig().world().break_part(fault);
    let mut talk = Talk::new(board);
    let (faults, sentences) = told(&mut talk, 1.5);
    eprintln!("{faults:?}, {sentences:?}");
    assert_eq!(faults.first(), Some(&Fault::SensorSilent));
    let named = |said: &String| said.contains("the IIS3DWB accelerometer answers FF to 8F");
    assert!(sentences.iter().any(named), "{sentences:?}");
    works_again(&mut talk);
    assert_eq!(talk.board().resets().unwrap(), []);
}

#[test]
fn a_part_that_is_read_in_a_wrong_mode_is_silent() {
    let Some(mut board) = board(FingerName::Mems) else {
        return;
    };
    board.run_ms(BEFORE_SLOTS_MS).unwrap();
    let (begin, bytes) = board.symbol("SLOT_PLAN").unwrap();
    let places: Vec<u64> = (begin..=begin + bytes - TRANSACTION_BYTES)
        .step_by(4)
        .filter(|place| board.read(place + FRAME_AT, 2).unwrap() == RDATA.to_le_bytes())
        .collect();
    let [place] = places[..] else {
        panic!("{places:x?}")
    };
    assert_eq!(board.read(place + MODE_AT, 1).unwrap(), [1]);
    board.write(place + MODE_AT, &[3]).unwrap();
    let mut talk = Talk::new(board);
    let (faults, _) = told(&mut talk, 1.5);
    assert_eq!(faults.first(), Some(&Fault::SensorSilent));
    assert!(talk.board().rig().world().truth().force_max_n < MOST_N);
}

/// A brown-out leaves the parts their identity and stops their data.
#[test]
#[ignore = "long"]
fn a_brown_out_while_it_slides_is_named() {
    for fault in [PartFault::AccelerometerBrownOut, PartFault::CellBrownOut] {
        let Some(board) = board(FingerName::Mems) else {
            return;
        };
        let mut talk = Talk::new(board);
        ready(&mut talk);
        talk.board().rig().world().reset_extremes();
        let (mut slides_ms, mut named) = (None, None);
        let _ = talk.send(identify(1), 60.0, |board, report| {
            match report.map(|report| &report.event) {
                Some(Event::Phase(Phase::Sliding)) => slides_ms = Some(0),
                Some(Event::Fault(fault)) => named = named.or(Some(*fault)),
                Some(_) => {}
                None => {
                    slides_ms = slides_ms.map(|ms| ms + 1);
                    if slides_ms == Some(300) {
                        board.rig().world().break_part(fault);
                    }
                }
            }
        });
        let most_n = talk.board().rig().world().truth().force_max_n;
        eprintln!("{fault:?}: {named:?}, at most {most_n:.3} N");
        let allowed = [
            Fault::SensorSilent,
            Fault::SensorErrors,
            Fault::Unsteady,
            Fault::ForceHigh,
        ];
        assert!(
            named.is_some_and(|fault| allowed.contains(&fault)),
            "{named:?}"
        );
        assert!(most_n < MOST_N, "{most_n}");
    }
}
