//! The client that the book has beside the page of the link: 140 lines of Python, which know the messages from
//! `wire.json` alone.

use std::io::Write as _;
use std::process::{Command, Stdio};
use std::thread;

use serde_json::Value;
use tactus_core::features::Movement;
use tactus_core::rig::{FAULTS, RigError};
use tactus_core::sensor::{FingerCode, FingerName};
use tactus_core::table::Name;
use tactus_core::wire::{self, Event, Forget, MAX_FRAME, PROTOCOL, Report, Request, Reset};
use tactus_core::wire::{Again, Failure, Identify, MemoryError, Prompt, Rejection, Train};

use super::software::Bench;
use crate::Scratch;

const PAGES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/src");
/// Reports in frames from stdin, as lines of JSON; requests as lines of JSON after them, as frames in hexadecimal.
const BOTH: &str = "
import sys, json, client
for line in sys.stdin:
    if line[0] == '{':
        print(client.frame(client.write('Request', json.loads(line))).hex())
    else:
        print(json.dumps(client.read('Report', client.message(bytes.fromhex(line)[:-1]))[0]))
";

/// Python, which finds the client; `None` where there is none.
fn python() -> Option<Command> {
    let there = Command::new("python3").arg("--version").output();
    if there.is_ok_and(|out| out.status.success()) {
        let mut python = Command::new("python3");
        python.current_dir(PAGES).env("PYTHONPATH", PAGES);
        python.env("PYTHONDONTWRITEBYTECODE", "1");
        return Some(python);
    }
    let required = std::env::var_os("CI").is_some();
    assert!(!required, "no python3: apt-get install python3");
    tactus_tests::skipped("no python3");
    None
}

fn piped(mut command: Command, input: &str) -> String {
    command.stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let input = input.to_owned();
    let writes = thread::spawn(move || stdin.write_all(input.as_bytes()).unwrap());
    let out = child.wait_with_output().unwrap();
    writes.join().unwrap();
    assert!(out.status.success());
    String::from_utf8(out.stdout).unwrap()
}

fn hex(message: &impl serde::Serialize) -> String {
    let mut buffer = [0; MAX_FRAME + 1];
    let frame = wire::encode(message, &mut buffer).unwrap();
    frame.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Both are the same; numbers as exact as the line has them, and a finger has its number there.
fn same(ours: &Value, theirs: &Value) -> bool {
    match (ours, theirs) {
        (Value::Object(a), Value::Object(b)) => {
            let mut pairs = a.iter();
            a.len() == b.len() && pairs.all(|(key, a)| b.get(key).is_some_and(|b| same(a, b)))
        }
        (Value::Array(a), Value::Array(b)) => {
            a.len() == b.len() && a.iter().zip(b).all(|(a, b)| same(a, b))
        }
        (Value::Number(a), Value::Number(b)) => {
            a == b || a.as_f64().unwrap() as f32 == b.as_f64().unwrap() as f32
        }
        (Value::String(name), Value::Number(number)) => {
            let name: FingerName = name.parse().unwrap();
            number.as_u64()
                == FingerName::ALL
                    .iter()
                    .position(|n| *n == name)
                    .map(|n| n as u64)
        }
        _ => ours == theirs,
    }
}

/// All reports of two sessions, and those that they have not.
fn reports() -> Vec<Report> {
    let mut reports = Vec::new();
    for log in ["identify", "learning"] {
        let lines = Scratch::new().log(log);
        for line in lines.lines() {
            let line: Value = serde_json::from_str(line).unwrap();
            if let Some(report) = line.get("report") {
                reports.push(serde_json::from_value(report.clone()).unwrap());
            }
        }
    }
    assert!(reports.len() > 1000);
    let name = Name::try_from("Böse Überraschung").unwrap();
    let why = Failure::Memory(MemoryError::Unknown(name));
    let slide = Rejection::Rig(RigError::Fault(FAULTS[3].fault));
    let mut others = vec![
        Event::Booted {
            protocol: PROTOCOL,
            version: "0.2.0".try_into().unwrap(),
            reset: Reset::Watchdog,
            last_words: Some(wire::text("x".repeat(119))),
            finger: FingerCode::of(FingerName::Mems),
        },
        Event::Refused { id: 300, why },
        Event::Rejected {
            slide: 3,
            why: Failure::NoGoodSlide(slide),
        },
        Event::Weighed {
            mn: 1471,
            counts: -12.75,
        },
        Event::Prompt(Prompt::Again(Again::TooUneven)),
        Event::Prompt(Prompt::Weigh(882)),
        Event::Early(500),
        Event::Pdc((-300..-280).collect()),
    ];
    others.extend(FAULTS.iter().map(|row| Event::Fault(row.fault)));
    reports.extend((0..).zip(others).map(|(number, event)| Report {
        number,
        at_ms: u32::MAX,
        event,
    }));
    reports
}

fn requests() -> Vec<Request> {
    let commands = [
        wire::Command::Status,
        wire::Command::Identify(Identify {
            among: (0..100).collect(),
            false_alarm: Some(0.02),
            ..Identify::default()
        }),
        wire::Command::Train(Train {
            name: "Burlap".try_into().unwrap(),
            trials: 5,
            pilot: true,
            seed: u32::MAX,
        }),
        wire::Command::Rename {
            from: "a".try_into().unwrap(),
            to: "é".try_into().unwrap(),
        },
        wire::Command::Forget(Forget::SelfLearned),
        wire::Command::WriteTable {
            offset: 70_000,
            bytes: (0..=255).collect(),
        },
        wire::Command::SetFalseAlarm(None),
        wire::Command::SetHighForce(true),
    ];
    let numbered = (127..).zip(commands);
    numbered
        .map(|(id, command)| Request { id, command })
        .collect()
}

#[test]
fn another_language_reads_and_writes_every_message_by_the_schema() {
    let Some(mut both) = python() else { return };
    let (reports, requests) = (reports(), requests());
    let mut input: Vec<String> = reports.iter().map(hex).collect();
    input.extend(requests.iter().map(|r| serde_json::to_string(r).unwrap()));
    both.args(["-c", BOTH]);
    let out = piped(both, &(input.join("\n") + "\n"));
    let lines: Vec<&str> = out.lines().collect();
    assert_eq!(lines.len(), reports.len() + requests.len());
    for (report, line) in reports.iter().zip(&lines) {
        let theirs = serde_json::from_str(line).unwrap();
        let ours = serde_json::to_value(report).unwrap();
        assert!(same(&ours, &theirs), "{ours}\n{theirs}");
    }
    for (request, line) in requests.iter().zip(&lines[reports.len()..]) {
        assert_eq!(*line, hex(request), "{request:?}");
    }
    // a movement is whole numbers on the line
    let movement = serde_json::to_value(Movement::FOR_FINENESS).unwrap();
    assert!(out.contains(&movement.to_string().replace(',', ", ")));
}

#[test]
fn a_client_of_another_language_identifies() {
    let Some(mut client) = python() else { return };
    let bench = Bench::new(1000);
    let told = bench.json("identify --seed 7", 0);
    bench.asked();
    let wanted = r#"{"threshold": 0.99, "max_slides": 10, "open": true, "seed": 7}"#;
    let out = client
        .args(["client.py", &bench.port, "Identify", wanted])
        .output();
    let out = out.unwrap();
    assert_eq!(out.status.code(), Some(0), "{out:?}");
    let reports = String::from_utf8(out.stdout).unwrap();
    let reports = reports
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap());
    let verdicts: Vec<Value> = reports
        .filter_map(|report| report["event"].get("Verdict").cloned())
        .collect();
    let [verdict] = &verdicts[..] else {
        panic!("{verdicts:?}")
    };
    assert_eq!(
        verdict["slides"].as_u64(),
        told["slides"].as_array().map(|all| all.len() as u64)
    );
    assert!(matches!(
        bench.asked()[..],
        [wire::Command::Identify(_), ..]
    ));
    let refused = python()
        .unwrap()
        .args(["client.py", &bench.port, "Forget", r#"{"Texture": "none"}"#])
        .output()
        .unwrap();
    assert_eq!(refused.status.code(), Some(1), "{refused:?}");
}
