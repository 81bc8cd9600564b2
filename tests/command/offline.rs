//! Commands without a probe: recordings, tables, explorations, reports.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::Stdio;

use serde_json::{Value, json};
use tactus_tests::{data, properties_csv};

use crate::{Scratch, array, assert_says, ran};

fn number(of: &Value) -> f64 {
    of.as_f64().unwrap_or_else(|| panic!("{of}"))
}

#[test]
fn help_says_what_it_is_and_what_to_try_first() {
    let at = Scratch::new();
    let help = at.printed("--help");
    assert_says(
        &help,
        &["touching it", "Try first", "tactus identify --recordings"],
    );
    assert_says(&help, &["https://github.com/dexrob/BioTac_slide_20_50"]);
    assert_says(&help, &["Exit codes", "4     not sure yet", "TACTUS_PORT"]);
    for command in "features learn table identify evaluate simulate import".split(' ') {
        assert!(help.contains(command), "{command}");
        assert_says(&at.printed(&format!("{command} --help")), &["Usage"]);
    }
    let version = concat!("tactus ", env!("CARGO_PKG_VERSION"), "\n");
    assert_eq!(at.printed("--version"), version);
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = at.printed(&format!("completions {shell}"));
        assert_says(&script, &["device", "monitor"]);
    }
}

#[test]
fn a_simulated_probe_recognises_a_texture() {
    let at = Scratch::new();
    let shown = at.printed("");
    assert_says(
        &shown,
        &["touching it", "An unknown texture, one of 60", "Slide 3:"],
    );
    assert_says(&shown, &["because", "█", "after 1 slide.", "tactus --help"]);
    assert_eq!(shown.matches("Right.").count(), 2);
    let burlap = "identify --simulated --texture burlap --among 5 --seed 3";
    let shown = at.printed(burlap);
    assert_says(&shown, &["one of 5", "Under the finger: Burlap"]);
    assert_eq!(shown, at.printed(burlap), "the same seed");
    let found = at.json("identify --simulated --among 3 --train-slides 2", 0);
    assert!(number(&found["rig_s"]) > 1.0 && found["skin_j"].is_number());
}

#[test]
fn an_exploration_is_text_and_one_object() {
    let at = Scratch::new();
    let identify = "identify --recordings SIMULATED --train-slides 2 --material";
    let shown = at.printed(&format!("{identify} CORDUROY"));
    assert_says(
        &shown,
        &["Slide 1:", "because", "should leave", "measured", "█"],
    );
    assert_says(&shown, &["It is Corduroy", "Right."]);
    assert_eq!(shown, at.printed(&format!("{identify} corduroy --seed 1")));
    assert_ne!(shown, at.printed(&format!("{identify} Corduroy --seed 2")));
    let found = at.json(&format!("{identify} corduroy"), 0);
    assert_eq!(found["presented"], "Corduroy");
    assert_eq!(
        (&found["right"], &found["known"]),
        (&true.into(), &true.into())
    );
    assert_eq!(found["verdict"]["told"], "sure");
    assert_eq!(found["verdict"]["texture"], "Corduroy");
    let slides = array(&found["slides"]);
    assert_eq!(json!(slides.len()), found["verdict"]["slides"]);
    for slide in slides {
        let fields = "force_n speed_mm_s traction_n roughness_ln fineness_ln expected_uncertainty";
        for field in fields.split(' ') {
            assert!(slide[field].is_number(), "{field}: {slide}");
        }
        let posterior = array(&slide["posterior"]).iter();
        let sum: f64 = posterior.map(|p| number(&p["probability"])).sum();
        assert!((sum - 1.0).abs() < 1e-3, "{slide}");
    }
    // not sure: 3, and the object is whole all the same
    let found = at.json(&format!("{identify} corduroy --threshold 1"), 4);
    assert_eq!(found["verdict"]["told"], "undecided");
    assert!(found["right"].is_null());
    // no slide comes twice, and nothing is ever more probable than 1
    let shown = at.printed(&format!(
        "{identify} Corduroy --method student-all --threshold 1"
    ));
    assert_says(&shown, &["The recordings have run out", "Not sure after "]);
    let measured = shown.lines().filter(|line| line.contains("  measured "));
    let slides = measured.clone().count();
    let different = measured.collect::<std::collections::BTreeSet<_>>().len();
    assert!((2..=3).contains(&slides) && different == slides, "{shown}");
}

#[test]
fn simulated_recordings_are_learned_and_evaluated() {
    let at = Scratch::new();
    let said = at.printed("simulate --out new --textures 'burlap,47,Oak wood' --trials 4 --seed 2");
    assert_says(&said, &["3 textures, 36 slides"]);
    let found = at.json("evaluate --recordings new --train-slides 3 --runs 300", 0);
    assert!(number(&found["accuracy"]) > 0.9, "{found}");
    let features = at.printed("features --recordings new --format csv");
    assert_eq!(features.lines().count(), 37);
    let said = at
        .run("learn --recordings new --train-slides 3 --out table")
        .out;
    assert_says(
        &at.printed("table table"),
        &["movement 3: 0.20 N, 63.1 mm/s"],
    );
    let explored = at.printed("identify --recordings new --material burlap --table table");
    assert_says(&explored, &["Right.", "3 slides not learned from"]);
    // through pipes: what is said of it is beside it
    let out = at
        .command("learn --recordings new --train-slides 3 --out -")
        .output()
        .unwrap();
    assert!(out.stdout == at.read("table"));
    let beside = String::from_utf8(out.stderr)
        .unwrap()
        .replacen('-', "table", 1);
    assert_eq!(beside, said);
    let mut piped = at.command("table -");
    let piped = ran(piped.stdin(fs::File::open(at.path("table")).unwrap()));
    assert_eq!(piped.out, at.printed("table table"));
    // nothing is overwritten
    assert_says(&at.error("simulate --out new --textures 1", 1), &["new"]);
    at.printed("import new imported");
    let figures = |folder| {
        at.json(
            &format!("evaluate --recordings {folder} --train-slides 3 --runs 100"),
            0,
        )
    };
    assert_eq!(figures("new"), figures("imported"));
}

#[test]
fn tables_and_features_are_objects() {
    let at = Scratch::new();
    // five slides are asked for by default, and there are three
    let learned = at.printed("learn --recordings SIMULATED --out table");
    assert_says(
        &learned,
        &["Fewer than 5 slides at a movement have 6 textures, 3 at least"],
    );
    let shown = at.json("table table", 0);
    assert_eq!(array(&shown["textures"]).len(), 6);
    assert_eq!(array(&shown["movements"]).len(), 3);
    let texture = &shown["textures"][0];
    assert_eq!(texture["movements"][0]["trials"], 3);
    assert!(number(&texture["movements"][0]["nearest_sd"]) > 0.0);

    let lines = at.printed("features --recordings SIMULATED --format json");
    let lines: Vec<Value> = lines
        .lines()
        .map(|l| serde_json::from_str(l).unwrap())
        .collect();
    assert_eq!((lines.len(), &lines[1]["trial"]), (54, &2.into()));
    assert_eq!(lines[0]["force_n"], 1.262);
    let csv = at.printed("features --recordings SIMULATED --format csv");
    let second = csv.lines().nth(2).unwrap();
    assert!(
        second.ends_with(",Computer paper,1.262,10.000,2"),
        "{second}"
    );
}

#[test]
fn features_prints_the_golden_columns() {
    let Some(folder) = data("biotac") else { return };
    let at = Scratch::new().with("BIOTAC", folder.to_str().unwrap());
    let ours = at.printed("features --recordings BIOTAC --format csv");
    let golden = fs::read_to_string(folder.join("features.csv")).unwrap();
    let bands: String = (0..26).map(|n| format!(",ln_fused_band{n}")).collect();
    let properties = "material,slide,traction_n,roughness_ln,fineness_unfiltered_ln";
    let header =
        format!("{properties}{bands},pdc_mean,pdc_sd,session,run,name,force_n,speed_mm_s,trial");
    assert_eq!(ours.lines().next(), Some(&header[..]));
    let keys = |text: &str| -> Vec<String> {
        let rows = text
            .lines()
            .skip(1)
            .map(|row| row.splitn(3, ',').take(2).collect::<Vec<_>>());
        rows.map(|key| key.join(",")).collect()
    };
    assert_eq!(
        keys(&ours),
        keys(&golden),
        "the same slides in the same order"
    );
    // a reader that leaves early is no failure
    for line in ["features --recordings BIOTAC", "completions bash"] {
        let mut command = at.command(line);
        let mut child = command
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        drop(child.stdout.take());
        let out = child.wait_with_output().unwrap();
        assert!(out.status.success() && out.stderr.is_empty(), "{out:?}");
    }
}

#[test]
fn an_evaluation_is_one_object_and_says_how_reliable_it_is() {
    let at = Scratch::new();
    let evaluate = "evaluate --recordings SIMULATED --train-slides 2 --threshold 0.97 --runs 60";
    let found = at.json(evaluate, 0);
    assert_eq!(
        (&found["method"], &found["protocol"]),
        (&"fused".into(), &"interleaved".into())
    );
    assert_eq!(
        (&found["train_slides"], &found["runs"]),
        (&2.into(), &60.into())
    );
    assert_eq!(
        found,
        at.json(evaluate, 0),
        "the same seed gives the same figures"
    );
    assert_ne!(found, at.json(&format!("{evaluate} --seed 2"), 0));
    assert_says(&at.printed(evaluate), &["threshold 97 %,"]);
    let confused = !array(&found["confused"]).is_empty();
    assert_eq!(confused, number(&found["accuracy"]) < 1.0);

    let reliability = array(&found["reliability"]);
    assert_eq!(number(&reliability[0]["from"]), 0.0);
    assert_eq!(number(&reliability[6]["to"]), 1.0);
    let mut slides = 0.0;
    for pair in reliability.windows(2) {
        assert_eq!(pair[0]["to"], pair[1]["from"]);
    }
    for bin in reliability {
        let [from, to, count, right] = ["from", "to", "count", "right"].map(|f| number(&bin[f]));
        assert!(right <= count, "{bin}");
        match bin["said"].as_f64() {
            Some(said) => assert!((from..=to).contains(&said), "{bin}"),
            None => assert_eq!(count, 0.0, "{bin}"),
        }
        slides += count;
    }
    // one statement after each slide until the answer
    let told = number(&found["mean_slides_told"]);
    assert!((slides / 60.0 - told).abs() < 1e-5, "{slides} {told}");
}

#[test]
fn a_second_folder_brings_the_test_slides() {
    let at = Scratch::new();
    // the third slide of each movement is of the other session
    let third = |line: &str| {
        line.split(',')
            .nth(2)
            .unwrap()
            .parse()
            .is_ok_and(|n: u32| n.is_multiple_of(3))
    };
    let is_head = |line: &str| line.starts_with("texture");
    at.recordings("train", |line| (!third(line)).then(|| line.to_owned()));
    at.recordings("test", |line| {
        (third(line) || is_head(line)).then(|| line.to_owned())
    });
    let evaluate = "evaluate --recordings train --test test --train-slides 2 --runs 100";
    let found = at.json(evaluate, 0);
    assert!(number(&found["accuracy"]) > 0.7, "{found}");
    // a table of the one folder has seen nothing of the other
    at.printed("learn --recordings train --train-slides 2 --out table");
    let explored = at.printed("identify --recordings test --material Burlap --table table");
    assert_says(&explored, &["3 slides not learned from"]);
}

#[test]
fn properties_are_evaluated_and_checked() {
    let at = Scratch::new();
    let csv = properties_csv(4, 2, |_, _, _| 3);
    at.write("world.csv", &csv);
    let evaluate = "evaluate --properties world.csv --runs 40";
    let found = at.json(evaluate, 0);
    assert_eq!(
        (&found["accuracy"], &found["train_slides"]),
        (&1.0.into(), &3.into())
    );
    assert_eq!(found["median_slides"], 1.0);
    let found = at.json(&format!("{evaluate} --train-slides 2"), 0);
    assert_eq!(found["train_slides"], 2);
    let few = at.error(&format!("{evaluate} --train-slides 4"), 1);
    assert_says(&few, &["3 slides to train from"]);
    at.write(
        "world.csv",
        csv.replacen("1.01,1.01,1.01", "1.01,NaN,1.01", 1),
    );
    assert_says(&at.error(evaluate, 1), &["world.csv", "2", "roughness"]);
    at.write("world.csv", csv.replace("validate", "train2"));
    assert_says(&at.error(evaluate, 1), &["train2"]);
    // as it comes from a rig, where no number of trials is like another
    let csv = properties_csv(4, 2, |texture, movement, set| match set {
        "train" => 2 + (texture + movement) % 3,
        _ => texture,
    });
    at.write("world.csv", csv);
    let found = at.json(evaluate, 0);
    assert_eq!(
        (&found["train_slides"], &found["verdicts"]["right"]),
        (&2.into(), &1.0.into())
    );
}

#[test]
fn a_gauge_study_compares_operators_of_several_folders() {
    let at = Scratch::new();
    let alone = at.json("report --recordings SIMULATED", 0);
    assert_eq!((&alone["parts"], &alone["slides"]), (&6.into(), &54.into()));
    let movements = array(&alone["movements"]);
    assert_eq!(movements.len(), 3);
    for gauge in movements.iter().flat_map(|m| array(&m["properties"])) {
        let sd = |name: &str| gauge["sd"][name].as_f64();
        assert_eq!((sd("operator"), sd("operator_by_part")), (None, None));
        let all = sd("gauge").unwrap().hypot(sd("part").unwrap());
        assert!((all / sd("total").unwrap() - 1.0).abs() < 1e-5, "{gauge}");
    }
    // the best reading is the first row, and in the verdict
    let text = at.printed("report --recordings SIMULATED");
    let least = movements.iter().flat_map(|m| array(&m["properties"]));
    let least = least.map(|gauge| number(&gauge["gauge_share"]));
    let least = least.fold(1.0, f64::min);
    let said = format!("{:.1} % of all variation is its own", 100.0 * least);
    assert!(text.starts_with("The gauge is good by "), "{text}");
    assert!(text.lines().next().unwrap().contains(&said), "{text}");
    let row = text.lines().nth(4).unwrap();
    assert!(row.contains(&format!("{:.1} %", 100.0 * least)), "{text}");
    // the same slides by two operators: nobody reads more than the other
    for name in ["Anna", "Ben"] {
        at.recordings(name, |line| match line.strip_suffix(",,,,biotac,,,1,,,") {
            Some(line) => Some(format!("{line},{name},,,biotac,,,1,,,")),
            None => Some(line.to_owned()),
        });
    }
    let both = at.json("report --recordings Anna --recordings Ben", 0);
    assert_eq!(both["operators"], json!(["Anna", "Ben"]));
    for (one, two) in movements.iter().zip(array(&both["movements"])) {
        let of = |m: &Value| m["properties"][1]["sd"].clone();
        assert_eq!(of(two)["operator"], 0.0);
        let [one, two] = [of(one), of(two)].map(|sd| number(&sd["part"]));
        assert!((one - two).abs() < 0.1 * one, "{one} and {two}");
    }
}

#[test]
fn a_table_has_a_report_as_text_as_an_object_and_as_a_page() {
    let at = Scratch::new();
    at.printed("learn --recordings SIMULATED --train-slides 2 --out table");
    let report = "report table --recordings SIMULATED --out page.html";
    let object = at.json(report, 0);
    let textures = array(&object["textures"]);
    assert_eq!(textures.len(), 6);
    let verdicts = &object["recorded"]["known"];
    let shares = ["right", "new", "wrong", "most_like", "undecided"];
    let sum: f64 = shares.iter().map(|name| number(&verdicts[name])).sum();
    assert!((sum - 1.0).abs() < 1e-5, "{verdicts}");
    // of three slides two were learned from: every exploration has three slides at most, one a movement
    for texture in textures {
        let slides = number(&texture["recorded"]["mean_slides"]);
        assert!((1.0..=3.0).contains(&slides), "{texture}");
        assert!(number(&texture["nearest"]["taken_for"]) <= 1.0);
    }
    let text = at.printed(report);
    assert_says(
        &text,
        &[
            "What users would be told, by 150 explorations",
            "What would help:",
        ],
    );
    let verdict = object["verdict"].as_str().unwrap();
    assert!(text.starts_with(&format!("{verdict}\n\n")), "{text}");
    let right = number(&verdicts["right"]) * 100.0;
    let said = format!("the right name in {} %", (10.0 * right).round() / 10.0);
    assert_says(
        verdict,
        &["All 6 textures are told apart by 1 slide", &said],
    );
    // well-formed, complete, and the map is in it
    let html = String::from_utf8(at.read("page.html")).unwrap();
    let html = html.strip_prefix("<!DOCTYPE html>").unwrap_or(&html);
    let html = roxmltree::Document::parse(html.trim()).unwrap();
    let has = |id: &str| html.descendants().any(|n| n.attribute("id") == Some(id));
    assert!(
        ["advice", "recorded", "textures", "movements"]
            .into_iter()
            .all(has)
    );
    assert!(html.descendants().any(|n| n.tag_name().name() == "svg"));
    // without recordings there is nothing that users would be told
    assert!(at.json("report table", 0)["recorded"].is_null());
}

#[test]
fn slides_are_verified_against_a_texture_of_a_table_and_of_recordings() {
    let at = Scratch::new();
    at.printed("learn --recordings SIMULATED --train-slides 2 --out table");
    let verify = "verify --table table --texture burlap --sample SIMULATED --material";
    let same = at.json(&format!("{verify} burlap"), 0);
    assert_eq!(
        (&same["answer"], &same["few"]),
        (&"same".into(), &true.into())
    );
    assert!(number(&same["false_accept"]) < 0.2);
    let other = at.json(&format!("{verify} corduroy"), 3);
    assert_eq!(other["answer"], "different");
    let last = array(&other["slides"]).last().unwrap();
    assert!(number(&last["score"]) > number(&last["limit"]), "{last}");
    // the other textures of its own recordings give the scale
    let itself = "verify --reference SIMULATED --texture burlap --sample SIMULATED";
    assert_says(&at.error(itself, 1), &["--sample is the reference itself"]);
    let text = at.printed(&format!("{itself} --material 'Denim twill'"));
    assert!(text.starts_with("Different from Burlap"), "{text}");
    // the last line explains the score that is printed, by its own numbers
    let text = at.printed(&format!("{verify} corduroy"));
    let (score, limit) = (number(&last["score"]), number(&last["limit"]));
    let said = format!(
        "Score {score:.1}: another texture explains the slides {:.0} times as well as Burlap does. Above {limit:.1}",
        score.exp()
    );
    assert_says(
        &text,
        &[&said, "(2 % of Burlap's own would be), below -4.6 the same"],
    );
    assert_eq!(
        other["same_below"].as_f64().map(|x| (10.0 * x).round()),
        Some(-46.0)
    );
    // the picture has all slides of the movement, and changes nothing in the answer
    let denim = format!("{itself} --material 'Denim twill'");
    let drawn = at.json(&format!("{denim} --plot pictures"), 3);
    assert_eq!(drawn, at.json(&denim, 3));
    let map = String::from_utf8(at.read("pictures/map.svg")).unwrap();
    let slides = (1..=9).filter(|n| map.contains(&format!("Denim twill, slide {n}<")));
    assert_eq!(slides.count(), 3, "{map}");
    // too strict a threshold leaves it open
    let open = at.json(&format!("{verify} burlap --threshold 1 --max-slides 1"), 4);
    assert_eq!(open["answer"], "unsure");
}

/// Two lots in one folder: one is held against the other, and every command can look at one of them.
#[test]
fn slides_are_selected_by_lot_and_session() {
    let at = Scratch::new();
    at.recordings("lots", |line| {
        match line.strip_suffix(",,,,biotac,,,1,,,") {
            Some(line) => {
                let slide: u32 = line.split(',').nth(2)?.parse().ok()?;
                let (lot, day) = if slide.is_multiple_of(3) {
                    ("8", "tuesday")
                } else {
                    ("7", "monday")
                };
                Some(format!("{line}{lot},,,,biotac,,,1,{day},,"))
            }
            None => Some(line.to_owned()),
        }
    });
    for (only, rows) in [
        ("", 54),
        ("--only lot=8", 18),
        ("--only lot=7 --only session=monday", 36),
    ] {
        let csv = at.printed(&format!("features --recordings lots {only} --format csv"));
        assert_eq!(csv.lines().count(), rows + 1, "{only}");
    }
    let none = at.error(
        "features --recordings lots --only lot=8 --only session=monday",
        1,
    );
    assert_says(
        &none,
        &["lot=8 (7, 8) and session=monday (monday, tuesday)"],
    );
    let verify = "verify --reference lots --texture burlap --sample lots --only lot=8";
    let same = at.json(&format!("{verify} --material burlap"), 0);
    assert_eq!(
        (&same["answer"], &same["reference_slides"]),
        (&"same".into(), &2.into())
    );
    assert_eq!(
        at.json(&format!("{verify} --material corduroy"), 3)["answer"],
        "different"
    );
    at.printed("learn --recordings lots --only lot=7 --train-slides 2 --out table");
    let report = at.json("report table --recordings lots --only lot=8", 0);
    assert_eq!(report["recorded"]["learned_left_out"], 0);
}

#[test]
fn a_table_says_whether_the_samples_of_its_slides_were_moved() {
    let at = Scratch::new();
    let learned = |labels: &dyn Fn(&str, u32) -> &'static str| {
        at.recordings("slides", |line| {
            // nobody said so far, nor of which finger and at what speed
            let line = line.rsplitn(9, ',').last()?;
            let fields: Vec<&str> = line.split(',').collect();
            let slide = fields[2].parse();
            let moved = slide.map_or("moved", |slide| labels(fields[1], slide));
            Some(format!("{line},{moved}"))
        });
        at.printed("learn --recordings slides --train-slides 2 --out table --force");
        let shown = at.json("table table", 0);
        let of = |t: &Value| {
            (
                t["name"].as_str().unwrap().to_owned(),
                t["sample_moved"].as_bool(),
            )
        };
        let moved: BTreeMap<_, _> = array(&shown["textures"]).iter().map(of).collect();
        (moved, at.read("table"))
    };
    let (none, plain) = learned(&|_, _| "");
    assert!(none.values().all(Option::is_none));
    // the third slide of each movement, 3, 6 and 9, is not learned from
    let (some, noted) = learned(&|name, slide| match name {
        "Burlap" => "yes",
        "Denim twill" => "no",
        "Corduroy" if slide % 3 == 0 => "no",
        "Corduroy" => "yes",
        "Terry cloth" if slide == 1 => "",
        "Terry cloth" => "yes",
        _ => "",
    });
    let said: Vec<_> = some
        .iter()
        .filter_map(|(name, moved)| Some((&name[..], (*moved)?)))
        .collect();
    assert_eq!(
        said,
        [("Burlap", true), ("Corduroy", true), ("Denim twill", false)]
    );
    // and nothing else: the same features, limits and explorations
    assert_ne!(plain, noted);
    let identify = |bytes: &[u8]| {
        at.write("table", bytes);
        at.json(
            "identify --recordings SIMULATED --material Burlap --table table",
            0,
        )
    };
    assert_eq!(identify(&plain), identify(&noted));
}

/// Name and bytes of each file of a folder, not of the folders in it.
fn contents(folder: &Path) -> BTreeMap<OsString, Vec<u8>> {
    let files = fs::read_dir(folder).unwrap().map(Result::unwrap);
    let files = files.filter(|entry| entry.file_type().unwrap().is_file());
    let read = files.map(|entry| (entry.file_name(), fs::read(entry.path()).unwrap()));
    read.collect()
}

#[test]
fn the_command_brings_along_what_the_repository_has() {
    let at = Scratch::new();
    let told = at.printed("unpack data");
    assert_says(&told, &["6 textures, 54 slides"]);
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    // not assert_eq, which would print all bytes
    assert!(contents(&at.path("data")) == contents(&here.join("../../shared/tables")));
    assert!(contents(&at.path("data/recordings")) == contents(Path::new(crate::SIMULATED)));
    // once more changes nothing, and a table of somebody's own is left alone
    assert_eq!(at.printed("unpack data"), told);
    at.write("data/factory.tact", "mine");
    assert_says(&at.error("unpack data", 1), &["give another folder"]);
    assert_eq!(at.read("data/factory.tact"), b"mine");
}
