//! What commands print for programs, how they end, and what they make of names, folders and ports.

use std::path::Path;
use std::process::{Command, Output, Stdio};

const SIMULATED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/simulated");

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tactus"));
    command
        .args(arguments)
        .env_remove("TACTUS_RECORDINGS")
        .env_remove("TACTUS_PORT")
        .env("TACTUS_CONFIG", "");
    command
}

fn tactus(arguments: &[&str]) -> Output {
    command(arguments).output().unwrap()
}

/// The object that a command printed which ends with this code.
fn json(arguments: &[&str], code: i32) -> serde_json::Value {
    let out = tactus(arguments);
    let said = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(code), "{arguments:?}: {said}");
    serde_json::from_slice(&out.stdout).unwrap()
}

fn said(arguments: &[&str], code: i32) -> String {
    let out = tactus(arguments);
    let said = String::from_utf8(out.stderr).unwrap();
    assert_eq!(out.status.code(), Some(code), "{arguments:?}: {said}");
    said
}

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn an_exploration_is_one_object() {
    let identify = [
        "identify",
        "--recordings",
        SIMULATED,
        "--material",
        "corduroy",
        "--train-slides",
        "2",
        "--format",
        "json",
    ];
    let found = json(&identify, 0);
    assert_eq!(found["presented"], "Corduroy");
    assert_eq!(
        (&found["right"], &found["known"]),
        (&true.into(), &true.into())
    );
    assert_eq!(found["verdict"]["told"], "sure");
    assert_eq!(found["verdict"]["texture"], "Corduroy");
    let slides = found["slides"].as_array().unwrap();
    assert_eq!(
        slides.len() as u64,
        found["verdict"]["slides"].as_u64().unwrap()
    );
    for slide in slides {
        for field in [
            "force_n",
            "speed_mm_s",
            "traction_n",
            "roughness_ln",
            "fineness_ln",
            "expected_uncertainty",
        ] {
            assert!(slide[field].is_number(), "{field}: {slide}");
        }
        let posterior = slide["posterior"].as_array().unwrap();
        let sum: f64 = posterior
            .iter()
            .map(|p| p["probability"].as_f64().unwrap())
            .sum();
        assert!((sum - 1.0).abs() < 1e-3, "{slide}");
    }
    // not sure: 3, and the object is whole all the same
    let strict: Vec<&str> = identify.into_iter().chain(["--threshold", "1"]).collect();
    let found = json(&strict, 3);
    assert_eq!(found["verdict"]["told"], "undecided");
    assert!(found["right"].is_null());
    let found = json(
        &[
            "identify",
            "--simulated",
            "--among",
            "3",
            "--train-slides",
            "2",
            "--format",
            "json",
        ],
        0,
    );
    assert!(found["rig_s"].as_f64().unwrap() > 1.0 && found["skin_j"].is_number());
}

#[test]
fn tables_and_features_are_objects() {
    let temp = tempfile::tempdir().unwrap();
    let file = temp.path().join("table");
    let learn = ["learn", "--recordings", SIMULATED, "--out", path(&file)];
    // five slides are asked for by default, and there are three
    let learned = String::from_utf8(tactus(&learn).stdout).unwrap();
    assert_eq!(learned.matches("only 3 slides").count(), 18, "{learned}");
    let shown = json(&["table", path(&file), "--format", "json"], 0);
    assert_eq!(shown["textures"].as_array().unwrap().len(), 6);
    assert_eq!(shown["movements"].as_array().unwrap().len(), 3);
    let texture = &shown["textures"][0];
    assert_eq!(texture["movements"][0]["trials"], 3);
    assert!(texture["movements"][0]["nearest_sd"].as_f64().unwrap() > 0.0);
    let features = tactus(&["features", "--recordings", SIMULATED, "--format", "json"]);
    let lines = String::from_utf8(features.stdout).unwrap();
    let lines: Vec<serde_json::Value> = lines
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len(), 54);
    assert_eq!(lines[1]["trial"], 2);
    assert!((lines[0]["force_n"].as_f64().unwrap() - 1.262).abs() < 1e-3);
    let csv = tactus(&["features", "--recordings", SIMULATED, "--format", "csv"]);
    let csv = String::from_utf8(csv.stdout).unwrap();
    assert!(
        csv.lines()
            .nth(2)
            .unwrap()
            .ends_with(",Computer paper,1.262,10.000,2"),
        "{csv}"
    );
}

#[test]
fn names_are_found_whatever_their_case_and_slips_are_named() {
    let identify = |material| {
        [
            "identify",
            "--recordings",
            SIMULATED,
            "--train-slides",
            "2",
            "--material",
            material,
        ]
    };
    assert_eq!(tactus(&identify("CORDUROY")).status.code(), Some(0));
    assert!(said(&identify("cordoroy"), 1).contains("did you mean Corduroy?"));
    let simulated = ["identify", "--simulated", "--texture", "burlpa"];
    assert!(said(&simulated, 1).contains("did you mean Burlap?"));
}

#[test]
fn the_environment_names_the_recordings_and_the_port() {
    let features = command(&["features", "--format", "csv"])
        .env("TACTUS_RECORDINGS", SIMULATED)
        .output()
        .unwrap();
    assert_eq!(
        String::from_utf8(features.stdout).unwrap().lines().count(),
        55
    );
    for arguments in [
        &["features"][..],
        &["evaluate"],
        &["identify", "--material", "1"],
    ] {
        let said = said(arguments, 2);
        assert!(
            said.contains("--recordings") && said.contains("TACTUS_RECORDINGS"),
            "{said}"
        );
    }
    // it does not stand in the way of what was asked for
    let simulated = command(&["evaluate", "--properties", "no/such/file"])
        .env("TACTUS_RECORDINGS", SIMULATED)
        .output()
        .unwrap();
    assert!(
        String::from_utf8(simulated.stderr)
            .unwrap()
            .contains("no/such/file")
    );
    // nobody is there, but it is understood
    let status = command(&["device", "status"])
        .env("TACTUS_PORT", "127.0.0.1:1")
        .output()
        .unwrap();
    let said = String::from_utf8(status.stderr).unwrap();
    assert!(
        said.contains("127.0.0.1:1") && said.contains("emulated board"),
        "{said}"
    );
}

#[test]
fn tables_and_logs_are_read_from_standard_input() {
    let table = std::fs::File::open(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../shared/tables/factory.tact"
    ));
    let show = |file: &str, stdin: Stdio| {
        let out = command(&["table", file]).stdin(stdin).output().unwrap();
        assert!(out.status.success(), "{out:?}");
        out.stdout
    };
    let named = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../shared/tables/factory.tact"
    );
    assert_eq!(show("-", table.unwrap().into()), show(named, Stdio::null()));
}

#[test]
fn a_closed_pipe_ends_completions_quietly() {
    let mut child = command(&["completions", "bash"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let out = child.wait_with_output().unwrap();
    assert!(out.status.success());
    assert_eq!(String::from_utf8_lossy(&out.stderr), "");
}

#[test]
fn figures_are_written_for_people() {
    let evaluate = [
        "evaluate",
        "--recordings",
        SIMULATED,
        "--train-slides",
        "2",
        "--runs",
        "20",
        "--threshold",
        "0.3",
    ];
    let shown = String::from_utf8(tactus(&evaluate).stdout).unwrap();
    assert!(shown.contains("threshold 30 %,"), "{shown}");
    let help = String::from_utf8(tactus(&["--help"]).stdout).unwrap();
    for part in ["Exit codes", "3 not identified", "TACTUS_PORT"] {
        assert!(help.contains(part), "{help}");
    }
}

#[test]
fn a_gauge_study_is_one_object_and_compares_operators_of_several_folders() {
    let alone = json(
        &["report", "--recordings", SIMULATED, "--format", "json"],
        0,
    );
    assert_eq!((&alone["parts"], &alone["slides"]), (&6.into(), &54.into()));
    let movements = alone["movements"].as_array().unwrap();
    assert_eq!(movements.len(), 3);
    for gauge in movements
        .iter()
        .flat_map(|m| m["properties"].as_array().unwrap())
    {
        let sd = |name: &str| gauge["sd"][name].as_f64();
        assert_eq!((sd("operator"), sd("operator_by_part")), (None, None));
        let all = sd("gauge").unwrap().hypot(sd("part").unwrap());
        assert!((all - sd("total").unwrap()).abs() < 1e-9, "{gauge}");
    }
    // the same slides by two operators: nobody reads more than the other
    let temp = tempfile::tempdir().unwrap();
    let folders = ["Anna", "Ben"].map(|name| {
        let folder = temp.path().join(name);
        std::fs::create_dir(&folder).unwrap();
        for file in std::fs::read_dir(SIMULATED).unwrap() {
            let file = file.unwrap();
            std::fs::copy(file.path(), folder.join(file.file_name())).unwrap();
        }
        let manifest = folder.join("manifest.csv");
        let text = std::fs::read_to_string(&manifest).unwrap();
        let named: Vec<String> = text
            .lines()
            .map(|line| {
                line.strip_suffix(",,,,biotac,,,1")
                    .map_or(line.to_owned(), |l| format!("{l},{name},,,biotac,,,1"))
            })
            .collect();
        std::fs::write(&manifest, named.join("\n")).unwrap();
        folder
    });
    let [anna, ben] = [&folders[0], &folders[1]].map(|folder| path(folder));
    let both = [
        "report",
        "--recordings",
        anna,
        "--recordings",
        ben,
        "--format",
        "json",
    ];
    let both = json(&both, 0);
    assert_eq!(both["operators"], serde_json::json!(["Anna", "Ben"]));
    for (one, two) in movements.iter().zip(both["movements"].as_array().unwrap()) {
        let of = |m: &serde_json::Value| m["properties"][1]["sd"].clone();
        assert_eq!(of(two)["operator"], 0.0);
        let [one, two] = [of(one), of(two)].map(|sd| sd["part"].as_f64().unwrap());
        assert!((one - two).abs() < 0.1 * one, "{one} and {two}");
    }
    let twice = said(
        &[
            "report",
            "--recordings",
            SIMULATED,
            "--recordings",
            SIMULATED,
        ],
        2,
    );
    assert!(twice.contains("was given before"), "{twice}");
}

#[test]
fn an_evaluation_says_how_reliable_it_is() {
    let evaluate = ["evaluate", "--recordings", SIMULATED, "--train-slides", "2"];
    let options = ["--runs", "60", "--threshold", "0.97", "--format", "json"];
    let found = json(&[&evaluate[..], &options].concat(), 0);
    let list = |field: &str| found[field].as_array().unwrap().clone();
    let number = |value: &serde_json::Value| value.as_f64().unwrap();

    let reliability = list("reliability");
    assert_eq!(number(&reliability[0]["from"]), 0.0);
    assert_eq!(number(&reliability[6]["to"]), 1.0);
    let mut slides = 0.0;
    for (bin, next) in reliability.iter().zip(reliability.iter().skip(1)) {
        assert_eq!(bin["to"], next["from"]);
    }
    for bin in &reliability {
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
    assert!((slides / 60.0 - told).abs() < 1e-9, "{slides} {told}");
}

#[test]
fn a_table_has_a_report_as_text_as_an_object_and_as_a_page() {
    let temp = tempfile::tempdir().unwrap();
    let [table, page] = ["table", "page.html"].map(|name| temp.path().join(name));
    let (table, page) = (path(&table), path(&page));
    let learn = [
        "learn",
        "--recordings",
        SIMULATED,
        "--train-slides",
        "2",
        "--out",
        table,
    ];
    assert!(tactus(&learn).status.success());
    let report = ["report", table, "--recordings", SIMULATED, "--out", page];
    let object: Vec<&str> = report.into_iter().chain(["--format", "json"]).collect();
    let object = json(&object, 0);
    let textures = object["textures"].as_array().unwrap();
    assert_eq!(textures.len(), 6);
    let verdicts = &object["recorded"]["known"];
    let shares = ["right", "changed", "new", "wrong", "undecided"];
    let sum: f64 = shares
        .iter()
        .map(|name| verdicts[name].as_f64().unwrap())
        .sum();
    assert!((sum - 1.0).abs() < 1e-9, "{verdicts}");
    // of three slides two were learned from: every exploration has three slides at most, one a movement
    for texture in textures {
        let slides = texture["recorded"]["mean_slides"].as_f64().unwrap();
        assert!((1.0..=3.0).contains(&slides), "{texture}");
        assert!(texture["nearest"]["taken_for"].as_f64().unwrap() <= 1.0);
    }
    let text = String::from_utf8(tactus(&report).stdout).unwrap();
    assert!(
        text.contains("What users would be told, by 150 explorations"),
        "{text}"
    );
    assert!(text.contains("What would help:"), "{text}");
    // well-formed, complete, and the map is in it
    let html = std::fs::read_to_string(page).unwrap();
    let html = html.strip_prefix("<!DOCTYPE html>").unwrap_or(&html);
    let html = roxmltree::Document::parse(html.trim()).unwrap();
    let has = |id: &str| html.descendants().any(|n| n.attribute("id") == Some(id));
    assert!(
        ["advice", "recorded", "textures", "movements"]
            .into_iter()
            .all(has)
    );
    let rows = html.descendants().filter(|n| n.has_tag_name("tr")).count();
    assert_eq!(rows, 2 + 7);
    assert!(html.descendants().any(|n| n.tag_name().name() == "svg"));
    let lines = html.descendants().filter(|n| n.has_tag_name("li")).count();
    assert_eq!(lines, 3 + object["advice"].as_array().unwrap().len());
    // without recordings there is nothing that users would be told
    assert!(json(&["report", table, "--format", "json"], 0)["recorded"].is_null());
    let lost = said(&["report", table, "--recordings", "nowhere"], 1);
    assert!(lost.contains("nowhere: no such folder"), "{lost}");
}

#[test]
fn slides_are_verified_against_a_texture_of_a_table_and_of_recordings() {
    let temp = tempfile::tempdir().unwrap();
    let table = temp.path().join("table");
    let table = path(&table);
    let learn = ["learn", "--recordings", SIMULATED, "--train-slides", "2"];
    let learn = [&learn[..], &["--out", table]].concat();
    assert!(tactus(&learn).status.success());
    let of = |material: &'static str, code| {
        let verify = [
            "verify",
            "--table",
            table,
            "--texture",
            "burlap",
            "--sample",
        ];
        let sample = [SIMULATED, "--material", material, "--format", "json"];
        json(&[&verify[..], &sample].concat(), code)
    };
    let same = of("burlap", 0);
    assert_eq!(
        (&same["answer"], &same["few"]),
        (&"same".into(), &true.into())
    );
    assert!(same["false_accept"].as_f64().unwrap() < 0.2);
    let other = of("corduroy", 3);
    assert_eq!(other["answer"], "different");
    let slides = other["slides"].as_array().unwrap();
    let last = slides.last().unwrap();
    assert!(last["score"].as_f64() > last["limit"].as_f64(), "{last}");
    assert_eq!(last["answer"], "different");

    // the other textures of its own recordings give the scale
    let reference = ["verify", "--reference", SIMULATED, "--texture", "burlap"];
    let itself = [&reference[..], &["--sample", SIMULATED]].concat();
    assert!(said(&itself, 1).contains("--sample is the reference itself"));
    let other = [&itself[..], &["--material", "Denim twill"]].concat();
    let text = String::from_utf8(tactus(&other).stdout).unwrap();
    assert!(text.contains("Different from Burlap"), "{text}");
    let lost = ["verify", "--table", table, "--sample", SIMULATED];
    assert!(said(&lost, 2).contains("--texture NAME"));
    let typo = [&lost[..], &["--texture", "burlab"]].concat();
    assert!(said(&typo, 1).contains("did you mean Burlap?"));
}

#[test]
fn a_table_says_whether_the_samples_of_its_slides_were_moved() {
    let temp = tempfile::tempdir().unwrap();
    let (folder, table) = (temp.path().join("slides"), temp.path().join("table"));
    std::fs::create_dir(&folder).unwrap();
    for entry in std::fs::read_dir(SIMULATED).unwrap() {
        let from = entry.unwrap().path();
        std::fs::copy(&from, folder.join(from.file_name().unwrap())).unwrap();
    }
    let manifest = folder.join("manifest.csv");
    let rows = std::fs::read_to_string(&manifest).unwrap();
    let learned = |labels: &dyn Fn(&str, u32) -> &'static str| {
        let label = |line: &str| {
            // nobody said so far, nor of which finger and at what speed
            let line = line.rsplitn(6, ',').last().unwrap();
            let fields: Vec<&str> = line.split(',').collect();
            let moved = match fields[2].parse() {
                Ok(slide) => labels(fields[1], slide),
                Err(_) => "moved",
            };
            format!("{line},{moved}\n")
        };
        let labelled: String = rows.lines().map(label).collect();
        std::fs::write(&manifest, labelled).unwrap();
        let learn = [
            "learn",
            "--recordings",
            path(&folder),
            "--train-slides",
            "2",
        ];
        let out = tactus(&[&learn[..], &["--out", path(&table)]].concat());
        assert!(out.status.success(), "{out:?}");
        let shown = json(&["table", path(&table), "--format", "json"], 0);
        let of = |t: &serde_json::Value| {
            let name = t["name"].as_str().unwrap().to_owned();
            (name, t["sample_moved"].as_bool())
        };
        let all: Vec<_> = shown["textures"]
            .as_array()
            .unwrap()
            .iter()
            .map(of)
            .collect();
        (all, std::fs::read(&table).unwrap())
    };
    let (none, plain) = learned(&|_, _| "");
    assert!(none.iter().all(|(_, moved)| moved.is_none()));
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
    for (name, moved) in some {
        let wanted = match name.as_str() {
            "Burlap" | "Corduroy" => Some(true),
            "Denim twill" => Some(false),
            _ => None,
        };
        assert_eq!(moved, wanted, "{name}");
    }
    // and nothing else: the same features, limits and explorations
    assert_ne!(plain, noted);
    let identify = |bytes: &[u8]| {
        std::fs::write(&table, bytes).unwrap();
        let identify = [
            "identify",
            "--recordings",
            SIMULATED,
            "--material",
            "Burlap",
            "--table",
        ];
        json(
            &[&identify[..], &[path(&table), "--format", "json"]].concat(),
            0,
        )
    };
    assert_eq!(identify(&plain), identify(&noted));
    // a part of the note that is cut off is told
    let at = noted.windows(4).rposition(|w| w == [3, 0, 15, 0]).unwrap();
    let mut damaged = noted.clone();
    damaged[at + 4 + 4] = 7;
    let body = damaged.len() - 4;
    let mut crc = flate2::Crc::new();
    crc.update(&damaged[..body]);
    damaged[body..].copy_from_slice(&crc.sum().to_le_bytes());
    std::fs::write(&table, damaged).unwrap();
    let refused = said(&["table", path(&table)], 1);
    assert!(refused.contains("section 3 is damaged"), "{refused}");
}
