//! Wrote `requests-7.jsonl`, `reports-7.jsonl` and `reasons-7.jsonl` in this folder: see README.md. It is compiled at that
//! commit only, and shall stay as it is.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use tactus_core::wire::*;

fn main() {
    let out = PathBuf::from(std::env::args().nth(1).expect("a folder"));
    lines(&out, "requests-7.jsonl", requests(&out));
    lines(&out, "reports-7.jsonl", reports(&out));
    lines(&out, "reasons-7.jsonl", failures(&out));
}

fn lines<M: Serialize>(out: &Path, name: &str, messages: Vec<M>) {
    let mut file = fs::File::create(out.join(name)).unwrap();
    for message in messages {
        let mut buffer = [0; MAX_FRAME + 1];
        let frame = encode(&message, &mut buffer).unwrap();
        let frame: String = frame.iter().map(|b| format!("{b:02x}")).collect();
        writeln!(file, "{}", json!({"frame": frame, "message": message})).unwrap();
    }
}

/// The messages of a file of version 6, with the fields of today.
fn before<M: DeserializeOwned>(out: &Path, name: &str) -> Vec<M> {
    let text = fs::read_to_string(out.join(name)).unwrap();
    let message = |line: &str| {
        let mut line: Value = serde_json::from_str(line).unwrap();
        serde_json::from_value(line["message"].take()).unwrap()
    };
    text.lines().map(message).collect()
}

/// That each of `0..wanted` is there.
fn all(kinds: impl Iterator<Item = usize>, wanted: usize) {
    let kinds: std::collections::BTreeSet<usize> = kinds.collect();
    assert_eq!(kinds.into_iter().collect::<Vec<_>>(), (0..wanted).collect::<Vec<_>>());
}

fn requests(out: &Path) -> Vec<Request> {
    let mut requests: Vec<Request> = before(out, "requests-6.jsonl");
    for command in [Command::SetHighForce(false), Command::SetHighForce(true)] {
        requests.push(Request { id: 300, command });
    }
    // a message that is not listed does not compile
    let kind = |request: &Request| match request.command {
        Command::Status => 0,
        Command::Home => 1,
        Command::Stop => 2,
        Command::Identify(_) => 3,
        Command::Label(_) => 4,
        Command::Train(_) => 5,
        Command::Rename { .. } => 6,
        Command::Forget(Forget::Texture(_) | Forget::SelfLearned | Forget::Training(_)) => 7,
        Command::Calibrate => 8,
        Command::ReadCalibration => 9,
        Command::WriteCalibration(_) => 10,
        Command::Stream(_) => 11,
        Command::ReadTable(_) => 12,
        Command::BeginTable(_) => 13,
        Command::WriteTable { .. } => 14,
        Command::CommitTable => 15,
        Command::FactoryTable => 16,
        Command::Weigh(_) => 17,
        Command::Verify(_) => 18,
        Command::SetFalseAlarm(_) => 19,
        Command::SetHighForce(_) => 20,
    };
    all(requests.iter().map(kind), 21);
    requests
}

fn reports(out: &Path) -> Vec<Report> {
    let mut reports: Vec<Report> = before(out, "reports-6.jsonl");
    let mut statuses = Vec::new();
    for report in &mut reports {
        match &mut report.event {
            Event::Booted { protocol, .. } => *protocol = PROTOCOL,
            Event::Status(status) => statuses.push(status.clone()),
            _ => {}
        }
    }
    let mut events = Vec::new();
    for status in statuses {
        events.push(Event::Status(Status {
            high_force: true,
            ..status
        }));
    }
    reports.extend(events.into_iter().map(|event| Report {
        number: 300,
        at_ms: 70_000,
        event,
    }));
    let kind = |report: &Report| match &report.event {
        Event::Booted { .. } => 0,
        Event::Status(_) => 1,
        Event::Done(_) => 2,
        Event::Refused { .. } => 3,
        Event::Damaged(_) => 4,
        Event::Phase(_) => 5,
        Event::Chosen { .. } => 6,
        Event::SlideReport { .. } => 7,
        Event::Rejected { .. } => 8,
        Event::Verdict(_) => 9,
        Event::TextureLearned(_) => 10,
        Event::TrainingSlide { .. } => 11,
        Event::Live(_) => 12,
        Event::Fault(_) => 13,
        Event::Block(_) => 14,
        Event::Calibration(_) => 15,
        Event::TablePart { .. } => 16,
        Event::Trouble(_) => 17,
        Event::Prompt(_) => 18,
        Event::Pdc(_) => 19,
        Event::Weighed { .. } => 20,
        Event::Verified { .. } => 21,
    };
    all(reports.iter().map(kind), 22);
    reports
}

/// Those of version 6, in which no reason has become another.
fn failures(out: &Path) -> Vec<Failure> {
    let mut failures: Vec<Failure> = before(out, "reasons-6.jsonl");
    failures.extend(before::<Failure>(out, "reasons-6-records.jsonl"));
    let kind = |failure: &Failure| match failure {
        Failure::Said(_) => 0,
        Failure::Busy => 1,
        Failure::Rig(_) => 2,
        Failure::Explorer(_) => 3,
        Failure::Slide(_) => 4,
        Failure::NoGoodSlide(_) => 5,
        Failure::Movement(_) => 6,
        Failure::Training(_) => 7,
        Failure::Rejected => 8,
        Failure::Memory(_) => 9,
        Failure::Calibration(_) => 10,
        Failure::CalibrationLength => 11,
        Failure::NoSuchByte => 12,
        Failure::NotLearned(_) => 13,
        Failure::OtherProbe => 14,
        Failure::NoLimits => 15,
        Failure::FalseAlarm => 16,
    };
    all(failures.iter().map(kind), 17);
    failures
}
