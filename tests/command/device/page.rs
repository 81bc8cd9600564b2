//! What a page does with a probe at a port, `tactus_lab::remote`: its bytes are carried here, and it says what the
//! command says.

use std::fs;
use std::io::ErrorKind::{TimedOut, WouldBlock};
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tactus_core::table::Table;
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::remote::Remote;

use super::software::{Bench, known, line};
use crate::{array, assert_says};

const STOPPED: &str = "stopped: the finger is lifted and the stage stands";

/// A page's end of a line.
struct Page {
    remote: Remote,
    line: TcpStream,
    began: Instant,
}

/// A page's frames until its probe was done.
#[derive(Default)]
struct Got {
    said: String,
    failed: Option<String>,
    happened: Vec<Value>,
    files: Vec<Value>,
    folders: Vec<Value>,
    known: Value,
}

impl Page {
    /// Connected to the probe at this address.
    fn new(at: &str) -> (Self, Got) {
        let line = TcpStream::connect(at.trim_start_matches("tcp:")).unwrap();
        line.set_read_timeout(Some(Duration::from_millis(2)))
            .unwrap();
        let mut page = Self {
            remote: Remote::default(),
            line,
            began: Instant::now(),
        };
        let got = page.until_done(&json!({"do": "connect", "port": at, "now_ms": 0}), |_| None);
        (page, got)
    }

    fn ask(&mut self, request: &Value) -> Value {
        let reply: Value = serde_json::from_str(&self.remote.ask(&request.to_string())).unwrap();
        if let Some(send) = reply["send"].as_array() {
            let bytes: Vec<u8> = send.iter().map(|b| b.as_u64().unwrap() as u8).collect();
            self.line.write_all(&bytes).unwrap();
        }
        reply
    }

    /// Asks, and carries bytes until all is done; `meanwhile` may ask for something else, once.
    fn until_done(&mut self, request: &Value, meanwhile: impl Fn(&Value) -> Option<Value>) -> Got {
        let (mut got, mut interrupted) = (Got::default(), false);
        let mut frame = self.ask(request);
        loop {
            assert_eq!(frame["is"], "frame", "{request}: {frame}");
            got.said += frame["said"].as_str().unwrap();
            got.failed = got.failed.or(frame["failed"].as_str().map(str::to_owned));
            for (to, from) in [
                (&mut got.happened, "happened"),
                (&mut got.files, "files"),
                (&mut got.folders, "folders"),
            ] {
                to.extend_from_slice(frame[from].as_array().unwrap());
            }
            if !frame["known"].is_null() {
                got.known = frame["known"].clone();
            }
            if frame["busy"] == false {
                return got;
            }
            assert!(self.began.elapsed() < Duration::from_secs(120), "{request}");
            if let Some(asked) = meanwhile(&frame).filter(|_| !interrupted) {
                interrupted = true;
                frame = self.ask(&asked);
                continue;
            }
            let mut bytes = [0; 4096];
            let received = match self.line.read(&mut bytes) {
                Ok(length) => &bytes[..length],
                Err(why) if [WouldBlock, TimedOut].contains(&why.kind()) => &[],
                Err(why) => panic!("{why}"),
            };
            let now_ms = self.began.elapsed().as_millis() as u64;
            frame = self.ask(&json!({"do": "step", "now_ms": now_ms, "received": received}));
        }
    }

    /// Has the probe do something, which must succeed.
    fn work(&mut self, wanted: Value) -> Got {
        self.asked(wanted, |_| None)
    }

    fn asked(&mut self, wanted: Value, answer: impl Fn(&Value) -> Option<Value>) -> Got {
        let got = self.until_done(&work(wanted), answer);
        assert_eq!(got.failed, None, "{}", got.said);
        got
    }
}

fn work(work: Value) -> Value {
    json!({"do": "work", "work": work})
}

fn bytes(file: &Value) -> Vec<u8> {
    let bytes = file["bytes"].as_array().unwrap();
    bytes.iter().map(|b| b.as_u64().unwrap() as u8).collect()
}

fn identify(seed: u32) -> Value {
    json!({"do": "identify", "threshold": 0.99, "false_alarm": null, "max_slides": 10, "seed": seed})
}

/// Lines that do not count what was done before.
fn lasting(said: &str) -> Vec<&str> {
    let counts = ["acquisition", "link", "skin"];
    let is_count = |line: &&str| counts.iter().any(|name| line.starts_with(name));
    said.lines().filter(|line| !is_count(line)).collect()
}

/// Answers each question that has these words.
fn answer(words: &'static str, answer: Value) -> impl Fn(&Value) -> Option<Value> {
    move |frame| {
        let asked = frame["question"]["asked"].as_str()?;
        assert_says(asked, &[words]);
        Some(answer.clone())
    }
}

fn yes() -> Value {
    json!({"do": "answer", "yes": true})
}

fn no() -> Value {
    json!({"do": "answer", "yes": false})
}

#[test]
fn a_page_says_what_the_command_says() {
    let bench = Bench::new(1000);
    let status = bench.printed("status");
    let (mut page, got) = Page::new(&bench.port);
    assert_eq!(got.failed, None);
    assert_eq!(lasting(&got.said), lasting(&status));
    assert_eq!(array(&got.known["textures"]).len(), 3);
    let found = page.work(identify(7));
    let of = |what: &'static str| found.happened.iter().filter(move |one| one["what"] == what);
    assert_eq!(of("verdict").count(), 1, "{}", found.said);
    assert!(of("slide").count() > 0 && of("slide").all(|slide| slide["place"].is_array()));
    // the log that the page keeps is one of the command's, which decides the same again
    let log = page.ask(&json!({"do": "log"}));
    bench.at.write("log", bytes(&log["files"][0]));
    let replayed = bench.at.printed("device log log");
    let told = found.said.lines().rfind(|line| line.starts_with("It is "));
    let name = told.unwrap().trim_start_matches("It is ");
    let name = name.split(": ").next().unwrap();
    let same = format!(": {name}: the same here");
    assert_says(&replayed, &[&same, "Every decision is the same here"]);
    drop(page);
    // the same words of settings, too
    let (mut page, _) = Page::new(&bench.port);
    let alarm = page.work(json!({"do": "false-alarm", "share": 0.005}));
    assert_says(&alarm.said, &["for 0.5 % false alarms, as set"]);
    let high = json!({"do": "high-force", "on": true});
    let high = page.asked(high, answer("a mount whose spring yields", yes()));
    assert_says(&high.said, &["up to 2.00 N, as set"]);
    let low = page.work(json!({"do": "high-force", "on": false}));
    assert_says(&low.said, &["up to 1.26 N"]);
    let table = page.work(json!({"do": "false-alarm", "share": null}));
    assert_says(&table.said, &["for the table's own false alarms"]);
}

#[test]
fn a_page_teaches_verifies_trains_and_records() {
    let bench = Bench::new(1000);
    let (mut page, _) = Page::new(&bench.port);
    page.work(identify(3));
    let taught = page.work(json!({"do": "teach", "name": "mine"}));
    assert_says(&taught.said, &["The probe has learned mine from"]);
    assert!(
        array(&taught.known["textures"]).contains(&json!("mine")),
        "{}",
        taught.known
    );
    let verify =
        json!({"do": "verify", "name": "mine", "threshold": 0.99, "max_slides": 3, "seed": 5});
    let verified = page.work(verify);
    assert_says(
        &verified.said,
        &["Is it mine?", "slide 1,", "The same as mine."],
    );
    // of a new texture it asks to move the sample before the second trial alone
    let moves = "Move or turn Mine under the finger, so that the next slide is on another track.";
    let train = |trials: u8| json!({"do": "train", "name": "Mine", "trials": trials, "seed": 1});
    let trained = page.asked(train(2), answer(moves, yes()));
    assert_says(
        &trained.said,
        &[
            "Mine: 6 slides made.",
            "Its sample was moved between trials.",
        ],
    );
    // of one with trials, before the first
    let stopped = page.until_done(&work(train(3)), answer(moves, json!({"do": "stop"})));
    assert_eq!(stopped.failed.as_deref(), Some(STOPPED));
    let mut same_spot = train(3);
    same_spot["moved"] = false.into();
    assert_says(&page.work(same_spot).said, &["Mine: 3 slides made."]);

    let record = json!({"do": "record", "name": "Mine", "slides": 4, "seed": 2});
    let recorded = page.asked(record, answer(moves, no()));
    let folder = tempfile::tempdir().unwrap();
    for file in array(&recorded.folders[0]["files"]) {
        fs::write(
            folder.path().join(file["name"].as_str().unwrap()),
            bytes(file),
        )
        .unwrap();
    }
    let set = RecordingSet::open(folder.path()).unwrap();
    assert_eq!(set.names(), ["Mine"]);
    assert_eq!(set.load_texture(0).unwrap().len(), 4);
    let manifest = fs::read_to_string(folder.path().join("manifest.csv")).unwrap();
    let moved = manifest
        .lines()
        .skip(1)
        .map(|row| row.rsplit(',').nth(7).unwrap());
    assert!(moved.eq(["no"; 4]), "{manifest}");
}

#[test]
fn a_page_changes_what_a_probe_knows_and_keeps_a_copy() {
    let bench = Bench::new(1000);
    let (mut page, _) = Page::new(&bench.port);
    let pull = |page: &mut Page| bytes(&page.work(json!({"do": "pull"})).files[0]);
    let factory = pull(&mut page);
    assert_eq!(factory, known().1);
    let first = Table::read(&factory).unwrap().name(0).unwrap().to_owned();
    let renamed = page.work(json!({"do": "rename", "from": first, "to": "renamed"}));
    assert_says(&renamed.said, &[&format!("{first} is renamed now.")]);
    assert!(array(&renamed.known["textures"]).contains(&json!("renamed")));
    let before = pull(&mut page);

    const ASK: &str = "\nGo on?";
    let forget = json!({"do": "forget", "name": "renamed"});
    let kept = page.until_done(&work(forget.clone()), answer(ASK, no()));
    assert_eq!(kept.failed.as_deref(), Some("nothing was changed"));
    assert_eq!(bytes(&kept.files[0]), before);
    let forgotten = page.asked(forget, answer(ASK, yes()));
    let said = [
        "The probe is to forget renamed.",
        "The probe's table is kept: table-",
    ];
    assert_says(&forgotten.said, &said);
    assert_says(&forgotten.said, &["The probe has forgotten renamed."]);
    assert_eq!(bytes(&forgotten.files[0]), before);
    assert_eq!(array(&forgotten.known["textures"]).len(), 2);
    for (request, said) in [
        (
            json!({"do": "forget-self-learned"}),
            "The probe is to forget what it learned by itself.",
        ),
        (
            json!({"do": "forget-training", "name": "x"}),
            "The probe has forgotten the training of x.",
        ),
        (
            json!({"do": "push", "file": "old.tact", "bytes": before}),
            "old.tact: the probe uses it now: 3 textures",
        ),
        (
            json!({"do": "factory"}),
            "The probe uses the firmware's own table: 3 textures",
        ),
    ] {
        assert_says(&page.asked(request, answer(ASK, yes())).said, &[said]);
    }
    assert_eq!(pull(&mut page), factory);
    // there is nothing to lose, and no question
    assert_eq!(page.work(json!({"do": "factory"})).files.len(), 0);
    let mut damaged = factory;
    damaged[40] ^= 1;
    let push = json!({"do": "push", "file": "bad.tact", "bytes": damaged});
    let refused = page.until_done(&work(push), |_| None);
    assert!(refused.failed.unwrap().starts_with("bad.tact: "));
}

#[test]
fn a_page_stops_a_probe_and_is_told_when_nobody_answers() {
    let bench = Bench::new(20);
    let (mut page, _) = Page::new(&bench.port);
    let stop = |frame: &Value| (frame["phase"] == "Sliding").then(|| json!({"do": "stop"}));
    let stopped = page.until_done(&work(identify(1)), stop);
    assert_eq!(stopped.failed.as_deref(), Some(STOPPED));
    let error = page.ask(&json!({"do": "dance"}));
    assert!(error["why"].as_str().unwrap().starts_with("no request"));
    for (greeting, why) in [
        (0, "the probe said nothing for"),
        (4000, "and not one report"),
    ] {
        let nobody = line(move |mut stream| {
            let _ = stream.write_all(&vec![0x55; greeting]);
            let _ = stream.read(&mut [0; 1]);
            thread::sleep(Duration::from_secs(30));
        });
        let (mut page, got) = Page::new(&nobody);
        assert_says(&got.failed.unwrap(), &[why]);
        let error = page.ask(&work(json!({"do": "status"})));
        assert_eq!(error["why"], "no probe is connected");
    }
}

/// With TACTUS_PAGE_PORT, `cargo xtask test --step page` has a page speak to this probe: the address goes to that file,
/// and the probe lives until standard input ends.
#[test]
fn serves_a_page() {
    let Some(file) = std::env::var_os("TACTUS_PAGE_PORT") else {
        return;
    };
    let bench = Bench::new(40);
    fs::write(file, bench.port.trim_start_matches("tcp:")).unwrap();
    let _ = std::io::stdin().read_to_end(&mut Vec::new());
}
