use tactus_core::table::{Contents, Table, factory};

use super::*;
use tactus_world::faults::Fault;

/// Of each rig's table that comes with the firmware every 58th texture, learned anew: the table is of this
/// simulator. All of each is compared by `cargo xtask campaign factory`.
#[test]
fn factory_tables_are_of_this_world() {
    // the image of this one ends slides early
    let lengths = Table::read(factory::RIG).unwrap();
    assert!(lengths.lengths_ms().eq(Collection::LENGTHS_MS));
    let plan = Plan::new();
    for finger in FingerName::ALL {
        let table = Table::read(factory::rig(finger)).unwrap();
        let Contents::Fused(set, features) = table.contents() else {
            panic!("{finger}: {:?}", table.contents());
        };
        let collection = Collection::new(1, (1..=117).step_by(58).collect(), 5).touched_by(finger);
        let calibration = calibrated(collection.setup(1, 0)).unwrap();
        let slides = collection.record(calibration, || ());
        let slides = slides.unwrap();
        for (slides, &texture) in slides.iter().zip(&collection.textures) {
            let movements = &Collection::MOVEMENTS;
            let observed = collection.observe(&plan, movements, texture, slides, &[]);
            for (movement, trials) in (0..).zip(observed.unwrap()) {
                let vectors = trials.iter().map(|trial| {
                    let vector = trial.whole.vector(set, features.into()).unwrap();
                    table.whiten(movement, &vector).unwrap()
                });
                let vectors: Vec<_> = vectors.collect();
                let known = table.white_mean(u16::from(texture) - 1, movement);
                for (axis, known) in known.enumerate() {
                    let sum: f64 = vectors.iter().map(|v| f64::from(v[axis])).sum();
                    let mean = sum / vectors.len() as f64;
                    // two roundings
                    assert!(
                        (mean - f64::from(known)).abs() <= 2.0,
                        "{finger}, texture {texture}, movement {movement}, axis {axis}: {mean} and {known}; if \
                         simulator or features were changed on purpose: cargo xtask campaign factory -- --write"
                    );
                }
            }
        }
    }
}

/// A press of the third trial was "force unsteady" in this world, and learning ended there.
#[test]
fn a_movement_that_failed_is_made_again() {
    let world = Collection::new(238, vec![111], 5);
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
