//! Slots and servo on a core that waits for its flash: the cycles of each instruction by the model, and a core that is as slow as its
//! worst millisecond, and slower.

use tactus_emulator::runs::bench::cycles::{CORE_HZ, Cycles, RESERVE, missed, slowed, trace};

use crate::common::elf;

/// Of the core's time, % that a slide may take, wait states included.
const BUSY: f64 = 9.0;
/// What is followed of each phase: all of it takes minutes, and is the bench's.
const WINDOW_NS: u64 = 50_000_000;

#[test]
fn slots_and_servo_keep_their_time_on_a_core_that_waits_for_its_flash() {
    let Some(elf) = elf() else { return };
    let cycles = trace(&elf, WINDOW_NS).unwrap();
    let Cycles {
        acquisition,
        servo,
        all,
        ..
    } = cycles;
    for (name, share) in [("acquisition", acquisition), ("servo", servo), ("all", all)] {
        eprintln!(
            "{name}: {:.2} cycles per instruction, {:.2} in its worst ms ({} instructions), {:.1} % of the core in its busiest ms",
            share.total.ratio(),
            share.slowest.spent.ratio(),
            share.slowest.spent.instructions,
            share.busiest.spent.cycles as f64 / (CORE_HZ * 1e-5),
        );
    }
    eprintln!(
        "a slot takes {:.0} cycles, a slide {:.1} % of the core's time",
        cycles.of_slot(),
        100.0 * cycles.busy()
    );
    eprintln!("{cycles:?}");
    assert_eq!(cycles.unseen, 0);
    let by = RESERVE * cycles.worst_ratio();
    assert!((1.3..8.0).contains(&by), "{by}");
    let slow = slowed(&elf, by);
    eprintln!("{by:.2} times slower: {slow:?}");
    assert_eq!(missed(&slow), [""; 0], "it missed its time");
    let margin_us = slow.map(|slow| slow.margin_us());
    eprintln!("a command ends {margin_us:?} us before it would be late");
    // a check that finds nothing on any core would find nothing here
    assert_ne!(missed(&slowed(&elf, 24.0)), [""; 0]);
    // nor one that finds something on all of them
    let intact = slowed(&elf, 1.0);
    eprintln!("as it is: {intact:?}");
    assert_eq!(missed(&intact), [""; 0]);
    let busy = 100.0 * cycles.busy();
    assert!(busy <= BUSY, "a slide takes {busy:.1} % of the core");
}
