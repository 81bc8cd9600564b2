//! `tactus device` as a user meets it, at a probe in software: the simulated rig under the core's own probe behind the
//! frames of the link, on a TCP port or a pseudo terminal; and at lines that are no probe's.

#[path = "device/client.rs"]
mod client;
#[path = "device/hostile.rs"]
mod hostile;
#[path = "device/lines.rs"]
mod lines;
#[path = "device/package.rs"]
mod package;
#[path = "device/page.rs"]
mod page;
#[path = "device/printer.rs"]
mod printer;
#[path = "device/software.rs"]
mod software;
#[path = "device/tables.rs"]
mod tables;
#[cfg(unix)]
#[path = "device/unix.rs"]
mod unix;

use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::Stdio;

use serde_json::Value;
use tactus_core::table::Table;
use tactus_core::wire::{self, Forget, PROTOCOL};
use tactus_lab::sim::collection::texture_name;

use crate::{Ran, Scratch, array, assert_says, ran};
use software::{Bench, UNKNOWN};

#[test]
fn the_doctor_says_what_is_wrong_and_changes_nothing() {
    let bench = Bench::new(1);
    let told = bench.json("doctor", 0);
    let of = |name: &str| {
        let check = array(&told["checks"])
            .iter()
            .find(|check| check["name"] == name);
        &check.unwrap_or_else(|| panic!("no {name} in {told}"))["state"]
    };
    for good in ["port", "line", "rig", "sensor", "skin", "store"] {
        assert_eq!(of(good), "good", "{good}: {told}");
    }
    // the firmware's own table, and a scale that nobody measured
    assert_eq!([of("table"), of("force scale")], ["look", "look"]);
    let mut writes = bench.asked();
    writes.retain(|c| !matches!(c, wire::Command::Status | wire::Command::ReadTable(_)));
    assert_eq!(writes, [wire::Command::SetFalseAlarm(None)]);
    let Ran { code, out, .. } = bench.at.run("device doctor --port /dev/none");
    assert_eq!(code, Some(1));
    assert!(
        out.starts_with("BAD   port") && out.contains("no such port"),
        "{out}"
    );
}

/// Teaches, renames and forgets the texture under the finger; the probe gets the commands that were meant.
#[test]
fn a_session_does_what_was_meant() {
    let bench = Bench::new(1000);
    let name = |name: &str| name.try_into().unwrap();
    let does = |line: &str, command: wire::Command| {
        let said = bench.printed(line);
        assert!(bench.asked().contains(&command), "{command:?}");
        said
    };
    assert_says(
        &bench.printed("status"),
        &["ready", "3 textures", "0 parity errors", "N/A"],
    );
    let status = bench.json("status", 0);
    assert_eq!(
        (&status["textures"], &status["phase"]),
        (&3.into(), &"Ready".into())
    );
    // of an exploration only
    assert_says(
        &bench.error("teach velvet"),
        &["the probe refused", "explore first"],
    );
    // nothing is ever more probable than 1
    let found = bench.json("identify --threshold 1 --max-slides 6 --seed 7", 4);
    assert_eq!(
        (&found["among"], &found["verdict"]["told"]),
        (&3.into(), &"undecided".into())
    );
    let slides = array(&found["slides"]);
    assert_eq!(slides.len(), 6);
    assert!(slides[0]["roughness_ln"].is_number(), "{found}");
    assert!(
        slides[1]["posterior"][0]["probability"].as_f64() > Some(0.3),
        "{found}"
    );
    // it is the very texture that the table has under another name
    let said = does("teach velvet", wire::Command::Label(name("velvet")));
    let twin = format!("Most like {}: ", texture_name(UNKNOWN));
    assert_says(&said, &["learned velvet from 6 slides", &twin]);
    assert_says(&bench.printed("status"), &["4 textures"]);
    let (from, to) = (name("velvet"), name("felt"));
    does("rename VELVET felt", wire::Command::Rename { from, to });
    for line in [
        "forget --name fel",
        "rename fel silk",
        "identify --among fel",
    ] {
        assert_says(&bench.error(line).to_lowercase(), &["did you mean felt?"]);
    }
    for (line, what) in [
        ("--name Felt", Forget::Texture(name("felt"))),
        ("--training a", Forget::Training(name("a"))),
        ("--self-learned", Forget::SelfLearned),
    ] {
        does(&format!("forget --yes {line}"), wire::Command::Forget(what));
    }
    assert_says(&bench.printed("status"), &["3 textures"]);
    does("home", wire::Command::Home);
    does("stop", wire::Command::Stop);
    assert_says(
        &bench.error("rename cheese felt"),
        &["no texture cheese; there are: "],
    );
    assert_says(
        &bench.error(&format!("teach {}", "x".repeat(41))),
        &["41 bytes: shorten it to 40"],
    );
    assert_says(
        &bench.error("monitor"),
        &["needs a terminal", "tactus device identify"],
    );
}

#[test]
#[ignore = "writes two logs of tests/golden anew"]
fn the_golden_logs_of_explorations() {
    let golden = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/golden"));
    let bench = Bench::new(1000);
    let paper = fs::read(golden.join("paper.tact")).unwrap();
    bench.at.write("paper.tact", paper);
    bench.printed("identify --learn --seed 5 --log identify");
    bench.printed("table push paper.tact");
    bench.printed("identify --method paper --threshold 0.9999 --seed 5 --log paper");
    for name in ["identify", "paper"] {
        let file = fs::File::create(golden.join(format!("{name}.jsonl.gz"))).unwrap();
        let mut packed = flate2::write::GzEncoder::new(file, flate2::Compression::best());
        packed.write_all(&bench.at.read(name)).unwrap();
        packed.finish().unwrap();
    }
}

#[test]
fn every_decision_of_a_session_is_computed_again_from_its_log() {
    let bench = Bench::new(1000);
    let identify = "identify --threshold 1 --max-slides 3 --seed 7 --method fused-random --log log";
    let live = bench.printed(identify);
    assert_says(
        &live,
        &["one of 3 (seed 7)", "Slide 1:", "measured", "█", "after"],
    );
    let asked = bench.asked();
    assert!(asked.contains(&wire::Command::Stream(true)));
    assert_eq!(asked.last(), Some(&wire::Command::Stream(false)));
    // a log is never written over
    assert_says(&bench.error(identify), &["log", "another name"]);
    let replayed = bench.at.printed("device log log");
    assert_says(
        &replayed,
        &["chosen here too", "features the same, posterior the same"],
    );
    assert_says(&replayed, &["the same here", "largest difference 0e0"]);

    let lines = String::from_utf8(bench.at.read("log")).unwrap();
    let changed = |from: &str, nth: usize, change: &dyn Fn(&str) -> String, words: &[&str]| {
        let places = lines
            .lines()
            .enumerate()
            .filter(|(_, line)| line.contains(from));
        let (at, _) = places.clone().nth(nth).unwrap();
        let new = lines.lines().enumerate();
        let new = new.map(|(n, line)| if n == at { change(line) } else { line.to_owned() } + "\n");
        bench.at.write("changed", new.collect::<String>());
        let Ran { code, out, said } = bench.at.run("device log changed");
        assert_eq!(code, Some(1), "{from}");
        assert_says(&(out + &said), words);
    };
    let gone = |_: &str| String::from("{\"command\":\"Status\"}");
    let differs = "not every decision is the same";
    // another seed makes other random choices
    let seed = |line: &str| line.replace("\"seed\":7", "\"seed\":11");
    changed(
        "{\"command\":{\"Identify\"",
        0,
        &seed,
        &["IS CHOSEN", differs],
    );
    let sample = |line: &str| {
        let mut line: Value = serde_json::from_str(line).unwrap();
        line["report"]["event"]["Block"]["pac"][7] = 900.into();
        line.to_string()
    };
    changed("\"still\":false", 30, &sample, &["apart", differs]);
    changed("\"TablePart\"", 0, &gone, &["does not have the table"]);
    changed("\"still\":false", 30, &gone, &["is missing"]);
    let nonsense = |_: &str| "nonsense".into();
    changed(
        "\"SlideReport\"",
        0,
        &nonsense,
        &["no line of a session's log"],
    );
    let version = format!("\"protocol\":{PROTOCOL}");
    let other = |line: &str| line.replace(&version, "\"protocol\":99");
    changed("session", 0, &other, &["version 99"]);
}

#[test]
fn recorded_slides_have_the_features_that_the_probe_reported() {
    let bench = Bench::new(1000);
    let said = bench.printed("record Burlap --slides 3 --out slides --log log");
    assert_says(&said, &["slide 3 of 3", "3 slides of 1 texture."]);
    let log = String::from_utf8(bench.at.read("log")).unwrap();
    let told = log.lines().filter_map(|line| {
        let line: Value = serde_json::from_str(line).unwrap();
        let observed = &line["report"]["event"]["SlideReport"]["observed"]["properties"];
        observed
            .as_array()
            .map(|all| [0, 1, 2].map(|n| all[n].as_f64().unwrap()))
    });
    let told: Vec<[f64; 3]> = told.collect();
    let rows = bench
        .at
        .printed("features --format csv --recordings slides");
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
    let manifest = String::from_utf8(bench.at.read("slides/manifest.csv")).unwrap();
    assert_says(&manifest, &["Burlap", "t001_s003_pdc.npy", ",20,"]);
    assert_says(
        &bench.error("record x --out slides"),
        &["already holds recordings"],
    );
}

/// Without a scale or weights nobody has measured what a count of P_DC is worth: a date would say that somebody has.
#[test]
fn a_force_scale_that_nobody_measured_has_no_date() {
    let bench = Bench::new(1000);
    let calibration = || {
        let status = bench.json("status", 0);
        assert_eq!(
            status["calibrated"] == 0,
            status["calibration"]["force_scale_date"].is_null()
        );
        status["calibration"].clone()
    };
    assert_eq!(calibration()["air_known"], false);
    for line in ["calibrate", "calibrate --drifted"] {
        bench.printed(line);
        let found = calibration();
        assert_eq!(found["force_mn_per_count"], 11.5);
        assert!(
            found["force_scale_date"].is_null(),
            "the paper's scale is dated: {found}"
        );
        assert_eq!(found["air_known"], true, "{found}");
    }
    assert_says(
        &bench.printed("status"),
        &["not measured (the paper's 11.5 mN a count)"],
    );
    // measured on a scale once, it stays so when the motor and the air are measured again
    let scale = "calibrate --force-mn-per-count 11.4 --newton-per-ampere 16.25";
    assert_says(&bench.printed(scale), &["11.40 mN a count", "16.25 N/A"]);
    for line in ["calibrate", "calibrate --drifted"] {
        bench.printed(line);
        let found = calibration();
        assert!(found["force_scale_date"].is_string(), "{found}");
        assert_eq!(found["air_known"], true, "{found}");
    }
    assert_says(
        &bench.error("calibrate --newton-per-ampere NaN"),
        &["above 0"],
    );
}

/// "The same as this one?" of what lies under the finger, the share of false alarms that the probe keeps, and a new
/// skin.
#[test]
fn a_probe_verifies_keeps_its_settings_and_is_refreshed() {
    let bench = Bench::new(1000);
    let table = bench.json("table show", 0);
    let name = |at: usize| table["textures"][at]["name"].as_str().unwrap();
    let [other, own, third] = [0, 1, 2].map(name);
    // its slides are made in the simulated world, which has the second texture under the finger
    let same = bench.json(&format!("verify '{own}' --seed 1"), 0);
    assert_eq!(
        (&same["answer"], &same["reference"]),
        (&"same".into(), &own.into())
    );
    for name in [other, third] {
        let different = bench.json(&format!("verify '{name}' --seed 1"), 3);
        assert_eq!(different["answer"], "different", "{different}");
        let last = array(&different["slides"]).last().unwrap();
        assert!(last["score"].as_f64() > last["limit"].as_f64());
    }
    assert_says(
        &bench.error("verify cheese"),
        &["no texture cheese; there are: "],
    );

    for (line, share, said) in [
        ("settings", None, "table's own"),
        ("settings --false-alarm 0.25e-1", Some(0.025), "2.5 %"),
        ("settings --as-table", None, "table's own"),
    ] {
        assert_says(&bench.printed(line), &[said]);
        let kept = bench.json("status", 0)["false_alarm"].as_f64();
        assert_eq!(kept.map(|share| share as f32), share, "{line}");
    }
    // 2 N take somebody who says that the finger is safe
    assert_says(
        &bench.error("settings --high-force on"),
        &["nothing was changed", "--yes"],
    );
    let sets = |command: &wire::Command| matches!(command, wire::Command::SetHighForce(_));
    assert!(!bench.asked().iter().any(sets));
    let said = bench.printed("settings --high-force on --yes");
    assert_says(&said, &["2.05 N, 0.009 N/mm", "hard stop", "up to 2.00 N"]);
    assert_eq!(bench.json("status", 0)["high_force"], true);
    bench.printed("settings --high-force off");
    assert_eq!(bench.json("status", 0)["high_force"], false);
    bench
        .at
        .error("device settings --false-alarm 0.7 --port PORT", 2);

    // nobody to ask: said before anybody has laid a sample under the finger
    bench.asked();
    assert_says(&bench.error("refresh"), &["nothing was changed", "--yes"]);
    let slid = |command: &wire::Command| matches!(command, wire::Command::Identify(_));
    assert!(!bench.asked().iter().any(slid));
    let mut refresh = bench.command("refresh --yes --seed 3 --backup before");
    let mut child = refresh.stdin(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(b"s\n\ns\n").unwrap();
    assert!(child.wait().unwrap().success());
    let slid = bench.asked().iter().filter(|c| slid(c)).count();
    assert!(slid >= 1);
    let before = bench.at.read("before");
    let crc = |bytes: &[u8]| format!("{:08x}", Table::read(bytes).unwrap().crc());
    assert_eq!(crc(&before), table["checksum"].as_str().unwrap());
    assert_ne!(bench.json("table show", 0)["checksum"], table["checksum"]);
    assert_eq!(
        bench.json(&format!("verify '{own}' --seed 5"), 0)["answer"],
        "same"
    );
}

#[test]
fn flash_says_what_it_runs_and_what_is_missing() {
    let at = Scratch::new();
    assert_says(
        &at.error("device flash --dry-run t/elf", 1),
        &["t/elf: no such file"],
    );
    at.write("t/elf", "");
    let lines = at.printed("device flash --dry-run t/elf");
    assert_eq!(
        lines,
        "probe-rs download --chip STM32F429ZITx --verify t/elf\nprobe-rs reset --chip STM32F429ZITx\n"
    );
    let line = "device flash --dry-run t/elf --attach -- --probe 0483:374b";
    let attached = "probe-rs run --chip STM32F429ZITx --probe 0483:374b t/elf\n";
    assert_eq!(at.printed(line), attached);
    at.write("elf", "");
    let bare = || {
        let mut flash = at.command("device flash elf");
        ran(flash.env("PATH", at.path(""))).said
    };
    assert_says(&bare(), &["cargo install probe-rs-tools"]);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        at.write("probe-rs", "#!/bin/sh\necho No debug probes were found.\n");
        let executable = std::fs::Permissions::from_mode(0o755);
        std::fs::set_permissions(at.path("probe-rs"), executable).unwrap();
        assert_says(&bare(), &["no debug probe found", "CN1"]);
    }
}
