//! Movements of up to 2 N, for a rig whose finger's mount yields, judged by the world's force on the finger. That they
//! have to be allowed first: `probe::tests::a_high_force_holds_only_where_it_is_kept`.

use rayon::prelude::*;
use tactus_core::features::Movement;
use tactus_core::rig::Ended;
use tactus_core::rig::guard::Unguarded;
use tactus_tests::seeds;
use tactus_world::mount::Mount;

use crate::press::{Bench, Press, Trouble};
use crate::rigs::texture;

/// On the mount that such a rig is to have, and on none.
#[test]
fn two_newtons_are_made_and_no_trouble_presses_harder_than_2_2() {
    let movements = [(1585, 25_119), (1995, 15_849), (2000, 63_096)];
    let movements = movements.map(|(mn, um_s)| Movement::new(mn, um_s).unwrap());
    let benches = seeds(50).flat_map(|seed| {
        let mounts = [Mount::FOR_2_N, Mount::STIFF];
        let each = |mount| Trouble::ALL.map(|trouble| (mount, trouble));
        mounts
            .into_iter()
            .flat_map(each)
            .map(move |(mount, trouble)| Bench {
                world: seed,
                texture: texture(seed),
                trouble,
                unguarded: Unguarded::default(),
                mount,
            })
    });
    let benches: Vec<Bench> = benches.collect();
    let presses: Vec<Press> = benches
        .into_par_iter()
        .flat_map_iter(|bench| {
            let movement = movements[bench.world as usize % movements.len()];
            bench.make([movement])
        })
        .collect();
    let list = |chosen: &dyn Fn(&&Press) -> bool| {
        let lines = presses.iter().filter(chosen).map(ToString::to_string);
        lines.collect::<Vec<_>>()
    };
    assert_eq!(list(&|press| press.is_too_hard()), [""; 0]);
    let sound = presses
        .iter()
        .filter(|press| press.bench.trouble == Trouble::Sound);
    let made = |press: &&Press| {
        press.ended == Ok(Ended::Whole)
            && press.force_max_n > 0.95 * f64::from(press.movement.force_n())
    };
    let (made, all) = (sound.clone().filter(made).count(), sound.count());
    println!("{made} of {all} sound ones were made");
    assert!(made * 20 >= all * 19, "{made} of {all}");
    let dead = |press: &&Press| press.bench.trouble == Trouble::Dead && press.ended.is_ok();
    assert_eq!(list(&dead), [""; 0]);
}
