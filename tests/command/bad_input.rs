//! Everything that `tactus` reads, damaged in eight ways: a clear error that says what and where, exit code 1 or 2, nothing
//! written, nothing lost. What is answered stands in the book, which this test compares.
//!
//! `TACTUS_BOOK=write` (`cargo xtask docs --write`) writes the page again.

#[path = "bad_input/arguments.rs"]
mod arguments;
#[path = "bad_input/ports.rs"]
mod ports;
#[path = "bad_input/settings.rs"]
mod settings;

use std::collections::BTreeMap;
use std::error::Error as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use tactus_lab::sim::scenario::Scenario;
use tactus_tests::properties_csv;
use tempfile::TempDir;

/// The page with the answers.
const PAGE: &str = "docs/src/bad-input.md";
const HEAD: &str = "\
# Bad input

Everything that is read, damaged in eight ways, and the first line of the answer. For files and ports the exit code is 1, for arguments 2; nothing is written, and what was read is as it was.
`tests/bad_input.rs` damages them and writes this page; a test fails when an answer is another one. Where a cell has no answer it says why.

*A flipped bit*: one in each of 64 bytes all over the file, one at a time. Where a file has no check sum, a flipped bit can make another valid file, and the table says how many did.
*Huge*: 6 GB. *No permission*: not readable by the user; the user root may read it nevertheless.

";

/// How a file is damaged.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Damage {
    Missing,
    Empty,
    CutShort,
    FlippedBit,
    WrongType,
    Huge,
    AnotherVersion,
    NoPermission,
}

const DAMAGES: [(Damage, &str); 8] = [
    (Damage::Missing, "missing"),
    (Damage::Empty, "empty"),
    (Damage::CutShort, "cut short"),
    (Damage::FlippedBit, "a flipped bit"),
    (Damage::WrongType, "wrong type"),
    (Damage::Huge, "huge"),
    (Damage::AnotherVersion, "another version"),
    (Damage::NoPermission, "no permission"),
];

/// A file that something reads.
struct Input {
    name: &'static str,
    /// Puts a good one into a folder; the file that is damaged.
    make: fn(&Path) -> PathBuf,
    reader: Reader,
    /// A file of another version, made of a good one.
    another_version: fn(Vec<u8>) -> Vec<u8>,
    /// Whether the format says where a file ends.
    has_end: bool,
}

/// Who reads a file.
enum Reader {
    /// A command; `DIR` is the folder, `OUT` what it may write.
    Command(&'static [&'static str]),
    /// The tests of the emulated handheld.
    Scenario,
}

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

fn recordings(to: &Path) {
    for entry in fs::read_dir(root().join("host-tools/recordings/simulated")).unwrap() {
        let entry = entry.unwrap();
        fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
    }
}

fn copied(from: &str, to: &Path) -> PathBuf {
    let to = to.join(Path::new(from).file_name().unwrap());
    fs::copy(root().join(from), &to).unwrap();
    to
}

fn replaced(bytes: Vec<u8>, old: &str, new: &str) -> Vec<u8> {
    let text = String::from_utf8(bytes).unwrap();
    assert!(text.contains(old));
    text.replacen(old, new, 1).into_bytes()
}

/// Reads all of a folder, and writes a table.
const LEARN: &[&str] = &[
    "learn",
    "--recordings",
    "DIR",
    "--train-slides",
    "2",
    "--out",
    "OUT",
];

const INPUTS: [Input; 6] = [
    Input {
        name: "A recording folder's manifest",
        make: |folder| {
            recordings(folder);
            folder.join("manifest.csv")
        },
        reader: Reader::Command(LEARN),
        another_version: (|bytes| replaced(bytes, "pac_rate_hz", "pac_rate_khz")),
        has_end: true,
    },
    Input {
        name: "Samples of a slide (npy)",
        make: |folder| {
            recordings(folder);
            folder.join("t001_s001_pac.npy")
        },
        reader: Reader::Command(LEARN),
        another_version: (|mut bytes| {
            // behind \x93NUMPY
            bytes[6] = 9;
            bytes
        }),
        has_end: true,
    },
    Input {
        name: "A table of properties (CSV)",
        make: |folder| {
            let file = folder.join("properties.csv");
            fs::write(&file, properties_csv(3, 3, |_, _, _| 5)).unwrap();
            file
        },
        reader: Reader::Command(&[
            "evaluate",
            "--properties",
            "DIR/properties.csv",
            "--method",
            "paper",
            "--runs",
            "20",
        ]),
        another_version: (|bytes| replaced(bytes, "fineness", "sharpness")),
        has_end: false,
    },
    Input {
        name: "A texture table",
        make: |folder| copied("tests/golden/fused-bands.tact", folder),
        reader: Reader::Command(&["table", "show", "DIR/fused-bands.tact"]),
        another_version: (|mut bytes| {
            // behind TACT
            bytes[4] = 2;
            bytes
        }),
        has_end: true,
    },
    Input {
        name: "A log of a session",
        make: |folder| {
            let packed = fs::File::open(root().join("tests/golden/identify.jsonl.gz")).unwrap();
            let file = folder.join("session.jsonl");
            let mut log = fs::File::create(&file).unwrap();
            std::io::copy(&mut flate2::read::GzDecoder::new(packed), &mut log).unwrap();
            file
        },
        reader: Reader::Command(&["device", "log", "replay", "DIR/session.jsonl"]),
        another_version: (|bytes| replaced(bytes, "\"protocol\":3", "\"protocol\":99")),
        has_end: true,
    },
    Input {
        name: "A scenario of the emulated handheld",
        make: |folder| copied("host-tools/emulator/scenarios/known.json", folder),
        reader: Reader::Scenario,
        another_version: (|bytes| replaced(bytes, "\"step\"", "\"steps\"")),
        has_end: true,
    },
];

/// What a command answered.
struct Answer {
    code: Option<i32>,
    said: String,
}

fn answer(input: &Input, folder: &Path, out: &Path) -> Answer {
    let Reader::Command(command) = input.reader else {
        let file = folder.join("known.json");
        let said = Scenario::read(&file).err().map(|why| {
            let source = why.source().map(|source| format!(": {source}"));
            format!("error: {why}{}", source.unwrap_or_default())
        });
        return Answer {
            code: Some(said.is_some().into()),
            said: said.unwrap_or_default(),
        };
    };
    let folder = folder.to_str().unwrap();
    let arguments = command.iter().map(|argument| match *argument {
        "OUT" => out.to_str().unwrap().to_owned(),
        other => other.replace("DIR", folder),
    });
    let done = Command::new(env!("CARGO_BIN_EXE_tactus"))
        .args(arguments)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    Answer {
        code: done.status.code(),
        said: String::from_utf8(done.stderr).unwrap(),
    }
}

/// The names and sizes in a folder.
fn listed(folder: &Path) -> BTreeMap<PathBuf, u64> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    entries
        .map(|entry| (entry.path(), entry.metadata().map_or(0, |m| m.len())))
        .collect()
}

/// The error of a command that must fail, for the page: its first line, with `DIR` for the folder.
fn error(input: &Input, damage: Damage, folder: &Path, out: &Path) -> Result<String, String> {
    let before = listed(folder);
    let Answer { code, said } = answer(input, folder, out);
    let here = format!("{}, {damage:?}", input.name);
    if code == Some(0) {
        return Err(format!("{here}: no error"));
    }
    assert!(matches!(code, Some(1 | 2)), "{here}: {code:?} {said}");
    assert!(said.starts_with("error: "), "{here}: {said}");
    assert!(!said.contains("panicked"), "{here}: {said}");
    assert!(!out.exists(), "{here}: something was written");
    assert_eq!(listed(folder), before, "{here}: something was lost");
    let line = said.lines().next().unwrap().trim_start_matches("error: ");
    let name = folder.to_str().unwrap();
    assert!(
        line.contains(name),
        "{here}: the error names no file: {line}"
    );
    Ok(of_table(&line.replace(name, "DIR")))
}

/// Text that a cell of a table in Markdown shows as it is.
fn of_table(text: &str) -> String {
    text.replace('|', "\\|").replace('<', "\\<")
}

/// A cell of the table.
fn cell(input: &Input, damage: Damage) -> String {
    let folder = TempDir::new().unwrap();
    let out = folder.path().with_extension("out");
    let folder = folder.path();
    let file = (input.make)(folder);
    let good = fs::read(&file).unwrap();
    let told = || error(input, damage, folder, &out).unwrap_or_else(|why| panic!("{why}"));
    if damage == Damage::CutShort && !input.has_end {
        return "none where a whole line is left: the format does not say where a file ends"
            .to_owned();
    }
    match damage {
        Damage::Missing => fs::remove_file(&file).unwrap(),
        Damage::Empty => fs::write(&file, []).unwrap(),
        // in the middle of a line or a value
        Damage::CutShort => fs::write(&file, &good[..good.len() / 2 + 3]).unwrap(),
        Damage::FlippedBit => {
            let mut answers = Vec::new();
            let mut accepted = 0;
            for n in 0..64 {
                let mut bad = good.clone();
                bad[n * (good.len() - 1) / 63] ^= 1 << (n % 8);
                fs::write(&file, bad).unwrap();
                match error(input, damage, folder, &out) {
                    Ok(answer) => answers.push(answer),
                    Err(_) => {
                        accepted += 1;
                        let _ = fs::remove_file(&out);
                    }
                }
            }
            let first = answers.first().cloned().unwrap_or_default();
            return match accepted {
                0 => first,
                _ => {
                    format!("{accepted} of 64 are read as another valid file; the others: {first}")
                }
            };
        }
        Damage::WrongType => fs::write(&file, b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x01").unwrap(),
        Damage::Huge => {
            let file = fs::OpenOptions::new().append(true).open(&file).unwrap();
            file.set_len(6 << 30).unwrap();
        }
        Damage::AnotherVersion => fs::write(&file, (input.another_version)(good)).unwrap(),
        Damage::NoPermission => {
            use std::os::unix::fs::PermissionsExt as _;
            fs::set_permissions(&file, fs::Permissions::from_mode(0o0)).unwrap();
            if fs::read(&file).is_ok() {
                // root: another way to be unreadable
                fs::remove_file(&file).unwrap();
                fs::create_dir(&file).unwrap();
            }
            let line = told();
            // the system's own words differ between the two
            assert!(!line.is_empty());
            return "as missing, with the system's reason".to_owned();
        }
    }
    told()
}

#[test]
fn bad_input_is_refused_as_the_book_says() {
    let mut page = HEAD.to_owned();
    for input in &INPUTS {
        let reader = match input.reader {
            Reader::Command(command) => format!("`tactus {}`", command.join(" ")),
            Reader::Scenario => "No command reads one: tests play them.".to_owned(),
        };
        page += &format!(
            "## {}\n\n{reader}\n\n| damage | answer |\n|---|---|\n",
            input.name
        );
        for (damage, name) in DAMAGES {
            page += &format!("| {name} | {} |\n", cell(input, damage));
        }
        page += "\n";
    }
    page += &ports::section();
    page += &settings::section();
    page += &arguments::section();
    let page = page.trim_end().to_owned() + "\n";
    let path = root().join(PAGE);
    if std::env::var("TACTUS_BOOK").as_deref() == Ok("write") {
        fs::write(&path, &page).unwrap();
    }
    let there = fs::read_to_string(&path).unwrap_or_default();
    for (there, now) in there.lines().zip(page.lines()) {
        assert_eq!(
            there, now,
            "{PAGE}: `cargo xtask docs --write` writes it again"
        );
    }
    assert_eq!(there.lines().count(), page.lines().count(), "{PAGE}");
}

/// A good input of each kind is accepted: the errors are those of the damage.
#[test]
fn what_is_not_damaged_is_accepted() {
    for input in &INPUTS {
        let folder = TempDir::new().unwrap();
        let out = folder.path().join("out.tact");
        (input.make)(folder.path());
        let Answer { code, said } = answer(input, folder.path(), &out);
        assert_eq!(code, Some(0), "{}: {said}", input.name);
    }
}
