//! The command `tactus` as a user meets it: what it prints, how it fails.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use sha2::{Digest as _, Sha256};
use tactus_tests::{data, properties_csv};

fn tactus(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tactus"))
        .args(arguments)
        .output()
        .unwrap()
}

/// What a command that must succeed printed; 3 is an exploration that ended without a name.
fn printed(arguments: &[&str]) -> String {
    let out = tactus(arguments);
    assert!(
        matches!(out.status.code(), Some(0 | 3)),
        "{arguments:?}: {}",
        String::from_utf8_lossy(&out.stderr)
    );
    String::from_utf8(out.stdout).unwrap()
}

/// What a command that must fail said.
fn complaint(arguments: &[&str]) -> String {
    let out = tactus(arguments);
    let said = String::from_utf8(out.stderr).unwrap();
    assert_eq!(out.status.code(), Some(1), "{arguments:?}: {said}");
    assert!(!said.contains("panicked"), "{said}");
    said
}

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn json(text: &str) -> serde_json::Value {
    serde_json::from_str(text).unwrap()
}

/// Recordings in the layout of data/biotac, with only the slides that `keep` wants.
fn part_of(folder: &Path, to: &Path, keep: impl Fn(u64) -> bool) {
    let mut manifest = json(&fs::read_to_string(folder.join("manifest.json")).unwrap());
    let slides: Vec<u64> = manifest["slides"]
        .as_array()
        .unwrap()
        .iter()
        .map(|s| s.as_u64().unwrap())
        .collect();
    let record: usize = manifest["record"]
        .as_array()
        .unwrap()
        .iter()
        .map(|r| 2 * r["count"].as_u64().unwrap() as usize)
        .sum();
    let hex = |bytes: &[u8]| {
        Sha256::digest(bytes)
            .iter()
            .map(|b| format!("{b:02x}"))
            .collect::<String>()
    };
    let kept: Vec<u64> = slides.iter().copied().filter(|&s| keep(s)).collect();
    for file in manifest["files"].as_array_mut().unwrap() {
        let name = file["file"].as_str().unwrap().to_owned();
        let mut raw = Vec::new();
        flate2::read::GzDecoder::new(fs::File::open(folder.join(&name)).unwrap())
            .read_to_end(&mut raw)
            .unwrap();
        let raw: Vec<u8> = raw
            .chunks(record)
            .zip(&slides)
            .filter(|(_, s)| kept.contains(s))
            .flat_map(|(r, _)| r.to_vec())
            .collect();
        let mut gz = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        gz.write_all(&raw).unwrap();
        let gz = gz.finish().unwrap();
        file["n_slides"] = kept.len().into();
        file["bytes_raw"] = raw.len().into();
        file["bytes_gz"] = gz.len().into();
        file["sha256_raw"] = hex(&raw).into();
        file["sha256_gz"] = hex(&gz).into();
        fs::write(to.join(name), gz).unwrap();
    }
    manifest["slides"] = kept.into();
    fs::write(to.join("manifest.json"), manifest.to_string()).unwrap();
}

/// Slides of every material of a folder: recordings of other slides of the same materials have other numbers of them.
fn slides(folder: &Path) -> Vec<u64> {
    let manifest = fs::read_to_string(folder.join("manifest.json")).unwrap();
    let slides = json(&manifest)["slides"].as_array().unwrap().clone();
    slides.iter().map(|n| n.as_u64().unwrap()).collect()
}

#[test]
fn help_says_what_it_is_and_what_to_try_first() {
    let help = printed(&["--help"]);
    assert!(
        help.contains("touching it")
            && help.contains("Try first")
            && help.contains("tactus identify --recordings")
    );
    assert!(help.contains("https://github.com/dexrob/BioTac_slide_20_50"));
    for command in [
        "features", "learn", "table", "identify", "evaluate", "simulate", "import",
    ] {
        assert!(help.contains(command), "{command}");
        assert!(printed(&[command, "--help"]).contains("Usage"), "{command}");
    }
}

#[test]
fn the_command_is_tactus_whatever_its_package() {
    let version = concat!("tactus ", env!("CARGO_PKG_VERSION"), "\n");
    assert_eq!(printed(&["--version"]), version);
}

#[test]
fn a_table_goes_through_pipes() {
    let recordings = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/simulated");
    let temp = tempfile::tempdir().unwrap();
    let table = temp.path().join("table");
    let learn = |to: &str| {
        tactus(&[
            "learn",
            "--recordings",
            recordings,
            "--train-slides",
            "2",
            "--out",
            to,
        ])
    };
    let said = learn(path(&table)).stdout;
    let piped = learn("-");
    assert!(piped.stdout == fs::read(&table).unwrap());
    // what is said of it is beside it
    let beside = String::from_utf8_lossy(&piped.stderr).replacen('-', path(&table), 1);
    assert_eq!(beside, String::from_utf8_lossy(&said));
    let check = Command::new(env!("CARGO_BIN_EXE_tactus"))
        .args(["table", "-"])
        .stdin(fs::File::open(&table).unwrap())
        .output()
        .unwrap();
    assert!(check.status.success(), "{check:?}");
}

#[test]
fn without_arguments_a_simulated_probe_recognises_a_texture() {
    let shown = printed(&[]);
    for part in [
        "touching it",
        "An unknown texture, one of 20",
        "Slide 1:",
        "because",
        "█",
        "Right.",
        "Try first",
    ] {
        assert!(shown.contains(part), "{part}: {shown}");
    }
}

#[test]
fn the_simulated_probe_is_given_the_texture_asked_for() {
    let arguments = [
        "identify",
        "--simulated",
        "--texture",
        "burlap",
        "--among",
        "5",
        "--seed",
        "3",
    ];
    let shown = printed(&arguments);
    assert!(
        shown.contains("one of 5") && shown.contains("Under the finger: Burlap"),
        "{shown}"
    );
    assert!(
        ["Right.", "Wrong: it was Burlap", "Undecided: it was Burlap"]
            .iter()
            .any(|end| shown.contains(end)),
        "{shown}"
    );
    assert_eq!(shown, printed(&arguments), "the same seed");
    let said = complaint(&["identify", "--simulated", "--texture", "cheese"]);
    assert!(said.contains("cheese") && said.contains("Burlap"), "{said}");
}

#[test]
fn simulated_recordings_are_learned_and_evaluated_like_real_ones() {
    let temp = tempfile::tempdir().unwrap();
    let folder = temp.path().join("simulated");
    let said = printed(&[
        "simulate",
        "--out",
        path(&folder),
        "--textures",
        "burlap,47,Oak wood",
        "--trials",
        "4",
        "--seed",
        "2",
    ]);
    assert!(said.contains("3 textures, 36 slides"), "{said}");
    let e = json(&printed(&[
        "evaluate",
        "--recordings",
        path(&folder),
        "--train-slides",
        "3",
        "--runs",
        "300",
        "--format",
        "json",
    ]));
    assert!(e["accuracy"].as_f64().unwrap() > 0.9, "{e}");
    let features = printed(&["features", "--recordings", path(&folder), "--format", "csv"]);
    assert_eq!(features.lines().count(), 37);
    let table = temp.path().join("table");
    printed(&[
        "learn",
        "--recordings",
        path(&folder),
        "--train-slides",
        "3",
        "--out",
        path(&table),
    ]);
    assert!(printed(&["table", path(&table)]).contains("movement 3: 0.20 N, 63.1 mm/s"));
    let explored = printed(&[
        "identify",
        "--recordings",
        path(&folder),
        "--material",
        "burlap",
        "--table",
        path(&table),
    ]);
    assert!(
        explored.contains("Right.") && explored.contains("3 slides not learned from"),
        "{explored}"
    );
    // nothing is overwritten
    assert!(
        complaint(&["simulate", "--out", path(&folder), "--textures", "1"]).contains("simulated")
    );
}

#[test]
fn a_missing_folder_is_named_with_where_to_get_recordings() {
    for command in [
        &["features", "--recordings", "no/such/folder"][..],
        &["learn", "--recordings", "no/such/folder", "--out", "x"],
        &[
            "identify",
            "--recordings",
            "no/such/folder",
            "--material",
            "1",
        ],
        &["evaluate", "--recordings", "no/such/folder"],
    ] {
        let said = complaint(command);
        assert!(
            said.contains("no/such/folder") && said.contains("dexrob/BioTac_slide_20_50"),
            "{said}"
        );
        assert!(said.contains("tactus import"), "{said}");
    }
}

#[test]
fn senseless_arguments_are_refused_with_a_hint() {
    for (arguments, hint) in [
        (&["evaluate"][..], "--recordings"),
        (
            &["evaluate", "--recordings", "a", "--threshold", "1.5"],
            "between 0 and 1",
        ),
        (
            &["evaluate", "--recordings", "a", "--threshold", "nan"],
            "between 0 and 1",
        ),
        (
            &["evaluate", "--recordings", "a", "--max-slides", "0"],
            "max-slides",
        ),
        (
            &["evaluate", "--recordings", "a", "--properties", "b"],
            "cannot be used with",
        ),
        (
            &["evaluate", "--recordings", "a", "--method", "magic"],
            "paper",
        ),
        (&["touch"], "subcommand"),
    ] {
        let out = tactus(arguments);
        let said = String::from_utf8(out.stderr).unwrap();
        assert_eq!(out.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains(hint), "{arguments:?}: {said}");
    }
}

#[test]
fn features_prints_the_golden_columns() {
    let Some(folder) = data("biotac") else { return };
    let ours = printed(&["features", "--recordings", path(&folder), "--format", "csv"]);
    let golden = fs::read_to_string(folder.join("features.csv")).unwrap();
    let header = "material,slide,traction_n,roughness_ln,fineness_unfiltered_ln,ln_psd_band0,ln_psd_band1,ln_psd_band2,\
                  ln_psd_band3,ln_psd_band4,ln_psd_band5,ln_psd_band6,ln_psd_band7,name,force_n,speed_mm_s,trial";
    assert_eq!(ours.lines().next(), Some(header));
    let key = |line: &str| {
        line.split(',')
            .take(2)
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    assert!(
        ours.lines()
            .skip(1)
            .map(key)
            .eq(golden.lines().skip(1).map(key)),
        "the same slides in the same order"
    );
    let text = printed(&["features", "--recordings", path(&folder)]);
    assert_eq!(text.lines().count(), ours.lines().count());
    assert!(text.contains("bath towel"));
}

#[test]
fn a_reader_that_leaves_early_is_no_failure() {
    let Some(folder) = data("biotac") else { return };
    let mut child = Command::new(env!("CARGO_BIN_EXE_tactus"))
        .args(["features", "--recordings", path(&folder)])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let out = child.wait_with_output().unwrap();
    assert!(
        out.status.success(),
        "{}",
        String::from_utf8_lossy(&out.stderr)
    );
    assert_eq!(String::from_utf8_lossy(&out.stderr), "");
}

#[test]
fn a_table_is_learned_shown_checked_and_used() {
    let Some(folder) = data("biotac") else { return };
    let temp = tempfile::tempdir().unwrap();
    let file = temp.path().join("table");
    printed(&[
        "learn",
        "--recordings",
        path(&folder),
        "--train-slides",
        "5",
        "--method",
        "paper",
        "--out",
        path(&file),
    ]);
    let shown = printed(&["table", path(&file)]);
    assert!(
        shown.contains("0.80 N, 25.0 mm/s")
            && shown.contains("bath towel")
            && shown.contains("traction")
    );
    // the table's means are those of the first five slides
    let golden = fs::read_to_string(folder.join("features.csv")).unwrap();
    let first: Vec<f64> = golden
        .lines()
        .skip(1)
        .take(5)
        .map(|l| l.split(',').nth(2).unwrap().parse().unwrap())
        .collect();
    let mean = first.iter().sum::<f64>() / 5.0;
    let row = shown.lines().find(|l| l.contains("carpet net")).unwrap();
    let shown_mean: f64 = row.split_whitespace().nth(4).unwrap().parse().unwrap();
    assert!((shown_mean - mean).abs() < 2.5e-4, "{row} {mean}");

    let explored = printed(&[
        "identify",
        "--recordings",
        path(&folder),
        "--material",
        "bath towel",
        "--table",
        path(&file),
    ]);
    assert!(
        explored.contains(&format!(
            "{} slides not learned from",
            slides(&folder).len() - 5
        )),
        "{explored}"
    );
    assert!(
        [
            "Right.",
            "Wrong: it was bath towel.",
            "Undecided: it was bath towel."
        ]
        .iter()
        .any(|end| explored.contains(end)),
        "{explored}"
    );
}

#[test]
fn a_bad_table_is_refused_with_the_check_that_failed() {
    let Some(folder) = data("biotac") else { return };
    let temp = tempfile::tempdir().unwrap();
    let file = temp.path().join("table");
    printed(&["learn", "--recordings", path(&folder), "--out", path(&file)]);
    let good = fs::read(&file).unwrap();
    let mut flipped = good.clone();
    flipped[100] ^= 1;
    let mut other_version = good.clone();
    other_version[4] = 9;
    let mut longer = good.clone();
    longer.extend([0; 3]);
    let truncated = format!("truncated: 200 bytes of {}", good.len());
    for (bytes, check) in [
        (flipped, "checksum"),
        (other_version, "version 9"),
        (longer, "bytes follow"),
        (good[..200].to_vec(), truncated.as_str()),
        (b"texture,movement".to_vec(), "not a texture table"),
        (Vec::new(), "truncated: 0 bytes"),
    ] {
        fs::write(&file, bytes).unwrap();
        for command in [
            &["table", path(&file)][..],
            &[
                "identify",
                "--recordings",
                path(&folder),
                "--material",
                "1",
                "--table",
                path(&file),
            ],
        ] {
            let said = complaint(command);
            assert!(said.contains(check) && said.contains(path(&file)), "{said}");
        }
    }
    assert!(complaint(&["table", "no/such/table"]).contains("no/such/table"));
}

#[test]
fn identify_recognises_a_texture_and_explains_each_step() {
    let Some(folder) = data("biotac") else { return };
    let explored = printed(&["identify", "--recordings", path(&folder), "--material", "3"]);
    for part in [
        "Slide 1:",
        "because",
        "should leave",
        "measured",
        "█",
        "It is bath towel",
        "Right.",
    ] {
        assert!(explored.contains(part), "{part}: {explored}");
    }
    assert_eq!(
        explored,
        printed(&[
            "identify",
            "--recordings",
            path(&folder),
            "--material",
            "BATH TOWEL",
            "--seed",
            "1"
        ])
    );
    assert_ne!(
        explored,
        printed(&[
            "identify",
            "--recordings",
            path(&folder),
            "--material",
            "3",
            "--seed",
            "2"
        ])
    );
    let said = complaint(&[
        "identify",
        "--recordings",
        path(&folder),
        "--material",
        "granite",
    ]);
    assert!(
        said.contains("granite") && said.contains("3 bath towel"),
        "{said}"
    );
}

#[test]
fn evaluate_prints_one_json_object() {
    let Some(folder) = data("biotac") else { return };
    let arguments = [
        "evaluate",
        "--recordings",
        path(&folder),
        "--runs",
        "500",
        "--format",
        "json",
    ];
    let text = printed(&arguments);
    let e = json(&text);
    assert_eq!(
        (e["method"].as_str(), e["protocol"].as_str()),
        (Some("fused"), Some("interleaved"))
    );
    assert_eq!(
        (e["train_slides"].as_u64(), e["runs"].as_u64()),
        (Some(5), Some(500))
    );
    for share in ["accuracy", "converged", "wrong_when_sure"] {
        assert!((0.0..=1.0).contains(&e[share].as_f64().unwrap()), "{share}");
    }
    assert!(
        e["median_slides"].as_f64().unwrap() <= 11.0 && e["mean_slides"].as_f64().unwrap() <= 10.0
    );
    let confused = !e["confused"].as_array().unwrap().is_empty();
    assert_eq!(confused, e["accuracy"].as_f64() < Some(1.0));
    assert_eq!(
        text,
        printed(&arguments),
        "the same seed gives the same figures"
    );
    let other: Vec<&str> = arguments.into_iter().chain(["--seed", "2"]).collect();
    assert_ne!(text, printed(&other));
    let strict: Vec<&str> = arguments
        .into_iter()
        .chain(["--threshold", "0.9999"])
        .collect();
    assert!(json(&printed(&strict))["converged"].as_f64() < e["converged"].as_f64());
}

#[test]
fn evaluate_counts_the_right_name_among_those_told_changed() {
    let Some(folder) = data("biotac") else { return };
    let drift = ["evaluate", "--recordings", path(&folder), "--protocol"];
    let drift = [&drift[..], &["drift", "--runs", "300", "--novelty"]].concat();
    let drift = [&drift[..], &["leave-one-out"]].concat();
    let e = json(&printed(&[&drift[..], &["--format", "json"]].concat()));
    let after = &e["novelty"][2];
    let right = after["known"]["changed_right"].as_f64().unwrap();
    assert!((0.5..=1.0).contains(&right), "{after}");
    // of what was left out no name is right
    assert!(after["unknown"].get("changed_right").is_none());
    assert!(e["verdicts_new"]["changed"].as_f64() > Some(0.0));
    assert!(e["verdicts_new"]["changed_right"].is_null());
    let said = printed(&drift);
    let right = format!("(the right one in {:.1} %)", 100.0 * right);
    let of_known = said.lines().find(|line| line.contains(&right)).unwrap();
    assert!(of_known.contains("like one, but changed"), "{said}");
    for line in said.lines().filter(|line| line.contains("new texture")) {
        assert!(!line.contains("the right one"), "{said}");
    }
}

#[test]
fn evaluate_says_when_there_are_too_few_slides() {
    let Some(folder) = data("biotac") else { return };
    let all = slides(&folder).len();
    let (number, more) = (all.to_string(), (all + 1).to_string());
    // the first 19 of 34 are the early ones (`Protocol`)
    let early = (all * 19 + 17) / 34;
    let too_many = (early + 1).to_string();
    for (more, cause) in [
        (
            &["--train-slides", &number][..],
            "no slide is left to test on".to_owned(),
        ),
        (
            &["--train-slides", &more],
            format!("{all} slides to train from, and --train-slides is {more}"),
        ),
        (
            &["--train-slides", &too_many, "--protocol", "blocked"],
            format!("{early} slides to train from"),
        ),
        (&["--train-slides", "1"], "at least two slides".to_owned()),
    ] {
        let arguments: Vec<&str> = ["evaluate", "--recordings", path(&folder)]
            .iter()
            .chain(more)
            .copied()
            .collect();
        let said = complaint(&arguments);
        assert!(said.contains(&cause), "{said}");
    }
}

#[test]
fn a_second_folder_brings_the_test_slides() {
    let Some(folder) = data("biotac") else { return };
    let temp = tempfile::tempdir().unwrap();
    let (train, test) = (temp.path().join("train"), temp.path().join("test"));
    fs::create_dir(&train).unwrap();
    fs::create_dir(&test).unwrap();
    // every other one, as they come
    let slides = slides(&folder);
    let even = |slide| slides.iter().position(|n| *n == slide).unwrap() % 2 == 0;
    part_of(&folder, &train, even);
    part_of(&folder, &test, |slide| !even(slide));
    let accuracy = |protocol| {
        let e = json(&printed(&[
            "evaluate",
            "--recordings",
            path(&train),
            "--test",
            path(&test),
            "--method",
            "paper",
            "--protocol",
            protocol,
            "--runs",
            "2000",
            "--format",
            "json",
        ]));
        e["accuracy"].as_f64().unwrap()
    };
    // neighbours in time are alike; late slides are harder for a table of early ones
    let (interleaved, blocked, drift) = (
        accuracy("interleaved"),
        accuracy("blocked"),
        accuracy("drift"),
    );
    println!("interleaved {interleaved}, blocked {blocked}, drift {drift}");
    assert!((0.80..0.95).contains(&interleaved) && blocked < interleaved && drift < interleaved);
    // alone, a folder of half the slides is divided in the same proportion
    printed(&[
        "evaluate",
        "--recordings",
        path(&train),
        "--protocol",
        "blocked",
        "--train-slides",
        "3",
        "--runs",
        "100",
    ]);

    // a table of the one folder has seen nothing of the other
    let table = temp.path().join("table");
    printed(&[
        "learn",
        "--recordings",
        path(&train),
        "--train-slides",
        "6",
        "--out",
        path(&table),
    ]);
    for (folder, left) in [
        (&test, slides.len() / 2),
        (&train, slides.len().div_ceil(2) - 6),
    ] {
        let explored = printed(&[
            "identify",
            "--recordings",
            path(folder),
            "--material",
            "3",
            "--table",
            path(&table),
        ]);
        assert!(
            explored.contains(&format!("{left} slides not learned from")),
            "{explored}"
        );
    }

    let lone = temp.path().join("lone");
    fs::create_dir(&lone).unwrap();
    let late = slides[slides.len() * 19 / 34];
    part_of(&folder, &lone, |slide| slide < late);
    let said = complaint(&[
        "evaluate",
        "--recordings",
        path(&train),
        "--test",
        path(&lone),
        "--protocol",
        "blocked",
    ]);
    assert!(said.contains("no slide is left to test on"), "{said}");
}

#[test]
fn damaged_recordings_are_named() {
    let Some(folder) = data("biotac") else { return };
    let temp = tempfile::tempdir().unwrap();
    part_of(&folder, temp.path(), |slide| slide < 10);
    let file = temp.path().join("mat07.i16le.gz");
    let bytes = fs::read(&file).unwrap();
    fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
    let said = complaint(&["features", "--recordings", path(temp.path())]);
    assert!(said.contains("mat07.i16le.gz"), "{said}");
    fs::remove_file(&file).unwrap();
    assert!(complaint(&["features", "--recordings", path(temp.path())]).contains("mat07.i16le.gz"));
}

#[test]
fn imported_recordings_evaluate_to_the_same_figures() {
    let Some(folder) = data("biotac") else { return };
    let temp = tempfile::tempdir().unwrap();
    let imported: PathBuf = temp.path().join("imported");
    printed(&["import", path(&folder), path(&imported)]);
    let evaluate = |folder: &Path| {
        printed(&[
            "evaluate",
            "--recordings",
            path(folder),
            "--runs",
            "500",
            "--format",
            "json",
        ])
    };
    assert_eq!(evaluate(&folder), evaluate(&imported));
}

#[test]
fn properties_are_evaluated_and_checked() {
    let temp = tempfile::tempdir().unwrap();
    let file = temp.path().join("world.csv");
    let csv = properties_csv(4, 2, |_, _, _| 3);
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
    let e = json(&printed(&evaluate));
    assert_eq!(
        (e["accuracy"].as_f64(), e["train_slides"].as_u64()),
        (Some(1.0), Some(3))
    );
    assert_eq!(e["median_slides"].as_f64(), Some(1.0));
    let two: Vec<&str> = evaluate
        .into_iter()
        .chain(["--train-slides", "2"])
        .collect();
    assert_eq!(json(&printed(&two))["train_slides"].as_u64(), Some(2));
    let four: Vec<&str> = evaluate
        .into_iter()
        .chain(["--train-slides", "4"])
        .collect();
    assert!(complaint(&four).contains("3 slides to train from"));

    fs::write(&file, csv.replacen("1.01,1.01,1.01", "1.01,NaN,1.01", 1)).unwrap();
    let said = complaint(&evaluate);
    assert!(
        said.contains("world.csv") && said.contains('2') && said.contains("roughness"),
        "{said}"
    );
    fs::write(&file, csv.replace("validate", "train2")).unwrap();
    assert!(complaint(&evaluate).contains("train2"));
}

/// Name and bytes of each file of a folder, not of the folders in it.
fn contents(folder: &Path) -> BTreeMap<OsString, Vec<u8>> {
    let files = fs::read_dir(folder).unwrap().map(Result::unwrap);
    let files = files.filter(|entry| entry.file_type().unwrap().is_file());
    files
        .map(|entry| (entry.file_name(), fs::read(entry.path()).unwrap()))
        .collect()
}

#[test]
fn what_the_command_brings_along_is_what_the_repository_has() {
    let temp = tempfile::tempdir().unwrap();
    let folder = temp.path().join("tactus-data");
    let unpack = ["unpack", path(&folder)];
    let told = printed(&unpack);
    assert!(told.contains("6 textures, 54 slides"), "{told}");
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    // not assert_eq, which would print all bytes
    assert!(contents(&folder) == contents(&here.join("../../shared/tables")));
    let recordings = folder.join("recordings");
    assert!(contents(&recordings) == contents(&here.join("../recordings/simulated")));
    // once more changes nothing, and a table of somebody's own is left alone
    assert_eq!(printed(&unpack), told);
    let own = folder.join("factory.tact");
    fs::write(&own, "mine").unwrap();
    let said = complaint(&unpack);
    assert!(said.contains("give another folder"), "{said}");
    assert_eq!(fs::read(&own).unwrap(), b"mine");
}
