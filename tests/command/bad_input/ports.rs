//! Ports, and what may come from them.

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread;

use tactus_core::sensor::FingerCode;
use tactus_core::wire::{self, Counts, Event, MAX_FRAME, Phase, Report, Reset, Status};
use tempfile::TempDir;

use super::of_table;

const COMMAND: [&str; 4] = ["device", "status", "--port", "PORT"];

/// What a good probe answers.
fn frame(event: Event) -> Vec<u8> {
    let report = Report {
        number: 0,
        at_ms: 0,
        event,
    };
    let mut buffer = [0; MAX_FRAME + 1];
    wire::encode(&report, &mut buffer).unwrap().to_vec()
}

fn status() -> Vec<u8> {
    frame(Event::Status(Status {
        phase: Phase::Ready,
        fault: None,
        textures: 4,
        table_bytes: 900,
        table_crc: 7,
        factory: true,
        calibrated: 0,
        counts: Counts::default(),
        skin_mj: (1500, 250),
        false_alarm: None,
        high_force: false,
        finger: FingerCode::BIOTAC,
    }))
}

/// Somebody at a TCP port of its own, who answers each request so.
fn says(answer: impl Fn(&mut TcpStream) + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let at = listener.local_addr().unwrap().to_string();
    thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            let mut bytes = [0; 256];
            while stream.read(&mut bytes).is_ok_and(|length| length > 0) {
                answer(&mut stream);
            }
        }
    });
    at
}

/// The first line of what the command answers at this port; it must be an error.
fn error(port: &str) -> String {
    let temp = TempDir::new().unwrap();
    let arguments = COMMAND.map(|argument| argument.replace("PORT", port));
    let out = Command::new(env!("CARGO_BIN_EXE_tactus"))
        .args(&arguments)
        .env("XDG_RUNTIME_DIR", temp.path())
        .env("XDG_DATA_HOME", temp.path())
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let said = String::from_utf8(out.stderr).unwrap();
    assert_eq!(out.status.code(), Some(1), "{port}: {said}");
    assert!(out.stdout.is_empty(), "{port}");
    assert!(!said.contains("panicked"), "{port}: {said}");
    let line = said.lines().next().unwrap_or_default();
    let line = line.strip_prefix("error: ").expect("an error");
    of_table(&counted(&line.replace(port, "PORT")))
}

/// The text with N for the number of bytes that came, which hangs on time.
fn counted(text: &str) -> String {
    match text.split_once(" bytes came") {
        Some((before, after)) => {
            let kept = before.trim_end_matches(|c: char| c.is_ascii_digit());
            format!("{kept}N bytes came{after}")
        }
        None => text.to_owned(),
    }
}

fn send(bytes: Vec<u8>) -> impl Fn(&mut TcpStream) + Send + 'static {
    // whether the other end still listens is its own affair
    move |stream| drop(stream.write_all(&bytes))
}

/// A port that nobody listens at.
fn nobody() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    listener.local_addr().unwrap().to_string()
}

pub(super) fn section() -> String {
    let mut flipped = status();
    let middle = flipped.len() / 2;
    flipped[middle] ^= 1;
    let half = status()[..20].to_vec();
    let booted = Event::Booted {
        protocol: 99,
        version: Default::default(),
        reset: Reset::Power,
        last_words: None,
        finger: FingerCode::BIOTAC,
    };
    // a good answer is none of these errors
    let at = says(send([status(), frame(Event::Done(0))].concat()));
    let good = Command::new(env!("CARGO_BIN_EXE_tactus"))
        .args(COMMAND.map(|argument| argument.replace("PORT", &at)))
        .stdin(Stdio::null())
        .output()
        .unwrap();
    assert!(
        !String::from_utf8_lossy(&good.stderr).contains("not one report"),
        "{good:?}"
    );
    let ports: Vec<(&str, String)> = vec![
        ("missing", nobody()),
        ("missing, a serial port", "/dev/no-such-port".to_owned()),
        ("empty: it says nothing", says(|_| ())),
        (
            "cut short: half a report, and the port is closed",
            says(move |stream| {
                send(half.clone())(stream);
                let _ = stream.shutdown(std::net::Shutdown::Both);
            }),
        ),
        ("a flipped bit in every report", says(send(flipped))),
        (
            "wrong type: a terminal's greeting",
            says(send(b"login: ".to_vec())),
        ),
        ("wrong type: a file", "/dev/null".to_owned()),
        (
            "huge: bytes without end, and no end of a report",
            says(|stream| while stream.write_all(&[0x55; 4096]).is_ok() {}),
        ),
        ("another version of the messages", says(send(frame(booted)))),
    ];
    let answers: Vec<_> = ports
        .into_iter()
        .map(|(name, port)| (name, thread::spawn(move || error(&port))))
        .collect();
    let mut text = format!(
        "## A port\n\n`tactus {}`\n\nN is a number of bytes. A flipped bit in one report is no error: the report is counted as damaged, and asked for again.\n\n\
         | damage | answer |\n|---|---|\n",
        COMMAND.join(" ")
    );
    for (name, answer) in answers {
        text += &format!("| {name} | {} |\n", answer.join().unwrap());
    }
    text += &format!("| no permission | {} |\n\n", not_allowed());
    text
}

/// A port that the user may not open. Root may open any: then only what others are told is known.
fn not_allowed() -> &'static str {
    use std::os::unix::fs::PermissionsExt as _;
    let temp = TempDir::new().unwrap();
    let file = temp.path().join("port");
    std::fs::write(&file, []).unwrap();
    std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o0)).unwrap();
    let said = error(file.to_str().unwrap());
    let is_root = Path::new(&file).exists() && std::fs::read(&file).is_ok();
    const DENIED: &str = "PORT: you may not open this port. On Linux: sudo usermod -aG dialout $USER, then log in again";
    assert!(is_root || said == DENIED, "{said}");
    DENIED
}
