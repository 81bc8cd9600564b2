//! What a command writes replaces nothing that it reads, goes where no link leads, and says what to do where it cannot.

use std::fs;

use crate::kills::files;
use crate::{Scratch, assert_says};

/// A table, a log and recordings.
fn with_inputs() -> Scratch {
    let at = Scratch::new();
    at.log("identify");
    at.recordings("own", |line| Some(line.to_owned()));
    at.printed("learn --recordings own --train-slides 2 --out t.tact");
    at
}

#[test]
fn no_input_is_replaced_with_force_either() {
    let at = with_inputs();
    fs::create_dir(at.path("sub")).unwrap();
    let before = files(&at.path(""));
    for line in [
        "report t.tact --out t.tact",
        "report t.tact --out ./sub/../t.tact",
        "report t.tact --recordings own --out own/manifest.csv",
        "convert identify.jsonl --mcap identify.jsonl",
        "learn --recordings own --train-slides 2 --out own/manifest.csv",
        "learn --recordings own --train-slides 2 --out own/t001_s001_pac.npy",
    ] {
        let why = at.error(&format!("{line} --force"), 1);
        assert_says(&why, &["is read by this command", "give another name"]);
        assert!(files(&at.path("")) == before, "{line}");
    }
    // a table that lies beside the recordings is none of them
    at.printed("learn --recordings own --train-slides 2 --out own/t.tact");
    at.printed("learn --recordings own --train-slides 2 --out own/t.tact --force");
}

#[cfg(unix)]
#[test]
fn nothing_is_written_where_a_planted_link_leads() {
    use std::os::unix::fs::symlink;
    let simulate = "simulate --textures burlap --trials 1 --out";
    for (line, link) in [
        (simulate, "INCOMPLETE.part"),
        (simulate, "INCOMPLETE.lock"),
        (simulate, "INCOMPLETE"),
        ("table t.tact --plot", ".tactus-plot.part"),
        (
            "learn --recordings own --train-slides 2 --out",
            "../.out.tactus-part",
        ),
        ("unpack", "factory.tact"),
    ] {
        let at = with_inputs();
        at.write("victim", "mine");
        fs::create_dir(at.path("out")).unwrap();
        symlink(at.path("victim"), at.path("out").join(link)).unwrap();
        let out = if link.starts_with("..") {
            "out/../out"
        } else {
            "out"
        };
        let ran = at.run(&format!("{line} {out}"));
        assert!(!ran.said.contains("mine"), "{line} {link}: {}", ran.said);
        assert_eq!(at.read("victim"), b"mine", "{line} {link}: {}", ran.said);
    }
}

#[test]
fn what_is_in_the_way_is_named_with_a_remedy() {
    let at = with_inputs();
    at.write("mine", "mine");
    let long = "x".repeat(300);
    for (out, folder, file) in [
        (
            "mine",
            "is no folder: give another name",
            "give another name",
        ),
        ("mine/x", "", "there is no such folder: make it first"),
        (
            "no/such/place",
            "",
            "there is no such folder: make it first",
        ),
        (&long, "", "the name is too long"),
        ("own", "give a new folder", "is a folder: name a file"),
    ] {
        for line in ["report t.tact --out", "convert identify.jsonl --mcap"] {
            assert_says(&at.error(&format!("{line} {out}"), 1), &[file]);
        }
        if !folder.is_empty() {
            let simulate = format!("simulate --textures burlap --trials 1 --out {out}");
            assert_says(&at.error(&simulate, 1), &[folder]);
        }
        assert_eq!(at.read("mine"), b"mine");
    }
}

/// Of an import into a folder below its input, the next import of the same input takes nothing for data.
#[test]
fn recordings_below_the_data_are_no_data() {
    use crate::import::{TEXTURES, recording, wav};
    let at = Scratch::new();
    for (texture, (name, _)) in TEXTURES.iter().enumerate().take(2) {
        let x = recording(texture, 0, 2200.0, 1.0);
        at.write(&format!("data/{name}/1.wav"), wav(2200, 16, &[&x]));
    }
    // a list of somebody's own is left alone
    at.write("data/cork/manifest.csv", "file,texture\n1.wav,cork\n");
    let first = at.printed("import data data/out");
    assert_says(&first, &["written, 2 slides"]);
    let again = at.printed("import data other");
    assert_says(
        &again,
        &[
            "left out: out: recordings of this project",
            "written, 2 slides",
        ],
    );
}
