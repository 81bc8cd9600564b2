//! Wrote `reports-9.jsonl` in this folder: see README.md. It is compiled at that commit only, and shall stay as it is.

use std::fs;
use std::io::Write as _;
use std::path::PathBuf;

use serde_json::{Value, json};
use tactus_core::wire::*;

fn main() {
    let out = PathBuf::from(std::env::args().nth(1).expect("a folder"));
    let text = fs::read_to_string(out.join("reports-7.jsonl")).unwrap();
    let mut reports: Vec<Report> = text
        .lines()
        .map(|line| {
            let mut line: Value = serde_json::from_str(line).unwrap();
            serde_json::from_value(line["message"].take()).unwrap()
        })
        .collect();
    for report in &mut reports {
        if let Event::Booted { protocol, .. } = &mut report.event {
            *protocol = PROTOCOL;
        }
    }
    for pace in [i16::MIN, -341, 0, i16::MAX] {
        reports.push(Report {
            number: 301,
            at_ms: 80_000,
            event: Event::Pace(pace),
        });
    }
    let mut file = fs::File::create(out.join("reports-9.jsonl")).unwrap();
    for message in reports {
        let mut buffer = [0; MAX_FRAME + 1];
        let frame = encode(&message, &mut buffer).unwrap();
        let frame: String = frame.iter().map(|b| format!("{b:02x}")).collect();
        writeln!(file, "{}", json!({"frame": frame, "message": message})).unwrap();
    }
}
