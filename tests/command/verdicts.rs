//! What users are told: `identify` and `evaluate` agree, and `verify` is right as often as it says.

use tactus_tests::{count, data};

use crate::{Scratch, array};

/// Names of the verdicts.
const VERDICTS: [&str; 5] = ["right", "new", "wrong", "most_like", "undecided"];

/// The verdict that `identify` printed, by its place in [`VERDICTS`].
fn told(shown: &str) -> usize {
    let name = match shown.lines().rev().find(|line| line.contains(" after ")) {
        Some(line) if line.starts_with("It is not one of") => "new",
        Some(line) if line.starts_with("Not sure") => "undecided",
        Some(line) if line.starts_with("It is most like") => "most_like",
        Some(line) if line.starts_with("It is ") && shown.contains("\nRight.") => "right",
        Some(line) if line.starts_with("It is ") && shown.contains("\nWrong:") => "wrong",
        _ => panic!("{shown}"),
    };
    VERDICTS
        .iter()
        .position(|verdict| *verdict == name)
        .unwrap()
}

/// Learns from the first slides of `FOLDER`, identifies every material `times` times, and plays as many explorations as
/// `evaluate` has by default: the same verdicts, at least two kinds of them.
fn compare(at: &Scratch, train_slides: u32, method: &str, more: &str, times: u64) {
    let features = at.printed("features --recordings FOLDER --format csv");
    let rows = features.lines().skip(1);
    let mut materials: Vec<&str> = rows.filter_map(|row| row.split(',').next()).collect();
    materials.dedup();
    let learn =
        format!("learn --recordings FOLDER --train-slides {train_slides} --method {method}");
    at.printed(&format!("{learn} --out table"));
    let (mut counts, mut runs) = ([0.0; 5], 0.0);
    for material in materials {
        for _ in 0..times {
            runs += 1.0;
            // another seed each time: with the same one, all materials show the same places of their sessions
            let identify =
                format!("identify --recordings FOLDER --table table --material {material}");
            let shown = at.printed(&format!(
                "{identify} --method {method} {more} --seed {runs}"
            ));
            counts[told(&shown)] += 1.0;
        }
    }
    let evaluate =
        format!("evaluate --recordings FOLDER --protocol drift --train-slides {train_slides}");
    let figures = at.json(&format!("{evaluate} --method {method} {more}"), 0);
    let shares = VERDICTS.map(|verdict| figures["verdicts"][verdict].as_f64().unwrap());
    println!("identify {counts:?} of {runs}, evaluate {shares:?}");
    assert!(
        (shares.iter().sum::<f64>() - 1.0).abs() < 1e-9,
        "{shares:?}"
    );
    assert!(
        shares.iter().filter(|share| **share > 0.02).count() >= 2,
        "{shares:?}"
    );
    for ((verdict, share), count) in VERDICTS.iter().zip(shares).zip(counts) {
        // four standard errors of the difference; of what never came, four runs
        let error = 4.0 * (share * (1.0 - share) * (1.0 / runs + 1.0 / 8000.0)).sqrt();
        let found = count / runs;
        let is_near = (found - share).abs() <= error.max(4.0 / runs);
        assert!(is_near, "{verdict}: {found}, evaluate has {share}");
    }
}

/// A table that expects so much drift that it would call most new textures by a name says "most like" in its place.
#[test]
fn a_name_that_too_many_new_textures_would_get_is_most_like() {
    let at = Scratch::new();
    let named = |drift: &str| {
        let learn =
            format!("learn --recordings SIMULATED --train-slides 2 --drift {drift} --force");
        let said = at.printed(&format!("{learn} --out table"));
        let table = at.json("table table", 0);
        let share = table["open_set"]["new_named"]["share"].as_f64().unwrap();
        (share, said.contains("so it says \"most like X\""))
    };
    let identify = "identify --recordings SIMULATED --table table --material Corduroy";
    let (share, is_said) = named("2,1");
    assert!(share > 0.1 && is_said, "{share}");
    let found = at.json(identify, 3);
    assert_eq!(found["verdict"]["told"], "most-like");
    assert_eq!(found["verdict"]["texture"], "Corduroy");
    assert!(found["right"].is_null(), "{found}");
    assert!(
        at.printed(identify)
            .contains("\nIt is most like Corduroy: ")
    );
    let found = at.json(&format!("{identify} --closed"), 0);
    assert_eq!(found["verdict"]["told"], "sure");
    let report = at.printed("report table");
    assert!(report.contains("so it says \"most like X\""), "{report}");
    // with figures of its own it is the same in the sums: a group for itself, nothing in it with --closed
    let evaluate = "evaluate --recordings SIMULATED --train-slides 2 --drift 2,1 --runs 60";
    let told = at.json(evaluate, 0)["verdicts"].clone();
    assert!(told["most_like"].as_f64() > Some(0.5), "{told}");
    assert!(told["most_like_right"].as_f64() > Some(0.5), "{told}");
    assert_eq!((&told["right"], &told["wrong"]), (&0.0.into(), &0.0.into()));
    let told = at.json(&format!("{evaluate} --closed"), 0)["verdicts"].clone();
    assert!(told["right"].as_f64() > Some(0.5), "{told}");
    assert_eq!(told["most_like"], 0.0);
    // and one that would seldom be wrong says the name
    let (share, is_said) = named("0,0");
    assert!(share <= 0.1 && !is_said, "{share}");
    assert_eq!(at.json(identify, 0)["verdict"]["told"], "sure");
}

#[test]
#[ignore = "a minute: 8000 learned tables"]
fn identifications_of_real_materials_agree_with_evaluate() {
    let Some(folder) = data("biotac") else { return };
    let at = Scratch::new().with("FOLDER", folder.to_str().unwrap());
    compare(&at, 5, "fused", "", 10);
}

#[test]
fn identifications_in_the_simulated_world_agree_with_evaluate() {
    let at = Scratch::new().with("FOLDER", "slides");
    at.printed("simulate --textures 12,13,14,15,16,47,60,90 --trials 7 --out slides");
    compare(&at, 3, "paper", "--max-slides 1", count(25, 6));
}

/// Worlds with a texture under the simulated finger against itself, and against another that the probe knows or does
/// not.
#[test]
fn live_slides_are_verified_as_often_right_as_it_says() {
    let at = Scratch::new();
    let (mut rejected, mut stated, mut unsure) = (0, 0.0, 0);
    for seed in 1..=count(20, 3) {
        let reference = 1 + seed * 29 % 117;
        let other = 1 + (seed * 29 + 7 * seed + 3) % 117;
        for under in [reference, other] {
            let verify =
                format!("verify --simulated --among 5 --seed {seed} --texture {reference}");
            let ran = at.run(&format!("{verify} --material {under} --format json"));
            let told: serde_json::Value = serde_json::from_str(&ran.out).expect(&ran.said);
            let (answer, slides) = (&told["answer"], array(&told["slides"]).len());
            println!("world {seed}: {under} against {reference}: {answer} after {slides}");
            if under == reference {
                stated += told["false_alarm"].as_f64().unwrap();
                rejected += i32::from(answer == "different");
                unsure += i32::from(answer == "unsure");
            } else {
                assert_ne!(answer, "same", "{told}");
            }
        }
    }
    // three standard deviations of a count
    let most = stated + 3.0 * stated.sqrt();
    assert!(
        f64::from(rejected) <= most && unsure <= 2,
        "{rejected} of {stated}, {unsure} unsure"
    );
}
