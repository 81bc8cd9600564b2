//! Trials in worlds that make them hard.

use crate::sim::collection::{Collection, calibrated, record_texture};
use crate::sim::rig::SimRig;
use tactus_core::features::Movement;
use tactus_world::faults::Fault;
use tactus_world::world::Setup;

/// A press of the third trial was "force unsteady" in this world, and learning ended there.
#[test]
fn a_movement_that_failed_is_made_again() {
    let world = Collection {
        seed: 238,
        textures: vec![111],
        trials: 5,
    };
    let setup = world.setup(111, 0);
    let calibration = calibrated(setup).unwrap();
    let movements = Collection::MOVEMENTS;
    let slides = record_texture(setup, calibration, &movements, world.trials).unwrap();
    assert_eq!(slides.len(), movements.len() * 5);
}

/// A rig that homes and tries again by itself must not follow a finger that drifts: in the end no zero would be right.
#[test]
fn a_finger_that_drifts_is_no_matter_of_the_movement() {
    let setup = Setup::default();
    let calibration = calibrated(setup).unwrap();
    for counts_per_s in [-20.0, -10.0, 15.0, 30.0] {
        let mut rig = SimRig::new(setup);
        rig.control().calibrate(calibration).unwrap();
        rig.home().unwrap();
        let movement = Movement::FOR_ROUGHNESS;
        rig.record(movement).unwrap();
        rig.world().inject(Fault::PdcDrift { counts_per_s });
        let before = rig.now();
        let failed = rig.record(movement).unwrap_err();
        let took = (rig.now() - before).as_secs_f64();
        assert!(took < 30.0, "{counts_per_s}: {failed}, {took} s");
        // once it is mended, homing is enough
        rig.world().clear();
        rig.control().reset().unwrap();
        rig.home()
            .unwrap_or_else(|why| panic!("{counts_per_s}: {failed}, then {why}"));
        rig.record(movement).unwrap();
        assert!(rig.world().truth().force_max_n < 2.2);
    }
}
