//! The campaign of faults on the simulated rig: some of its cases, and those by name that have failed.

use rayon::prelude::*;
use tactus_core::rig;
use tactus_core::rig::guard::Unguarded;
use tactus_core::table::factory;
use tactus_lab::sim::fault_case::naming::Naming;
use tactus_lab::sim::fault_case::{Activity, Bench, Case, Outcome};
use tactus_world::encoder::Cut;
use tactus_world::faults::Fault;

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

/// Has a case happen, which must end well.
fn ends_well(seed: u64, activity: Activity, texture: u8, faults: &[(u64, Fault)]) {
    let outcome = outcome(&case(seed, activity, texture, faults));
    assert!(outcome.wrong.is_empty(), "{outcome}");
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
    let cases: Vec<Case> = (1..=60).map(Case::draw).collect();
    let outcomes: Vec<Outcome> = cases
        .par_iter()
        .map(|case| bench.run(case).unwrap())
        .collect();
    let wrong: Vec<String> = outcomes
        .iter()
        .filter(|outcome| !outcome.wrong.is_empty())
        .map(ToString::to_string)
        .collect();
    assert_eq!(wrong, [""; 0]);
    // else this would show nothing
    assert!(outcomes.iter().filter(|o| !o.named.is_empty()).count() > 8);
    assert!(outcomes.iter().any(|o| o.force_max_n > 0.3));
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

/// The judge goes by the world: a driver that steps down by itself while the finger slides, and a rig that does not look at the
/// force.
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

/// P_DC that drifts while it is measured in the air: with those constants a finger that drifts no more would be one that is
/// pressed.
#[test]
fn a_calibration_with_a_drifting_pressure_is_refused() {
    let cases = [
        (100_432, 41, 1_197, -1.885_477_276_745_623_4),
        (100_013, 64, 11_259, -2.797_370_443_493_259_4),
        (100_353, 58, 16_319, -4.279_273_699_133_493),
    ];
    for (seed, texture, at_ms, counts_per_s) in cases {
        let drift = [(at_ms, Fault::PdcDrift { counts_per_s })];
        ends_well(seed, Activity::Calibrate, texture, &drift);
        let outcome = outcome(&case(seed, Activity::Calibrate, texture, &drift));
        assert!(outcome.refused.is_some(), "{outcome}");
    }
}

/// P_DC that says a quarter of what there is: the lever presses until it says what is wanted.
#[test]
fn the_spring_holds_a_finger_whose_pressure_is_weak() {
    let weak = Fault::PdcWeak {
        gain: 0.238_497_425_065_986_06,
    };
    the_spring_holds(48, Activity::Train, 72, &[(10_700, weak)]);
}

/// A skin that leaks within nine seconds, from between two movements on.
#[test]
fn the_spring_holds_a_finger_that_leaks_slowly() {
    let leak = Fault::SkinLeaks {
        seconds: 9.432_495_918_938_178,
    };
    the_spring_holds(267, Activity::Train, 104, &[(8_400, leak)]);
}

/// A skin that tears quickly while the finger is down.
#[test]
fn the_spring_holds_a_finger_that_leaks_quickly() {
    let leak = Fault::SkinLeaks {
        seconds: 0.173_351_269_437_774,
    };
    the_spring_holds(965, Activity::Label, 45, &[(7_125, leak)]);
}

/// The wire of DIR goes wrong while the finger is down, and the sensor is silent before it is lifted: what lifts, presses, and
/// nothing says so.
#[test]
fn the_spring_holds_under_an_inverted_lever_without_a_sensor() {
    let faults = [
        (6_600, Fault::LeverDirInverted),
        (8_624, Fault::MisoStuck { high: false }),
    ];
    the_spring_holds(213, Activity::Label, 54, &faults);
}

/// The wire of DIR goes wrong while the finger is down: the fault says how the finger is freed.
#[test]
fn an_inverted_lever_is_told_with_its_knob() {
    let faults = [(6_722, Fault::LeverDirInverted)];
    ends_well(130, Activity::Label, 68, &faults);
    let outcome = outcome(&case(130, Activity::Label, 68, &faults));
    let knob = |named: &rig::Fault| named.recovery().contains("knob");
    assert!(outcome.named.iter().any(knob), "{outcome}");
}

/// The wire of DIR goes wrong while the finger is lifted, so that the lever goes up where it is to press; then its switch says
/// that it is at the top. What is to lift it from there goes down as far as it was thought to have come.
#[test]
fn an_inverted_lever_below_a_closed_switch_is_told_with_its_knob() {
    let closed = Fault::LeverTopStuck { closed: true };
    for (seed, texture, inverted_ms, closed_ms) in [
        (205_362, 3, 26_262, 30_097),
        (209_075, 62, 17_194, 27_356),
        (209_734, 96, 16_572, 24_201),
    ] {
        let faults = [(inverted_ms, Fault::LeverDirInverted), (closed_ms, closed)];
        ends_well(seed, Activity::Train, texture, &faults);
        let outcome = outcome(&case(seed, Activity::Train, texture, &faults));
        let knob = |named: &rig::Fault| named.recovery().contains("knob");
        assert!(outcome.named.iter().any(knob), "{outcome}");
    }
}

/// The same without a sensor, when the finger is lifted because of that: nothing says that it is down. The fault that was named says
/// that a person looks, and how the finger is freed.
#[test]
fn an_inverted_lever_without_a_sensor_below_a_closed_switch_is_told_with_its_knob() {
    let faults = [
        (24_522, Fault::MisoStuck { high: true }),
        (26_154, Fault::LeverDirInverted),
        (26_502, Fault::LeverTopStuck { closed: true }),
    ];
    the_spring_holds(14_559, Activity::Train, 13, &faults);
}

/// The stage did not find its limit switch and went over it to the hard stop. When the switch is repaired it is closed where the stage
/// stands: the origin is where it opens, and not there.
#[test]
fn a_stage_beyond_its_repaired_switch_finds_where_it_opens() {
    let faults = [
        (
            8_545,
            Fault::PdcFades {
                seconds: 4.167_844_254_963_095,
            },
        ),
        (
            10_122,
            Fault::StageLimitStuck {
                upper: false,
                closed: false,
            },
        ),
    ];
    ends_well(1_294, Activity::Label, 104, &faults);
}

/// P_DC that had sunk says the truth again while the rig stands at its fault, at the lever's switch: that is no lever that comes down.
#[test]
fn a_drift_that_is_repaired_at_a_fault_does_not_keep_the_rig_from_homing() {
    let faults = [
        (
            1_639,
            Fault::PdcFades {
                seconds: 0.098_440_724_680_469_62,
            },
        ),
        (11_939, Fault::StageVibrates { um: 0.5 }),
        (
            20_413,
            Fault::PdcDrift {
                counts_per_s: -3.399_227_899_245_355,
            },
        ),
    ];
    ends_well(9_139, Activity::Train, 85, &faults);
}

/// A driver that steps down by itself while the stage's current is measured without load, and after it while the rig waits: the
/// finger is lifted, or the fault says how it is freed.
#[test]
fn a_lever_that_runs_down_by_itself_is_seen() {
    let bench = Bench::new(FACTORY).unwrap();
    let wrong: Vec<String> = (0..50u64)
        .into_par_iter()
        .map(|n| {
            let texture = u8::try_from(1 + n * 37 % 117).unwrap();
            let at_ms = 2_000 + n * 700;
            let runs_down = [(at_ms, Fault::LeverRunaway)];
            bench
                .run(&case(n, Activity::Calibrate, texture, &runs_down))
                .unwrap()
        })
        .filter(|outcome| !outcome.wrong.is_empty())
        .map(|outcome| outcome.to_string())
        .collect();
    assert_eq!(wrong, [""; 0]);
}

/// A driver that steps down by itself, and then words of the sensor are damaged.
#[test]
fn a_runaway_lever_with_damaged_words_ends_well() {
    let flips = Fault::BitFlips {
        share: 0.005_811_423_298_212_308,
    };
    let faults = [(37_654, Fault::LeverRunaway), (39_538, flips)];
    ends_well(283, Activity::Calibrate, 69, &faults);
}

/// A driver that steps down by itself while P_DC is dead or says too little: the limit switch opens under the lifted lever.
#[test]
fn a_runaway_lever_without_a_pressure_is_seen() {
    for case in [100_628, 200_195, 200_349].map(Case::draw) {
        let outcome = outcome(&case);
        assert!(outcome.wrong.is_empty(), "{outcome}");
    }
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
        let texture = u8::try_from(1 + n * 37 % 117).unwrap();
        bench.run(&case(n, activity, texture, &faults)).unwrap()
    };
    (0..60u64).into_par_iter().for_each(|n| {
        let outcome = waits(n, Unguarded::default());
        assert!(outcome.wrong.is_empty(), "{outcome}");
        // the lever goes up anyway when it has just begun to home
        let freed = outcome.named == [rig::Fault::LeverNotHome] || outcome.named.is_empty();
        assert!(freed && outcome.force_max_n == 0.0, "{outcome}");
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
