//! The fingers of parts on the simulated rig and in a simulated hand: explorations, and the result of each fault.

use crate::sim::collection::{Collection, calibrated, texture_name};
use crate::sim::handheld;
use crate::sim::rig::{SimError, SimRig};
use embassy_futures::block_on;
use rayon::prelude::*;
use tactus_core::dsp::Plan;
use tactus_core::explorer::{Config, Explorer, Method};
use tactus_core::features::{Movement, PropertySet};
use tactus_core::handheld::{ASK_AFTER, judge_at_most};
use tactus_core::probe::explore::{ExplorationStep, explore};
use tactus_core::rig::{Fault, Phase};
use tactus_core::sensor::FingerName;
use tactus_core::table::Table;
use tactus_world::parts::PartFault;
use tactus_world::person::Manner;
use tactus_world::world::Setup;

/// The fingers that are no BioTac.
const OTHERS: [FingerName; 2] = [FingerName::Analog, FingerName::Mems];

fn world(finger: FingerName, textures: u8) -> Collection {
    Collection::new(11, Collection::spread(60, textures), 5).touched_by(finger)
}

#[test]
fn eight_explorations_on_the_rig() {
    for finger in OTHERS {
        let right = explore_on_the_rig(&world(finger, 8));
        assert!(right >= 7, "{finger}: {right} of 8");
    }
}

/// Explores each texture of a table once; the force of every slide is right, and how many textures are.
fn explore_on_the_rig(world: &Collection) -> usize {
    let finger = world.finger;
    let calibration = calibrated(world.setup(world.textures[0], 0)).unwrap();
    let bytes = world
        .learn_at(
            &Collection::MOVEMENTS,
            (Method::Fused, None),
            &[],
            calibration,
            || (),
        )
        .unwrap();
    let table = Table::read(&bytes).unwrap();
    let plan = Plan::new();
    let config = Config {
        method: Method::Fused,
        open: true,
        ..Config::default()
    };
    let explored: Vec<_> = world
        .textures
        .par_iter()
        .map(|&unknown| {
            let mut rig = SimRig::new(world.setup(unknown, 100));
            rig.control().calibrate(calibration).unwrap();
            let mut explorer = Explorer::<128>::new(table, PropertySet::ALL, config).unwrap();
            let mut movements = Vec::new();
            let verdict = block_on(explore(
                &mut rig,
                &mut explorer,
                &plan,
                || 0,
                |event| match event {
                    ExplorationStep::Measured(action, ..) => {
                        movements.push(table.movement(action.movement).unwrap());
                    }
                    ExplorationStep::Rejected(_, why) => {
                        panic!("{finger}, {}: {why}", texture_name(unknown))
                    }
                    _ => {}
                },
            ))
            .unwrap_or_else(|why| panic!("{finger}, {}: {why}", texture_name(unknown)));
            let named = table.name(verdict.texture).unwrap();
            if named != texture_name(unknown) {
                eprintln!("{finger}: {} taken for {named}", texture_name(unknown));
            }
            assert_eq!(rig.world().complaints(), 0);
            let slides = movements.into_iter().zip(rig.performed().to_vec());
            (named == texture_name(unknown), slides.collect::<Vec<_>>())
        })
        .collect();
    for (movement, made) in explored.iter().flat_map(|e| &e.1) {
        let off_mn = (1e3 * made.force_n - f64::from(movement.force_mn())).abs();
        // 5 %, or a count
        let most_mn = (0.05 * f64::from(movement.force_mn())).max(11.5);
        assert!(
            off_mn <= most_mn,
            "{finger}: {movement}, {off_mn:.1} mN off"
        );
        assert!(made.force_max_n <= 2.2, "{finger}: {} N", made.force_max_n);
    }
    explored.iter().filter(|e| e.0).count()
}

/// From five slides of each of twelve textures. Vibrations of the handle reach the transducers of the fingers of parts,
/// and no fluid's resonance shapes their signal: textures are less far apart. From fifteen slides of each 60, 60 and 56
/// of 60 are right. The book says so.
#[test]
fn an_exploration_of_each_texture_by_hand() {
    for (finger, least) in FingerName::ALL.into_iter().zip([11, 9, 9]) {
        let world = world(finger, 12);
        let (bytes, left_out) = handheld::learn(&world, || ()).unwrap();
        assert_eq!(left_out, [0u8; 0], "{finger}");
        let table = Table::read(&bytes).unwrap();
        let is_right = |&&texture: &&u8| {
            let setup = world.setup(texture, 7);
            let (measured, _) =
                handheld::slides(setup, Manner::default(), ASK_AFTER as u32).unwrap();
            let judged = (1..=ASK_AFTER)
                .map(|n| {
                    judge_at_most(table, &measured[..n], None, None, ASK_AFTER)
                        .unwrap()
                        .0
                })
                .find(|judged| !judged.open)
                .unwrap();
            let is = table.find(texture_name(texture)) == Some(judged.leading[0].0);
            is && !judged.unknown
        };
        let right = world.textures.par_iter().filter(is_right).count();
        assert!(right >= least, "{finger}: {right} of 12");
    }
}

/// The rig's fault, and the largest force on the finger by the world, N, when this broke: before anything moved, or
/// 300 ms into a phase of a slide.
fn broken(finger: FingerName, fault: PartFault, seed: u64, at: Phase) -> (Option<Fault>, f64) {
    let mut rig = SimRig::new(Setup {
        texture: [1, 45, 60, 95][seed as usize % 4],
        finger,
        trial_seed: seed,
        finger_seed: seed,
        ..Setup::default()
    });
    if at == Phase::Parked {
        rig.world().break_part(fault);
    }
    if rig.home().is_err() {
        return (Some(Fault::SensorSilent), 0.0);
    }
    rig.world().reset_extremes();
    let movement = if seed.is_multiple_of(2) {
        Movement::FOR_ROUGHNESS
    } else {
        Movement::FOR_TRACTION
    };
    rig.control().start(movement, 0.3).unwrap();
    let (mut named, mut since_ms) = (None, 0);
    for _ in 0..90_000 {
        rig.tick();
        let phase = rig.control().phase();
        since_ms = if phase == at { since_ms + 1 } else { 0 };
        if since_ms == 300 {
            rig.world().break_part(fault);
        }
        if let Phase::Faulted(fault) = phase {
            named = Some(fault);
        }
        if rig.control().is_at_rest() {
            break;
        }
    }
    assert!(
        rig.control().is_at_rest(),
        "{finger}, {fault:?}, {at:?}, {seed}"
    );
    (named, rig.world().truth().force_max_n)
}

/// Names that are right for a part's fault; none, where it must make no difference.
fn names(finger: FingerName, fault: PartFault) -> &'static [Fault] {
    use Fault::*;
    use PartFault::*;
    match (finger, fault) {
        (FingerName::Analog, AccelerometerBrownOut | CellBrownOut | ClocksOff { .. }) => &[],
        (FingerName::Mems, ClocksOff { .. }) => &[],
        (_, CellReversed) => &[Unsteady, LeverSlips, ForceHigh],
        // a cell without any other witness: the lever goes down as far as the sprung mount lets it
        (FingerName::Mems, CellBlocked) => &[NoContact, LeverSlips, Unsteady],
        (_, CellBlocked) => &[PressureDead, LeverSlips, Unsteady],
        // between two transactions of a slot: a force for a moment
        (FingerName::Mems, Unplugged) => &[SensorSilent, SensorErrors, Unsteady],
        // registers of power-up: the last conversion is 0, which may be another force before it is stale
        (FingerName::Mems, CellBrownOut) => &[SensorSilent, SensorErrors, Unsteady, ForceHigh],
        _ => &[SensorSilent, SensorErrors],
    }
}

#[test]
fn each_fault_of_a_part_is_named_and_never_presses_too_hard() {
    use PartFault::*;
    let faults = [
        AccelerometerBrownOut,
        CellBrownOut,
        CellWire,
        CellReversed,
        CellBlocked,
        Unplugged,
        ClocksOff { share: 0.05 },
        ClocksOff { share: -0.05 },
    ];
    let phases = [
        Phase::Parked,
        Phase::Pressing,
        Phase::Background,
        Phase::Sliding,
    ];
    let mut cases = Vec::new();
    for (finger, fault) in OTHERS.iter().flat_map(|f| faults.map(|fault| (*f, fault))) {
        cases.extend(
            (1u64..)
                .zip(phases)
                .map(|(seed, at)| (finger, fault, seed, at)),
        );
    }
    let wrong = cases.par_iter().filter_map(|&(finger, fault, seed, at)| {
        let (named, most_n) = broken(finger, fault, seed, at);
        let allowed = names(finger, fault);
        let is_right = match named {
            // once the lever holds, a cell that stands still is not checked any more
            None => {
                let started_after =
                    matches!(fault, AccelerometerBrownOut | CellBrownOut) && at == Phase::Parked;
                let is_held = fault == CellBlocked && at != Phase::Parked;
                allowed.is_empty() || started_after || is_held
            }
            Some(named) => allowed.contains(&named),
        };
        let says = || format!("{finger}, {fault:?}, {at:?}: {named:?}, {most_n:.3} N");
        (most_n > 2.2 || !is_right).then(says)
    });
    let wrong: Vec<String> = wrong.collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn parts_that_do_not_start_are_named() {
    let mut rig = SimRig::new(Setup {
        finger: FingerName::Mems,
        ..Setup::default()
    });
    rig.world().break_part(PartFault::Unplugged);
    match rig.home() {
        Err(SimError::Part(why)) => assert_eq!(why.part, "IIS3DWB accelerometer"),
        other => panic!("{other:?}"),
    }
}

/// A table that shakes by 20 mg, as a printer's does: the still finger's background holds it, and the slide is made.
#[test]
fn a_shaking_table_is_background() {
    for finger in OTHERS {
        let mut rig = SimRig::new(Setup {
            finger,
            ..Setup::default()
        });
        rig.home().unwrap();
        let quiet = rig.record(Movement::FOR_ROUGHNESS).unwrap();
        rig.world().shake(0.02, 120.0);
        let shaken = rig.record(Movement::FOR_ROUGHNESS).unwrap();
        assert_eq!(quiet.movement, shaken.movement);
    }
}
