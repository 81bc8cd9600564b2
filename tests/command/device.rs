//! `tactus device` as a user meets it, at a probe in software: the simulated rig under the core's own probe behind the
//! frames of the link, on a TCP port or a pseudo terminal; and at lines that are no probe's.

#[path = "device/client.rs"]
mod client;
#[path = "device/package.rs"]
mod package;
#[path = "device/page.rs"]
mod page;
#[path = "device/software.rs"]
mod software;
#[path = "device/tables.rs"]
mod tables;

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;
use std::sync::mpsc::{self, Receiver as Told, Sender};
use std::time::{Duration, Instant};
use std::{fs, thread};

use tactus_core::dsp::Plan;
use tactus_core::explorer::Method;
use tactus_core::features::Movement;
use tactus_core::probe::seams::{Panel, RigHandle as _};
use tactus_core::probe::{RigState, TableInUse, Turn, Watch, receive};
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::skin::SkinCare;
use tactus_core::sensor::FingerCode;
use tactus_core::table::{Name, Table};
use tactus_core::wire::{
    self, Counts, Event, Forget, MAX_FRAME, PROTOCOL, Phase, Receiver, Report, Request, Reset,
    Status,
};
use tactus_lab::sim::collection::{Collection, calibrated, texture_name};
use tactus_lab::sim::flash::{RamFlash, SECTOR, TABLE};
use tactus_lab::sim::probe::{self, Host};
use tactus_lab::sim::rig::SimRig;

use software::*;

fn device(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tactus"));
    command.arg("device").args(arguments);
    // its locks, and the tables that it keeps
    for folder in ["XDG_RUNTIME_DIR", "XDG_DATA_HOME"] {
        command.env(folder, env!("CARGO_TARGET_TMPDIR"));
    }
    command.stdin(Stdio::null());
    command
}

fn printed(arguments: &[&str]) -> String {
    let Output {
        status,
        stdout,
        stderr,
    } = device(arguments).output().unwrap();
    let said = String::from_utf8(stderr).unwrap();
    // 3: an exploration that ended without a name
    assert!(
        matches!(status.code(), Some(0 | 3)),
        "{arguments:?}: {said}"
    );
    String::from_utf8(stdout).unwrap()
}

/// The object that a command printed which ends with this code.
fn object(arguments: &[&str], code: i32) -> serde_json::Value {
    let out = device(arguments).output().unwrap();
    let said = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(code), "{arguments:?}: {said}");
    serde_json::from_slice(&out.stdout).unwrap()
}

#[test]
fn the_doctor_says_what_is_wrong_and_changes_nothing() {
    let (at, asked) = probe(1);
    let doctor = ["doctor", "--port", &at, "--format", "json"];
    let told = object(&doctor, 0);
    let checks = told["checks"].as_array().unwrap();
    let of = |name: &str| {
        let check = checks.iter().find(|check| check["name"] == name);
        let state = &check.unwrap_or_else(|| panic!("no {name} in {told}"))["state"];
        state.as_str().unwrap().to_owned()
    };
    for good in ["port", "line", "rig", "sensor", "skin", "store"] {
        assert_eq!(of(good), "good", "{good}: {told}");
    }
    // the firmware's own table, and a scale that nobody measured
    assert_eq!([of("table"), of("force scale")], ["look", "look"]);
    let writes: Vec<wire::Command> = asked
        .try_iter()
        .filter(|command| !matches!(command, wire::Command::Status | wire::Command::ReadTable(_)))
        .collect();
    assert_eq!(writes, [wire::Command::SetFalseAlarm(None)]);

    let nobody = line(|mut stream| stream.write_all(&[0x55; 4000]).unwrap());
    let told = object(&["doctor", "--port", &nobody, "--format", "json"], 1);
    assert_eq!(told["checks"][0]["state"], "bad", "{told}");
    let out = device(&["doctor", "--port", "/dev/none"]).output().unwrap();
    assert_eq!(out.status.code(), Some(1));
    let said = String::from_utf8(out.stdout).unwrap();
    assert!(
        said.starts_with("BAD   port") && said.contains("no such port"),
        "{said}"
    );
}

#[test]
fn an_exploration_and_a_table_are_objects() {
    let (at, _) = probe(1000);
    let identify = ["identify", "--port", &at, "--seed", "7", "--format", "json"];
    // nothing is ever more probable than 1
    let undecided = [&identify[..], &["--threshold", "1", "--max-slides", "2"]].concat();
    let found = object(&undecided, 3);
    assert_eq!(found["among"], 3);
    assert_eq!(found["verdict"]["told"], "undecided");
    assert_eq!(found["slides"].as_array().unwrap().len(), 2);
    assert!(found["slides"][0]["roughness_ln"].is_number(), "{found}");
    assert!(
        found["slides"][1]["posterior"][0]["probability"]
            .as_f64()
            .unwrap()
            > 0.3
    );
    let table = object(&["table", "show", "--port", &at, "--format", "json"], 0);
    let name = table["textures"][0]["name"].as_str().unwrap().to_owned();
    let mut slip = name.clone();
    slip.pop();
    let meant = format!("Did you mean {name}?");
    assert_says(
        &complaint(&["identify", "--port", &at, "--among", &slip]),
        &[&meant],
    );
}

fn complaint(arguments: &[&str]) -> String {
    let out = device(arguments).output().unwrap();
    let said = String::from_utf8(out.stderr).unwrap();
    assert_eq!(out.status.code(), Some(1), "{arguments:?}: {said}");
    assert!(!said.contains("panicked"), "{said}");
    said
}

fn assert_says(said: &str, parts: &[&str]) {
    for part in parts {
        assert!(said.contains(part), "{part}: {said}");
    }
}

fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn a_probe_says_how_it_is() {
    let (at, _) = probe(1000);
    let status = printed(&["status", "--port", &at]);
    assert_says(
        &status,
        &[
            "rig             ready",
            "3 textures",
            "0 parity errors",
            "1.5 J of sliding",
            "N/A",
        ],
    );
    let json: serde_json::Value =
        serde_json::from_str(&printed(&["status", "--port", &at, "--format", "json"])).unwrap();
    assert_eq!(
        (json["textures"].as_u64(), json["phase"].as_str()),
        (Some(3), Some("Ready"))
    );
}

#[test]
fn every_decision_of_a_session_is_computed_again_from_its_log() {
    let (at, asked) = probe(1000);
    let temp = tempfile::tempdir().unwrap();
    let log = temp.path().join("session.jsonl");
    let identify = [
        "identify",
        "--port",
        &at,
        "--threshold",
        "1",
        "--max-slides",
        "3",
        "--seed",
        "7",
        "--method",
        "fused-random",
        "--log",
        path(&log),
    ];
    let live = printed(&identify);
    assert_says(
        &live,
        &["one of 3 (seed 7)", "Slide 1:", "measured", "█", "after"],
    );
    let asked: Vec<wire::Command> = asked.try_iter().collect();
    assert!(
        asked.contains(&wire::Command::Stream(true))
            && asked.last() == Some(&wire::Command::Stream(false))
    );
    // a log is never written over
    assert_says(&complaint(&identify), &["session.jsonl", "another name"]);

    let replayed = printed(&["log", path(&log)]);
    assert_says(
        &replayed,
        &[
            "chosen here too",
            "features the same, posterior the same",
            "the same here",
            "largest difference 0e0",
        ],
    );
    let lines = fs::read_to_string(&log).unwrap();
    let changed = |from: &str, nth: usize, change: &dyn Fn(&str) -> String| {
        let mut places = lines
            .lines()
            .zip(0..)
            .filter(|(line, _)| line.contains(from));
        let at = places.nth(nth).unwrap().1;
        let lines = lines.lines().zip(0..);
        let file = temp.path().join("changed.jsonl");
        let new = lines.map(|(line, n)| if n == at { change(line) } else { line.to_owned() } + "\n");
        fs::write(&file, new.collect::<String>()).unwrap();
        let out = device(&["log", path(&file)]).output().unwrap();
        assert_eq!(out.status.code(), Some(1), "{from}");
        String::from_utf8([out.stdout, out.stderr].concat()).unwrap()
    };
    let gone = |_: &str| String::from("{\"command\":\"Status\"}");
    // another seed makes other random choices
    let seed = |line: &str| line.replace("\"seed\":7", "\"seed\":11");
    let other = changed("{\"command\":{\"Identify\"", 0, &seed);
    assert_says(&other, &["IS CHOSEN", "not every decision is the same"]);
    let sample = |line: &str| {
        let mut line: serde_json::Value = serde_json::from_str(line).unwrap();
        line["report"]["event"]["Block"]["pac"][7] = 900.into();
        line.to_string()
    };
    let other = changed("\"still\":false", 30, &sample);
    assert_says(&other, &["apart", "not every decision is the same"]);
    let other = changed("\"TablePart\"", 0, &gone);
    assert_says(&other, &["does not have the table"]);
    assert_says(&changed("\"still\":false", 30, &gone), &["is missing"]);
    let other = changed("\"SlideReport\"", 0, &|_| "nonsense".into());
    assert_says(&other, &["no line of a session's log"]);
    let version = format!("\"protocol\":{PROTOCOL}");
    let other = changed("session", 0, &|line| {
        line.replace(&version, "\"protocol\":99")
    });
    assert_says(&other, &["version 99"]);
    assert_says(&complaint(&["log", "no/such/log"]), &["no/such/log"]);
}

#[test]
fn recorded_slides_have_the_features_that_the_probe_reported() {
    let (at, _) = probe(1000);
    let temp = tempfile::tempdir().unwrap();
    let (folder, log) = (temp.path().join("slides"), temp.path().join("log"));
    let said = printed(&[
        "record",
        "Burlap",
        "--port",
        &at,
        "--slides",
        "3",
        "--out",
        path(&folder),
        "--log",
        path(&log),
    ]);
    assert_says(&said, &["slide 3 of 3", "3 slides of 1 texture."]);
    let told: Vec<[f64; 3]> = fs::read_to_string(&log)
        .unwrap()
        .lines()
        .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap())
        .filter_map(|line| {
            let observed = line["report"]["event"]["SlideReport"]["observed"]["properties"]
                .as_array()?
                .clone();
            Some([0, 1, 2].map(|n| observed[n].as_f64().unwrap()))
        })
        .collect();
    let out = Command::new(env!("CARGO_BIN_EXE_tactus"))
        .args(["features", "--format", "csv", "--recordings", path(&folder)])
        .output()
        .unwrap();
    let rows = String::from_utf8(out.stdout).unwrap();
    let rows: Vec<Vec<&str>> = rows
        .lines()
        .skip(1)
        .map(|row| row.split(',').collect())
        .collect();
    assert_eq!((rows.len(), told.len()), (3, 3));
    for (row, told) in rows.iter().zip(told) {
        for (here, there) in row[2..5].iter().zip(told) {
            let here: f64 = here.parse().unwrap();
            assert!((here - there).abs() < 2e-6, "{row:?} {told:?}");
        }
    }
    let manifest = fs::read_to_string(folder.join("manifest.csv")).unwrap();
    assert_says(&manifest, &["Burlap", "t001_s003_pdc.npy", ",20,"]);
    assert_says(
        &complaint(&["record", "x", "--port", &at, "--out", path(&folder)]),
        &["already holds recordings"],
    );
}

/// A terminal at which somebody answers each question with the next of these, as `tactus device` with these arguments asks
/// them; what was printed, and what was asked.
#[cfg(unix)]
fn answered(arguments: &[&str], answers: &[&str]) -> (String, String) {
    use serialport::{SerialPort as _, TTYPort};
    let (mut terminal, slave) = TTYPort::pair().unwrap();
    let stdin = fs::OpenOptions::new()
        .read(true)
        .write(true)
        .open(slave.name().unwrap())
        .unwrap();
    let mut child = device(arguments)
        .stdin(stdin)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stderr = child.stderr.take().unwrap();
    let (mut said, mut answers) = (Vec::new(), answers.iter());
    let mut byte = [0];
    while stderr.read(&mut byte).unwrap() > 0 {
        said.push(byte[0]);
        if said.ends_with(b"(n: it stays): ") {
            let answer = answers.next().expect("one question too many");
            terminal.write_all(answer.as_bytes()).unwrap();
        }
    }
    assert!(answers.next().is_none(), "a question too few");
    let out = child.wait_with_output().unwrap();
    let said = String::from_utf8(said).unwrap();
    assert!(out.status.success(), "{arguments:?}: {said}");
    (String::from_utf8(out.stdout).unwrap(), said)
}

#[cfg(unix)]
#[test]
fn a_training_asks_to_move_the_sample_and_the_table_says_what_came_of_it() {
    let (at, asked) = probe(1000);
    let temp = tempfile::tempdir().unwrap();
    let [pulled, page] = ["pulled", "page.html"].map(|name| temp.path().join(name));
    let train = |name: &str, options: &[&str], answers: &[&str]| {
        let command = ["train", name, "--trials", "3", "--seed", "4", "--port", &at];
        while asked.try_recv().is_ok() {}
        let told = answered(&[&command, options].concat(), answers);
        let trained = asked
            .try_iter()
            .filter(|c| matches!(c, wire::Command::Train(_)));
        (told.0, trained.count())
    };
    let says = |name: &str| {
        let show = ["table", "show", "--port", &at, "--format", "json"];
        let table: serde_json::Value = serde_json::from_str(&printed(&show)).unwrap();
        let textures = table["textures"].as_array().unwrap().clone();
        let texture = textures.into_iter().find(|t| t["name"] == name).unwrap();
        assert!(
            texture["movements"][2]["trials"].as_u64() >= Some(3),
            "{texture}"
        );
        texture["sample_moved"].clone()
    };
    // twice between three trials
    let (out, parts) = train("moved", &[], &["\n", "\n"]);
    assert_says(&out, &["9 slides made", "was moved between trials"]);
    assert_eq!((parts, says("moved")), (3, true.into()));
    let (out, _) = train("stayed", &[], &["n\n", "n\n"]);
    assert_says(
        &out,
        &["9 slides made", "was not moved: slides on the same"],
    );
    assert_eq!(says("stayed"), false);
    let (out, _) = train("both", &[], &["\n", "n\n"]);
    assert_says(&out, &["does not know whether"]);
    assert!(says("both").is_null());
    // who says so beforehand is not asked; a script is not either
    let (_, parts) = train("turned", &["--moved"], &[]);
    assert_eq!((parts, says("turned")), (1, true.into()));
    let (_, parts) = train("flat", &["--same-spot"], &[]);
    assert_eq!((parts, says("flat")), (1, false.into()));
    let script = ["train", "script", "--trials", "3", "--port", &at];
    assert_says(
        &printed(&script),
        &["9 slides made", "does not know whether"],
    );
    assert!(says("script").is_null());
    // more trials of a texture that was moved: not known any more, unless they were, too
    let more = ["train", "turned", "--trials", "4", "--port", &at];
    printed(&[&more[..], &["--moved"]].concat());
    assert_eq!(says("turned"), true);
    printed(&["train", "turned", "--trials", "5", "--port", &at]);
    assert!(says("turned").is_null());
    // what the probe learns and deletes otherwise leaves it as it is
    printed(&["identify", "--port", &at, "--seed", "7"]);
    printed(&["teach", "something else", "--port", &at]);
    printed(&["forget", "--name", "script", "--yes", "--port", &at]);
    printed(&["rename", "moved", "renamed", "--port", &at]);
    assert_eq!(
        (says("flat"), says("renamed")),
        (false.into(), serde_json::Value::Null)
    );
    printed(&["table", "pull", path(&pulled), "--port", &at]);
    let tactus = |arguments: &[&str]| {
        let mut tactus = Command::new(env!("CARGO_BIN_EXE_tactus"));
        let out = tactus.args(arguments).output().unwrap();
        assert!(out.status.success(), "{out:?}");
        String::from_utf8(out.stdout).unwrap()
    };
    for said in [
        tactus(&["table", "show", path(&pulled)]),
        tactus(&["report", path(&pulled), "--out", path(&page)]),
    ] {
        assert_says(
            &said,
            &[
                "always at the same spot: stayed, flat;",
                "Learned at one spot: stayed, flat.",
            ],
        );
    }
    let page = fs::read_to_string(page).unwrap();
    assert_says(
        &page,
        &[
            "sample moved",
            "Learned at one spot: stayed, flat.",
            "<td>not known</td>",
        ],
    );
    let report = tactus(&["report", path(&pulled), "--format", "json"]);
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    let moved = |name: &str| {
        let textures = report["textures"].as_array().unwrap();
        textures.iter().find(|t| t["name"] == name).unwrap()["sample_moved"].clone()
    };
    assert_eq!(
        [moved("flat"), moved("both")],
        [false.into(), serde_json::Value::Null]
    );
}

#[test]
fn teaching_and_calibrating_do_what_was_meant() {
    let (at, asked) = probe(1000);
    let name = |name: &str| Name::try_from(name).unwrap();
    let last = |arguments: &[&str], command: wire::Command| {
        let said = printed(&[arguments, &["--port", &at]].concat());
        assert!(
            asked.try_iter().any(|asked| asked == command),
            "{command:?}"
        );
        said
    };
    let refused = |arguments: &[&str]| complaint(&[arguments, &["--port", &at]].concat());
    // of an exploration only
    assert_says(
        &refused(&["teach", "velvet"]),
        &["the probe refused", "explore first"],
    );
    let identify = [
        "identify",
        "--threshold",
        "1",
        "--max-slides",
        "6",
        "--seed",
        "7",
    ];
    printed(&[&identify[..], &["--port", &at]].concat());
    // it is the very texture that the table has under another name: ten slides of a table of so few would not always show it
    let twin = texture_name(UNKNOWN);
    assert_says(
        &last(&["teach", "velvet"], wire::Command::Label(name("velvet"))),
        &[
            "learned velvet from 6 slides",
            &format!("Most like {twin}: "),
        ],
    );
    let textures = |count: &str| {
        let status = printed(&["status", "--port", &at]);
        assert_says(&status, &[count]);
    };
    textures("4 textures");
    let rename = wire::Command::Rename {
        from: name("velvet"),
        to: name("felt"),
    };
    last(&["rename", "VELVET", "felt"], rename);
    for wanted in ["forget --name fel", "rename fel silk"] {
        let arguments: Vec<&str> = wanted.split(' ').collect();
        assert_says(
            &refused(&arguments),
            &["no texture fel; did you mean felt?"],
        );
    }
    last(
        &["forget", "--yes", "--name", "Felt"],
        wire::Command::Forget(Forget::Texture(name("felt"))),
    );
    textures("3 textures");
    last(
        &["forget", "-y", "--training", "a"],
        wire::Command::Forget(Forget::Training(name("a"))),
    );
    last(
        &["forget", "--yes", "--self-learned"],
        wire::Command::Forget(Forget::SelfLearned),
    );
    last(&["home"], wire::Command::Home);
    last(&["stop"], wire::Command::Stop);
    assert_says(
        &refused(&["rename", "cheese", "felt"]),
        &["no texture cheese; there are: "],
    );
    let long = "x".repeat(41);
    assert_says(&complaint(&["teach", &long, "--port", &at]), &["40 bytes"]);

    let measured = last(
        &[
            "calibrate",
            "--newton-per-ampere",
            "16.25",
            "--force-mn-per-count",
            "11.4",
        ],
        wire::Command::Calibrate,
    );
    assert_says(
        &measured,
        &["11.40 mN a count, measured on 20", "16.25 N/A"],
    );
    let nonsense = ["calibrate", "--newton-per-ampere", "NaN", "--port", &at];
    assert_says(&complaint(&nonsense), &["above 0"]);
}

/// Without a scale or weights nobody has measured what a count of P_DC is worth: a date would say that somebody has.
#[test]
fn a_force_scale_that_nobody_measured_has_no_date() {
    let (at, _) = probe(1000);
    let calibrated = || object(&["status", "--port", &at, "--format", "json"], 0);
    let before = calibrated();
    assert_eq!(before["calibration"]["air_known"], false, "{before}");
    let without = [&["calibrate"][..], &["calibrate", "--drifted"]];
    for arguments in without {
        printed(&[arguments, &["--port", &at]].concat());
        let found = &calibrated();
        assert_eq!(found["calibrated"], 0);
        let found = &found["calibration"];
        assert_eq!(found["force_mn_per_count"], 11.5);
        assert!(
            found["force_scale_date"].is_null(),
            "the paper's scale is dated: {found}"
        );
        assert_eq!(found["air_known"], true, "{found}");
    }
    assert_says(
        &printed(&["status", "--port", &at]),
        &["not measured (the paper's 11.5 mN a count)"],
    );
    // measured on a scale once, it stays so when the motor and the air are measured again
    printed(&["calibrate", "--force-mn-per-count", "11.4", "--port", &at]);
    let dated = calibrated();
    assert!(dated["calibrated"].as_u64() > Some(20_261_100), "{dated}");
    for arguments in without {
        printed(&[arguments, &["--port", &at]].concat());
        let found = calibrated();
        assert_eq!(found["calibrated"], dated["calibrated"], "{found}");
        assert_eq!(found["calibration"]["air_known"], true, "{found}");
    }
}

/// "The same as this one?" of what lies under the finger, the share of false alarms that the probe keeps, and a new skin.
#[test]
fn a_probe_verifies_keeps_its_setting_and_is_refreshed() {
    let (at, asked) = probe(1000);
    let temp = tempfile::tempdir().unwrap();
    let backup = temp.path().join("before.tact");
    let json = |arguments: &[&str], code: i32| {
        let at = ["--port", &at, "--format", "json"];
        object(&[arguments, &at].concat(), code)
    };
    let table = json(&["table", "show"], 0);
    let name = |at: usize| table["textures"][at]["name"].as_str().unwrap().to_owned();
    let [other, own, third] = [0, 1, 2].map(name);
    // its slides are made in the simulated world, which has the second texture under the finger
    let same = json(&["verify", &own, "--seed", "1"], 0);
    assert_eq!(
        (&same["answer"], &same["reference"]),
        (&"same".into(), &own.as_str().into())
    );
    for name in [&other, &third] {
        let different = json(&["verify", name, "--seed", "1"], 3);
        assert_eq!(different["answer"], "different", "{different}");
        let last = different["slides"]
            .as_array()
            .unwrap()
            .last()
            .unwrap()
            .clone();
        assert!(last["score"].as_f64() > last["limit"].as_f64());
    }
    assert_says(
        &complaint(&["verify", "cheese", "--port", &at]),
        &["no texture cheese; there are: "],
    );

    let set = |arguments: &[&str]| {
        let said = printed(&[&["settings"][..], arguments, &["--port", &at]].concat());
        (said, json(&["status"], 0))
    };
    assert!(set(&[]).1["false_alarm"].is_null());
    let (said, status) = set(&["--false-alarm", "0.25e-1"]);
    assert_eq!(status["false_alarm"].as_f64().unwrap() as f32, 0.025);
    assert_says(&said, &["2.5 %"]);
    assert_says(&printed(&["status", "--port", &at]), &["2.5 %"]);
    assert!(set(&["--as-table"]).1["false_alarm"].is_null());
    // 2 N take somebody who says that the finger is safe
    assert_eq!(set(&[]).1["high_force"], false);
    for _ in asked.try_iter() {}
    assert_says(
        &complaint(&["settings", "--high-force", "on", "--port", &at]),
        &["nothing was changed", "--yes"],
    );
    let sets = |command: wire::Command| matches!(command, wire::Command::SetHighForce(_));
    assert!(!asked.try_iter().any(sets));
    let (said, status) = set(&["--high-force", "on", "--yes"]);
    assert_says(&said, &["2.05 N, 0.009 N/mm", "hard stop", "up to 2.00 N"]);
    assert_eq!(status["high_force"], true);
    assert_says(&printed(&["status", "--port", &at]), &["up to 2.00 N"]);
    assert_eq!(set(&["--high-force", "off"]).1["high_force"], false);
    let usage = device(&["settings", "--false-alarm", "0.7", "--port", &at]).output();
    assert_eq!(usage.unwrap().status.code(), Some(2));

    // nobody to ask: said before anybody has laid a sample under the finger
    for _ in asked.try_iter() {}
    assert_says(
        &complaint(&["refresh", "--port", &at]),
        &["nothing was changed", "--yes"],
    );
    let slid = |command: wire::Command| matches!(command, wire::Command::Identify(_));
    assert!(!asked.try_iter().any(slid));
    let mut refresh = device(&["refresh", "--yes", "--seed", "3", "--port", &at, "--backup"])
        .arg(&backup)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    refresh
        .stdin
        .take()
        .unwrap()
        .write_all(b"s\n\ns\n")
        .unwrap();
    let done = refresh.wait_with_output().unwrap();
    assert!(done.status.success());
    let now = json(&["table", "show"], 0)["checksum"].clone();
    assert_ne!(now, table["checksum"]);
    assert_says(
        &String::from_utf8(done.stdout).unwrap(),
        &[&own, now.as_str().unwrap()],
    );
    let before = fs::read(&backup).unwrap();
    assert_eq!(
        format!("{:08x}", Table::read(&before).unwrap().crc()),
        table["checksum"].as_str().unwrap()
    );
    assert_eq!(json(&["verify", &own, "--seed", "5"], 0)["answer"], "same");
}

/// Frames of these reports, and a reader of what the host says, which is thrown away.
fn says(events: &'static [fn() -> Event]) -> String {
    line(move |mut stream| {
        let mut bytes = [0; 256];
        let mut number = 0;
        while stream.read(&mut bytes).is_ok_and(|length| length > 0) {
            for tell in events {
                let report = Report {
                    number,
                    at_ms: 0,
                    event: tell(),
                };
                number += 1;
                let mut buffer = [0; MAX_FRAME + 1];
                let frame = wire::encode(&report, &mut buffer).unwrap();
                let _ = stream.write_all(frame);
            }
        }
    })
}

#[test]
fn a_port_without_a_probe_is_an_error_that_says_what_to_do() {
    let garbage = line(|mut stream| {
        let noise: Vec<u8> = (0..4000u32)
            .map(|n| (n.wrapping_mul(2_654_435_761) >> 13) as u8)
            .collect();
        while stream.write_all(&noise).is_ok() {
            thread::sleep(Duration::from_millis(5));
        }
    });
    assert_says(
        &complaint(&["status", "--port", &garbage]),
        &["not one report", "not the probe's port"],
    );
    // a terminal's greeting, without any 0
    let greeting = line(|mut stream| {
        let _ = stream.write_all(b"login: ");
        thread::sleep(Duration::from_secs(30));
    });
    assert_says(
        &complaint(&["status", "--port", &greeting]),
        &["7 bytes came and not one report"],
    );
    let silent = line(|_stream| thread::sleep(Duration::from_secs(30)));
    assert_says(
        &complaint(&["status", "--port", &silent]),
        &["said nothing", "has power"],
    );
    let closed = line(drop);
    assert_says(
        &complaint(&["status", "--port", &closed]),
        &["port", "open it again"],
    );
    let booted = says(&[|| Event::Booted {
        protocol: 2,
        version: Default::default(),
        reset: Reset::Power,
        last_words: None,
        finger: FingerCode::BIOTAC,
    }]);
    assert_says(
        &complaint(&["status", "--port", &booted]),
        &["version 2", "tactus device flash"],
    );
    // whole frames with a message that nobody knows
    let foreign = line(|mut stream| {
        let mut bytes = [0; 256];
        while stream.read(&mut bytes).is_ok_and(|length| length > 0) {
            let mut buffer = [0; MAX_FRAME + 1];
            let _ = stream.write_all(wire::encode(&[250u8; 30], &mut buffer).unwrap());
        }
    });
    assert_says(
        &complaint(&["status", "--port", &foreign]),
        &["another version", "tactus device flash"],
    );
    let nobody = complaint(&["status", "--port", "tcp:127.0.0.1:1"]);
    assert_says(&nobody, &["127.0.0.1:1", "cargo xtask emulate"]);
    assert_says(
        &complaint(&["status", "--port", "tcp:nonsense"]),
        &["nonsense"],
    );
    assert_says(
        &complaint(&["status", "--port", "/dev/no-such-port"]),
        &["there is no such port"],
    );
    assert_says(
        &complaint(&["status", "--port", "/dev/null"]),
        &["is it a serial port?"],
    );
}

#[test]
fn a_slow_line_works_and_a_vanished_one_is_an_error() {
    known();
    /// Gives its bytes one at a time.
    struct Slow(TcpStream);
    impl Read for Slow {
        fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
            self.0.read(&mut bytes[..1])
        }
    }
    impl Write for Slow {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            thread::sleep(Duration::from_micros(300));
            self.0.write(&bytes[..1])
        }
        fn flush(&mut self) -> std::io::Result<()> {
            self.0.flush()
        }
    }
    let slow = line(|stream| {
        let wait = Some(Duration::from_millis(1));
        stream.set_read_timeout(wait).unwrap();
        serve(once(Slow(stream)), 1000, mpsc::channel().0);
    });
    assert_says(&printed(&["status", "--port", &slow]), &["3 textures"]);

    // the cable is pulled while the finger slides
    let vanishing = line(|stream| {
        let (asked, told) = mpsc::channel();
        let wait = Some(Duration::from_millis(1));
        stream.set_read_timeout(wait).unwrap();
        let cable = stream.try_clone().unwrap();
        thread::spawn(move || {
            while !matches!(told.recv(), Ok(wire::Command::Identify(_)) | Err(_)) {}
            thread::sleep(Duration::from_millis(100));
            let _ = cable.shutdown(std::net::Shutdown::Both);
        });
        serve(once(stream), 10, asked);
    });
    let said = complaint(&["identify", "--port", &vanishing]);
    assert_says(&said, &["port", "The rig was moving", "emergency stop"]);
}

#[cfg(unix)]
#[path = "device/unix.rs"]
mod unix;

#[test]
fn the_monitor_wants_a_terminal() {
    let (at, _) = probe(1000);
    assert_says(
        &complaint(&["monitor", "--port", &at]),
        &["needs a terminal", "tactus device identify"],
    );
}

#[test]
fn flash_says_what_it_runs_and_what_is_missing() {
    let lines = |options: &[&str]| printed(&[&["flash", "--dry-run", "t/elf"], options].concat());
    assert_eq!(
        lines(&[]),
        "probe-rs download --chip STM32F429ZITx --verify t/elf\nprobe-rs reset --chip STM32F429ZITx\n"
    );
    assert_eq!(
        lines(&["--attach", "--", "--probe", "0483:374b"]),
        "probe-rs run --chip STM32F429ZITx --probe 0483:374b t/elf\n"
    );
    assert_says(
        &complaint(&["flash", "no/such/elf"]),
        &["no/such/elf", "cargo xtask size"],
    );
    let temp = tempfile::tempdir().unwrap();
    let elf = temp.path().join("elf");
    fs::write(&elf, "").unwrap();
    let bare = |folder: &Path| {
        let out = device(&["flash", path(&elf)])
            .env("PATH", folder)
            .output()
            .unwrap();
        String::from_utf8(out.stderr).unwrap()
    };
    assert_says(&bare(temp.path()), &["cargo install probe-rs-tools"]);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        let program = temp.path().join("probe-rs");
        fs::write(&program, "#!/bin/sh\necho No debug probes were found.\n").unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        assert_says(&bare(temp.path()), &["no debug probe found", "CN1"]);
    }
}

#[test]
fn completions_know_the_commands() {
    let tactus = |arguments: &[&str]| {
        let out = Command::new(env!("CARGO_BIN_EXE_tactus"))
            .args(arguments)
            .output()
            .unwrap();
        assert!(out.status.success(), "{arguments:?}");
        String::from_utf8(out.stdout).unwrap()
    };
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = tactus(&["completions", shell]);
        assert_says(&script, &["device", "monitor", "high-force"]);
    }
}

#[test]
fn a_port_has_one_owner() {
    // one that takes calls and says nothing: whoever asks it waits
    let at = line(|stream| {
        thread::sleep(Duration::from_secs(60));
        drop(stream);
    });
    let folder = tempfile::tempdir().unwrap();
    let status = || {
        let mut command = device(&["status", "--port", &at]);
        command.env("XDG_RUNTIME_DIR", folder.path());
        command.stdout(Stdio::null()).stderr(Stdio::piped());
        command
    };
    let mut first = status().spawn().unwrap();
    let began = Instant::now();
    // until it has the port, after which it waits for an answer
    while !fs::read_dir(folder.path().join("tactus")).is_ok_and(|mut files| files.next().is_some())
    {
        assert!(began.elapsed() < Duration::from_secs(20));
        thread::sleep(Duration::from_millis(5));
    }
    thread::sleep(Duration::from_millis(50));
    let refused = status().output().unwrap();
    let said = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert_says(&said, &[&at, "used by another tactus"]);
    assert!(first.try_wait().unwrap().is_none(), "the first one goes on");
    // however the owner ends, the port is free
    first.kill().unwrap();
    first.wait().unwrap();
    let mut next = status().spawn().unwrap();
    thread::sleep(Duration::from_millis(300));
    assert!(next.try_wait().unwrap().is_none(), "it asks the probe");
    next.kill().unwrap();
    next.wait().unwrap();
}
