//! What users are told: `identify` and `evaluate` agree, and no slide counts twice.

use std::fs;
use std::path::Path;
use std::process::Command;

use tactus_tests::{data, properties_csv};

/// What a command printed that must succeed or, as `identify`, end without a name.
fn printed(arguments: &[&str]) -> String {
    let out = Command::new(env!("CARGO_BIN_EXE_tactus"))
        .args(arguments)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(
        matches!(out.status.code(), Some(0 | 3)),
        "{arguments:?}: {said}"
    );
    String::from_utf8(out.stdout).unwrap()
}

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Names of the verdicts.
const VERDICTS: [&str; 5] = ["right", "changed", "new", "wrong", "undecided"];

/// The verdict that `identify` printed, by its place in [`VERDICTS`].
fn told(shown: &str) -> usize {
    let name = match shown.lines().rev().find(|line| line.contains(" after ")) {
        Some(line) if line.starts_with("It is not one of") => "new",
        Some(line) if line.starts_with("Not sure") => "undecided",
        Some(line) if line.starts_with("It is like ") => "changed",
        Some(line) if line.starts_with("It is ") && shown.contains("\nRight.") => "right",
        Some(line) if line.starts_with("It is ") && shown.contains("\nWrong:") => "wrong",
        _ => panic!("{shown}"),
    };
    VERDICTS
        .iter()
        .position(|verdict| *verdict == name)
        .unwrap()
}

/// Learns from the first slides, identifies every material `times` times, and plays as many explorations as `evaluate` has
/// by default; at least `kinds` of verdicts must come.
fn compare(folder: &Path, train_slides: &str, more: &[&str], times: usize, kinds: usize) {
    let temp = tempfile::tempdir().unwrap();
    let table = temp.path().join("table");
    let manifest = printed(&["features", "--recordings", path(folder), "--format", "csv"]);
    let mut materials: Vec<&str> = manifest
        .lines()
        .skip(1)
        .filter_map(|line| line.split(',').next())
        .collect();
    materials.dedup();
    let method = more[..2].iter().copied();
    let learn = [
        "learn",
        "--recordings",
        path(folder),
        "--train-slides",
        train_slides,
    ];
    let learn: Vec<&str> = learn
        .into_iter()
        .chain(method)
        .chain(["--out", path(&table)])
        .collect();
    printed(&learn);
    let mut counts = [0.0; 5];
    // another seed each time: with the same one, all materials show the same places of their sessions
    for (seed, material) in (1..).zip(materials.iter().flat_map(|m| std::iter::repeat_n(m, times)))
    {
        let seed = i32::to_string(&seed);
        let identify = [
            "identify",
            "--recordings",
            path(folder),
            "--table",
            path(&table),
            "--material",
            material,
            "--seed",
            &seed,
        ];
        let identify: Vec<&str> = identify.iter().chain(more).copied().collect();
        counts[told(&printed(&identify))] += 1.0;
    }
    let runs = (materials.len() * times) as f64;
    assert!(runs >= 200.0, "{runs}");

    let evaluate = [
        "evaluate",
        "--recordings",
        path(folder),
        "--protocol",
        "drift",
        "--train-slides",
        train_slides,
        "--format",
        "json",
    ];
    let evaluate: Vec<&str> = evaluate.iter().chain(more).copied().collect();
    let figures: serde_json::Value = serde_json::from_str(&printed(&evaluate)).unwrap();
    let shares = VERDICTS.map(|verdict| figures["verdicts"][verdict].as_f64().unwrap());
    println!("identify {:?} of {runs}, evaluate {shares:?}", counts);
    assert!(
        (shares.iter().sum::<f64>() - 1.0).abs() < 1e-9,
        "{shares:?}"
    );
    assert!(
        shares.iter().filter(|share| **share > 0.02).count() >= kinds,
        "{shares:?}"
    );
    for ((verdict, share), count) in VERDICTS.iter().zip(shares).zip(counts) {
        // four standard errors of the difference; of what never came, four runs
        let error = 4.0 * (share * (1.0 - share) * (1.0 / runs + 1.0 / 8000.0)).sqrt();
        let error = error.max(4.0 / runs);
        let found = count / runs;
        assert!(
            (found - share).abs() <= error,
            "{verdict}: {found}, evaluate has {share}"
        );
    }
}

#[test]
fn two_hundred_identifications_agree_with_evaluate() {
    let Some(folder) = data("biotac") else { return };
    compare(&folder, "5", &["--method", "fused"], 10, 2);
}

#[test]
fn two_hundred_identifications_in_the_simulated_world_agree_with_evaluate() {
    let temp = tempfile::tempdir().unwrap();
    let folder = temp.path().join("slides");
    let textures = "12,13,14,15,16,47,60,90";
    let simulate = [
        "simulate",
        "--textures",
        textures,
        "--trials",
        "7",
        "--out",
        path(&folder),
    ];
    printed(&simulate);
    compare(
        &folder,
        "3",
        &["--method", "paper", "--max-slides", "1"],
        25,
        2,
    );
}

#[test]
fn identify_ends_when_the_recordings_run_out() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/simulated");
    // nothing is ever more probable than 1: three slides of each of three movements, two of them learned from
    let shown = printed(&[
        "identify",
        "--recordings",
        folder,
        "--material",
        "Corduroy",
        "--train-slides",
        "2",
        "--method",
        "student-all",
        "--threshold",
        "1",
    ]);
    assert!(shown.contains("The recordings have run out"), "{shown}");
    assert!(shown.contains("Not sure after "), "{shown}");
    let slides = shown.matches("  measured ").count();
    assert!((2..=3).contains(&slides), "{shown}");
    let mut measured: Vec<&str> = shown
        .lines()
        .filter(|line| line.contains("measured"))
        .collect();
    measured.sort_unstable();
    measured.dedup();
    assert_eq!(measured.len(), slides, "no slide comes twice: {shown}");
}

/// A table of properties as it comes from a rig, where no number of trials is like another.
#[test]
fn numbers_of_trials_may_differ() {
    let temp = tempfile::tempdir().unwrap();
    let file = temp.path().join("world.csv");
    let csv = properties_csv(4, 2, |texture, movement, set| match set {
        "train" => 2 + (texture + movement) % 3,
        _ => texture,
    });
    fs::write(&file, &csv).unwrap();
    let evaluate = [
        "evaluate",
        "--properties",
        path(&file),
        "--runs",
        "40",
        "--format",
        "json",
    ];
    let figures: serde_json::Value = serde_json::from_str(&printed(&evaluate)).unwrap();
    assert_eq!(figures["train_slides"], 2, "the fewest");
    assert_eq!(figures["verdicts"]["right"], 1.0);
    let said = Command::new(env!("CARGO_BIN_EXE_tactus"))
        .args(evaluate)
        .args(["--train-slides", "4"])
        .output()
        .unwrap();
    let said = String::from_utf8(said.stderr).unwrap();
    assert!(
        said.contains("2 slides to train from") || said.contains("3 slides to train from"),
        "{said}"
    );
}

/// Twenty worlds: a texture under the simulated finger against itself, and against another that the probe knows or does not.
#[test]
fn live_slides_are_verified_as_often_right_as_it_says() {
    let textures: Vec<String> = (1..=117).map(|n: u8| n.to_string()).collect();
    let (mut rejected, mut stated, mut unsure) = (0, 0.0, 0);
    for seed in 1..=20 {
        let reference = &textures[seed * 29 % 117];
        let (world, other) = (
            seed.to_string(),
            &textures[(seed * 29 + 7 * seed + 3) % 117],
        );
        assert_ne!(reference, other);
        for under in [reference, other] {
            let command = ["verify", "--simulated", "--among", "5", "--format", "json"];
            let more = [
                "--texture",
                reference,
                "--material",
                under,
                "--seed",
                &world,
            ];
            let told: serde_json::Value =
                serde_json::from_str(&printed(&[&command[..], &more].concat())).unwrap();
            let answer = told["answer"].as_str().unwrap();
            println!(
                "world {seed}: {} against {}: {answer} after {}",
                told["sample"],
                told["reference"],
                told["slides"].as_array().unwrap().len()
            );
            if under == reference {
                stated += told["false_alarm"].as_f64().unwrap();
                rejected += i32::from(answer == "different");
                unsure += i32::from(answer == "unsure");
            } else {
                assert_ne!(answer, "same", "{told}");
            }
        }
    }
    println!("{rejected} of 20 called different, {stated:.1} expected; {unsure} unsure");
    // three standard deviations of a count
    assert!(
        f64::from(rejected) <= stated + 3.0 * stated.sqrt(),
        "{rejected}"
    );
    assert!(unsure <= 2, "{unsure}");
}
