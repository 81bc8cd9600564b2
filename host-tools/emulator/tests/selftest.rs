//! The board's self-test on boards that are intact, and on boards that are not.
//!
//! TACTUS_SELFTEST_ELF names the ELF, which `cargo xtask build` makes; without it there is nothing to run.

use std::path::PathBuf;

use tactus::sim::encoder::Cut;
use tactus_emulator::{Emulator, Fault, Options, ResetCause, Setup};

/// How a run of the self-test ended.
struct Run {
    log: Vec<String>,
    /// Names of the checks, in their order, and whether they passed.
    checks: Vec<(String, bool)>,
    leds: [bool; 3],
    resets: Vec<ResetCause>,
}

impl Run {
    fn failed(&self) -> Vec<&str> {
        let failed = self.checks.iter().filter(|(_, passed)| !passed);
        failed.map(|(name, _)| name.as_str()).collect()
    }
}

fn run(faults: &[Fault]) -> Option<Run> {
    let Some(elf) = std::env::var_os("TACTUS_SELFTEST_ELF").map(PathBuf::from) else {
        eprintln!("skipped: TACTUS_SELFTEST_ELF is not set");
        return None;
    };
    let mut emulator = Emulator::start(&elf, Setup::default(), Options::default()).unwrap();
    for fault in faults {
        emulator.inject(*fault);
    }
    let mut log = Vec::new();
    while !log.iter().any(|line: &String| line.contains("SELF-TEST")) {
        assert!(emulator.now_ns() < 60_000_000_000, "no end: {log:#?}");
        emulator.run_ms(100).unwrap();
        log.extend(emulator.log().unwrap().into_iter().map(|(_, line)| line));
    }
    eprintln!("{}", log.join("\n"));
    assert_eq!(emulator.unmapped().unwrap(), [0u64; 0]);
    for register in emulator.unimplemented().unwrap() {
        assert!(register.starts_with("SYSCFG."), "{register}");
    }
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
        log,
    })
}

const CHECKS: [&str; 16] = [
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
    "lever",
    "stage",
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
            .contains("SELF-TEST PASSED: 16 checks")
    );
    assert_eq!(run.leds, [true, false, false]);
    assert_eq!(run.resets.len(), 1, "only the watchdog's: {:?}", run.resets);
}

#[test]
fn an_unplugged_sensor_fails_the_sensors_checks_only() {
    let Some(run) = run(&[Fault::SensorUnplugged]) else {
        return;
    };
    let sensors = ["sensor identity", "sensor words", "P_AC noise", "P_DC"];
    assert_eq!(run.failed(), sensors);
    assert_eq!(run.leds, [false, false, true]);
}

#[test]
fn a_cut_encoder_fails_the_stage_only() {
    for cut in [Cut::A, Cut::B, Cut::Both] {
        let Some(run) = run(&[Fault::EncoderCut(cut)]) else {
            return;
        };
        assert_eq!(run.failed(), ["stage"], "{cut:?}");
    }
}

#[test]
fn nothing_moves_while_the_emergency_stop_is_pressed() {
    let Some(run) = run(&[Fault::EStop]) else {
        return;
    };
    assert_eq!(run.failed(), ["emergency stop PF13", "lever", "stage"]);
}

#[test]
fn a_lever_switch_that_never_closes_or_opens_fails_the_lever_only() {
    for closed in [false, true] {
        let Some(run) = run(&[Fault::LeverTopStuck { closed }]) else {
            return;
        };
        assert_eq!(run.failed(), ["lever"], "stuck {closed}");
    }
}
