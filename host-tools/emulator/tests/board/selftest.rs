//! The board's self-test on boards that are intact, and on boards that are not.
//!
//! TACTUS_SELFTEST_ELF names the ELF, which `cargo xtask size` makes; without it there is nothing to run.

use tactus_emulator::board::{Emulator, Options, Output, ResetCause};
use tactus_world::encoder::Cut;
use tactus_world::faults::Fault;
use tactus_world::person::{Hand, Manner};
use tactus_world::world::Setup;

use crate::common::elf_of;

/// How a run of the self-test ended.
struct Run {
    log: Vec<String>,
    /// Names of the checks, in their order, and whether they passed.
    checks: Vec<(String, bool)>,
    leds: [bool; 3],
    resets: Vec<ResetCause>,
    /// What the motors were told, with the times, ns.
    outputs: Vec<(u64, Output)>,
    force_max_n: f64,
    /// When it said that the motors move.
    warned_ns: u64,
}

impl Run {
    fn failed(&self) -> Vec<&str> {
        let failed = self.checks.iter().filter(|(_, passed)| !passed);
        failed.map(|(name, _)| name.as_str()).collect()
    }
}

/// What the person does who is asked to take the finger off and to squeeze it.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Person {
    /// That.
    Obeys,
    /// Squeezes it, and puts it back.
    PutsItBack,
    /// Nothing: it is on the lever.
    IsAway,
}

/// Runs the self-test, the finger in somebody's hand, with these faults: from power-up on, or so long after it has said
/// that the motors move, ns.
fn run(faults: &[(u64, Fault)]) -> Option<Run> {
    run_with(Person::Obeys, faults)
}

fn run_with(person: Person, faults: &[(u64, Fault)]) -> Option<Run> {
    let elf = elf_of("TACTUS_SELFTEST_ELF")?;
    let options = Options {
        trace_s: 60,
        ..Options::default()
    };
    let mut emulator = Emulator::start(&elf, Setup::default(), options).unwrap();
    for (_, fault) in faults.iter().filter(|(after_ns, _)| *after_ns == 0) {
        emulator.inject(*fault);
    }
    if person != Person::IsAway {
        let hand = Hand::new(1, Manner::default());
        emulator.rig().world().hold(hand);
    }
    // a hand takes a second and a half to get to it
    let squeeze = |emulator: &mut Emulator, force_n, ms| {
        if let Some(hand) = emulator.rig().world().hand() {
            hand.intend(force_n, 0.0);
        }
        emulator.run_ms(ms).unwrap();
    };
    let mut log = Vec::new();
    let (mut asked, mut warned_ns) = (false, 0);
    while !log.iter().any(|line: &String| line.contains("SELF-TEST")) {
        assert!(emulator.now_ns() < 60_000_000_000, "no end: {log:#?}");
        emulator.run_ms(100).unwrap();
        log.extend(emulator.log().unwrap().into_iter().map(|(_, line)| line));
        if warned_ns == 0
            && let Some(line) = log.iter().find(|line| line.contains("THE MOTORS MOVE"))
        {
            let stamp = line.split_whitespace().next().unwrap();
            warned_ns = (stamp.parse::<f64>().unwrap() * 1e9) as u64;
            for (after_ns, fault) in faults.iter().filter(|(after_ns, _)| *after_ns > 0) {
                emulator.schedule(warned_ns + after_ns, *fault);
            }
        }
        if !asked && log.iter().any(|line| line.contains("TAKE THE FINGER OFF")) {
            asked = true;
            squeeze(&mut emulator, 0.5, 3000);
            squeeze(&mut emulator, 0.0, 200);
            if person == Person::PutsItBack {
                emulator.rig().world().put_back();
                emulator.rig().world().reset_extremes();
            }
        }
    }
    eprintln!("{}", log.join("\n"));
    assert_eq!(emulator.violations().unwrap(), []);
    let force_max_n = emulator.rig().world().truth().force_max_n;
    let checks = log.iter().filter_map(|line| {
        let (verdict, name) = [("PASS ", true), ("FAIL ", false)]
            .into_iter()
            .find_map(|(mark, passed)| Some((passed, line.split_once(mark)?.1)))?;
        Some((name.split_once(": ")?.0.to_owned(), verdict))
    });
    Some(Run {
        checks: checks.collect(),
        leds: emulator.leds().unwrap(),
        resets: emulator
            .resets()
            .unwrap()
            .into_iter()
            .map(|reset| reset.cause)
            .collect(),
        outputs: emulator.rig().trace().copied().collect(),
        force_max_n,
        warned_ns,
        log,
    })
}

const CHECKS: [&str; 18] = [
    "reset",
    "clock",
    "PA12",
    "sensor identity",
    "sensor words",
    "P_AC noise",
    "P_DC",
    "motor current at rest",
    "left switch PF14",
    "right switch PF15",
    "emergency stop PF13",
    "lever switch PF12",
    "finger off",
    "lever",
    "stage",
    "bridge brakes",
    "store",
    "watchdog",
];

#[test]
fn an_intact_board_passes_every_check() {
    let Some(run) = run(&[]) else { return };
    let names: Vec<&str> = run.checks.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, CHECKS);
    assert_eq!(run.failed(), [""; 0]);
    assert!(
        run.log
            .last()
            .unwrap()
            .contains("SELF-TEST PASSED: 18 checks")
    );
    assert_eq!(run.leds, [true, false, false]);
    assert_eq!(run.resets.len(), 1, "only the watchdog's: {:?}", run.resets);
}

#[test]
#[ignore = "long"]
fn an_unplugged_sensor_fails_its_checks_and_no_motor_moves_without_it() {
    let Some(run) = run(&[(0, Fault::SensorUnplugged)]) else {
        return;
    };
    let sensors = ["sensor identity", "sensor words", "P_AC noise", "P_DC"];
    let motors = ["finger off", "lever", "stage"];
    assert_eq!(run.failed(), [&sensors[..], &motors].concat());
    assert!(!run.outputs.iter().any(|(_, output)| moves(output)));
    assert_eq!(run.leds, [false, false, true]);
}

#[test]
#[ignore = "long"]
fn nothing_moves_while_the_emergency_stop_is_pressed() {
    let Some(run) = run(&[(0, Fault::EStop)]) else {
        return;
    };
    assert_eq!(run.failed(), ["emergency stop PF13", "lever", "stage"]);
    assert!(!run.outputs.iter().any(|(_, output)| moves(output)));
}

#[test]
#[ignore = "long"]
fn the_stage_stays_where_it_is_if_the_levers_switch_never_closes_or_opens() {
    for closed in [false, true] {
        let Some(run) = run(&[(0, Fault::LeverTopStuck { closed })]) else {
            return;
        };
        assert_eq!(run.failed(), ["lever", "stage"], "stuck {closed}");
        let duty = |output: &Output| matches!(output, Output::StageDuty(duty) if *duty != 0.0);
        assert!(!run.outputs.iter().any(|(_, output)| duty(output)));
    }
}

#[test]
#[ignore = "long"]
fn the_emergency_stop_stops_lever_and_stage_at_once() {
    // while the lever goes up, and while the stage goes to the right
    for (after_ns, failed) in [
        (3_839_000_000, &["lever", "stage"][..]),
        (8_719_000_000, &["stage"][..]),
    ] {
        let Some(run) = run(&[(after_ns, Fault::EStop)]) else {
            return;
        };
        assert_eq!(run.failed(), failed);
        let at_ns = run.warned_ns + after_ns;
        let moving = run.outputs.iter().filter(|(_, output)| moves(output));
        let last_ns = moving.map(|(at_ns, _)| *at_ns).max().unwrap();
        let ends = run.outputs.iter().filter(|(at, _)| *at > last_ns);
        let end_ns = ends.map(|(at_ns, _)| *at_ns).min().unwrap();
        assert!(last_ns > at_ns - 100_000_000, "it did not move before");
        // its contact bounces for 4 ms
        assert!(end_ns < at_ns + 7_000_000, "moves until {end_ns}");
    }
}

/// The finger is on its mount all the same, and up is down.
fn is_not_crushed(person: Person, failed: &[&str]) {
    let Some(run) = run_with(person, &[(0, Fault::LeverDirInverted)]) else {
        return;
    };
    assert_eq!(run.failed(), failed, "{person:?}");
    let force_n = run.force_max_n;
    assert!(force_n < 0.5, "{person:?}: {force_n:.2} N on the finger");
    let moved = run.outputs.iter().any(|(_, output)| moves(output));
    assert_eq!(moved, person == Person::PutsItBack);
}

#[test]
fn a_finger_that_was_put_back_is_not_crushed_by_a_lever_that_goes_down() {
    is_not_crushed(Person::PutsItBack, &["lever", "stage"]);
}

#[test]
#[ignore = "long"]
fn a_finger_that_was_left_on_is_not_crushed_by_a_lever_that_goes_down() {
    is_not_crushed(Person::IsAway, &["finger off", "lever", "stage"]);
}

/// Each of them fails its own check, and no other.
fn fails(fault: Fault, failed: &str) {
    let Some(run) = run(&[(0, fault)]) else {
        return;
    };
    assert_eq!(run.failed(), [failed], "{fault:?}");
    let named = fault != Fault::FastDecay || run.log.iter().any(|line| line.contains("fast decay"));
    assert!(named, "{:?}", run.log);
}

#[test]
fn a_cut_encoder_fails_the_stage_only() {
    fails(Fault::EncoderCut(Cut::A), "stage");
}

#[test]
#[ignore = "long"]
fn other_faults_of_the_stage_fail_their_checks_only() {
    fails(Fault::EncoderCut(Cut::B), "stage");
    fails(Fault::EncoderCut(Cut::Both), "stage");
    fails(Fault::StageJammed, "stage");
    // without duty such a bridge lets the stage coast, and the duty that should move it does not
    fails(Fault::FastDecay, "bridge brakes");
}

/// A step, or a stage that is driven.
fn moves(output: &Output) -> bool {
    match output {
        Output::LeverStep(high) => *high,
        Output::StageDuty(duty) => *duty != 0.0,
        _ => false,
    }
}
