//! The campaign of faults on the simulated rig: some of its cases, and those by name that have failed.

use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use tactus_core::rig;
use tactus_core::rig::guard::Unguarded;
use tactus_core::table::factory;
use tactus_lab::sim::fault_case::naming::Naming;
use tactus_lab::sim::fault_case::{Activity, Bench, Case, Outcome};
use tactus_tests::seeds;
use tactus_world::encoder::Cut;
use tactus_world::faults::Fault;

use crate::rigs::{assert_all, texture};

/// The table that comes with the firmware.
const FACTORY: &[u8] = factory::RIG;

fn outcome(case: &Case) -> Outcome {
    Bench::new(FACTORY).unwrap().run(case).unwrap()
}

fn case(seed: u64, activity: Activity, texture: u8, faults: &[(u64, Fault)]) -> Case {
    Case {
        seed,
        texture,
        activity,
        faults: faults.to_vec(),
        bits: Vec::new(),
        stiff: false,
    }
}

fn right(outcome: Outcome) -> Result<(), Box<Outcome>> {
    if outcome.wrong.is_empty() {
        Ok(())
    } else {
        Err(outcome.into())
    }
}

/// Has a case happen, which must end well.
fn ends_well(seed: u64, activity: Activity, texture: u8, faults: &[(u64, Fault)]) -> Outcome {
    let outcome = outcome(&case(seed, activity, texture, faults));
    assert!(outcome.wrong.is_empty(), "{outcome}");
    outcome
}

/// What no guard sees, the spring of the finger's mount holds; without it the finger would be pressed too hard.
fn the_spring_holds(seed: u64, activity: Activity, texture: u8, faults: &[(u64, Fault)]) {
    ends_well(seed, activity, texture, faults);
    let stiff = outcome(&Case {
        stiff: true,
        ..case(seed, activity, texture, faults)
    });
    assert!(stiff.force_max_n > 2.2, "it is not the spring: {stiff}");
}

#[test]
fn the_first_cases_end_well() {
    let bench = Bench::new(FACTORY).unwrap();
    let cases = seeds(60).map(Case::draw).collect();
    let (named, pressed) = (AtomicUsize::new(0), AtomicUsize::new(0));
    assert_all(cases, |case| {
        let outcome = bench.run(case).unwrap();
        named.fetch_add(usize::from(!outcome.named.is_empty()), Relaxed);
        pressed.fetch_add(usize::from(outcome.force_max_n > 0.3), Relaxed);
        right(outcome)
    });
    // else this would show nothing
    let least = seeds(60).count() / 8;
    assert!(named.into_inner() > least && pressed.into_inner() > 0);
}

/// The judge must object to a rig whose finger is pressed too hard, and to a store that is another one without a word.
#[test]
fn a_case_says_what_broke() {
    let stop = [(3_000, Fault::EStop)];
    let stopped = outcome(&case(7, Activity::Identify, 10, &stop));
    assert_eq!(stopped.named, [rig::Fault::EStop]);
    assert_eq!(stopped.naming, Naming::Right);
    assert!(
        stopped.refused.is_some() && stopped.wrong.is_empty(),
        "{stopped}"
    );
    let nothing = outcome(&case(7, Activity::Identify, 10, &[]));
    assert_eq!((nothing.refused, nothing.named), (None, Vec::new()));
    assert!(nothing.wrong.is_empty(), "{:?}", nothing.wrong);
}

/// The judge goes by the world: a driver that steps down by itself while the finger slides, and a rig that does not
/// look at the force.
#[test]
fn a_rig_without_a_guard_fails() {
    let case = Case {
        stiff: true,
        ..case(7, Activity::Identify, 10, &[(6_600, Fault::LeverRunaway)])
    };
    let guarded = outcome(&case);
    assert!(guarded.wrong.is_empty(), "{guarded}");
    assert_eq!(guarded.naming, Naming::Right);
    let off = [
        rig::Fault::ForceHigh,
        rig::Fault::LeverSlips,
        rig::Fault::Unsteady,
    ];
    let bench = Bench {
        unguarded: off.into_iter().fold(Unguarded::default(), Unguarded::and),
        ..Bench::new(FACTORY).unwrap()
    };
    let unguarded = bench.run(&case).unwrap();
    let pressed = |wrong: &String| wrong.ends_with("N on the finger");
    assert!(unguarded.wrong.iter().any(pressed), "{unguarded}");
}

/// P_DC that drifts while it is measured in the air: with those constants a finger that drifts no more would be one
/// that is pressed.
#[test]
fn a_calibration_with_a_drifting_pressure_is_refused() {
    let cases = [
        (100_432, 41, 1_197, -1.885_477_276_745_623_4),
        (100_013, 64, 11_259, -2.797_370_443_493_259_4),
        (100_353, 58, 16_319, -4.279_273_699_133_493),
    ];
    for (seed, texture, at_ms, counts_per_s) in cases {
        let drift = [(at_ms, Fault::PdcDrift { counts_per_s })];
        let outcome = ends_well(seed, Activity::Calibrate, texture, &drift);
        assert!(outcome.refused.is_some(), "{outcome}");
    }
}

/// Cases of the campaign that have failed once. Where no guard sees what happens, the spring of the mount holds the
/// finger.
#[test]
fn the_spring_holds_a_finger_that_no_guard_sees() {
    let weak = Fault::PdcWeak {
        gain: 0.238_497_425_065_986_06,
    };
    let leaks = |seconds| Fault::SkinLeaks { seconds };
    let silent = |high| Fault::MisoStuck { high };
    let inverted = Fault::LeverDirInverted;
    let closed = Fault::LeverTopStuck { closed: true };
    // P_DC says a quarter; a skin leaks between two movements, or tears while the finger is down
    the_spring_holds(48, Activity::Train, 72, &[(10_700, weak)]);
    let slow = leaks(9.432_495_918_938_178);
    the_spring_holds(267, Activity::Train, 104, &[(8_400, slow)]);
    let quick = leaks(0.173_351_269_437_774);
    the_spring_holds(965, Activity::Label, 45, &[(7_125, quick)]);
    // DIR turns round and the sensor falls silent: what lifts, presses, and nothing says so
    let faults = [(6_600, inverted), (8_624, silent(false))];
    the_spring_holds(213, Activity::Label, 54, &faults);
    let faults = [(24_522, silent(true)), (26_154, inverted), (26_502, closed)];
    the_spring_holds(14_559, Activity::Train, 13, &faults);
}

/// The wire of DIR goes wrong while the finger is down, or while it is lifted and its switch then says that it is at
/// the top: the fault says how the finger is freed.
#[test]
fn an_inverted_lever_is_told_with_its_knob() {
    let closed = Fault::LeverTopStuck { closed: true };
    let inverted = Fault::LeverDirInverted;
    for (seed, activity, texture, faults) in [
        (130, Activity::Label, 68, &[(6_722, inverted)][..]),
        (
            205_362,
            Activity::Train,
            3,
            &[(26_262, inverted), (30_097, closed)],
        ),
        (
            209_075,
            Activity::Train,
            62,
            &[(17_194, inverted), (27_356, closed)],
        ),
        (
            209_734,
            Activity::Train,
            96,
            &[(16_572, inverted), (24_201, closed)],
        ),
    ] {
        let outcome = ends_well(seed, activity, texture, faults);
        let knob = |named: &rig::Fault| named.recovery().contains("knob");
        assert!(outcome.named.iter().any(knob), "{outcome}");
    }
}

#[test]
fn what_is_repaired_at_a_fault_does_not_keep_the_rig_from_homing() {
    // the stage has gone over its limit switch to the hard stop: the origin is where the switch opens
    let fades = |seconds| Fault::PdcFades { seconds };
    let open = Fault::StageLimitStuck {
        upper: false,
        closed: false,
    };
    let faults = [(8_545, fades(4.167_844_254_963_095)), (10_122, open)];
    ends_well(1_294, Activity::Label, 104, &faults);
    // P_DC that had sunk says the truth again: that is no lever that comes down
    let drift = Fault::PdcDrift {
        counts_per_s: -3.399_227_899_245_355,
    };
    let faults = [
        (1_639, fades(0.098_440_724_680_469_62)),
        (11_939, Fault::StageVibrates { um: 0.5 }),
        (20_413, drift),
    ];
    ends_well(9_139, Activity::Train, 85, &faults);
}

/// A driver that steps down by itself while the stage's current is measured without load, and after it while the rig
/// waits: the finger is lifted, or the fault says how it is freed.
#[test]
fn a_lever_that_runs_down_by_itself_is_seen() {
    assert_all(seeds(50).collect(), |&n| {
        let n = n * 13 % 50;
        let runs_down = [(2_000 + n * 700, Fault::LeverRunaway)];
        right(outcome(&case(
            n,
            Activity::Calibrate,
            texture(n),
            &runs_down,
        )))
    });
    // and then words of the sensor are damaged
    let flips = Fault::BitFlips {
        share: 0.005_811_423_298_212_308,
    };
    let faults = [(37_654, Fault::LeverRunaway), (39_538, flips)];
    ends_well(283, Activity::Calibrate, 69, &faults);
}

/// A driver that steps down by itself while P_DC is dead or says too little: the limit switch opens under the lifted
/// lever.
#[test]
fn a_runaway_lever_without_a_pressure_is_seen() {
    let failed_once = [100_628, 200_195, 200_349].map(Case::draw);
    assert_all(failed_once.into(), |case| right(outcome(case)));
    let blind = |share: f64| {
        [
            Fault::PdcStuck,
            Fault::PdcWeak { gain: 0.9 * share },
            Fault::PdcFades {
                seconds: 5.0 * share,
            },
            Fault::SkinLeaks {
                seconds: 0.1 + 20.0 * share,
            },
        ]
    };
    let waits = |n: u64, unguarded: Unguarded| {
        let bench = Bench {
            unguarded,
            ..Bench::new(FACTORY).unwrap()
        };
        let sensor = blind((n % 13) as f64 / 13.0)[n as usize % 4];
        // it homes its stage, or waits; or its motor is measured
        let (activity, lasts_ms) = [
            (Activity::Homing, 6_000),
            (Activity::Idle, 5_000),
            (Activity::Calibrate, 35_000),
        ][n as usize % 3];
        let at_ms = 500 + n * 977 % (lasts_ms - 500);
        let faults = [(at_ms, sensor), (at_ms + n * 7, Fault::LeverRunaway)];
        bench.run(&case(n, activity, texture(n), &faults)).unwrap()
    };
    assert_all(seeds(60).collect(), |&n| {
        let outcome = waits(n, Unguarded::default());
        // the lever goes up anyway when it has just begun to home
        let freed = outcome.named == [rig::Fault::LeverNotHome] || outcome.named.is_empty();
        assert!(freed && outcome.force_max_n == 0.0, "{outcome}");
        right(outcome)
    });
    let unguarded = waits(1, Unguarded::against(rig::Fault::LeverNotHome));
    assert!(unguarded.force_max_n > 1.0, "{unguarded}");
}

/// Encoder lines that are exchanged, or cut, are noticed before the stage is in a hard stop.
#[test]
fn a_stage_that_counts_backwards_ends_well() {
    for fault in [Fault::EncoderSwapped, Fault::EncoderCut(Cut::Both)] {
        for at_ms in [500, 4_000, 9_000, 12_000] {
            ends_well(at_ms, Activity::Identify, 10, &[(at_ms, fault)]);
        }
    }
}
