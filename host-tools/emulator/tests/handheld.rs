//! The real ELF of the handheld probe in the scenarios of `scenarios/`: a hand and a button, and what must be seen.

use std::path::{Path, PathBuf};

use tactus_emulator::Emulator;
use tactus_emulator::scenario::Scenario;

/// Every scenario has a test here.
const SCENARIOS: [&str; 7] = [
    "again", "faults", "known", "rest", "spell", "teach", "uneven",
];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios")
}

/// Plays a scenario; what holds of all of them is looked at here. `None` without an ELF.
fn play(name: &str) -> Option<(Emulator, Vec<String>)> {
    let Some(elf) = std::env::var_os("TACTUS_HANDHELD_ELF") else {
        assert!(
            std::env::var("TACTUS_REQUIRE_ELF").as_deref() != Ok("1"),
            "TACTUS_REQUIRE_ELF=1, but TACTUS_HANDHELD_ELF is not set"
        );
        eprintln!("skipped: TACTUS_HANDHELD_ELF is not set (run `cargo xtask test`)");
        return None;
    };
    assert!(SCENARIOS.contains(&name));
    let scenario = Scenario::read(&folder().join(format!("{name}.json"))).unwrap();
    let mut board = scenario
        .play(Path::new(&elf), None)
        .unwrap_or_else(|why| panic!("{name}: {why}"));
    let log: Vec<String> = board
        .log()
        .unwrap()
        .into_iter()
        .map(|(_, line)| line)
        .collect();
    log.iter().for_each(|line| eprintln!("{line}"));
    assert_eq!(board.resets().unwrap(), []);
    assert_eq!(board.unmapped().unwrap(), [0u64; 0]);
    for register in board.unimplemented().unwrap() {
        assert!(register.starts_with("SYSCFG."), "{register}");
    }
    assert_eq!(board.rig().display().unknown(), [0u8; 0]);
    Some((board, log))
}

#[test]
fn every_scenario_is_played() {
    let mut there: Vec<String> = std::fs::read_dir(folder())
        .unwrap()
        .map(|file| file.unwrap().path())
        .map(|path| {
            Scenario::read(&path).unwrap();
            path.file_stem().unwrap().to_str().unwrap().to_owned()
        })
        .collect();
    there.sort_unstable();
    assert_eq!(there, SCENARIOS);
}

#[test]
fn a_known_texture_is_recognised() {
    play("known");
}

#[test]
#[ignore = "known defect: with this seed the slide is not noticed, or not as uneven"]
fn slides_that_are_no_good_are_made_again() {
    play("again");
}

#[test]
#[ignore = "known defect: with this seed the slide is not noticed, or not as uneven"]
fn an_uneven_slide_is_made_again() {
    play("uneven");
}

#[test]
fn an_unknown_texture_is_taught_and_known_after_a_power_cut() {
    play("teach");
}

#[test]
fn a_name_is_spelled() {
    play("spell");
}

#[test]
fn faults_are_shown_and_go() {
    play("faults");
}

/// The share of time awake, as the firmware says it: with its samples and without.
#[test]
fn it_sleeps_between_samples_and_when_nobody_wants_any() {
    let Some((_, log)) = play("rest") else { return };
    let shares = |what: &str| -> Vec<f32> {
        let lines = log.iter().filter_map(|line| line.split_once(what));
        lines
            .map(|(_, share)| share.trim().parse().unwrap())
            .collect()
    };
    let (listening, resting) = (shares("awake listening:"), shares("awake at rest:"));
    let (Some(listening), Some(resting)) = (listening.last(), resting.last()) else {
        panic!("it says nothing of its sleep: {log:?}");
    };
    assert!((0.02..0.6).contains(listening), "{listening}");
    assert!((0.0..0.02).contains(resting), "{resting}");
}
