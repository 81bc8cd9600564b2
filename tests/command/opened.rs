//! Files that are given to a page, `tactus_lab::remote`: sessions and recordings as the library writes them, and what is said of others.

use std::collections::BTreeMap;
use std::fs;
use std::io::Read as _;
use std::path::Path;
use std::sync::LazyLock;

use flate2::read::GzDecoder;
use proptest::prelude::*;
use serde_json::{Value, json};
use tactus_core::explorer::Method;
use tactus_core::features::{Observation, Property};
use tactus_core::table::Table;
use tactus_core::wire::SlideReport;
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::data::replay::{MeasuredSlide, measure_all};
use tactus_lab::eval::learn::learn;
use tactus_lab::remote::Remote;

const RECORDINGS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/simulated");

type Files = BTreeMap<String, Vec<u8>>;

/// The files of the recordings that come with the command, in a folder of this name.
fn recordings(folder: &str) -> Files {
    let all = fs::read_dir(RECORDINGS).unwrap().map(|entry| {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        (format!("{folder}{name}"), fs::read(path).unwrap())
    });
    all.collect()
}

/// Of those, the first texture alone.
fn one_texture() -> Files {
    let mut files = recordings("paper/");
    let manifest = String::from_utf8(files["paper/manifest.csv"].clone()).unwrap();
    let rows = manifest.lines().enumerate();
    let kept = rows.filter(|(n, row)| *n == 0 || row.starts_with("1,"));
    let kept: Vec<&str> = kept.map(|(_, row)| row).collect();
    files.insert(
        "paper/manifest.csv".to_owned(),
        kept.join("\n").into_bytes(),
    );
    files
}

/// A session's log.
static SESSION: LazyLock<String> = LazyLock::new(|| {
    let packed = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/golden/identify.jsonl.gz"
    );
    let mut log = String::new();
    let mut packed = GzDecoder::new(fs::File::open(packed).unwrap());
    packed.read_to_string(&mut log).unwrap();
    log
});

/// What no program of ours writes where there is a number, a name or a list.
fn odd() -> impl Strategy<Value = Value> {
    prop_oneof![
        Just(Value::Null),
        Just(json!(true)),
        Just(json!([])),
        Just(json!({})),
        any::<f64>().prop_map(|number| json!(number)),
        any::<i64>().prop_map(|number| json!(number)),
        ".{0,8}".prop_map(|text| json!(text)),
        proptest::collection::vec(any::<f32>(), 0..40).prop_map(|list| json!(list)),
    ]
}

/// Puts it in the place of a value, the one that `at` chooses on the way down.
fn put(value: &mut Value, at: &mut impl Iterator<Item = usize>, odd: &Value) {
    let inner = match value {
        Value::Array(list) if !list.is_empty() => at.next().map(|n| {
            let n = n % list.len();
            &mut list[n]
        }),
        Value::Object(map) if !map.is_empty() => at.next().map(|n| {
            let n = n % map.len();
            map.values_mut().nth(n).unwrap()
        }),
        _ => None,
    };
    match inner {
        Some(inner) => put(inner, at, odd),
        None => *value = odd.clone(),
    }
}

fn ask(remote: &mut Remote, files: &Files) -> Value {
    for bytes in files.values() {
        remote.give(bytes.clone());
    }
    let names: Vec<&String> = files.keys().collect();
    let asked = json!({"do": "open", "files": names}).to_string();
    serde_json::from_str(&remote.ask(&asked)).unwrap()
}

fn opened(files: &Files) -> Value {
    let reply = ask(&mut Remote::default(), files);
    assert_eq!(reply["is"], "frame", "{reply}");
    reply
}

fn one(name: &str, bytes: Vec<u8>) -> Files {
    Files::from([(name.to_owned(), bytes)])
}

fn refused(files: &Files) -> String {
    let reply = ask(&mut Remote::default(), files);
    assert_eq!(reply["is"], "error", "{reply}");
    reply["why"].as_str().unwrap().to_owned()
}

fn of<'a>(reply: &'a Value, what: &str) -> Vec<&'a Value> {
    let all = reply["happened"].as_array().unwrap().iter();
    all.filter(|one| one["what"] == what).collect()
}

/// CRCs of the tables of all slides but those that are judged after each.
fn learned_from_others(
    reply: &Value,
    names: &[String],
    measured: &[Vec<MeasuredSlide>],
) -> Vec<u32> {
    let happened = reply["happened"].as_array().unwrap();
    let mut begins: Vec<usize> =
        serde_json::from_value::<Vec<(usize, Value)>>(reply["tables"].clone())
            .unwrap()
            .into_iter()
            .map(|(begin, _)| begin)
            .collect();
    begins.push(happened.len());
    let mut movements = Vec::new();
    for slide in measured.iter().flatten() {
        if !movements.contains(&slide.movement) {
            movements.push(slide.movement);
        }
    }
    let table = |judged: &[Value]| {
        let judged: Vec<&Value> = judged.iter().map(|one| &one["at"]).collect();
        let mut at = 0;
        let slides: Vec<Vec<Vec<Observation>>> = measured
            .iter()
            .map(|texture| {
                let mut cells = vec![Vec::new(); movements.len()];
                for slide in texture {
                    let movement = movements.iter().position(|m| *m == slide.movement);
                    if !judged.contains(&&json!(at)) {
                        let report = SlideReport::from(&slide.measurement);
                        cells[movement.unwrap()].push(report.observation());
                    }
                    at += 1;
                }
                cells
            })
            .collect();
        let table = learn(Method::Fused, None, names, &movements, &slides).unwrap();
        Table::read(&table).unwrap().crc()
    };
    begins
        .windows(2)
        .map(|part| table(&happened[part[0]..part[1]]))
        .collect()
}

#[test]
fn recordings_are_shown_slide_by_slide_and_judged_by_tables_that_have_not_seen_them() {
    let mut remote = Remote::default();
    let reply = ask(&mut remote, &recordings("touched/"));
    assert_eq!(reply["is"], "frame", "{reply}");
    let said = reply["said"].as_str().unwrap();
    assert!(said.starts_with("54 slides of 6 textures.\n"), "{said}");
    assert!(said.contains("not learned from it: there are 3"), "{said}");
    assert_eq!(reply["tables"].as_array().unwrap().len(), 3);

    let set = RecordingSet::open(Path::new(RECORDINGS)).unwrap();
    let measured = measure_all(&set, |_| ()).unwrap();
    let learned = learned_from_others(&reply, &set.names(), &measured);
    for (told, learned) in reply["tables"].as_array().unwrap().iter().zip(learned) {
        assert_eq!(told[1]["crc"], learned);
    }
    let measured = measured.concat();
    let recorded = of(&reply, "recorded");
    assert_eq!(recorded.len(), measured.len());
    for slide in &recorded {
        let at = slide["at"].as_u64().unwrap() as usize;
        let traction = measured[at].measurement.properties.get(Property::Traction);
        let told = slide["measured"]["traction_n"].as_f64();
        assert_eq!(told.map(|x| x as f32), traction, "{slide}");
    }
    // each once
    let mut places: Vec<u64> = recorded.iter().map(|s| s["at"].as_u64().unwrap()).collect();
    places.sort_unstable();
    places.dedup();
    assert_eq!(places.len(), measured.len());

    // before each slide what would be chosen and why, after it what is probable
    let happened = reply["happened"].as_array().unwrap();
    for (n, slide) in happened.iter().enumerate() {
        if slide["what"] != "slide" {
            continue;
        }
        assert_eq!(happened[n - 1]["what"], "recorded");
        let chosen = &happened[n - 2];
        assert_eq!(chosen["what"], "chosen");
        let expected = chosen["expected"].as_array().unwrap();
        assert_eq!(expected.len(), 3);
        let benefit = |n: usize| expected[n]["benefit"].as_f64().unwrap();
        assert!(benefit(0) >= benefit(1) && benefit(1) >= benefit(2));
        assert_eq!(chosen["movement"], expected[0]["movement"]);
        let posterior = slide["standing"]["posterior"].as_array().unwrap();
        let sum: f64 = posterior.iter().map(|p| p.as_f64().unwrap()).sum();
        assert!((sum - 1.0).abs() < 1e-3, "{sum}");
        assert!(slide["place"].is_array());
    }
    // an exploration of each texture with each table; the name is right where the tables are good for anything
    let (mut on, mut right, mut answers) = (Value::Null, 0, 0);
    for one in happened {
        match one["what"].as_str().unwrap() {
            "recorded" => on = one["texture"].clone(),
            "verdict" => {
                answers += 1;
                right += usize::from(one["texture"] == on);
            }
            _ => {}
        }
    }
    assert_eq!(answers, 18);
    assert!(right >= 16, "{right} of {answers}");

    let slide = &set.load_texture(1).unwrap()[2];
    let streams: Value = serde_json::from_str(&remote.ask(r#"{"do":"recorded","at":11}"#)).unwrap();
    let streams = &streams["streams"];
    let pac: Vec<i16> = serde_json::from_value(streams["pac"].clone()).unwrap();
    assert_eq!(pac, [slide.still(), slide.pac()].concat());
    assert_eq!(streams["still"], slide.still().len());
    assert_eq!(streams["pdc"], json!(slide.pdc));
    assert_eq!(streams["shear_mn"], json!(slide.shear_mn().unwrap()));
    assert_eq!(streams["pdc_rate_hz"], slide.pdc_rate_hz);
    assert!(streams["spectra"].as_array().unwrap().len() > 50);
    let none: Value = serde_json::from_str(&remote.ask(r#"{"do":"recorded","at":54}"#)).unwrap();
    assert_eq!(none["why"], "there is no such slide");
}

#[test]
fn a_deeper_folder_shows_what_the_folder_shows() {
    let folder = opened(&recordings("a/"));
    // files that lie there besides do no harm
    let mut files = recordings("deep/a/");
    files.insert("deep/notes.txt".to_owned(), b"notes".to_vec());
    assert_eq!(opened(&files)["happened"], folder["happened"]);
}

#[test]
fn one_texture_is_judged_with_the_world_that_comes_with_the_page() {
    let reply = opened(&one_texture());
    let said = reply["said"].as_str().unwrap();
    assert!(said.contains("from two textures or more. So"), "{said}");
    assert!(said.contains("simulated world 1"), "{said}");
    assert_eq!(of(&reply, "recorded").len(), 9);
    let known = &reply["tables"][0][1];
    assert_eq!(known["textures"].as_array().unwrap().len(), 117);
    assert_eq!(of(&reply, "slide").len(), 9);
    assert_eq!(of(&reply, "verdict").len(), 1);

    // nor of another finger
    let mut files = one_texture();
    let manifest = String::from_utf8(files["paper/manifest.csv"].clone()).unwrap();
    let mems = manifest.replace(",biotac,", ",mems,").into_bytes();
    files.insert("paper/manifest.csv".to_owned(), mems);
    let reply = opened(&files);
    let said = reply["said"].as_str().unwrap();
    assert!(said.contains("So no probabilities are shown"), "{said}");
    assert_eq!(of(&reply, "recorded").len(), 9);
    assert_eq!(reply["happened"].as_array().unwrap().len(), 9);
}

#[test]
fn what_cannot_be_shown_is_told_with_what_to_do() {
    let mut without_manifest = recordings("a/");
    without_manifest.remove("a/manifest.csv");
    let mut without_file = recordings("a/");
    without_file.remove("a/t001_s001_pac.npy");
    let mut changed = recordings("a/");
    changed.get_mut("a/t001_s001_pac.npy").unwrap()[200] ^= 1;
    let mut unfinished = without_manifest.clone();
    unfinished.insert("a/INCOMPLETE".to_owned(), b"tactus device record".to_vec());

    for (files, wanted) in [
        (
            without_manifest,
            "a: neither manifest.csv nor manifest.json in this folder",
        ),
        (
            without_file,
            "a/t001_s001_pac.npy: is in manifest.csv, but not among the files that were given: give the whole folder",
        ),
        (changed, "a/t001_s001_pac.npy: "),
        (unfinished, "a: recordings that are not whole, by: "),
        (
            one("holiday.jpg", vec![0xff, 0xd8]),
            "holiday.jpg: neither a session's log (.jsonl",
        ),
        (
            one("a.jsonl", b"no log".to_vec()),
            "a.jsonl: line 1 is no line of a session's log",
        ),
        (Files::new(), "what was given: there is no file in it"),
    ] {
        let why = refused(&files);
        assert!(
            why.starts_with(wanted),
            "{wanted}\nis not how this begins:\n{why}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// A panic would end the page's module. What comes is shown, or refused in a sentence.
    #[test]
    fn odd_messages_and_tables_never_panic(
        odd in odd(),
        kind in prop_oneof!["Chosen", "SlideReport", "Verdict", "Block", "Identify", "TablePart"],
        every in 1_u32..4,
        way in proptest::collection::vec(any::<usize>(), 0..6),
    ) {
        let mut seen = 0;
        let lines = SESSION.lines().map(|line| {
            seen += u32::from(line.contains(&kind));
            if !line.contains(&kind) || !seen.is_multiple_of(every) {
                return line.to_owned();
            }
            let mut value: Value = serde_json::from_str(line).unwrap();
            put(&mut value, &mut way.iter().copied(), &odd);
            value.to_string()
        });
        let log = lines.collect::<Vec<_>>().join("\n");
        let reply = ask(&mut Remote::default(), &one("odd.jsonl", log.into_bytes()));
        prop_assert!(reply["is"] == "frame" || reply["why"].is_string(), "{reply}");
    }

    #[test]
    fn damaged_files_never_panic(
        cut in any::<prop::sample::Index>(),
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
    ) {
        let mut file = SESSION.clone().into_bytes();
        for (at, byte) in changes {
            let at = at.index(file.len());
            file[at] ^= byte;
        }
        file.truncate(cut.index(file.len() + 1));
        let reply = ask(&mut Remote::default(), &one("damaged.jsonl", file));
        prop_assert!(reply["is"] == "frame" || reply["why"].is_string(), "{reply}");
    }
}

/// With TACTUS_PAGE_FILES, `cargo xtask test --step page` drops what is in that folder then on the page in a browser.
#[test]
fn leaves_files_for_a_page() {
    let Some(folder) = std::env::var_os("TACTUS_PAGE_FILES") else {
        return;
    };
    let folder = Path::new(&folder);
    // of an earlier run
    let _ = fs::remove_dir_all(folder);
    fs::create_dir_all(folder.join("no-manifest")).unwrap();
    let log = folder.join("session.jsonl");
    fs::write(&log, SESSION.as_bytes()).unwrap();
    for (name, bytes) in [
        ("some.txt", b"some".to_vec()),
        ("no-manifest/t001_s001_pac.npy", vec![0]),
    ] {
        fs::write(folder.join(name), bytes).unwrap();
    }
}
