//! A few cases of the campaign of faults on the emulated board.

use tactus_core::table::factory;
use tactus_emulator::runs::faults::board::{BoardBench, BoardCase, Upset};
use tactus_lab::sim::fault_case;

use crate::common::elf;

/// The first cases in which the link is noisy, a debugger halts the core and the supply fails; and one in which the rig breaks.
#[test]
fn the_first_cases_of_each_kind_end_well() {
    let Some(elf) = elf() else { return };
    let pc = fault_case::Bench::new(factory::RIG).unwrap();
    let bench = BoardBench::new(&elf, &pc.calibration).unwrap();
    let kinds: [fn(&BoardCase) -> bool; 4] = [
        |case| has(case, |upset| matches!(upset, Upset::LinkNoise { .. })),
        |case| has(case, |upset| matches!(upset, Upset::Halt { .. })),
        |case| has(case, |upset| matches!(upset, Upset::BrownOut { .. })),
        |case| case.upsets.is_empty() && !case.case.faults.is_empty(),
    ];
    for kind in kinds {
        let case = (1..).map(BoardCase::draw).find(kind).unwrap();
        let outcome = bench.run(&case).unwrap();
        eprintln!("{case:?}: {outcome:?}");
        assert!(outcome.wrong.is_empty(), "{case:?}: {outcome:?}");
    }
}

fn has(case: &BoardCase, kind: fn(&Upset) -> bool) -> bool {
    case.upsets.iter().any(|(_, upset)| kind(upset))
}
