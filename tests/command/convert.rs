//! `tactus convert`: what others' readers find in the files is what the log holds.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use mcap::MessageStream;
use serde_json::Value;

use crate::{Scratch, array};

/// Time and content of all messages of a file, by channel; each channel's schema names each field.
fn messages(bytes: &[u8]) -> BTreeMap<String, Vec<(u64, Value)>> {
    let mut found: BTreeMap<String, Vec<(u64, Value)>> = BTreeMap::new();
    for message in MessageStream::new(bytes).unwrap() {
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

#[test]
fn an_mcap_of_a_log_holds_what_the_probe_said_when_it_said_it() {
    let at = Scratch::new();
    let log = at.log("identify");
    at.printed("convert identify.jsonl --mcap file");
    let found = messages(&at.read("file"));
    let lines: Vec<Value> = log
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let of = |kind: &str| -> Vec<(u64, &Value)> {
        let reports = lines.iter().filter_map(|line| line.get("report"));
        let of_kind = reports.filter_map(|r| Some((r["at_ms"].as_u64()?, r["event"].get(kind)?)));
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
    let blocks = of("Block");
    let sent = blocks.iter().flat_map(|(_, block)| array(&block["pac"]));
    assert!(found["/pac"].iter().map(|(_, m)| &m["counts"]).eq(sent));
    // gap-free, but for where the still finger's samples end
    let steps = found["/pac"].windows(2).map(|pair| pair[1].0 - pair[0].0);
    let gaps = steps.filter(|step| !(454_000..=455_000).contains(step));
    assert!(gaps.count() <= 1);
    let [(when, verdict)] = of("Verdict")[..] else {
        panic!()
    };
    assert_eq!(found["/verdict"][0].0, when * 1_000_000);
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
    read_by_python(&at.path("file"), found.values().map(Vec::len).sum());
}

#[test]
fn a_file_is_not_written_over_and_layouts_show_channels_that_there_are() {
    let at = Scratch::new();
    at.log("identify");
    at.printed("convert identify.jsonl --mcap file");
    let bytes = at.read("file");
    at.error("convert identify.jsonl --mcap file", 1);
    assert!(at.read("file") == bytes);
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let docs = |name| format!("{}/../../docs/{name}", env!("CARGO_MANIFEST_DIR"));
    let page = fs::read_to_string(docs("src/convert.md")).unwrap();
    let mut fields = Vec::new();
    for channel in summary.channels.values() {
        let topic = &channel.topic;
        assert!(page.contains(&format!("| `{topic}` |")), "{topic}");
        let schema = channel.schema.as_ref().unwrap();
        let schema: Value = serde_json::from_slice(&schema.data).unwrap();
        fields.push(topic.clone());
        let names = schema["properties"].as_object().unwrap().keys();
        fields.extend(names.map(|name| format!("{topic}/{name}")));
    }
    for layout in ["foxglove.json", "plotjuggler.xml"] {
        let layout = fs::read_to_string(docs(layout)).unwrap();
        let words = layout
            .split('"')
            .filter(|word| word.starts_with('/') && !word.contains('\n'));
        let shown: Vec<String> = words.map(|word| word.replace('.', "/")).collect();
        assert!(shown.len() >= 5);
        for field in shown {
            assert!(fields.contains(&field), "{field}");
        }
    }
}

/// The reader that Foxglove publishes finds as many messages; skipped where it is not installed.
fn read_by_python(file: &Path, messages: usize) {
    const PROGRAM: &str = "import sys, json
from mcap.reader import make_reader
n = 0
for schema, channel, message in make_reader(open(sys.argv[1], 'rb')).iter_messages():
    json.loads(message.data)
    assert channel.message_encoding == 'json' and schema.encoding == 'jsonschema'
    n += 1
assert n == int(sys.argv[2]), n";
    let python = |program| {
        let mut python = Command::new("python3");
        python
            .args(["-c", program])
            .arg(file)
            .arg(messages.to_string())
            .output()
    };
    if !python("import mcap").is_ok_and(|has| has.status.success()) {
        return tactus_tests::skipped("no python3 with mcap (pip install mcap)");
    }
    let ran = python(PROGRAM).unwrap();
    assert!(ran.status.success(), "{ran:?}");
}

#[test]
fn samples_that_a_log_lacks_are_named_where_they_are_missing() {
    let at = Scratch::new();
    let log = at.log("identify");
    let told = |file: &str| -> usize {
        at.printed(&format!("convert identify.jsonl --mcap {file}"));
        let log = messages(&at.read(file)).remove("/log").unwrap_or_default();
        let missing = log.iter().filter(|(_, message)| {
            let said = message["message"].as_str().unwrap();
            said.contains("samples before this are missing")
        });
        missing.count()
    };
    assert_eq!(told("whole"), 0);
    let is_block = |line: &&str| line.contains("\"Block\":{\"number\":10,");
    let lost = log.lines().find(is_block).unwrap();
    at.write("identify.jsonl", log.replace(&format!("{lost}\n"), ""));
    assert_eq!(told("gap"), 1);
}
