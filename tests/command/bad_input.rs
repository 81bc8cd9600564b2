//! Damaged files: the command names the file and what is wrong with it, ends with 1, and writes nothing.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use tactus_tests::properties_csv;
use tempfile::TempDir;

const LEARN: &str = "learn --recordings DIR --train-slides 2 --out OUT";

/// A damage: the file, the command that reads it, what is written to it, and what the error says.
type Damage = (
    &'static str,
    &'static str,
    fn(Vec<u8>) -> Vec<u8>,
    &'static str,
);

const DAMAGES: [Damage; 12] = [
    (
        "manifest.csv",
        LEARN,
        empty,
        ":1: no column texture in the header",
    ),
    ("manifest.csv", LEARN, cut, "cut off or damaged"),
    ("manifest.csv", LEARN, picture, ":1: not UTF-8 text"),
    (
        "t001_s001_pac.npy",
        LEARN,
        cut,
        "the file was damaged or changed",
    ),
    (
        "properties.csv",
        PROPERTIES,
        empty,
        ":1: no column texture in the header",
    ),
    ("properties.csv", PROPERTIES, picture, ":1: not UTF-8 text"),
    ("t.tact", TABLE, empty, "truncated: 0 bytes of 16"),
    ("t.tact", TABLE, cut, "truncated: "),
    ("t.tact", TABLE, picture, "not a texture table"),
    ("session.jsonl", LOG, empty, "no exploration in this log"),
    ("session.jsonl", LOG, cut, "is no line of a session's log"),
    (
        "session.jsonl",
        LOG,
        picture,
        "line 1 is no line of a session's log",
    ),
];
const PROPERTIES: &str = "evaluate --properties DIR/properties.csv --method paper --runs 20";
const TABLE: &str = "table DIR/t.tact";
const LOG: &str = "device log replay DIR/session.jsonl";

/// What is said of a file that is not there.
const MISSING: [(&str, &str, &str); 5] = [
    (
        "manifest.csv",
        LEARN,
        "neither manifest.csv nor manifest.json in this folder",
    ),
    (
        "t001_s001_pac.npy",
        LEARN,
        "t001_s001_pac.npy: No such file",
    ),
    (
        "properties.csv",
        PROPERTIES,
        "properties.csv:1: No such file",
    ),
    (
        "t.tact",
        TABLE,
        "no table here, `tactus learn --out FILE` writes one",
    ),
    ("session.jsonl", LOG, "session.jsonl: No such file"),
];

/// What is said of a file that is longer than any can be.
const HUGE: [(&str, &str, &str); 4] = [
    (
        "manifest.csv",
        LEARN,
        "the table is longer than 67108864 bytes; split it",
    ),
    (
        "t001_s001_pac.npy",
        LEARN,
        "longer than the 8392704 bytes it can have",
    ),
    ("t.tact", TABLE, "other bytes follow the table"),
    ("session.jsonl", LOG, "is no line of a session's log"),
];

fn empty(_: Vec<u8>) -> Vec<u8> {
    Vec::new()
}

/// Ends in the middle of a line or a value.
fn cut(good: Vec<u8>) -> Vec<u8> {
    good[..good.len() / 2 + 3].to_vec()
}

fn picture(_: Vec<u8>) -> Vec<u8> {
    b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01".to_vec()
}

/// A folder with a good file of each kind.
fn good() -> TempDir {
    let folder = TempDir::new().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for entry in fs::read_dir(root.join("host-tools/recordings/simulated")).unwrap() {
        let entry = entry.unwrap();
        fs::copy(entry.path(), folder.path().join(entry.file_name())).unwrap();
    }
    fs::copy(
        root.join("tests/golden/fused-bands.tact"),
        folder.path().join("t.tact"),
    )
    .unwrap();
    let properties = properties_csv(3, 3, |_, _, _| 5);
    fs::write(folder.path().join("properties.csv"), properties).unwrap();
    let packed = fs::File::open(root.join("tests/golden/identify.jsonl.gz")).unwrap();
    let mut log = fs::File::create(folder.path().join("session.jsonl")).unwrap();
    std::io::copy(&mut flate2::read::GzDecoder::new(packed), &mut log).unwrap();
    folder
}

/// The exit code and the error; `OUT` of the command must not be there where it failed.
fn answer(command: &str, folder: &Path) -> (Option<i32>, String) {
    let out: PathBuf = folder.join("out.tact");
    let arguments = command.split(' ').map(|argument| match argument {
        "OUT" => out.to_str().unwrap().to_owned(),
        other => other.replace("DIR", folder.to_str().unwrap()),
    });
    let done = Command::new(env!("CARGO_BIN_EXE_tactus"))
        .args(arguments)
        .output()
        .unwrap();
    assert!(
        done.status.success() || !out.exists(),
        "{command}: something was written"
    );
    (done.status.code(), String::from_utf8(done.stderr).unwrap())
}

fn assert_refused(file: &str, command: &str, folder: &Path, expected: &str) {
    let (code, said) = answer(command, folder);
    assert_eq!(code, Some(1), "{file}: {said}");
    let line = said.lines().next().unwrap();
    let names_it = line.contains(folder.to_str().unwrap());
    assert!(
        line.starts_with("error: ") && names_it && line.contains(expected),
        "{file}: {line}"
    );
}

#[test]
fn damaged_files_are_refused_and_named() {
    let folder = good();
    let folder = folder.path();
    for command in [LEARN, PROPERTIES, TABLE, LOG] {
        assert_eq!(
            answer(command, folder),
            (Some(0), String::new()),
            "{command}"
        );
    }
    fs::remove_file(folder.join("out.tact")).unwrap();
    for (name, command, damage, expected) in DAMAGES {
        let file = folder.join(name);
        let whole = fs::read(&file).unwrap();
        fs::write(&file, damage(whole.clone())).unwrap();
        assert_refused(name, command, folder, expected);
        fs::write(&file, whole).unwrap();
    }
    for (name, command, expected) in MISSING {
        let (file, away) = (folder.join(name), folder.join("away"));
        fs::rename(&file, &away).unwrap();
        assert_refused(name, command, folder, expected);
        fs::rename(&away, &file).unwrap();
    }
    for (name, command, expected) in HUGE {
        let file = folder.join(name);
        let length = fs::metadata(&file).unwrap().len();
        let open = fs::OpenOptions::new().write(true).open(&file).unwrap();
        open.set_len(6 << 30).unwrap();
        assert_refused(name, command, folder, expected);
        open.set_len(length).unwrap();
    }
}
