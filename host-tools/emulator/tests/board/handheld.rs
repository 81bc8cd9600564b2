//! The real ELF of the handheld probe in the scenarios of `scenarios/`: a hand and a button, and what must be seen.

use std::path::{Path, PathBuf};

use tactus_emulator::board::Emulator;

use crate::common::elf_of;
use crate::scenario::Scenario;

const SCENARIOS: [&str; 7] = [
    "again", "faults", "known", "rest", "spell", "teach", "uneven",
];

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios")
}

/// The handheld's firmware.
fn elf() -> Option<PathBuf> {
    elf_of("TACTUS_HANDHELD_ELF")
}

/// Plays a scenario; what holds of all of them is looked at here. `None` without an ELF.
fn play(name: &str) -> Option<(Emulator, Vec<String>)> {
    let elf = elf()?;
    eprintln!("scenario {name}");
    let scenario = std::fs::read(folder().join(format!("{name}.json"))).unwrap();
    let mut board = Scenario::parse(&scenario).play(&elf);
    let log: Vec<String> = board
        .log()
        .unwrap()
        .into_iter()
        .map(|(_, line)| line)
        .collect();
    log.iter().for_each(|line| eprintln!("{line}"));
    // no slot came late, and no word was lost, from power-up on
    let slots: Vec<_> = log.iter().filter(|l| l.contains("sensor slots:")).collect();
    let all_well = |line: &str| line.ends_with("sensor slots: 0 late, 0 lost");
    assert!(slots.iter().all(|line| all_well(line)), "{slots:?}");
    assert_eq!(board.resets().unwrap(), []);
    assert_eq!(board.violations().unwrap(), []);
    assert_eq!(board.rig().display().unknown(), [0u8; 0]);
    Some((board, log))
}

#[test]
fn a_known_texture_is_recognised() {
    play("known");
}

#[test]
#[ignore = "long"]
fn the_other_scenarios_are_played() {
    for name in SCENARIOS {
        if !["known", "rest"].contains(&name) {
            play(name);
        }
    }
}

/// The last number behind `what` in the log.
fn said(log: &[String], what: &str) -> f64 {
    let mut lines = log.iter().rev();
    let share = lines.find_map(|line| Some(line.split_once(what)?.1.trim().to_owned()));
    let share = share.unwrap_or_else(|| panic!("no \"{what}\" in {log:?}"));
    share.parse().unwrap()
}

/// The share of time awake, as the firmware says it: with its samples and without.
#[test]
#[ignore = "long"]
fn it_sleeps_between_samples_and_when_nobody_wants_any() {
    let Some((_, log)) = play("rest") else { return };
    let (listening, resting) = (said(&log, "awake listening:"), said(&log, "awake at rest:"));
    assert!((0.02..0.6).contains(&listening), "{listening}");
    assert!((0.0..0.02).contains(&resting), "{resting}");
}

/// Compares the firmware's account of its sleep with the instructions that the emulated core has executed.
#[test]
#[ignore = "long"]
fn the_share_of_time_awake_is_true() {
    let Some(elf) = elf() else { return };
    let ready = br#"{"about": "", "texture": "burlap", "step": [{"see": {"text": ["Press", "and hold"]}}]}"#;
    let mut board = Scenario::parse(ready).play(&elf);
    let clock_hz = tactus_emulator::board::Options::default().instructions_per_second;
    let awake = |board: &mut Emulator, what: &str| {
        board.run_ms(1000).unwrap();
        let (from, from_ns) = (board.instructions().unwrap(), board.now_ns());
        board.run_ms(12_000).unwrap();
        let executed = (board.instructions().unwrap() - from) as f64;
        let seconds = (board.now_ns() - from_ns) as f64 * 1e-9;
        let log: Vec<String> = board.log().unwrap().into_iter().map(|(_, l)| l).collect();
        (executed / seconds / clock_hz.get() as f64, said(&log, what))
    };
    let (is, said) = awake(&mut board, "awake listening:");
    eprintln!("listening: awake {is:.4}, said {said:.4}");
    assert!((is - said).abs() < 0.003 && is > 0.02, "{is} {said}");
    // the book's table of power goes by it
    let book = include_str!("../../../../docs/src/handheld.md");
    let row = book
        .lines()
        .find(|line| line.starts_with("| waiting for a press"));
    let cell = row
        .and_then(|row| row.split('|').nth(2))
        .unwrap_or_default();
    let written: f64 = cell.trim_matches([' ', '%']).parse().unwrap();
    assert!(
        (100.0 * is - written).abs() < 1.5,
        "{is}, in the book {written} %"
    );
    board.press(true).unwrap();
    board.run_ms(100).unwrap();
    board.press(false).unwrap();
    let (is, said) = awake(&mut board, "awake at rest:");
    eprintln!("at rest: awake {is:.4}, said {said:.4}");
    assert!((is - said).abs() < 0.0005 && is < 0.02, "{is} {said}");
}
