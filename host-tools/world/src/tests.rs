//! The simulated world against what the paper and the makers observed.

mod bench;
mod finger;
mod fingers;
mod paper;
mod protocol;
mod surface;

use std::fs;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::TICK_S;
use super::finger::{Contact, Finger};
use super::sensor::{POWER_UP_NS, SensorPeer};

/// All source files of the simulated world.
fn sources() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let (mut files, mut folders) = (Vec::new(), vec![root]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                files.push(path);
            }
        }
    }
    files
}

/// Modules of the core that decide, where a source names one.
fn forbidden(source: &str) -> Option<String> {
    // not written out, or this file would name it
    let core = concat!("tactus", "_core::");
    let hidden = concat!("tactus", "_core as");
    let code: String = source
        .lines()
        .map(|line| line.split("//").next().unwrap_or_default())
        .collect::<Vec<_>>()
        .join("\n");
    // by another name it would not be seen below
    if code.contains(hidden) {
        return Some(hidden.to_owned());
    }
    let word = |path: &str, word: &str| {
        path.split(|c: char| !c.is_alphanumeric() && c != '_')
            .any(|w| w == word)
    };
    code.match_indices(core)
        .map(|(at, _)| code[at..].split(';').next().unwrap_or_default())
        .find(|path| {
            path.contains("::*")
                || ["features", "table", "explorer"]
                    .iter()
                    .any(|w| word(path, w))
        })
        .map(str::to_owned)
}

#[test]
fn the_world_knows_nothing_of_features_tables_and_decisions() {
    let core = concat!("tactus", "_core");
    assert!(forbidden(&format!("use {core}::biotac;")).is_none());
    for bad in [
        "use X::features::Features;",
        "use X::{biotac, table};",
        "let e = X::explorer::f();",
        "use X::*;",
    ] {
        assert!(forbidden(&bad.replace('X', core)).is_some(), "{bad}");
    }
    let sources = sources();
    assert!(sources.len() > 20, "{}", sources.len());
    for path in sources {
        let found = forbidden(&fs::read_to_string(&path).unwrap());
        assert!(
            found.is_none(),
            "{}: {}",
            path.display(),
            found.unwrap_or_default()
        );
    }
}

/// Words of a second of touching a texture: pressed, then sliding.
fn words(seed: u64) -> Vec<[u8; 2]> {
    let surface = bench::sample(100, seed);
    let (mut finger, mut sensor) = (Finger::new(seed), SensorPeer::new(seed));
    let mut now_ns = POWER_UP_NS;
    let mut words = Vec::new();
    for tick in 0..13_200 {
        let seconds = f64::from(tick) * TICK_S;
        finger.tick(&Contact {
            indentation_mm: 0.5,
            surface: Some(&surface),
            x_mm: 10.0 + 40.0 * (seconds - 0.3).max(0.0),
            speed_mm_s: if seconds > 0.3 { 40.0 } else { 0.0 },
            lever_vibration: 0.0,
        });
        if tick % 3 == 0 {
            let command = [0x80, 0x83][words.len() % 2];
            let mut word = [0; 2];
            sensor.transfer(now_ns, 3_000, &[command, 0], &mut word, &mut finger, 0.5);
            sensor.transfer(now_ns + 60_000, 3_000, &[0, 1], &mut word, &mut finger, 0.5);
            words.push(word);
        }
        now_ns += 75_758;
    }
    words
}

#[test]
fn the_same_seed_gives_the_same_words_on_any_thread() {
    let alone: Vec<_> = (1..=4).map(words).collect();
    let together: Vec<_> = (1..=4_u64).into_par_iter().map(words).collect();
    assert_eq!(alone, together);
    assert_ne!(alone[0], alone[1]);
    assert!(
        alone
            .iter()
            .flatten()
            .flatten()
            .all(|byte| byte.count_ones() % 2 == 1)
    );
}
