//! No slide is tested that was learned from, and figures by session are not those within one.

use std::collections::BTreeSet;
use std::fs;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::import::wav;
use crate::{Scratch, array, assert_says};

/// Noise whose strength is the texture's, a slide of 1.7 s between stillness.
fn noise(strength: f64, seed: u64) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let samples = 2200 * 24 / 10;
    let of = |n: usize| {
        let slides = (samples / 5..samples * 9 / 10).contains(&n);
        let now = if slides { strength } else { 0.01 };
        now * random.random_range(-1.0..1.0)
    };
    (0..samples).map(of).collect()
}

/// Two days of four textures, each twice as strong as the one before. On the second day all are stronger by more than
/// half of such a step.
fn two_days() -> Scratch {
    let at = Scratch::new();
    for (day, by) in [(1_i32, 0.0), (2, 0.6)] {
        for (texture, name) in (0_i32..).zip(["cork", "denim", "silk", "suede"]) {
            for number in 0..8 {
                let strength = 2_f64.powf(f64::from(texture) + by - 4.0);
                let x = noise(strength, (day * 1000 + texture * 100 + number) as u64);
                at.write(
                    &format!("data/day{day}/{name}/{number}.wav"),
                    wav(2200, 16, &[&x]),
                );
            }
        }
    }
    at
}

#[test]
fn a_shift_between_sessions_shows_by_session_only() {
    let at = two_days();
    // one slide of one day: too few for anything
    at.write("data/day1/felt/0.wav", wav(2200, 16, &[&noise(0.3, 7)]));
    at.printed("import data recordings");
    let evaluate = "evaluate --recordings recordings --runs 400 --protocol";
    let figures = |protocol: &str| {
        let told = at.json(&format!("{evaluate} {protocol}"), 0);
        assert_eq!(told["protocol"], protocol);
        assert_eq!(told["textures"], 4);
        let notes: Vec<&str> = array(&told["notes"])
            .iter()
            .filter_map(|n| n.as_str())
            .collect();
        assert!(
            notes.contains(&"Left out, with too few slides: felt."),
            "{notes:?}"
        );
        let turns = notes.iter().find(|note| note.starts_with("Tested in turn"));
        (
            told["one_slide_accuracy"].as_f64().unwrap(),
            turns.map(|turns| turns.to_string()),
        )
    };
    let (within, turns) = figures("interleaved");
    assert!(within > 0.75 && turns.is_none(), "{within}");
    let (by_session, turns) = figures("leave-one-session-out");
    assert!(by_session < 0.5, "{by_session}");
    assert_eq!(turns.unwrap(), "Tested in turn: 2 parts, day1, day2.");
    // every file is a run of its own here, and the other files of its day are learned from
    let (by_run, turns) = figures("leave-one-run-out");
    assert!(by_run > 0.75, "{by_run}");
    assert_says(&turns.unwrap(), &["65 parts, day1 "]);
    let text = at.printed(&format!("{evaluate} leave-one-session-out"));
    assert_says(
        &text,
        &[
            "leave-one-session-out, 5 training slides",
            "right after one slide",
            "undecided",
        ],
    );
    // the other ways to evaluate divide the slides as well
    let one = at.json(&format!("{evaluate} leave-one-session-out --verify"), 0);
    assert_says(&one["notes"].to_string(), &["felt", "day1, day2"]);
    let one = at.json(
        &format!("{evaluate} leave-one-session-out --novelty leave-one-out"),
        0,
    );
    assert_says(&one["notes"].to_string(), &["felt", "day1, day2"]);
    let why = at.error(
        "evaluate --recordings SIMULATED --protocol leave-one-session-out",
        1,
    );
    assert_says(
        &why,
        &["is of no session", "column session of manifest.csv"],
    );
    // a table of what there is, in a sentence; one slide is none
    let said = at.printed("learn --recordings recordings --train-slides 20 --out table");
    assert_says(
        &said,
        &["4 textures learned", "Left out, with too few slides: felt."],
    );
    assert_says(
        &said,
        &["Fewer than 20 slides at a movement have 4 textures, 16 at least"],
    );
    assert_says(&said, &["With textures and slides left out it flags"]);
    assert_eq!(said.lines().count(), 9, "{said}");
}

/// Learns from the first two of the three slides of each texture and movement in every way that there is. In a copy of
/// the folder, with other file names and rows, every command tests the third only, and says how many it left out.
#[test]
fn no_command_tests_a_slide_that_the_table_was_learned_from() {
    let at = Scratch::new();
    at.recordings("copy", |line| Some(line.replace("_s0", "_z0")));
    for entry in fs::read_dir(at.path("copy")).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        let name = name.replace("_s0", "_z0");
        fs::rename(entry.path(), at.path("copy").join(name)).unwrap();
    }
    let manifest = String::from_utf8(at.read("copy/manifest.csv")).unwrap();
    let (head, rows) = manifest.split_once('\n').unwrap();
    let rows: Vec<&str> = rows.lines().rev().collect();
    at.write(
        "copy/manifest.csv",
        format!("{head}\n{}\n", rows.join("\n")),
    );
    // the same samples, begun 37 later
    at.recordings("shifted", |line| {
        let mut cells: Vec<&str> = line.split(',').collect();
        let hash = cells.iter().position(|cell| *cell == "2200");
        if let Some(rate) = hash {
            cells[rate + 1] = "";
        }
        Some(cells.join(","))
    });
    for entry in fs::read_dir(at.path("shifted")).unwrap() {
        let path = entry.unwrap().path();
        if path.to_string_lossy().ends_with("_pac.npy") {
            let mut file = fs::read(&path).unwrap();
            file[128..].rotate_left(2 * 37);
            fs::write(&path, file).unwrap();
        }
    }
    let slides = |told: &serde_json::Value| -> BTreeSet<u64> {
        let slides = array(&told["slides"]).iter();
        slides
            .map(|slide| slide["number"].as_u64().unwrap())
            .collect()
    };
    for (how, is_fused) in [
        ("", true),
        ("--features force", true),
        ("--features pressure", true),
        ("--features bands", true),
        ("--features properties", true),
        ("--drift 0", true),
        ("--lengths 1,2", true),
        ("--method paper", false),
        ("--method student", false),
    ] {
        at.printed(&format!(
            "learn --recordings SIMULATED --train-slides 2 {how} --out table --force"
        ));
        for folder in ["SIMULATED", "copy", "shifted"] {
            let identify =
                format!("identify --table table --recordings {folder} --material Burlap");
            let text = at.printed(&format!("{identify} --threshold 1"));
            assert_says(
                &text,
                &[
                    "3 slides not learned from",
                    "6 slides are left out: the table",
                ],
            );
            let report = at.json(&format!("report table --recordings {folder}"), 0);
            let recorded = &report["recorded"];
            assert_eq!(recorded["learned_left_out"], 36, "{how}: {recorded}");
            assert_eq!(recorded["learned_all_known"], true, "{how}: {recorded}");
            if !is_fused || how.contains("drift") {
                continue;
            }
            let verify = format!("verify --table table --texture burlap --sample {folder}");
            let ran = at.run(&format!(
                "{verify} --material burlap --threshold 1 --format json"
            ));
            let told: serde_json::Value = serde_json::from_str(&ran.out).expect(&ran.said);
            // the third of each movement
            let thirds = BTreeSet::from([3, 6, 9]);
            assert!(
                !slides(&told).is_empty() && slides(&told).is_subset(&thirds),
                "{told}"
            );
            assert_eq!(told["learned_left_out"], 6, "{how}");
        }
    }
    let report = at.printed("report table --recordings copy");
    assert_says(
        &report,
        &["36 slides are left out: the table was learned from them."],
    );
    // all of them were learned from
    at.printed("learn --recordings SIMULATED --train-slides 3 --out all");
    let none = at.error(
        "identify --table all --recordings copy --material Burlap",
        1,
    );
    assert_says(&none, &["learned from every slide of Burlap"]);
    let none = at.error(
        "verify --table all --texture burlap --sample copy --material burlap",
        1,
    );
    assert_says(&none, &["learned from every slide of Burlap"]);
    assert_says(
        &at.error("report all --recordings copy", 1),
        &["none of the recorded textures"],
    );
    // a reference from recordings was learned from them, and the copy has the same
    let itself = "verify --reference SIMULATED --texture burlap --sample copy --material burlap";
    assert_says(
        &at.error(itself, 1),
        &["learned from every slide of Burlap"],
    );
    at.printed("learn --recordings SIMULATED --train-slides 2 --out table --force");
    let put = "verify --table table --reference SIMULATED --texture corduroy --sample copy";
    let other = at.run(&format!(
        "{put} --material burlap --threshold 1 --format json"
    ));
    let told: serde_json::Value = serde_json::from_str(&other.out).expect(&other.said);
    assert_eq!(told["learned_left_out"], 6);
    assert_eq!(told["learned_all_known"], true);
    // test slides of a second folder
    for test in ["copy", "shifted"] {
        let evaluate = format!(
            "evaluate --recordings SIMULATED --test {test} --train-slides 2 --runs 20 --protocol drift"
        );
        assert_says(
            &at.printed(&evaluate),
            &["Left out of the test, as they may be learned from: 36 slides."],
        );
    }
    let shifted = itself.replace("copy", "shifted");
    assert_says(
        &at.error(&shifted, 1),
        &["learned from every slide of Burlap"],
    );
}
