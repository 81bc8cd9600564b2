//! Recordings whose manifest somebody wrote by hand, and folders that hold more than recordings.

use std::fs;
use std::path::Path;

use crate::import::{TEXTURES, recording, wav};
use crate::{SIMULATED, Scratch, assert_says};

/// The recordings that come with the command, with some columns of the manifest left out.
fn without(at: &Scratch, to: &str, gone: &dyn Fn(&str) -> bool) {
    let manifest = fs::read_to_string(Path::new(SIMULATED).join("manifest.csv")).unwrap();
    let header: Vec<&str> = manifest.lines().next().unwrap().split(',').collect();
    at.recordings(to, |line| {
        let cells = header.iter().zip(line.split(','));
        let cells = cells.filter(|(column, _)| !gone(column));
        Some(cells.map(|(_, cell)| cell).collect::<Vec<_>>().join(","))
    });
}

#[test]
fn every_command_reads_a_manifest_without_what_was_not_measured() {
    for (what, gone) in [
        ("all but three", None),
        ("force", Some("force_n")),
        ("speed", Some("speed_mm_s")),
        ("pressure", Some("pdc_")),
        ("shear", Some("shear_")),
        ("background", Some("background_")),
    ] {
        let at = Scratch::new();
        without(&at, "own", &|column| match gone {
            Some(gone) => column.starts_with(gone),
            None => !["name", "pac_file", "pac_rate_hz"].contains(&column),
        });
        let said = at.printed("learn --recordings own --train-slides 2 --out table");
        assert_says(&said, &["6 textures learned"]);
        at.printed("evaluate --recordings own --train-slides 2 --runs 20");
        at.printed("report table --recordings own");
        at.printed("identify --recordings own --material Burlap --train-slides 2");
        at.printed("identify --table table --recordings own --material Burlap");
        let verify = "verify --table table --texture burlap --sample own --material burlap";
        let code = at.run(verify).code;
        assert!(matches!(code, Some(0 | 3 | 4)), "{what}: {code:?}");
        let rows = at.printed("features --recordings own --format csv");
        let mut rows = rows.lines().map(|row| row.split(',').collect::<Vec<_>>());
        let header = rows.next().unwrap();
        let first = rows.next().unwrap();
        let cell = |column: &str| first[header.iter().position(|name| *name == column).unwrap()];
        // a value that is unknown is no value, and the other one of the movement stays
        let unknown = |of: &str| gone.is_none_or(|gone| of.starts_with(gone));
        for column in ["force_n", "speed_mm_s"] {
            assert_eq!(cell(column).is_empty(), unknown(column), "{what}");
        }
        assert_eq!(cell("pdc_mean").is_empty(), unknown("pdc_"), "{what}");
        assert_eq!(cell("traction_n").is_empty(), unknown("shear_"), "{what}");
        at.printed("import own copy");
        let copied = at.printed("features --recordings copy --format csv");
        assert_eq!(copied.lines().count(), 1 + 6 * 9, "{what}");
    }
}

#[test]
fn names_that_begin_with_tactus_are_ours() {
    let at = Scratch::new();
    at.write(
        "data/a/1.wav",
        wav(2200, 16, &[&recording(0, 0, 2200.0, 1.0)]),
    );
    let ours = ["tactus-x", "biotac, analog, mems", "another name"];
    for name in ["tactus-x", "' tactus-x'", "Tactus-X", "TACTUS-X"] {
        let why = at.error(&format!("import data out --finger {name}"), 1);
        assert_says(&why.to_lowercase(), &ours);
    }
    at.write("data/import.toml", "finger = \"tactus-x\"\n");
    assert_says(&at.error("import data out", 1), &ours);
    assert!(!at.path("out").exists());
    at.recordings("own", |line| Some(line.replace(",biotac,", ",tactus-x,")));
    let why = at.error("features --recordings own", 1);
    assert_says(&why, &ours);
    assert_says(&why, &["manifest.csv:2: column finger"]);
    // ours itself is ours, and a name with tactus in it is anybody's
    at.write("data/import.toml", "finger = \"my-tactus-x\"\n");
    at.printed("import data out");
    at.printed("import data biotac --finger biotac");
}

/// Whatever lies beside the recordings and is not read is named with the reason; nothing leads out of the folder.
#[cfg(unix)]
#[test]
fn what_is_skipped_is_named() {
    use std::os::unix::fs::symlink;
    let at = Scratch::new();
    for (texture, (name, _)) in TEXTURES.iter().enumerate().take(2) {
        let x = recording(texture, 0, 2200.0, 1.0);
        at.write(&format!("data/{name}/1.wav"), wav(2200, 16, &[&x]));
    }
    at.write(
        "elsewhere/2.wav",
        wav(2200, 16, &[&recording(2, 0, 2200.0, 1.0)]),
    );
    symlink(at.path("elsewhere/2.wav"), at.path("data/cork/2.wav")).unwrap();
    symlink(at.path("elsewhere"), at.path("data/elsewhere")).unwrap();
    symlink(at.path("nowhere"), at.path("data/denim/nowhere.wav")).unwrap();
    let pipe = at.path("data/denim/3.wav");
    assert!(
        std::process::Command::new("mkfifo")
            .arg(&pipe)
            .status()
            .unwrap()
            .success()
    );
    at.write("data/denim/4.parquet", "PAR1");
    at.write("data/denim/readme.md", "no data");
    at.write("data/1/2/3/4/5/6/7/8/9/deep.wav", "RIFF");
    let said = at.printed("import data out");
    let mut left_out: Vec<&str> = said
        .lines()
        .filter(|line| line.contains("left out: "))
        .collect();
    left_out.sort_unstable();
    let wanted = [
        ["1/2/3/4/5/6/7/8/9: ", "deeper than 8"],
        ["cork/2.wav: ", "a symbolic link, which is not followed"],
        ["denim/3.wav: ", "a pipe, socket or device"],
        ["denim/4.parquet: ", "a file of parquet, which is not read"],
        ["denim/nowhere.wav: ", "a symbolic link"],
        ["elsewhere: ", "a symbolic link"],
    ];
    assert_eq!(left_out.len(), wanted.len(), "{said}");
    for (line, parts) in left_out.iter().zip(wanted) {
        assert_says(line, &parts);
    }
    assert_says(&said, &["out: written, 2 slides"]);
    // where nothing is left, the error says so as well
    at.write("links/readme.md", "no data");
    symlink(at.path("elsewhere/2.wav"), at.path("links/2.wav")).unwrap();
    let why = at.error("import links other", 1);
    assert_says(&why, &["no file in it ends with", "2.wav: a symbolic link"]);
    assert!(!at.path("other").exists());
    // settings are no exception
    fs::remove_file(at.path("links/2.wav")).unwrap();
    at.write("elsewhere/import.toml", "rate = 2200\n");
    symlink(
        at.path("elsewhere/import.toml"),
        at.path("data/import.toml"),
    )
    .unwrap();
    assert_says(
        &at.error("import data other", 1),
        &["import.toml: leads out of this folder"],
    );
    fs::remove_file(at.path("data/import.toml")).unwrap();
    fs::rename(&pipe, at.path("data/import.toml")).unwrap();
    assert_says(
        &at.error("import data other", 1),
        &["import.toml: is no file but"],
    );
}

/// The refusal of parquet says two lines of Python that convert it, which are those of the page.
#[test]
fn parquet_is_refused_with_what_converts_it() {
    let at = Scratch::new();
    at.write("x.parquet", "PAR1\x15\x04");
    at.write("folder/x.parquet", "PAR1\x15\x04");
    let page = include_str!("../../docs/src/own-data.md");
    for from in ["x.parquet", "folder"] {
        let why = at.error(&format!("import {from} out"), 1);
        let at_line = why.find("import glob, pandas\n").expect(&why);
        let lines: Vec<&str> = why[at_line..].lines().take(2).collect();
        assert_says(&why, &["x.parquet", "which is not read"]);
        assert_says(
            lines[1],
            &["for f in glob.glob(\"**/*.parquet\", recursive=True): "],
        );
        assert_says(page, &[&lines.join("\n")]);
    }
}
