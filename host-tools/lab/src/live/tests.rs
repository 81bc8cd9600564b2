use super::slides::{TRIALS, Trials, WORLD};
use crate::sim::collection::{Collection, calibrated};
use tactus_world::textures::TEXTURES;

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/src/live/world-1.trials");

#[test]
fn the_trials_that_come_with_the_program_are_what_the_world_gives() {
    let world = Collection::new(WORLD, vec![1], TRIALS);
    let calibration = calibrated(world.setup(1, 0)).unwrap();
    let make = |texture: u8| Trials::make(WORLD, texture, calibration).unwrap();
    if std::env::var("TACTUS_TRIALS").as_deref() == Ok("write") {
        use rayon::prelude::*;
        let numbers: Vec<u8> = TEXTURES.iter().map(|t| t.number).collect();
        let all: Vec<Trials> = numbers.par_iter().map(|&number| make(number)).collect();
        let bytes = postcard::to_extend(&all, Vec::new()).unwrap();
        std::fs::write(FILE, bytes).unwrap();
        return;
    }
    let all = Trials::of_world().unwrap();
    let numbers: Vec<u8> = all.iter().map(|t| t.texture).collect();
    assert!(numbers.iter().copied().eq(1..=117));
    for texture in [1, 60, 117] {
        let here = &all[usize::from(texture) - 1];
        assert!(
            *here == make(texture),
            "T{texture}: sensor, features or world were changed on purpose? \
             TACTUS_TRIALS=write cargo test -p tactus-lab live::"
        );
        assert_eq!(
            here.movements[0][0].first.len(),
            Collection::LENGTHS_MS.len()
        );
    }
}
