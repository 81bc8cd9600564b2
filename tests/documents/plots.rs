//! `--plot`: the pictures are well-formed, nothing in them leaves the picture or is too small to read on a phone, and they
//! say the numbers that the commands print.

use std::collections::BTreeMap;
use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use tactus_core::explorer::Config;
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::data::replay::measure_all;
use tactus_lab::eval::evaluate::{Method, explorer, play_with};
use tactus_lab::eval::experiment::{Experiment, Protocol};

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tactus"))
        .args(arguments)
        .current_dir(root())
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

/// What a command prints, and what it says beside that; it does what it is to do.
fn tactus(arguments: &[&str]) -> (String, String) {
    let out = run(arguments);
    let [printed, said] = [out.stdout, out.stderr].map(|text| String::from_utf8(text).unwrap());
    assert!(out.status.success(), "{arguments:?}: {said}");
    (printed, said)
}

const RECORDINGS: [&str; 4] = [
    "--recordings",
    "host-tools/recordings/simulated",
    "--train-slides",
    "2",
];

/// What all `<title>`s of a picture say, but the pictures' own.
fn says(svg: &str) -> Vec<String> {
    let picture = roxmltree::Document::parse(svg).unwrap();
    let titles = picture
        .descendants()
        .filter(|n| n.has_tag_name("title") || n.tag_name().name() == "title");
    let parts = titles.filter(|n| n.parent().is_some_and(|p| p.tag_name().name() == "rect"));
    parts.filter_map(|n| n.text().map(str::to_owned)).collect()
}

/// Width of a letter as part of its height, on average, in the fonts that browsers take.
const WIDE: f64 = 0.52;
/// Least height of letters on a phone, 390 px wide.
const READABLE: f64 = 10.0;

/// Looks at a picture, and the pictures in it.
fn look(name: &str, svg: &str) {
    let picture = roxmltree::Document::parse(svg).unwrap_or_else(|why| panic!("{name}: {why}"));
    let number =
        |n: &roxmltree::Node<'_, '_>, key| n.attribute(key).and_then(|v| v.parse::<f64>().ok());
    let full = number(&picture.root_element(), "width").unwrap();
    let is = |n: &roxmltree::Node<'_, '_>, tag: &str| n.tag_name().name() == tag;
    for drawing in picture.descendants().filter(|n| is(n, "svg")) {
        let title = drawing.first_element_child().unwrap();
        assert!(
            is(&title, "title") && title.text().is_some(),
            "{name} has no title"
        );
        let [width, height] = ["width", "height"].map(|key| number(&drawing, key).unwrap());
        let words = drawing.children().filter(|n| is(n, "text"));
        for text in words {
            let said = text.text().unwrap_or_default().trim();
            let em = number(&text, "font-size").unwrap();
            assert!(
                em * 390.0 / full >= READABLE,
                "{name}, {said}: {em} px of {full}"
            );
            let [x, y] = ["x", "y"].map(|key| number(&text, key).unwrap());
            let long = WIDE * em * said.chars().count() as f64;
            let before = match text.attribute("text-anchor") {
                Some("middle") => long / 2.0,
                Some("end") => long,
                _ => 0.0,
            };
            let (along, across) = match text.attribute("transform") {
                // upwards: it begins below
                Some(_) => ((y - before, height), (x, width)),
                None => ((x - before, width), (y, height)),
            };
            assert!(
                along.0 >= -1.0 && along.0 + long <= along.1 + 1.0,
                "{name}: {said} at {x}, {y}"
            );
            assert!(
                (0.0..=across.1).contains(&across.0),
                "{name}: {said} at {x}, {y}"
            );
        }
        let style = drawing.children().any(|n| {
            is(&n, "style")
                && n.text()
                    .is_some_and(|s| s.contains("prefers-color-scheme:dark"))
        });
        let is_outer = drawing.children().any(|n| is(&n, "svg"));
        assert!(style || is_outer, "{name} has no dark colours");
    }
}

/// The log of a session, unpacked.
fn session(folder: &Path, name: &str) -> PathBuf {
    let packed = fs::File::open(root().join(format!("tests/golden/{name}.jsonl.gz"))).unwrap();
    let mut log = Vec::new();
    flate2::read::GzDecoder::new(packed)
        .read_to_end(&mut log)
        .unwrap();
    let file = folder.join(format!("{name}.jsonl"));
    fs::write(&file, log).unwrap();
    file
}

#[test]
fn pictures_can_be_read_and_change_nothing_else() {
    let temp = tempfile::tempdir().unwrap();
    let log = session(temp.path(), "identify");
    let paper_log = session(temp.path(), "paper");
    let (log, paper_log) = (log.to_str().unwrap(), paper_log.to_str().unwrap());
    let recorded = |more: &[&'static str]| [&more[..1], &RECORDINGS, &more[1..]].concat();
    let all = |figures: &[&'static str]| figures.to_vec();
    let exploration = || all(&["posterior", "spectrum"]);
    let commands: Vec<(Vec<&str>, Vec<&str>)> = vec![
        (
            recorded(&[
                "evaluate",
                "--runs",
                "300",
                "--method",
                "paper",
                "--threshold",
                "0.97",
            ]),
            all(&["confusion", "reliability"]),
        ),
        (recorded(&["identify", "--material", "91"]), exploration()),
        (
            recorded(&[
                "identify",
                "--material",
                "91",
                "--method",
                "random",
                "--format",
                "json",
            ]),
            exploration(),
        ),
        (
            vec!["identify", "--simulated", "--among", "4", "--seed", "3"],
            exploration(),
        ),
        (vec!["device", "log", "show", log], exploration()),
        (vec!["device", "log", "replay", paper_log], exploration()),
        (
            vec!["table", "show", "shared/tables/factory.tact"],
            all(&["map"]),
        ),
        (
            vec![
                "table",
                "show",
                "shared/tables/handheld.tact",
                "--format",
                "json",
            ],
            all(&["map"]),
        ),
        (
            vec!["table", "show", "tests/golden/paper.tact"],
            all(&["map"]),
        ),
    ];
    for (number, (command, figures)) in commands.iter().enumerate() {
        let folder = temp.path().join(format!("pictures/{number}"));
        let folder = folder.to_str().unwrap();
        let (plain, _) = tactus(command);
        let (printed, said) = tactus(&[command, &["--plot", folder][..]].concat());
        assert_eq!(plain, printed, "{command:?}");
        let told = said.lines().last().unwrap_or_default();
        assert_eq!(said.lines().count(), 1, "{said}");
        assert!(told.starts_with(&format!("wrote {folder}: ")), "{told}");
        let mut drawn: Vec<String> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        drawn.sort();
        let named: Vec<String> = figures.iter().map(|f| format!("{f}.svg")).collect();
        assert_eq!(drawn, named, "{command:?}");
        for name in &drawn {
            let svg = fs::read_to_string(Path::new(folder).join(name)).unwrap();
            look(&format!("{command:?}, {name}"), &svg);
        }
        // all in one file; what is there is replaced
        let file = temp.path().join("all.SVG");
        let file = file.to_str().unwrap();
        fs::write(file, "old").unwrap();
        let (printed, said) = tactus(&[command, &["--quiet", "--plot", file][..]].concat());
        assert_eq!(
            (plain.as_str(), ""),
            (printed.as_str(), said.as_str()),
            "{command:?}"
        );
        look(
            &format!("{command:?}, in one file"),
            &fs::read_to_string(file).unwrap(),
        );
    }
}

#[test]
fn the_matrix_counts_what_the_verdicts_say() {
    let temp = tempfile::tempdir().unwrap();
    let folder = temp.path().to_str().unwrap();
    for method in ["paper", "fused", "random"] {
        let command = [
            "--runs",
            "600",
            "--method",
            method,
            "--threshold",
            "0.9",
            "--format",
            "json",
            "--plot",
            folder,
        ];
        let (json, _) = tactus(&[&["evaluate"], &RECORDINGS[..], &command].concat());
        let json: Value = serde_json::from_str(&json).unwrap();
        let matrix = fs::read_to_string(temp.path().join("confusion.svg")).unwrap();
        let mut rows: BTreeMap<String, (u64, u64)> = BTreeMap::new();
        let mut kinds: BTreeMap<&str, u64> = BTreeMap::new();
        for said in says(&matrix) {
            let (name, rest) = said.split_once(": ").unwrap();
            let (told, counts) = rest.rsplit_once(", ").unwrap();
            let (count, all) = counts.split_once(" of ").unwrap();
            let count: u64 = count.parse().unwrap();
            let all: u64 = all.split_once(' ').unwrap().0.parse().unwrap();
            let row = rows.entry(name.to_owned()).or_insert((0, all));
            assert_eq!(row.1, all);
            row.0 += count;
            let kind = match told {
                "told as sure, right" => "right",
                "told to be none of those known" => "new",
                "told as not sure" => "undecided",
                other => {
                    assert!(other.starts_with("told as sure to be "), "{other}");
                    "wrong"
                }
            };
            *kinds.entry(kind).or_default() += count;
        }
        assert_eq!(rows.len(), 6);
        assert!(rows.values().all(|(sum, all)| sum == all), "{rows:?}");
        assert_eq!(rows.values().map(|row| row.1).sum::<u64>(), 600);
        for kind in ["right", "new", "wrong", "undecided"] {
            let counted = kinds.get(kind).copied().unwrap_or(0) as f64 / 600.0;
            let told = json["verdicts"][kind].as_f64().unwrap();
            assert!(
                (counted - told).abs() < 1e-9,
                "{method}, {kind}: {counted} for {told}"
            );
        }
    }
}

#[test]
fn reliability_is_what_is_counted_slide_by_slide() {
    let temp = tempfile::tempdir().unwrap();
    let folder = temp.path().to_str().unwrap();
    let command = [
        "--runs",
        "500",
        "--method",
        "paper",
        "--threshold",
        "0.99",
        "--plot",
        folder,
    ];
    tactus(&[&["evaluate"], &RECORDINGS[..], &command].concat());
    let drawn = says(&fs::read_to_string(temp.path().join("reliability.svg")).unwrap());
    // explorations that end at the threshold, one by one
    let set = RecordingSet::open(&root().join(RECORDINGS[1])).unwrap();
    let names = set.textures().iter().map(|t| t.name.clone()).collect();
    let measured = measure_all(&set, |_| ()).unwrap();
    let experiment =
        Experiment::recorded(names, &measured, None, Protocol::Interleaved, 2, 1).unwrap();
    let experiment = experiment.each_slide_once();
    let config = Config {
        method: Method::Paper.method(),
        strategy: Method::Paper.strategy(),
        open: true,
        ..Config::default()
    };
    let mut counts: BTreeMap<&str, [u64; 2]> = BTreeMap::new();
    for index in 0..500 {
        let run = experiment.run(index);
        let presented = run.unknown;
        let table = run.learn(config.method).unwrap();
        let mut explorer = explorer(&table, experiment.measured(), config, None).unwrap();
        play_with(&mut explorer, config.strategy, run, |_, explorer| {
            let posterior = explorer.posterior();
            let best = posterior.iter().copied().fold(0.0, f32::max);
            let range = match best {
                p if p < 0.5 => "<50",
                p if p < 0.8 => "50\u{2013}80",
                p if p < 0.9 => "80\u{2013}90",
                p if p < 0.95 => "90\u{2013}95",
                p if p < 0.99 => "95\u{2013}99",
                p if p < 0.999 => "99\u{2013}99.9",
                _ => "\u{2265}99.9",
            };
            let [all, right] = counts.entry(range).or_default();
            *all += 1;
            let first = posterior.iter().position(|&p| p == best);
            *right += u64::from(first == Some(presented));
        });
    }
    assert!(counts.len() >= 4, "{counts:?}");
    assert_eq!(drawn.len(), counts.len());
    for (range, [all, right]) in counts {
        let begin = format!("said {range}: right {right} of {all} times");
        assert!(
            drawn.iter().any(|said| said.starts_with(&begin)),
            "{begin}: {drawn:#?}"
        );
    }
}

#[test]
fn the_posterior_is_that_of_the_json() {
    let temp = tempfile::tempdir().unwrap();
    let folder = temp.path().to_str().unwrap();
    let command = [
        "--material",
        "91",
        "--method",
        "paper",
        "--threshold",
        "1",
        "--format",
        "json",
        "--plot",
        folder,
    ];
    let out = run(&[&["identify"], &RECORDINGS[..], &command].concat());
    let json: Value = serde_json::from_slice(&out.stdout).unwrap();
    let drawn = says(&fs::read_to_string(temp.path().join("posterior.svg")).unwrap());
    // not those for which no recording was left
    let counted = |slide: &&Value| slide["rejected"].is_null();
    let slides = json["slides"].as_array().unwrap();
    let slides: Vec<&Value> = slides.iter().filter(counted).collect();
    assert!(slides.len() >= 2);
    let mut compared = 0;
    for (slide, number) in slides.iter().zip(1..) {
        for candidate in slide["posterior"].as_array().unwrap() {
            let name = candidate["texture"].as_str().unwrap();
            let percent = 100.0 * candidate["probability"].as_f64().unwrap();
            let begin = format!("{name}: ");
            let end = format!(" after slide {number}");
            let said = drawn
                .iter()
                .find_map(|said| said.strip_prefix(&begin)?.strip_suffix(&end));
            // those that were never likely have no line
            let Some(said) = said else { continue };
            let said: f64 = said.trim_end_matches(" %").parse().unwrap();
            assert!(
                (said - percent).abs() <= 0.0051,
                "{name}: {said} for {percent}"
            );
            compared += 1;
        }
    }
    assert!(compared >= slides.len(), "{drawn:#?}");
}

/// Distances of a table of Gaussians, computed again from the JSON of `table show`.
#[test]
fn the_map_names_the_nearest_texture() {
    let temp = tempfile::tempdir().unwrap();
    let file = temp.path().join("map.svg");
    let command = [
        "table",
        "show",
        "tests/golden/paper.tact",
        "--format",
        "json",
        "--plot",
    ];
    let (json, _) = tactus(&[&command[..], &[file.to_str().unwrap()]].concat());
    let json: Value = serde_json::from_str(&json).unwrap();
    let drawn = says(&fs::read_to_string(&file).unwrap());
    let textures = json["textures"].as_array().unwrap();
    assert!(textures.len() >= 3);
    assert_eq!(drawn.len(), textures.len());
    let of = |texture: &Value, movement: usize, property: &str| -> Option<[f64; 2]> {
        let known = texture["movements"][movement][property].as_array()?;
        Some([known[0].as_f64()?, known[1].as_f64()?])
    };
    for texture in textures {
        let distance = |other: &Value| {
            let mut squares = Vec::new();
            for movement in 0..texture["movements"].as_array().unwrap().len() {
                let parts = ["traction_n", "roughness_ln", "fineness_ln"].map(|property| {
                    let ([a, sd_a], [b, sd_b]) = (
                        of(texture, movement, property)?,
                        of(other, movement, property)?,
                    );
                    Some((a - b).powi(2) / ((sd_a.powi(2) + sd_b.powi(2)) / 2.0))
                });
                squares.push(parts.into_iter().flatten().sum::<f64>());
            }
            (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
        };
        let others = textures
            .iter()
            .filter(|other| other["name"] != texture["name"]);
        let nearest = others.map(|other| (distance(other), other["name"].as_str().unwrap()));
        let (sd, nearest) = nearest.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        let name = texture["name"].as_str().unwrap();
        let wanted = format!("{name}; nearest {nearest}, {sd:.1} standard deviations");
        assert!(drawn.contains(&wanted), "{wanted}: {drawn:#?}");
    }
}

#[test]
fn a_place_that_cannot_be_drawn_to_is_told_before_the_work() {
    let temp = tempfile::tempdir().unwrap();
    let path = |name: &str| temp.path().join(name).to_str().unwrap().to_owned();
    fs::create_dir(path("folder.svg")).unwrap();
    fs::write(path("mine"), "mine").unwrap();
    for (target, code, hint) in [
        (path("picture.png"), 2, "FILE.svg"),
        (String::new(), 2, "FILE.svg"),
        (path("folder.svg"), 1, "is a folder"),
        (path("mine"), 1, "is a file"),
        (path("mine/picture.svg"), 1, "cannot be written"),
        (path("nowhere/picture.svg"), 1, "cannot be written"),
        (path("mine/pictures"), 1, "cannot be written"),
    ] {
        let out = run(&[
            "table",
            "show",
            "tests/golden/paper.tact",
            "--plot",
            &target,
        ]);
        let said = String::from_utf8(out.stderr).unwrap();
        assert_eq!(out.status.code(), Some(code), "{target}: {said}");
        assert!(
            said.contains(hint) && !said.contains("panicked"),
            "{target}: {said}"
        );
        assert!(out.stdout.is_empty(), "{target}");
    }
    assert_eq!(fs::read_to_string(path("mine")).unwrap(), "mine");
    assert_eq!(fs::read_dir(temp.path()).unwrap().count(), 2);
}
