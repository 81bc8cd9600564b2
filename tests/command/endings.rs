//! Readers that leave, disks that are full, commands that are killed, two at once: the exit code is the verdict's, and
//! every output is whole or absent.

use std::fs::{self, File};
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::kills::files;
use crate::{Scratch, assert_says, ran};

/// A pipe at whose other end nobody reads.
fn left() -> Stdio {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    writer.into()
}

const DIFFERENT: &str = "verify --simulated --among 4 --texture burlap --material marble";

#[test]
fn a_reader_that_leaves_ends_the_printing_and_not_the_verdict() {
    let at = Scratch::new();
    at.log("identify");
    let unsure = "identify --simulated --among 3 --threshold 1 --max-slides 2";
    for (line, code) in [
        (unsure, 3),
        (DIFFERENT, 3),
        ("features --recordings SIMULATED", 0),
        ("learn --recordings SIMULATED --out -", 0),
        ("convert identify.jsonl --mcap -", 0),
        ("table none", 1),
        ("evaluate", 2),
        ("--help", 0),
    ] {
        let mut command = at.command(line);
        let ended = command.stdout(left()).stderr(Stdio::null()).status();
        assert_eq!(ended.unwrap().code(), Some(code), "{line}");
        let mut command = at.command(line);
        let ended = command.stdout(Stdio::null()).stderr(left()).status();
        assert_eq!(ended.unwrap().code(), Some(code), "{line}: standard error");
        #[cfg(target_os = "linux")]
        {
            let mut command = at.command(line);
            let full = File::options().write(true).open("/dev/full").unwrap();
            let ended = command.stdout(Stdio::null()).stderr(full).status();
            assert_eq!(ended.unwrap().code(), Some(code), "{line}: /dev/full");
        }
    }
    #[cfg(target_os = "linux")]
    {
        let mut features = at.command("features --recordings SIMULATED");
        let full = File::options().write(true).open("/dev/full").unwrap();
        let ended = features
            .stdout(full)
            .stderr(Stdio::piped())
            .output()
            .unwrap();
        let said = String::from_utf8(ended.stderr).unwrap();
        assert_eq!(ended.status.code(), Some(1), "{said}");
        assert_says(&said, &["error: standard output takes no more"]);
    }
}

/// Commands that write one file or a folder of pictures, each its `OUT`.
const WRITES: [&str; 6] = [
    "learn --recordings SIMULATED --train-slides 2 --out OUT",
    "learn-by-hand --textures 1,9 --trials 2 --out OUT",
    "report t.tact --out OUT",
    "convert identify.jsonl --mcap OUT",
    "table t.tact --plot OUT",
    "unpack OUT",
];

fn with_inputs() -> Scratch {
    let at = Scratch::new();
    let golden = format!("{}/../../tests/golden", env!("CARGO_MANIFEST_DIR"));
    at.write(
        "t.tact",
        fs::read(format!("{golden}/fused-bands.tact")).unwrap(),
    );
    at.log("identify");
    at
}

/// A shell's limit of a file's size stands for a full disk.
#[cfg(unix)]
#[test]
fn a_full_disk_leaves_no_file_and_does_not_stand_in_the_way() {
    let at = with_inputs();
    let before = files(&at.path(""));
    for line in WRITES {
        let line = line.replace("OUT", "out");
        let command = at.command(&line);
        let mut shell = Command::new("sh");
        shell.args(["-c", "ulimit -f 1; trap '' XFSZ; exec \"$@\"", "sh"]);
        shell.arg(command.get_program()).args(command.get_args());
        let full = ran(shell.current_dir(at.path("")));
        assert_eq!(full.code, Some(1), "{line}: {}", full.said);
        assert_says(&full.said, &["error: ", "out", "arge"]);
        assert!(files(&at.path("")) == before, "{line}: something is left");
        at.printed(&line);
        let out = at.path("out");
        let _ = fs::remove_file(&out).or_else(|_| fs::remove_dir_all(&out));
    }
}

#[test]
fn no_file_is_replaced_without_force() {
    let at = with_inputs();
    for line in &WRITES[..4] {
        at.write("mine", "mine");
        let line = line.replace("OUT", "mine");
        assert_says(&at.error(&line, 1), &["mine: is there already", "--force"]);
        assert_eq!(at.read("mine"), b"mine", "{line}");
        at.printed(&format!("{line} --force"));
        assert!(at.read("mine") != b"mine", "{line}");
    }
    // the same bytes replace nothing
    at.printed("report t.tact --out page");
    at.printed("report t.tact --out page");
    fs::create_dir(at.path("data")).unwrap();
    at.write("data/factory.tact", "mine");
    assert_says(
        &at.error("unpack data", 1),
        &["factory.tact", "another folder"],
    );
    assert_eq!(at.read("data/factory.tact"), b"mine");
}

#[test]
fn a_conversion_that_is_killed_leaves_no_half_file() {
    let at = with_inputs();
    let convert = "convert identify.jsonl --mcap out";
    let begun = Instant::now();
    at.printed(convert);
    let (took, whole) = (begun.elapsed(), at.read("out"));
    for part in 1..10 {
        let _ = fs::remove_file(at.path("out"));
        let mut child = at.command(convert).spawn().unwrap();
        thread::sleep(took.mul_f64(f64::from(part) / 10.0));
        child.kill().unwrap();
        child.wait().unwrap();
        let there = fs::read(at.path("out"));
        assert!(there.is_err() || there.unwrap() == whole, "{part}");
    }
    let _ = fs::remove_file(at.path("out"));
    at.printed(convert);
    assert!(at.read("out") == whole);
    // what the last one left was taken over
    assert_eq!(files(&at.path("")).len(), 3);
}

#[test]
fn of_two_writers_of_a_folder_one_is_refused() {
    let at = Scratch::new();
    let simulate = "simulate --out new --textures 1,9,21 --trials 3";
    let [mut first, mut second] = [0, 1].map(|_| {
        let mut command = at.command(simulate);
        command
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    });
    let mut codes = [&mut first, &mut second].map(|child| child.wait().unwrap().code());
    codes.sort_unstable();
    assert_eq!(codes, [Some(0), Some(1)]);
    let said = [first, second].map(|child| {
        let out = child.wait_with_output().unwrap();
        String::from_utf8(out.stderr).unwrap()
    });
    assert_says(
        &said.concat(),
        &["new: another command writes recordings here now"],
    );
    // every hash is right, and nothing of the second is there
    assert_eq!(
        at.printed("features --recordings new --format csv")
            .lines()
            .count(),
        28
    );
    let names: Vec<_> = files(&at.path("new")).into_keys().collect();
    let is_known = |name: &std::path::PathBuf| {
        name.extension().is_some_and(|end| end == "npy") || name.ends_with("manifest.csv")
    };
    assert!(names.iter().all(is_known), "{names:?}");
}

#[test]
fn a_study_of_a_folder_that_another_one_writes_is_refused() {
    let at = Scratch::new();
    let mut first = at.command("study pilot --out study").spawn().unwrap();
    let begun = Instant::now();
    while !at.path("study/INCOMPLETE.lock").exists() {
        assert!(begun.elapsed() < Duration::from_secs(30));
        thread::sleep(Duration::from_millis(5));
    }
    let said = at.error("study pilot --out study", 1);
    assert_says(
        &said,
        &["study: another study is written there now", "--out"],
    );
    first.kill().unwrap();
    first.wait().unwrap();
    // what a killed one leaves does not stand in the way, and is no study
    assert_eq!(files(&at.path("study")).len(), 1);
}

/// A file of settings gives no consent and names no output: none is read.
#[test]
fn a_file_of_settings_sets_nothing() {
    let at = Scratch::new();
    fs::create_dir(at.path("below")).unwrap();
    let settings = "yes = true\nforce = true\nrecordings = 'SIMULATED'\nport = 'tcp:127.0.0.1:1'\nout = 'stolen'\n";
    for name in ["tactus.toml", ".tactus.toml", "below/tactus.toml"] {
        at.write(name, settings);
    }
    at.write("below/mine", "mine");
    let before = files(&at.path(""));
    for (line, code) in [
        ("features", 2),
        (
            "learn --recordings SIMULATED --train-slides 2 --out mine",
            1,
        ),
        ("device status", 1),
    ] {
        let mut command = at.command(line);
        let ended = ran(command.current_dir(at.path("below")));
        assert_eq!(ended.code, Some(code), "{line}: {}", ended.said);
        assert!(!ended.said.contains("127.0.0.1"), "{line}: {}", ended.said);
        assert!(files(&at.path("")) == before, "{line}");
    }
}
