//! Wrong arguments and damaged files: the command says what is wrong and what to do, and writes nothing.

use std::fs;
use std::path::Path;

use tactus_tests::properties_csv;

use crate::kills::files;
use crate::{SIMULATED, Scratch, assert_says};

/// Rows of a text, each split at `=>`.
fn rows(text: &str) -> impl Iterator<Item = (&str, &str)> {
    let rows = text.lines().filter(|row| !row.starts_with('#'));
    rows.map(|row| row.split_once(" => ").unwrap())
}

#[test]
fn senseless_arguments_are_refused_with_a_hint() {
    let at = good();
    let before = files(&at.path(""));
    for (line, hints) in rows(include_str!("refusals.txt")) {
        let (code, line) = line.split_once(' ').unwrap();
        let said = at.error(line, code.parse().unwrap());
        for hint in hints.split(" + ") {
            assert!(said.contains(hint), "{line}: {said}");
        }
        assert!(
            files(&at.path("")) == before,
            "{line}: something was written"
        );
    }
    // the environment does not stand in the way of what was asked for
    let features = at
        .command("features --format csv")
        .env("TACTUS_RECORDINGS", SIMULATED)
        .output();
    assert_eq!(
        features
            .unwrap()
            .stdout
            .split(|byte| *byte == b'\n')
            .count(),
        56
    );
    let mut given = at.command("evaluate --properties no/such/file");
    let given = crate::ran(given.env("TACTUS_RECORDINGS", SIMULATED));
    assert_says(&given.said, &["no/such/file"]);
    // nobody is there, but it is understood
    let mut status = at.command("device status");
    let status = crate::ran(status.env("TACTUS_PORT", "127.0.0.1:1"));
    assert_says(&status.said, &["127.0.0.1:1", "emulated board"]);
}

const LEARN: &str = "learn --recordings . --train-slides 2 --out out.tact";
const PROPERTIES: &str = "evaluate --properties properties.csv --method paper --runs 20";
const TABLE: &str = "table t.tact";
const LOG: &str = "device log identify.jsonl";

/// A folder with a good file of each kind.
fn good() -> Scratch {
    let at = Scratch::new();
    at.recordings(".", |line| Some(line.to_owned()));
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden");
    at.write("t.tact", fs::read(golden.join("fused-bands.tact")).unwrap());
    at.write("properties.csv", properties_csv(3, 3, |_, _, _| 5));
    at.log("identify");
    at
}

#[test]
fn damaged_files_are_refused_and_named() {
    let at = good();
    for command in [LEARN, PROPERTIES, TABLE, LOG] {
        let good = at.run(command);
        assert_eq!((good.code, &good.said[..]), (Some(0), ""), "{command}");
    }
    fs::remove_file(at.path("out.tact")).unwrap();
    for (row, expected) in rows(include_str!("damages.txt")) {
        let [name, command, damage] = row.split(' ').collect::<Vec<_>>()[..] else {
            panic!("{row}");
        };
        let command = match command {
            "LEARN" => LEARN,
            "PROPERTIES" => PROPERTIES,
            "TABLE" => TABLE,
            _ => LOG,
        };
        let whole = at.read(name);
        let length = whole.len() as u64;
        let open = || {
            fs::OpenOptions::new()
                .write(true)
                .open(at.path(name))
                .unwrap()
        };
        match damage {
            "missing" => fs::remove_file(at.path(name)).unwrap(),
            // longer than any can be
            "huge" => open().set_len(6 << 30).unwrap(),
            "empty" => open().set_len(0).unwrap(),
            // in the middle of a line or a value
            "cut" => open().set_len(length / 2 + 3).unwrap(),
            "picture" => at.write(name, b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01"),
            _ => {
                let mut bytes = whole.clone();
                let place = damage.strip_prefix("byte-").unwrap();
                bytes[place.parse::<usize>().unwrap()] ^= 1;
                at.write(name, bytes);
            }
        }
        let said = at.error(command, 1);
        let line = said.lines().next().unwrap();
        let is_right = line.starts_with("error: ") && line.contains(expected);
        assert!(is_right, "{row}: {line}");
        assert!(
            !at.path("out.tact").exists(),
            "{row}: something was written"
        );
        at.write(name, whole);
    }
}
