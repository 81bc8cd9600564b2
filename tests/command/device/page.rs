//! What a page does with a probe at a port, `tactus_lab::remote`: its bytes are carried here, and it says what the command says.

use std::io::ErrorKind::{TimedOut, WouldBlock};

use serde_json::{Value, json};
use tactus_lab::remote::Remote;

use super::*;

/// A page's end of a line.
struct Page {
    remote: Remote,
    line: TcpStream,
    began: Instant,
}

/// What a page got until its probe was done.
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
        let got = page.done(&json!({"do": "connect", "port": at, "now_ms": 0}), |_| None);
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
    fn done(&mut self, request: &Value, meanwhile: impl Fn(&Value) -> Option<Value>) -> Got {
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

    fn work(&mut self, work: Value) -> Got {
        self.done(&json!({"do": "work", "work": work}), |_| None)
    }
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
    said.lines()
        .filter(|line| !counts.iter().any(|name| line.starts_with(name)))
        .collect()
}

#[test]
fn a_page_says_what_the_command_says() {
    let (at, _) = probe(1000);
    let status = printed(&["status", "--port", &at]);
    let (mut page, got) = Page::new(&at);
    assert_eq!(got.failed, None);
    assert_eq!(lasting(&got.said), lasting(&status));
    assert_eq!(got.known["textures"].as_array().unwrap().len(), 3);

    let found = page.work(identify(7));
    assert_eq!(found.failed, None, "{}", found.said);
    let verdicts: Vec<&Value> = found
        .happened
        .iter()
        .filter(|one| one["what"] == "verdict")
        .collect();
    assert_eq!(verdicts.len(), 1, "{}", found.said);
    let slides = found.happened.iter().filter(|one| one["what"] == "slide");
    assert!(slides.clone().count() > 0);
    for slide in slides {
        assert!(slide["place"].is_array(), "{slide}");
    }
    // the log that the page keeps is one of the command's, which decides the same again
    let log = page.ask(&json!({"do": "log"}));
    let temp = tempfile::tempdir().unwrap();
    let file = temp.path().join("session.jsonl");
    fs::write(&file, bytes(&log["files"][0])).unwrap();
    printed(&["log", path(&file)]);
    // heard again it is the same
    page.remote.give(fs::read(&file).unwrap());
    let again = page.ask(&json!({"do": "open", "files": ["session.jsonl"]}));
    let told = |happened: &[Value]| -> Vec<Value> {
        let of = |one: &&Value| one["what"] != "done";
        happened.iter().filter(of).cloned().collect()
    };
    assert_eq!(
        told(again["happened"].as_array().unwrap()),
        told(&found.happened)
    );
}

#[test]
fn a_page_teaches_verifies_and_records() {
    let (at, _) = probe(1000);
    let (mut page, _) = Page::new(&at);
    page.work(identify(3));
    let taught = page.work(json!({"do": "teach", "name": "mine"}));
    assert_eq!(taught.failed, None);
    assert_says(&taught.said, &["The probe has learned mine from"]);
    let names = taught.known["textures"].as_array().unwrap();
    assert!(names.contains(&json!("mine")), "{names:?}");
    let verified = page.work(
        json!({"do": "verify", "name": "mine", "threshold": 0.99, "max_slides": 3, "seed": 5}),
    );
    assert_eq!(verified.failed, None, "{}", verified.said);
    assert_says(
        &verified.said,
        &["Is it mine?", "slide 1,", "At this limit"],
    );
    // in the log it is judged again
    let log = page.ask(&json!({"do": "log"}));
    page.remote.give(bytes(&log["files"][0]));
    let again = page.ask(&json!({"do": "open", "files": ["session.jsonl"]}));
    {
        let happened = again["happened"]
            .as_array()
            .unwrap_or_else(|| panic!("{again}"));
        let of = |what: &str| -> Vec<&str> {
            let all = happened.iter().filter(|one| one["what"] == what);
            all.map(|one| one["said"].as_str().unwrap()).collect()
        };
        for said in [of("judged"), of("verified")].concat() {
            assert!(verified.said.contains(said), "{said}\n{}", verified.said);
        }
        let slides = verified.said.matches("  slide ").count();
        assert_eq!((of("judged").len(), of("verified").len()), (slides, 1));
    }

    let trained = page.work(json!({"do": "train", "name": "mine too", "trials": 1, "seed": 1}));
    assert_eq!(trained.failed, None, "{}", trained.said);
    assert_says(&trained.said, &["trial 1 of", "mine too: 3 slides made."]);

    let recorded = page.work(json!({"do": "record", "name": "Mine", "slides": 3, "seed": 2}));
    assert_eq!(recorded.failed, None, "{}", recorded.said);
    let temp = tempfile::tempdir().unwrap();
    for file in recorded.folders[0]["files"].as_array().unwrap() {
        let name = file["name"].as_str().unwrap();
        fs::write(temp.path().join(name), bytes(file)).unwrap();
    }
    let set = tactus_lab::data::recordings::RecordingSet::open(temp.path()).unwrap();
    assert_eq!(set.names(), ["Mine"]);
    assert_eq!(set.load_texture(0).unwrap().len(), 3);
}

#[test]
fn a_page_keeps_a_table_before_it_is_replaced() {
    let (at, _) = probe(1000);
    let (mut page, _) = Page::new(&at);
    let pulled = page.work(json!({"do": "pull"}));
    let factory = bytes(&pulled.files[0]);
    assert_eq!(factory, known().1);
    page.work(identify(3));
    page.work(json!({"do": "teach", "name": "mine"}));
    let learned = bytes(&page.work(json!({"do": "pull"})).files[0]);
    let push = json!({"do": "work", "work": {"do": "push", "file": "old.tact", "bytes": factory}});
    let answer = |yes: bool| {
        move |frame: &Value| {
            frame["question"]
                .is_object()
                .then(|| json!({"do": "answer", "yes": yes}))
        }
    };
    let kept = page.done(&push, answer(false));
    assert_eq!(kept.failed.as_deref(), Some("nothing was changed"));
    assert_eq!(bytes(&kept.files[0]), learned);
    assert_says(&kept.said, &["No longer known: mine."]);
    let pushed = page.done(&push, answer(true));
    assert_eq!(pushed.failed, None);
    assert_says(
        &pushed.said,
        &["old.tact: the probe uses it now: 3 textures"],
    );
    let mut damaged = factory.clone();
    damaged[40] ^= 1;
    let refused = page.work(json!({"do": "push", "file": "bad.tact", "bytes": damaged}));
    assert!(refused.failed.unwrap().starts_with("bad.tact: "));
}

#[test]
fn a_page_asks_to_move_the_sample_where_the_command_does() {
    let (at, _) = probe(1000);
    let (mut page, _) = Page::new(&at);
    let sentence =
        "Move or turn Mine under the finger, so that the next slide is on another track.";
    let answers = |answer: Value| {
        move |frame: &Value| {
            let question = frame["question"].as_object()?;
            assert_eq!(question["asked"], sentence);
            assert_eq!(question["yes"], "It is moved");
            Some(answer.clone())
        }
    };
    // of a new texture, before the second trial alone
    let train =
        json!({"do": "work", "work": {"do": "train", "name": "Mine", "trials": 2, "seed": 1}});
    let trained = page.done(&train, answers(json!({"do": "answer", "yes": true})));
    assert_eq!(trained.failed, None, "{}", trained.said);
    assert_says(
        &trained.said,
        &[
            "Mine: 6 slides made.",
            "Its sample was moved between trials.",
        ],
    );
    // of one with trials, before the first
    let again =
        json!({"do": "work", "work": {"do": "train", "name": "Mine", "trials": 3, "seed": 2}});
    let stopped = page.done(&again, answers(json!({"do": "stop"})));
    assert_eq!(
        stopped.failed.as_deref(),
        Some("stopped: the finger is lifted and the stage stands")
    );
    let known =
        page.work(json!({"do": "train", "name": "Mine", "trials": 3, "moved": false, "seed": 2}));
    assert_eq!(known.failed, None, "{}", known.said);
    assert_says(&known.said, &["Mine: 3 slides made."]);

    let record =
        json!({"do": "work", "work": {"do": "record", "name": "Mine", "slides": 4, "seed": 2}});
    let recorded = page.done(&record, answers(json!({"do": "answer", "yes": false})));
    assert_eq!(recorded.failed, None, "{}", recorded.said);
    let manifest = recorded.folders[0]["files"].as_array().unwrap().last();
    let manifest = String::from_utf8(bytes(manifest.unwrap())).unwrap();
    let of_slide = |row: &str| row.rsplit(',').nth(4).unwrap().to_owned();
    let moved: Vec<String> = manifest.lines().skip(1).map(of_slide).collect();
    assert_eq!(moved, ["no"; 4], "{manifest}");
}

#[test]
fn a_page_changes_what_a_probe_knows_and_keeps_as_the_command_does() {
    let (at, _) = probe(1000);
    let (mut page, _) = Page::new(&at);
    let factory = bytes(&page.work(json!({"do": "pull"})).files[0]);
    let first = Table::read(&factory).unwrap().name(0).unwrap().to_owned();
    let answer = |yes: bool| {
        move |frame: &Value| {
            let asked = frame["question"]["asked"].as_str()?;
            assert!(asked.ends_with("\nGo on?"), "{asked}");
            Some(json!({"do": "answer", "yes": yes}))
        }
    };
    let work = |work: Value| json!({"do": "work", "work": work});

    let renamed = page.work(json!({"do": "rename", "from": first, "to": "renamed"}));
    assert_eq!(renamed.failed, None);
    assert_says(&renamed.said, &[&format!("{first} is renamed now.")]);
    assert!(
        renamed.known["textures"]
            .as_array()
            .unwrap()
            .contains(&json!("renamed"))
    );
    let before = bytes(&page.work(json!({"do": "pull"})).files[0]);

    let forget = work(json!({"do": "forget", "name": "renamed"}));
    let kept = page.done(&forget, answer(false));
    assert_eq!(kept.failed.as_deref(), Some("nothing was changed"));
    assert_eq!(bytes(&kept.files[0]), before);
    let forgotten = page.done(&forget, answer(true));
    assert_eq!(forgotten.failed, None);
    assert_says(
        &forgotten.said,
        &[
            "The probe is to forget renamed.",
            "The probe's table is kept: table-",
            "The probe has forgotten renamed.",
        ],
    );
    assert_eq!(bytes(&forgotten.files[0]), before);
    assert_eq!(forgotten.known["textures"].as_array().unwrap().len(), 2);
    let nothing = page.done(&work(json!({"do": "forget-self-learned"})), answer(true));
    assert_says(
        &nothing.said,
        &["The probe is to forget what it learned by itself."],
    );
    let nobody = page.done(
        &work(json!({"do": "forget-training", "name": "nothing"})),
        answer(true),
    );
    assert_eq!(nobody.failed, None);
    assert_says(
        &nobody.said,
        &["The probe has forgotten the training of nothing."],
    );

    let back = page.done(&work(json!({"do": "factory"})), answer(true));
    assert_eq!(back.failed, None);
    assert_says(
        &back.said,
        &["The probe uses the firmware's own table: 3 textures"],
    );
    assert_eq!(bytes(&page.work(json!({"do": "pull"})).files[0]), factory);
    // there is nothing to lose, and no question
    assert_eq!(page.work(json!({"do": "factory"})).files.len(), 0);

    // the same words as the command's
    let alarm = page.work(json!({"do": "false-alarm", "share": 0.005}));
    drop(page);
    let printed = printed(&["settings", "--port", &at]);
    assert_eq!(alarm.said, printed);
    assert_says(&printed, &["for 0.5 % false alarms, as set"]);
    let (mut page, _) = Page::new(&at);
    let high = page.done(&work(json!({"do": "high-force", "on": true})), |frame| {
        let asked = frame["question"]["asked"].as_str()?;
        assert!(asked.contains("a mount whose spring yields"), "{asked}");
        Some(json!({"do": "answer", "yes": true}))
    });
    assert_eq!(high.failed, None);
    assert_says(&high.said, &["up to 2.00 N, as set"]);
    let low = page.work(json!({"do": "high-force", "on": false}));
    assert_says(&low.said, &["up to 1.26 N"]);
    let table = page.work(json!({"do": "false-alarm", "share": null}));
    assert_says(&table.said, &["for the table's own false alarms"]);
}

#[test]
fn a_page_stops_a_probe_and_is_told_when_nobody_answers() {
    let (at, _) = probe(20);
    let (mut page, _) = Page::new(&at);
    let stopped = page.done(&json!({"do": "work", "work": identify(1)}), |frame| {
        (frame["phase"] == "Sliding").then(|| json!({"do": "stop"}))
    });
    assert_eq!(
        stopped.failed.as_deref(),
        Some("stopped: the finger is lifted and the stage stands")
    );
    let error = page.ask(&json!({"do": "dance"}));
    assert!(error["why"].as_str().unwrap().starts_with("no request"));

    let nobody = line(|mut stream| {
        let _ = stream.read(&mut [0; 1]);
        thread::sleep(Duration::from_secs(30));
    });
    let (_, silent) = Page::new(&nobody);
    let failed = silent.failed.unwrap();
    assert!(failed.contains("the probe said nothing for"), "{failed}");
    let noise = line(|mut stream| {
        let _ = stream.write_all(&[0x55; 4000]);
        thread::sleep(Duration::from_secs(30));
    });
    let (mut page, garbage) = Page::new(&noise);
    let failed = garbage.failed.unwrap();
    assert!(failed.contains("and not one report"), "{failed}");
    let error = page.ask(&json!({"do": "work", "work": {"do": "status"}}));
    assert_eq!(error["why"], "no probe is connected");
}

/// With TACTUS_PAGE_PORT, `cargo xtask test --step page` has a page speak to this probe: the address goes to that file, and the
/// probe lives until standard input ends.
#[test]
fn serves_a_page() {
    let Some(file) = std::env::var_os("TACTUS_PAGE_PORT") else {
        return;
    };
    let (at, _) = probe(40);
    fs::write(file, at.trim_start_matches("tcp:")).unwrap();
    let _ = std::io::stdin().read_to_end(&mut Vec::new());
}
