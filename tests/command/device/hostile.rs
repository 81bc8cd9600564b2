//! A port that echoes, and probes that say what cannot be.

use std::io::{Read as _, Write as _};

use tactus_core::table::{Action, Table, factory};
use tactus_core::wire::{self, Command, Event, Failure, MAX_FRAME, Phase, Receiver};
use tactus_core::wire::{PART, Report, Request, SlideReport, Status, Verdict};

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
        textures: 3,
        table_bytes: 900,
        table_crc: 7,
        calibrated: 20_261_121,
        skin_mj: (1, 1),
        ..Status::default()
    }
}

/// A line's effect on bytes.
type Carries = fn(&[u8]) -> Vec<u8>;

/// A port that sends back what comes so.
fn echo(of: Carries) -> Scratch {
    let port = line(move |mut stream| {
        let mut bytes = [0; 1024];
        while let Ok(length @ 1..) = stream.read(&mut bytes) {
            let _ = stream.write_all(&of(&bytes[..length]));
        }
    });
    Scratch::new().with("PORT", port)
}

#[test]
fn a_port_that_echoes_is_called_that() {
    let words = [
        "sends back what it gets",
        "TX and RX are joined",
        "local echo is on",
    ];
    let at = echo(<[u8]>::to_vec);
    for command in [
        "status",
        "identify",
        "table pull x",
        "settings",
        "bringup --report new",
    ] {
        let said = at.error(&format!("device {command} --port PORT"), 1);
        assert_says(&said, &words);
        assert!(!said.contains("flash"), "{command}: {said}");
    }
    // whole, or as a line carries it that has seven bits, takes no zeros, changes ends of lines, or breaks off
    let carried: [Carries; 6] = [
        <[u8]>::to_vec,
        |bytes| bytes.iter().map(|byte| byte & 0x7f).collect(),
        |bytes| bytes.iter().copied().filter(|byte| *byte != 0).collect(),
        |bytes| {
            bytes
                .iter()
                .copied()
                .filter(|byte| *byte != b'\n')
                .collect()
        },
        |bytes| bytes[..bytes.len() / 2].to_vec(),
        |bytes| [b"login: ", bytes].concat(),
    ];
    for of in carried {
        let doctor = echo(of).run("device doctor --port PORT");
        assert_says(&doctor.out, &words);
        assert!(
            doctor.code == Some(1) && !doctor.out.contains("flash"),
            "{}",
            doctor.out
        );
    }
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
        (with(|s| s.calibrated = 20_250_229), "a day of no calendar"),
        (with(|s| s.calibrated = 21_000_229), "a day of no calendar"),
        (with(|s| s.calibrated = 20_260_431), "a day of no calendar"),
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

#[test]
fn what_is_not_of_the_probes_table_is_never_printed() {
    let (_, table) = factory::ALL[0];
    let whole = Table::read(table).unwrap();
    let verdict = |texture: u16, name: &str, slides| {
        Event::Verdict(Verdict {
            texture,
            name: wire::text(name).as_str().try_into().unwrap(),
            probability: 0.999,
            sure: true,
            slides,
            ..Verdict::default()
        })
    };
    let known = whole.name(3).unwrap();
    let report = |slide, textures| Event::SlideReport {
        slide,
        action: Action {
            movement: 0,
            property: None,
        },
        observed: SlideReport {
            background: 1.0,
            ..SlideReport::default()
        },
        posterior: vec![0.0; textures].into_iter().collect(),
    };
    let ours = usize::from(whole.textures());
    let cases = [
        (verdict(3, known, 2), true),
        (verdict(4, known, 2), false),
        (verdict(3, "evil", 2), false),
        (verdict(whole.textures(), "evil", 2), false),
        (verdict(3, known, 200), false),
        (report(1, ours + 1), false),
        (report(9, ours), false),
    ];
    let judged = |(event, is_good): (Event, bool)| {
        let shown = format!("{event:?}");
        let ended = tabled(event).run("device identify --max-slides 3 --port PORT");
        let said = ended.said + &ended.out;
        if is_good {
            assert_eq!(ended.code, Some(0), "{shown}: {said}");
            assert_says(&said, &[known]);
        } else {
            assert_eq!(ended.code, Some(1), "{shown}: {said}");
            let why = "reports what cannot be, something that is not in its table";
            assert_says(&said, &[why]);
            assert!(!said.contains("evil") && !said.contains(known), "{said}");
        }
    };
    // each waits until its finger is lifted
    std::thread::scope(|all| {
        for case in cases {
            all.spawn(|| judged(case));
        }
    });
}

/// A probe with the rig's own table that answers an exploration so.
fn tabled(event: Event) -> Scratch {
    let (_, table) = factory::ALL[0];
    let whole = Table::read(table).unwrap();
    probe(move |Request { id, command }| match command {
        Command::Status => vec![
            Event::Status(Status {
                textures: whole.textures(),
                table_bytes: table.len() as u32,
                table_crc: whole.crc(),
                finger: whole.finger(),
                ..status()
            }),
            Event::Done(*id),
        ],
        Command::ReadTable(offset) => {
            let rest = &table[*offset as usize..];
            let part = Event::TablePart {
                offset: *offset,
                length: table.len() as u32,
                bytes: rest.iter().copied().take(PART).collect(),
            };
            vec![part, Event::Done(*id)]
        }
        Command::Identify(_) => vec![event.clone(), Event::Done(*id)],
        _ => vec![Event::Done(*id)],
    })
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
