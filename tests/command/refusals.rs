//! Wrong arguments and damaged files: the command says what is wrong and what to do, and writes nothing.

use std::fs;
use std::path::Path;

use tactus_lab::data::recordings::files::sha256;
use tactus_lab::data::recordings::npy;
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
            files(&at.path("")) == before && !at.path("new").exists(),
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

/// Every command that reads a folder of recordings.
const FOLDER: [&str; 5] = [
    "features --recordings .",
    LEARN,
    "evaluate --recordings . --train-slides 2 --runs 20",
    "identify --recordings . --train-slides 2 --material burlap",
    "import . copy",
];

#[cfg(unix)]
#[test]
fn what_is_no_file_of_the_folder_is_not_opened() {
    let outside = Scratch::new();
    outside.write("secret", "the secret of somebody else\n");
    let secret = outside.path("secret");
    let hash = sha256(&outside.read("secret"));
    let fifo = |path: &Path| {
        let made = std::process::Command::new("mkfifo").arg(path).status();
        assert!(made.unwrap().success());
    };
    type Put<'p> = &'p dyn Fn(&Path);
    let puts: [(&str, Put<'_>, &str); 4] = [
        (
            "link out",
            &|path| std::os::unix::fs::symlink(&secret, path).unwrap(),
            "symbolic link",
        ),
        ("pipe", &fifo, "is no file but"),
        (
            "link to a device",
            &|path| std::os::unix::fs::symlink("/dev/zero", path).unwrap(),
            "symbolic link",
        ),
        (
            "folder",
            &|path| fs::create_dir(path).unwrap(),
            "is no file but",
        ),
    ];
    for (what, put, why) in puts {
        for name in ["manifest.csv", "t001_s001_pac.npy", "INCOMPLETE"] {
            let at = good();
            if name == "INCOMPLETE" {
                fs::remove_file(at.path("manifest.csv")).unwrap();
            } else {
                fs::remove_file(at.path(name)).unwrap();
            }
            put(&at.path(name));
            for command in FOLDER {
                let said = at.error(command, 1);
                assert!(
                    said.contains(name) && said.contains(why),
                    "{what} {name}: {said}"
                );
                let told = ["secret of somebody", &hash]
                    .iter()
                    .any(|part| said.contains(part));
                assert!(!told, "{what} {name}: {said}");
            }
        }
    }
    // a user's own link is followed, and a pipe is never waited for
    let at = good();
    for (name, command) in [
        ("properties.csv", PROPERTIES),
        ("t.tact", TABLE),
        ("identify.jsonl", LOG),
    ] {
        let whole = at.read(name);
        fs::remove_file(at.path(name)).unwrap();
        outside.write(name, &whole);
        std::os::unix::fs::symlink(outside.path(name), at.path(name)).unwrap();
        assert_eq!(at.run(command).code, Some(0), "{name}");
        fs::remove_file(at.path(name)).unwrap();
        fifo(&at.path(name));
        assert_says(&at.error(command, 1), &[name, "is no file but"]);
    }
}

/// Changes the samples of a file of the folder, and its hash in the manifest.
fn change(at: &Scratch, file: &str, samples: impl FnOnce(Vec<i16>) -> Vec<i16>) {
    let old = at.read(file);
    let new = npy::write(&samples(npy::read(&old).unwrap()));
    at.write(file, &new);
    let manifest = String::from_utf8(at.read("manifest.csv")).unwrap();
    at.write(
        "manifest.csv",
        manifest.replace(&sha256(&old), &sha256(&new)),
    );
}

#[test]
fn a_dead_sensor_is_no_texture() {
    // slide 2 of texture 100
    const PAC: &str = "t100_s002_pac.npy";
    type Change = fn(Vec<i16>) -> Vec<i16>;
    let cases: [(&str, Change, &str); 7] = [
        (PAC, |pac| vec![2047; pac.len()], "P_AC never changed"),
        (PAC, |pac| vec![0; pac.len()], "P_AC never changed"),
        (
            PAC,
            |pac| (0..pac.len()).map(|n| -2048 + (n % 3) as i16).collect(),
            "P_AC never changed",
        ),
        (
            PAC,
            |mut pac| {
                pac[3000..3300].fill(-7);
                pac
            },
            "P_AC never changed",
        ),
        (
            PAC,
            |pac| {
                pac.iter()
                    .map(|x| x.saturating_mul(1000).clamp(-2048, 2047))
                    .collect()
            },
            "is cut off",
        ),
        (
            "t100_s002_still.npy",
            |still| vec![1; still.len()],
            "P_AC never changed",
        ),
        (
            "t100_s002_pdc.npy",
            |pdc| [&pdc[..], &pdc[..1000]].concat(),
            "samples are missing",
        ),
    ];
    for (file, dead, why) in cases {
        let at = good();
        change(&at, file, dead);
        refused(&at, why);
    }
}

/// One recording that is cut twice is one slide, wherever it is cut and under whatever name.
#[test]
fn a_copy_is_no_slide() {
    type Change = fn(&[i16], Vec<i16>) -> Vec<i16>;
    const BURLAP: &str = "t100_s001_pac.npy";
    let shifted: Change = |first, own| [&first[37..], &own[own.len() - 37..]].concat();
    let most: Change = |first, own| [&first[2600..], &own[..2600]].concat();
    let inverted: Change = |first, _| first.iter().map(|x| -x).collect();
    let noisy: Change = |first, _| {
        let changed = first.iter().enumerate();
        changed.map(|(n, x)| x + i16::from(n % 300 == 0)).collect()
    };
    let later: Change = |first, own| [&own[..5], first].concat();
    for (of, copy, name) in [
        (
            BURLAP,
            (|first, _| first.to_vec()) as Change,
            "slide 1 of Burlap",
        ),
        (BURLAP, shifted, "slide 1 of Burlap"),
        (BURLAP, most, "slide 1 of Burlap"),
        (BURLAP, inverted, "slide 1 of Burlap"),
        (BURLAP, noisy, "slide 1 of Burlap"),
        ("t001_s003_pac.npy", later, "slide 3 of "),
    ] {
        let at = good();
        let first = npy::read(&at.read(of)).unwrap();
        change(&at, "t100_s002_pac.npy", |own| {
            let mut copied = copy(&first, own.clone());
            copied.resize(own.len(), 0);
            copied
        });
        refused(&at, &format!("% of its P_AC is that of {name}"));
    }
    // a fifth is none
    let at = good();
    let first = npy::read(&at.read(BURLAP)).unwrap();
    change(&at, "t100_s002_pac.npy", |own| {
        let part = own.len() / 5;
        [&first[first.len() - part..], &own[part..]].concat()
    });
    at.printed(LEARN);
}

#[track_caller]
fn refused(at: &Scratch, why: &str) {
    for command in &FOLDER[..4] {
        let said = at.error(command, 1);
        assert_says(&said, &["slide 2 of Burlap: ", why, "tactus import"]);
    }
    assert!(!at.path("out.tact").exists());
    // an import names it, and makes a folder that can be used
    let said = at.printed("import . copy");
    assert_says(
        &said,
        &[
            "6 textures, 53 slides",
            "left out: slide 2 of Burlap: ",
            why,
        ],
    );
    assert_eq!(
        at.printed("features --recordings copy --format csv")
            .lines()
            .count(),
        54
    );
}

#[test]
fn a_signal_that_is_cut_off_a_little_is_told() {
    let at = good();
    change(&at, "t100_s002_pac.npy", |mut pac| {
        pac.iter_mut().step_by(50).for_each(|x| *x = 2047);
        pac
    });
    for command in FOLDER {
        let ran = at.run(command);
        assert_eq!(ran.code, Some(0), "{}", ran.said);
        let told = [ran.out, ran.said].concat();
        assert_says(&told, &["slide 2 of Burlap: P_AC is cut off", "press less"]);
    }
}

#[test]
fn names_with_control_characters_are_refused_and_none_reaches_the_terminal() {
    let plain = |text: &str| {
        !text
            .chars()
            .any(|c| c.is_control() && c != '\n' || c == '\u{202e}')
    };
    for bad in [
        "\u{1b}[2J",
        "\u{9b}2J",
        "\u{202e}dem",
        "a\u{7}",
        "\u{7f}",
        "\u{2066}",
    ] {
        let at = good();
        let manifest = String::from_utf8(at.read("manifest.csv")).unwrap();
        let places = [
            manifest.replace(",Burlap,", &format!(",Bur{bad}lap,")),
            manifest.replace(",,,,biotac", &format!(",,An{bad}na,,biotac")),
            manifest.replace(",,,,biotac", &format!(",lot {bad}1,,,biotac")),
            manifest.replace(",,,,biotac", &format!(",,,{bad}1,biotac")),
            manifest.replace("t100_s002_pac", &format!("t100{bad}_s002_pac")),
            manifest.replace("1.262,", &format!("1.262{bad},")),
        ];
        for manifest in places {
            at.write("manifest.csv", &manifest);
            let said = at.error("features --recordings .", 1);
            assert!(
                plain(&said) && said.contains("manifest.csv") || said.contains("t100"),
                "{said:?}"
            );
        }
        let properties = String::from_utf8(at.read("properties.csv")).unwrap();
        let name = properties
            .lines()
            .nth(1)
            .unwrap()
            .split(',')
            .next()
            .unwrap();
        at.write(
            "properties.csv",
            properties.replace(&format!("\n{name},"), &format!("\nx{bad},")),
        );
        let said = at.error(PROPERTIES, 1);
        assert!(plain(&said) && said.contains("does not print"), "{said:?}");
    }
    // what a user names is shown, too, in results and in errors
    let at = good();
    let said = at.printed("import . \u{1b}]0;title\u{7}red");
    assert!(
        plain(&said) && said.contains("\\u001b]0;title\\u0007red: 6 textures"),
        "{said:?}"
    );
    let said = at.error("features --recordings \u{1b}[2Jno", 1);
    assert!(
        plain(&said) && said.contains("\\u001b[2Jno: no such folder"),
        "{said:?}"
    );
}

/// A name that is no text, ten thousand times too long, or moves the cursor, is told in a short sentence of plain text;
/// and nobody is waited for who may never read.
#[cfg(unix)]
#[test]
fn what_is_named_strangely_is_told_in_a_short_plain_sentence() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt as _;
    let at = good();
    let manifest = String::from_utf8(at.read("manifest.csv")).unwrap();
    let row = manifest.lines().nth(1).unwrap();
    let name = row.split(',').nth(1).unwrap();
    let long = row.replace(name, &"x".repeat(1_000_000));
    at.write("long/manifest.csv", manifest.replace(row, &long));
    at.write("data/felt/1.csv", "a\n1\n");
    let latin = at.path("").join(OsStr::from_bytes(b"latin/fe\xfflt"));
    fs::create_dir_all(&latin).unwrap();
    fs::write(latin.join("1.csv"), "a\n1\n").unwrap();
    let made = std::process::Command::new("mkfifo")
        .arg(at.path("pipe"))
        .status();
    assert!(made.unwrap().success());
    let before = files(&at.path("data"));
    for (line, code, parts) in [
        (
            "features --recordings long",
            1,
            ["xxx ... xxx", "one number and one name"],
        ),
        ("import latin new", 1, ["left out: fe", "not UTF-8; rename"]),
        (
            "import data new --rate 500 --unit 'm\u{1b}[2J'",
            1,
            ["unit", "U+001B"],
        ),
        (
            "evaluate --threshold 'a\u{202e}\u{1b}[2Jb'",
            2,
            ["a\\u202eb", "between 0 and 1"],
        ),
        (
            "learn --recordings . --train-slides 2 --out pipe --force",
            1,
            ["pipe", "name a file"],
        ),
        (
            "import . /proc/new",
            1,
            ["/proc/new", "make it first, or give another name"],
        ),
    ] {
        let mut bounded = std::process::Command::new("timeout");
        let command = at.command(line);
        bounded
            .arg("60")
            .arg(command.get_program())
            .args(command.get_args());
        let ran = crate::ran(bounded.current_dir(at.path("")));
        assert_eq!(ran.code, Some(code), "{line}");
        assert_says(&ran.said, &parts);
        let plain = |c| !matches!(c, '\u{1b}' | '\u{202e}');
        assert!(
            ran.said.len() < 2500 && ran.said.chars().all(plain),
            "{line}"
        );
        assert!(!at.path("new").exists() && files(&at.path("data")) == before);
    }
}
