use super::*;

const SECOND_NS: u64 = 1_000_000_000;

#[test]
fn ticks_do_not_drift() {
    let mut world = World::new(Setup::default());
    world.advance_to(SECOND_NS - 1);
    assert_eq!((world.ticks, world.tick_ends_ns), (13_200, SECOND_NS));
    world.advance_to(SECOND_NS);
    assert_eq!((world.ticks, world.tick_began_ns), (13_201, SECOND_NS));
}
