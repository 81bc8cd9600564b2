//! `tactus convert`: what others' readers find in the files is what the log holds.

use std::collections::BTreeMap;
use std::fs;
use std::io::Read as _;
use std::path::Path;
use std::process::{Command, Output};

use flate2::read::GzDecoder;
use mcap::MessageStream;
use serde_json::Value;

fn tactus(arguments: &[&str]) -> Output {
    let mut tactus = Command::new(env!("CARGO_BIN_EXE_tactus"));
    tactus.args(arguments).output().unwrap()
}

fn convert(from: &Path, kind: &str, to: &Path) {
    let out = tactus(&["convert", text(from), kind, text(to)]);
    assert!(out.status.success(), "{out:?}");
    let bytes = fs::metadata(to).unwrap().len();
    let said = String::from_utf8(out.stdout).unwrap();
    assert!(said.ends_with(&format!(": {bytes} bytes\n")), "{said}");
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Time and content of all messages of a file, by channel; each channel's schema names each field.
fn messages(file: &Path) -> BTreeMap<String, Vec<(u64, Value)>> {
    let bytes = fs::read(file).unwrap();
    let mut found: BTreeMap<String, Vec<(u64, Value)>> = BTreeMap::new();
    for message in MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let channel = &message.channel;
        let content: Value = serde_json::from_slice(&message.data).unwrap();
        let schema = channel.schema.as_ref().unwrap();
        let schema: Value = serde_json::from_slice(&schema.data).unwrap();
        for name in content.as_object().unwrap().keys() {
            let known = schema["properties"].get(name).is_some();
            // a verdict has more than its schema promises
            assert!(
                known || channel.topic == "/verdict",
                "{}: {name}",
                channel.topic
            );
        }
        let all = found.entry(channel.topic.clone()).or_default();
        all.push((message.log_time, content));
    }
    found
}

/// A session's log, unpacked.
fn session(folder: &Path) -> (std::path::PathBuf, Vec<Value>) {
    let packed = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/golden/identify.jsonl.gz"
    );
    let mut lines = String::new();
    let mut packed = GzDecoder::new(fs::File::open(packed).unwrap());
    packed.read_to_string(&mut lines).unwrap();
    let log = folder.join("session.jsonl");
    fs::write(&log, &lines).unwrap();
    let lines = lines
        .lines()
        .map(|line| serde_json::from_str(line).unwrap());
    (log, lines.collect())
}

#[test]
fn an_mcap_of_a_log_holds_what_the_probe_said_when_it_said_it() {
    let temp = tempfile::tempdir().unwrap();
    let (log, lines) = session(temp.path());
    let file = temp.path().join("session.mcap");
    convert(&log, "--mcap", &file);
    let found = messages(&file);
    let events: Vec<(u64, &Value)> = lines
        .iter()
        .filter_map(|line| {
            Some((
                line.get("report")?["at_ms"].as_u64()?,
                &line["report"]["event"],
            ))
        })
        .collect();
    let of = |kind: &str| -> Vec<(u64, &Value)> {
        let of_kind = events
            .iter()
            .filter_map(|(at, e)| Some((*at, e.get(kind)?)));
        of_kind.collect()
    };
    let live = of("Live");
    assert!(live.len() > 100);
    assert_eq!(found["/rig"].len(), live.len());
    for ((at, told), (at_ns, rig)) in live.iter().zip(&found["/rig"]) {
        assert_eq!(*at_ns, at * 1_000_000);
        assert_eq!(rig["force_mn"], told["force_mn"]);
        assert_eq!(rig["stage_mm"], told["stage_um"].as_f64().unwrap() * 1e-3);
    }
    let sent: Vec<Value> = of("Block")
        .iter()
        .flat_map(|(_, block)| block["pac"].as_array().unwrap().clone())
        .collect();
    let pac: Vec<Value> = found["/pac"]
        .iter()
        .map(|(_, m)| m["counts"].clone())
        .collect();
    assert_eq!(pac, sent);
    // gap-free, but for where the still finger's samples end
    let steps = found["/pac"].windows(2).map(|pair| pair[1].0 - pair[0].0);
    let gaps = steps.filter(|step| !(454_000..=455_000).contains(step));
    assert!(gaps.count() <= 1);
    let [(at, verdict)] = of("Verdict")[..] else {
        panic!()
    };
    assert_eq!(found["/verdict"][0].0, at * 1_000_000);
    assert_eq!(found["/verdict"][0].1["name"], verdict["name"]);
    // the table was read in this session: textures have their names
    let (_, last) = found["/posterior"].last().unwrap();
    assert_eq!(last["most_likely"], verdict["name"]);
    assert_eq!(
        last["all"][verdict["name"].as_str().unwrap()],
        last["probability"]
    );
    let asked = lines.iter().filter(|line| line.get("command").is_some());
    assert_eq!(found["/request"].len(), asked.count());
    read_by_python(&file, found.values().map(Vec::len).sum());
}

#[test]
fn files_go_through_pipes() {
    let temp = tempfile::tempdir().unwrap();
    let (log, _) = session(temp.path());
    let file = temp.path().join("session.mcap");
    convert(&log, "--mcap", &file);
    let piped = Command::new(env!("CARGO_BIN_EXE_tactus"))
        .args(["convert", "-", "--mcap", "-"])
        .stdin(fs::File::open(&log).unwrap())
        .output()
        .unwrap();
    assert!(piped.status.success(), "{piped:?}");
    // but for the name of where it is from, the same file
    let of = |bytes: &[u8]| {
        let messages = MessageStream::new(bytes).unwrap().map(Result::unwrap);
        messages
            .map(|m| (m.log_time, m.data.to_vec()))
            .collect::<Vec<_>>()
    };
    assert_eq!(of(&piped.stdout), of(&fs::read(&file).unwrap()));
}

#[test]
fn what_cannot_be_converted_is_told() {
    let temp = tempfile::tempdir().unwrap();
    let (log, _) = session(temp.path());
    let to = temp.path().join("there");
    fs::write(&to, "mine").unwrap();
    let over = tactus(&["convert", text(&log), "--mcap", text(&to)]);
    assert_eq!(over.status.code(), Some(1));
    assert_eq!(fs::read(&to).unwrap(), b"mine");
    let nothing = tactus(&["convert", text(&log)]);
    assert_eq!(nothing.status.code(), Some(2));
}

#[test]
fn layouts_show_channels_that_there_are() {
    let temp = tempfile::tempdir().unwrap();
    let (log, _) = session(temp.path());
    let file = temp.path().join("session.mcap");
    convert(&log, "--mcap", &file);
    let bytes = fs::read(&file).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let mut fields = Vec::new();
    for channel in summary.channels.values() {
        let schema = channel.schema.as_ref().unwrap();
        let schema: Value = serde_json::from_slice(&schema.data).unwrap();
        fields.push(channel.topic.clone());
        let names = schema["properties"].as_object().unwrap().keys();
        fields.extend(names.map(|name| format!("{}/{name}", channel.topic)));
    }
    let docs = |name| format!("{}/../../docs/{name}", env!("CARGO_MANIFEST_DIR"));
    let page = fs::read_to_string(docs("src/convert.md")).unwrap();
    for channel in summary.channels.values() {
        assert!(page.contains(&format!("| `{}` |", channel.topic)));
    }
    let foxglove = fs::read_to_string(docs("foxglove.json")).unwrap();
    serde_json::from_str::<Value>(&foxglove).unwrap();
    let plotjuggler = fs::read_to_string(docs("plotjuggler.xml")).unwrap();
    roxmltree::Document::parse(&plotjuggler).unwrap();
    for layout in [foxglove, plotjuggler] {
        let shown: Vec<String> = layout
            .split('"')
            .filter(|word| word.starts_with('/') && !word.contains('\n'))
            .map(|word| word.replace('.', "/"))
            .collect();
        assert!(shown.len() >= 5);
        for field in shown {
            assert!(fields.contains(&field), "{field}");
        }
    }
}

/// The reader that Foxglove publishes finds as many messages.
fn read_by_python(file: &Path, messages: usize) {
    python(
        "import sys, json
from mcap.reader import make_reader
n = 0
for schema, channel, message in make_reader(open(sys.argv[1], 'rb')).iter_messages():
    json.loads(message.data)
    assert channel.message_encoding == 'json' and schema.encoding == 'jsonschema'
    n += 1
assert n == int(sys.argv[2]), n",
        &[text(file), &messages.to_string()],
        "mcap",
    );
}

/// Runs a program of Python that needs a package; skipped where there is none.
fn python(program: &str, arguments: &[&str], package: &str) {
    let python = || Command::new("python3");
    let has = python().args(["-c", &format!("import {package}")]).output();
    if !has.is_ok_and(|has| has.status.success()) {
        tactus_tests::skipped(&format!(
            "no python3 with {package} (pip install {package})"
        ));
        return;
    }
    let ran = python()
        .args(["-c", program])
        .args(arguments)
        .output()
        .unwrap();
    assert!(
        ran.status.success(),
        "{}",
        String::from_utf8_lossy(&ran.stderr)
    );
}
