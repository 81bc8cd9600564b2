//! Trials in worlds that make them hard.

use crate::sim::collection::{Collection, calibrated, record_texture};

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
