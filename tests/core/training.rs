//! Training on the simulated rig: with the power cut after any trial, what is learned is the same.

use embassy_futures::block_on;
use tactus_core::dsp::Plan;
use tactus_core::explorer::{Config, Explorer, Method};
use tactus_core::features::Movement;
use tactus_core::features::Observation;
use tactus_core::features::{PropertySet, Slide};
use tactus_core::probe::explore::explore;
use tactus_core::probe::training::{Training, Wanted};
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::{HIGH_FORCE_MN, Rig as _};
use tactus_core::store::TrainingRecord;
use tactus_core::table::Table;
use tactus_lab::sim::collection::{Collection, calibrated, texture_name};
use tactus_lab::sim::rig::SimRig;

const ROOM: usize = 16 * 1024 - 32;
const NEW: u8 = 43;

fn world() -> Collection {
    Collection {
        seed: 11,
        textures: vec![10, 30, 47, 84, 100],
        trials: 5,
    }
}

fn wanted(name: &str) -> Wanted<'_> {
    Wanted {
        name,
        trials: 5,
        pilot: false,
        measures: PropertySet::ALL,
        most_mn: HIGH_FORCE_MN,
    }
}

/// Slides of the new texture on one rig, in the order that a training asks for.
fn slides(
    calibration: RigCalibration,
    table: &Table<'_>,
    mut training: Training,
) -> (Training, Vec<(Movement, Observation)>) {
    let plan = Plan::new();
    let mut rig = SimRig::new(world().setup(NEW, 7));
    rig.control().calibrate(calibration).unwrap();
    let mut observed = Vec::new();
    while let Some(movement) = training.next() {
        let mut slide = Slide::new(&plan, movement);
        block_on(rig.perform(&mut slide)).unwrap();
        let observation = Observation::from(&slide.finish().unwrap());
        training.took(Some(table), movement, &observation).unwrap();
        observed.push((movement, observation));
    }
    (training, observed)
}

#[test]
fn a_texture_is_trained_through_power_cuts_and_identified() {
    let name = texture_name(NEW);
    let calibration = calibrated(world().setup(10, 0)).unwrap();
    let bytes = world().learn(Method::Fused, calibration, || ()).unwrap();
    let old = Table::read(&bytes).unwrap();
    let begin = || Training::new(wanted(name), Some(&old), ROOM).unwrap();
    let (training, observed) = slides(calibration, &old, begin());
    assert_eq!(observed.len(), 15);
    let mut buffer = vec![0; ROOM];
    let new = training.encode(Some(&old), &mut buffer).unwrap();

    // cut after every trial: only what was stored is left
    for cut in 0..=observed.len() {
        let mut stored: Vec<TrainingRecord> = Vec::new();
        let mut training = begin();
        for (n, (movement, observation)) in observed.iter().enumerate() {
            if n == cut {
                training = begin();
                for record in &stored {
                    assert_eq!(record.table, training.table());
                    training.resume(record.movement, record.stats).unwrap();
                }
            }
            assert_eq!(
                training.next(),
                Some(*movement),
                "cut after {cut}, trial {n}"
            );
            let record = training.took(Some(&old), *movement, observation).unwrap();
            stored.retain(|other| other.movement != *movement);
            stored.push(record);
        }
        let mut buffer = vec![0; ROOM];
        let again = training.encode(Some(&old), &mut buffer).unwrap();
        assert_eq!(again.as_bytes(), new.as_bytes(), "cut after {cut}");
    }

    // the others are what they were
    assert_eq!(new.textures(), old.textures() + 1);
    for (texture, of_old) in old.names().enumerate() {
        assert_eq!(new.name(texture as u16), Some(of_old));
        for movement in 0..3 {
            let known = |table: &Table<'_>| table.whitened(texture as u16, movement);
            assert_eq!(known(&new), known(&old));
        }
    }
    let plan = Plan::new();
    let config = Config {
        method: Method::Fused,
        open: true,
        ..Config::default()
    };
    let mut right = 0;
    for trial in 0..10 {
        let mut rig = SimRig::new(world().setup(NEW, 100 + trial));
        rig.control().calibrate(calibration).unwrap();
        let mut explorer = Explorer::<128>::new(new, PropertySet::ALL, config).unwrap();
        let verdict = block_on(explore(&mut rig, &mut explorer, &plan, || 0, |_| ())).unwrap();
        right += usize::from(new.name(verdict.texture) == Some(name));
    }
    println!("{right} of 10 right");
    assert!(right >= 9, "{right} of 10");
}
