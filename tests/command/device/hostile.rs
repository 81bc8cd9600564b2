//! A port that echoes, and probes that say what cannot be.

use std::io::{Read as _, Write as _};

use tactus_core::sensor::FingerCode;
use tactus_core::wire::{self, Command, Counts, Event, Failure, MAX_FRAME, Phase, Receiver};
use tactus_core::wire::{Report, Request, Status};

use super::software::line;
use crate::kills::files;
use crate::{Scratch, assert_says};

fn frame(number: u16, event: Event) -> Vec<u8> {
    let mut buffer = [0; MAX_FRAME + 1];
    let report = Report {
        number,
        at_ms: 0,
        event,
    };
    wire::encode(&report, &mut buffer).unwrap().to_vec()
}

/// A probe that answers every request so.
fn probe(answers: impl Fn(&Request) -> Vec<Event> + Send + 'static) -> Scratch {
    let port = line(move |mut stream| {
        let (mut bytes, mut receiver, mut number) = ([0; 1024], Receiver::default(), 0);
        while let Ok(length @ 1..) = stream.read(&mut bytes) {
            for &byte in &bytes[..length] {
                let Some(Ok(request)) = receiver.push::<Request>(byte) else {
                    continue;
                };
                for event in answers(&request) {
                    let _ = stream.write_all(&frame(number, event));
                    number += 1;
                }
            }
        }
    });
    Scratch::new().with("PORT", port)
}

fn status() -> Status {
    Status {
        phase: Phase::Ready,
        fault: None,
        textures: 3,
        table_bytes: 900,
        table_crc: 7,
        factory: false,
        calibrated: 20_261_121,
        counts: Counts::default(),
        skin_mj: (1, 1),
        false_alarm: None,
        high_force: false,
        finger: FingerCode::BIOTAC,
    }
}

#[test]
fn a_port_that_echoes_is_called_that() {
    let at = Scratch::new().with(
        "PORT",
        line(|mut stream| {
            let mut bytes = [0; 1024];
            while let Ok(length @ 1..) = stream.read(&mut bytes) {
                let _ = stream.write_all(&bytes[..length]);
            }
        }),
    );
    let echo = [
        "sends back what it gets",
        "TX and RX are joined",
        "local echo is on",
    ];
    for command in [
        "status",
        "identify",
        "table pull x",
        "settings",
        "bringup --report new",
    ] {
        let said = at.error(&format!("device {command} --port PORT"), 1);
        assert_says(&said, &echo);
        assert!(!said.contains("flash"), "{command}: {said}");
    }
    let doctor = at.run("device doctor --port PORT");
    assert_says(&doctor.out, &echo);
    assert!(
        doctor.code == Some(1) && !doctor.out.contains("flash"),
        "{}",
        doctor.out
    );
}

#[test]
fn reports_that_cannot_be_are_refused_and_never_printed() {
    let with = |change: fn(&mut Status)| {
        let mut status = status();
        change(&mut status);
        Event::Status(status)
    };
    let said = Failure::Said(wire::text("\u{1b}[2J evil"));
    for (event, why) in [
        (with(|s| s.textures = 1700), "a count out of its range"),
        (
            with(|s| s.table_bytes = u32::MAX),
            "a count out of its range",
        ),
        (with(|s| s.calibrated = 20_261_399), "a day of no calendar"),
        (with(|s| s.calibrated = u32::MAX), "a day of no calendar"),
        (with(|s| s.false_alarm = Some(f32::NAN)), "a probability"),
        (with(|s| s.false_alarm = Some(2.0)), "a probability"),
        (Event::Trouble(said), "characters that do not print"),
    ] {
        let at = probe(move |request| vec![event.clone(), Event::Done(request.id)]);
        let before = files(&at.path(""));
        for command in ["status", "status --format json", "table pull x", "doctor"] {
            let ended = at.run(&format!("device {command} --port PORT"));
            let said = ended.said + &ended.out;
            assert_eq!(ended.code, Some(1), "{said}");
            assert_says(&said, &["reports what cannot be", why]);
            assert!(!said.contains('\u{1b}') && !said.contains("NaN"), "{said}");
            assert!(files(&at.path("")) == before, "{command}");
        }
    }
}

/// A table of 4 GB, and one that is another than the status says.
#[test]
fn a_table_that_cannot_be_is_not_pulled_and_not_kept() {
    for (length, why) in [(u32::MAX, "a part of no table"), (256, "table")] {
        let at = probe(move |Request { id, command }| match command {
            Command::Status => vec![Event::Status(status()), Event::Done(*id)],
            Command::ReadTable(offset) => {
                let part = Event::TablePart {
                    offset: *offset,
                    length,
                    bytes: [7; 256].into_iter().collect(),
                };
                vec![part, Event::Done(*id)]
            }
            _ => vec![Event::Done(*id)],
        });
        for command in ["table pull x", "table factory --yes --backup x"] {
            let said = at.error(&format!("device {command} --port PORT"), 1);
            assert_says(&said, &[why]);
            assert!(!at.path("x").exists(), "{command}");
        }
    }
}
