use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::task::Poll;
use std::time::{Duration, Instant};

use proptest::prelude::*;
use tactus_core::explorer::{Method, Strategy as Choice};
use tactus_core::features::{BLOCK, Block, Movement, Observation, Properties};
use tactus_core::sensor::FingerCode;
use tactus_core::sensor::pressure::Calibration;
use tactus_core::wire::{Phase, Text};

use tactus_core::rig::calibration::RigCalibration;
use tactus_core::table::{MAX_TEXTURES, Name, Table, TableError};
use tactus_core::wire::{
    self, Command, Event, Failure, Forget, Identify, MAX_FRAME, PART, PROTOCOL, Receiver, Report,
    Reset, TextureLearned, Train, Verdict,
};

use super::*;
use tactus_lab::eval::learn::learn;

/// A table of so many textures.
fn table(textures: u16) -> Vec<u8> {
    let names: Vec<String> = (0..textures).map(|n| format!("texture {n}")).collect();
    let observed = [0.4, 0.6]
        .map(|x| Observation::from(Properties::new([Some(x), Some(3.0 + x), Some(5.0 + x)])));
    let observed = vec![vec![observed.to_vec()]; textures.into()];
    let movements = [Movement::FOR_TRACTION];
    learn(Method::Paper, None, &names, &movements, &observed).unwrap()
}

fn calibration() -> RigCalibration {
    RigCalibration {
        pressure: Calibration::PAPER,
        unloaded_a: (0.037, 0.001),
        newton_per_ampere: 16.4,
        date: 20_261_121,
        air_known: true,
        turned: 0,
        serial: *b"BT-0000000000001",
    }
}

fn identify() -> Identify {
    Identify {
        among: (0..MAX_TEXTURES as u16).collect(),
        threshold: 0.99,
        max_slides: 10,
        method: Some(Method::Fused),
        strategy: Choice::Bayesian,
        open: true,
        learn: true,
        seed: u32::MAX,
        false_alarm: Some(0.05),
    }
}

/// The probe's end of the link, by what `wire` says of the messages.
#[derive(Default)]
struct Probe {
    receiver: Receiver,
    number: u16,
    damaged: u32,
    table: Vec<u8>,
    pushed: Option<Vec<u8>>,
    calibration: Vec<u8>,
    /// parts that an answer to `ReadTable` has
    parts: usize,
    asked: Vec<Command>,
}

impl Probe {
    fn event(&mut self, event: Event) -> Vec<u8> {
        let mut buffer = [0; MAX_FRAME + 1];
        let number = self.number;
        self.number = number.wrapping_add(1);
        wire::encode(
            &Report {
                number,
                at_ms: 0,
                event,
            },
            &mut buffer,
        )
        .unwrap()
        .to_vec()
    }

    fn receive(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut send = Vec::new();
        for &byte in bytes {
            match self.receiver.push::<wire::Request>(byte) {
                None => {}
                Some(Err(_)) => {
                    self.damaged += 1;
                    send.extend(self.event(Event::Damaged(self.damaged)));
                }
                Some(Ok(request)) => {
                    for event in self.obey(request) {
                        send.extend(self.event(event));
                    }
                }
            }
        }
        send
    }

    fn obey(&mut self, wire::Request { id, command }: wire::Request) -> Vec<Event> {
        self.asked.push(command.clone());
        let refused = |why: &str| Event::Refused {
            id,
            why: Failure::Said(Text::try_from(why).unwrap()),
        };
        let calibration = |bytes: &[u8]| Event::Calibration(bytes.iter().copied().collect());
        let mut events = match command {
            Command::ReadTable(from) => {
                let length = self.table.len() as u32;
                let parts = self.table[from as usize..].chunks(PART).zip(0..);
                parts
                    .take(self.parts)
                    .map(|(bytes, n)| Event::TablePart {
                        offset: from + n * PART as u32,
                        length,
                        bytes: bytes.iter().copied().collect(),
                    })
                    .collect()
            }
            Command::BeginTable(length) => {
                self.pushed = Some(vec![0xFF; length as usize]);
                vec![]
            }
            Command::WriteTable { offset, bytes } => {
                let Some(pushed) = &mut self.pushed else {
                    return vec![refused("begin a table first")];
                };
                pushed[offset as usize..][..bytes.len()].copy_from_slice(&bytes);
                vec![]
            }
            Command::CommitTable => match self.pushed.take() {
                Some(pushed) if Table::read(&pushed).is_ok() => {
                    self.table = pushed;
                    vec![]
                }
                _ => return vec![refused("the table is not whole: push it again")],
            },
            Command::ReadCalibration => vec![calibration(&self.calibration)],
            Command::WriteCalibration(bytes) => {
                self.calibration = bytes.to_vec();
                vec![calibration(&bytes)]
            }
            Command::Identify(how) => vec![
                Event::Phase(Phase::Sliding),
                Event::Block(Block {
                    number: 0,
                    still: true,
                    steady: None,
                    pac: (0..BLOCK as i16).collect(),
                    shear_mn: Default::default(),
                    lost: 0,
                }),
                Event::Verdict(Verdict {
                    texture: how.among[0],
                    name: Name::try_from("velcro").unwrap(),
                    probability: 0.995,
                    sure: true,
                    unknown: false,
                    log_odds: Some(-7.5),
                    slides: 3,
                    wants_label: false,
                    changed: false,
                    most_like: false,
                }),
                Event::TextureLearned(TextureLearned {
                    name: Name::try_from("velcro").unwrap(),
                    slides: 3,
                    itself: true,
                }),
            ],
            Command::Label(name) if name.is_empty() => return vec![refused("a name, please")],
            Command::Label(name) => vec![Event::TextureLearned(TextureLearned {
                name,
                slides: 2,
                itself: false,
            })],
            Command::Home => vec![Event::Phase(Phase::Homing), Event::Phase(Phase::Ready)],
            _ => vec![],
        };
        events.push(Event::Done(id));
        events
    }
}

/// Runs a transaction to its end over a line that does to every chunk what `disturb` does; `None` if both ends wait for
/// each other and the request may not be repeated.
fn see_through<E: Transaction>(
    session: &mut Session,
    probe: &mut Probe,
    transaction: E,
    mut disturb: impl FnMut(Vec<u8>) -> Vec<Vec<u8>>,
) -> Option<Result<E::Outcome, LinkError>> {
    let mut send = Vec::new();
    let mut job = match Job::begin(transaction, session, &mut send) {
        Ok(job) => job,
        Err(why) => return Some(Err(why)),
    };
    let mut received = VecDeque::new();
    loop {
        for chunk in disturb(std::mem::take(&mut send)) {
            let answer = disturb(probe.receive(&chunk));
            received.extend(answer.into_iter().filter(|chunk| !chunk.is_empty()));
        }
        match received.pop_front() {
            Some(chunk) => {
                if let Poll::Ready(outcome) = job.poll(session, &chunk, &mut send, |_| ()) {
                    return Some(outcome);
                }
            }
            None => match job.repeat(session, &mut send) {
                Ok(true) => {}
                Ok(false) => return None,
                Err(why) => return Some(Err(why)),
            },
        }
    }
}

fn undisturbed(bytes: Vec<u8>) -> Vec<Vec<u8>> {
    vec![bytes]
}

#[test]
fn the_longest_requests_fit() {
    let mut session = Session::default();
    for command in [
        Command::Identify(identify()),
        Command::WriteTable {
            offset: u32::MAX,
            bytes: (0..PART).map(|_| 0xFF).collect(),
        },
        Command::Train(Train {
            name: Name::try_from("n".repeat(40).as_str()).unwrap(),
            trials: 255,
            pilot: true,
            seed: u32::MAX,
        }),
        Command::WriteCalibration((0..64).collect()),
        Command::Rename {
            from: Name::try_from("n".repeat(40).as_str()).unwrap(),
            to: Name::try_from("m".repeat(40).as_str()).unwrap(),
        },
    ] {
        assert!(session.request(command, &mut Vec::new()).is_ok());
    }
}

#[test]
fn a_table_is_pushed_part_by_part_and_read_back() {
    for parts in [1, 3, usize::MAX] {
        let bytes = table(117);
        let mut session = Session::default();
        let mut probe = Probe {
            parts,
            ..Probe::default()
        };
        let push = PushTable::new(&bytes).unwrap();
        let (_, steps) = push.progress();
        let pushed = see_through(&mut session, &mut probe, push, undisturbed);
        assert_eq!(pushed, Some(Ok(())));
        assert_eq!(probe.table, bytes);
        assert_eq!(probe.asked.len(), steps);
        assert_eq!(probe.asked[0], Command::BeginTable(bytes.len() as u32));
        assert_eq!(probe.asked.last(), Some(&Command::CommitTable));
        let read = see_through(&mut session, &mut probe, ReadTable::default(), undisturbed);
        assert_eq!(read, Some(Ok(bytes)));
        assert_eq!((session.damaged(), session.missing()), (0, 0));
    }
}

#[test]
fn what_no_probe_holds_is_not_pushed() {
    let mut bytes = table(3);
    bytes[20] ^= 1;
    assert!(matches!(
        PushTable::new(&bytes).unwrap_err(),
        LinkError::Table(TableError::Crc { .. })
    ));
    assert!(PushTable::new(&table(128)).is_ok());
    let wrong = RigCalibration {
        newton_per_ampere: -1.0,
        ..calibration()
    };
    assert!(matches!(
        Request::write_calibration(&wrong),
        Err(LinkError::Calibration(_))
    ));
}

#[test]
fn requests_get_their_answers() {
    let mut session = Session::default();
    let mut probe = Probe::default();
    let mut send = |transaction| see_through(&mut session, &mut probe, transaction, undisturbed);
    let command = Request::write_calibration(&calibration()).unwrap();
    assert_eq!(send(command), Some(Ok(())));
    let home = Request::command(Command::Home);
    assert_eq!(send(home), Some(Ok(())));
    let read = see_through(
        &mut session,
        &mut probe,
        Request::read_calibration(),
        undisturbed,
    );
    assert_eq!(read, Some(Ok(calibration())));
    let found = see_through(
        &mut session,
        &mut probe,
        Request::identify(identify()),
        undisturbed,
    );
    let found = found.unwrap().unwrap();
    let Identified { verdict, learned } = found;
    assert_eq!((verdict.name.as_str(), verdict.slides), ("velcro", 3));
    assert_eq!((learned, verdict.log_odds), (3, Some(-7.5)));
    let named = |name| Request::label(Name::try_from(name).unwrap());
    let answered = see_through(&mut session, &mut probe, named("felt"), undisturbed);
    let learned = TextureLearned {
        name: Name::try_from("felt").unwrap(),
        slides: 2,
        itself: false,
    };
    assert_eq!(answered, Some(Ok(learned)));
    let nameless = see_through(&mut session, &mut probe, named(""), undisturbed);
    assert!(matches!(nameless, Some(Err(LinkError::Refused(_)))));
    // the mock reports no status: done without an answer
    let status = see_through(&mut session, &mut probe, Request::status(), undisturbed);
    assert_eq!(status, Some(Err(LinkError::NoAnswer)));
    let trained = Request::train(Train {
        name: Name::new(),
        trials: 5,
        pilot: false,
        seed: 1,
    });
    let trained = see_through(&mut session, &mut probe, trained, undisturbed);
    assert_eq!(trained, Some(Ok(0)));
}

#[test]
fn a_refusal_says_why() {
    let mut session = Session::default();
    let mut probe = Probe::default();
    let commit = Request::command(Command::CommitTable);
    let refused = see_through(&mut session, &mut probe, commit, undisturbed);
    let Some(Err(why)) = refused else {
        panic!("{refused:?}")
    };
    assert_eq!(
        why.to_string(),
        "the probe refused: the table is not whole: push it again"
    );
}

#[test]
fn a_damaged_request_is_repeated_only_if_it_may_be() {
    // the first bytes on the line are damaged
    let once = || {
        let mut first = true;
        move |mut bytes: Vec<u8>| {
            if std::mem::take(&mut first) {
                bytes[3] ^= 0x10;
            }
            vec![bytes]
        }
    };
    let mut session = Session::default();
    let mut probe = Probe {
        calibration: calibration().to_bytes().to_vec(),
        ..Probe::default()
    };
    let read = see_through(
        &mut session,
        &mut probe,
        Request::read_calibration(),
        once(),
    );
    assert_eq!(read, Some(Ok(calibration())));
    let found = see_through(
        &mut session,
        &mut probe,
        Request::identify(identify()),
        once(),
    );
    assert_eq!(found, Some(Err(LinkError::Unheard)));
    let cut = |_: Vec<u8>| vec![vec![]];
    let read = see_through(&mut session, &mut probe, Request::read_calibration(), cut);
    assert_eq!(read, Some(Err(LinkError::Disturbed)));
}

#[test]
fn a_restart_is_noticed() {
    let booted = |protocol| Event::Booted {
        protocol,
        version: Default::default(),
        reset: Reset::Watchdog,
        last_words: Some(Text::try_from("stack").unwrap()),
        finger: FingerCode::BIOTAC,
    };
    for (protocol, expected) in [
        (
            PROTOCOL,
            LinkError::Rebooted {
                reset: Reset::Watchdog,
                last_words: Some("stack".to_owned()),
            },
        ),
        (PROTOCOL + 1, LinkError::Protocol(PROTOCOL + 1)),
    ] {
        let (mut session, mut send) = (Session::default(), Vec::new());
        let mut before = Probe {
            number: 700,
            ..Probe::default()
        };
        let ready = before.event(Event::Phase(Phase::Ready));
        session.receive(&ready);
        let mut job = Job::begin(Request::identify(identify()), &mut session, &mut send).unwrap();
        let bytes = Probe::default().event(booted(protocol));
        let outcome = job.poll(&mut session, &bytes, &mut send, |_| ());
        assert_eq!(outcome, Poll::Ready(Err(expected)));
        assert_eq!(session.missing(), 0, "numbers begin anew");
    }
}

#[test]
fn gaps_in_the_numbers_are_counted() {
    let mut probe = Probe {
        number: u16::MAX - 1,
        ..Probe::default()
    };
    let frames: Vec<Vec<u8>> = (0..6).map(|n| probe.event(Event::Done(n))).collect();
    let mut session = Session::default();
    for n in [0, 1, 4, 5] {
        assert_eq!(session.receive(&frames[n]).len(), 1);
    }
    assert_eq!((session.damaged(), session.missing()), (0, 2));
}

fn slide_report(change: impl FnOnce(&mut wire::SlideReport), posterior: &[f32]) -> Event {
    let mut observed = wire::SlideReport {
        properties: [Some(0.4), Some(3.0), None],
        roughness_is_bound: false,
        background: 2.0,
        bands: Default::default(),
        pressure: None,
        pace: None,
    };
    change(&mut observed);
    Event::SlideReport {
        slide: 1,
        action: tactus_core::table::Action {
            movement: 0,
            property: None,
        },
        observed,
        posterior: posterior.iter().copied().collect(),
    }
}

fn verdict(change: impl FnOnce(&mut Verdict)) -> Event {
    let mut verdict = Verdict {
        texture: 1,
        name: Name::try_from("cork").unwrap(),
        probability: 0.995,
        sure: true,
        unknown: false,
        log_odds: Some(-7.5),
        slides: 3,
        wants_label: false,
        changed: false,
        most_like: false,
    };
    change(&mut verdict);
    Event::Verdict(verdict)
}

/// Whole frames with a right checksum, of a probe that is broken, or hostile.
#[test]
fn reports_that_no_probe_makes_are_damaged_ones() {
    let name = |name: &str| Name::try_from(name).unwrap();
    let learned = |texture: &str| {
        Event::TextureLearned(TextureLearned {
            name: name(texture),
            slides: 3,
            itself: true,
        })
    };
    let said = |text: &str| Failure::Said(wire::text(text));
    let part = |offset, length, bytes: usize| Event::TablePart {
        offset,
        length,
        bytes: vec![0; bytes].into_iter().collect(),
    };
    let steady = |steady| {
        Event::Block(Block {
            number: 0,
            still: false,
            steady: Some(steady),
            pac: [1; 64].into_iter().collect(),
            ..Block::default()
        })
    };
    let good = [
        steady((264, 13_200)),
        verdict(|_| ()),
        verdict(|v| (v.probability, v.log_odds) = (1.0, None)),
        verdict(|v| v.name = name("Ölpapier 2 µm")),
        slide_report(|_| (), &[0.25, 0.75]),
        slide_report(|o| o.properties = [None; 3], &[]),
        learned("cork"),
        part(256, 300, 44),
        part(0, 512, PART),
        Event::Trouble(said("press the button")),
        Event::Weighed {
            mn: 1,
            counts: -3.5,
        },
    ];
    let bad = [
        verdict(|v| v.probability = f32::NAN),
        verdict(|v| v.probability = 2.0),
        verdict(|v| v.probability = -0.5),
        verdict(|v| v.log_odds = Some(f32::INFINITY)),
        verdict(|v| v.texture = 5000),
        verdict(|v| v.name = name("\u{1b}]0;evil\u{7}")),
        verdict(|v| v.name = name("a\u{202e}b")),
        verdict(|v| v.name = name("")),
        slide_report(|_| (), &[f32::INFINITY, 0.5]),
        slide_report(|_| (), &[1.5]),
        slide_report(|_| (), &[0.9, 0.9]),
        slide_report(|o| o.background = -1.0, &[1.0]),
        slide_report(|o| o.background = f32::NAN, &[1.0]),
        slide_report(|o| o.properties[1] = Some(f32::INFINITY), &[1.0]),
        learned("a\nb"),
        part(0, u32::MAX, PART),
        part(4096, 4000, PART),
        part(u32::MAX, 300, 1),
        // a byte a part would take hours
        part(0, 300, 1),
        Event::Trouble(said("\u{1b}[2J")),
        Event::Refused {
            id: 0,
            why: Failure::Memory(wire::MemoryError::Unknown(name("a\rb"))),
        },
        Event::Weighed {
            mn: 1,
            counts: f32::NAN,
        },
        Event::Turned {
            g_counts: f32::NAN,
            offset_counts: 0.0,
        },
        // a count would be an infinite acceleration
        Event::Turned {
            g_counts: 0.0,
            offset_counts: 0.0,
        },
        steady((8000, 7000)),
        // two months of silence before it
        steady((4_000_000_000, 4_000_000_001)),
    ];
    for (event, is_good) in good
        .map(|e| (e, true))
        .into_iter()
        .chain(bad.map(|e| (e, false)))
    {
        let frame = Probe::default().event(event.clone());
        let (mut session, mut send) = (Session::default(), Vec::new());
        let reports = session.receive(&frame);
        let damaged = u64::from(!is_good);
        assert_eq!(
            (reports.len() == 1, session.damaged()),
            (is_good, damaged),
            "{event:?}"
        );
        let request = Request::command(Command::Home);
        let mut job = Job::begin(request, &mut session, &mut send).unwrap();
        let polled = job.poll(&mut session, &frame, &mut send, |_| ());
        let is_refused = matches!(polled, Poll::Ready(Err(LinkError::Impossible(_))));
        assert_eq!(is_refused, !is_good, "{event:?}");
    }
}

/// The longest that a request goes on while such a probe says this every 50 ms, s; the error at its end.
fn goes_on<E: Transaction>(request: E, event: &Event, times: usize) -> (u64, String)
where
    E::Outcome: std::fmt::Debug,
{
    let time = Duration::from_secs(5);
    let host = super::Probe::new("here", time, time);
    let mut probe = Probe::default();
    let mut get = std::pin::pin!(host.get(request));
    let mut context = std::task::Context::from_waker(std::task::Waker::noop());
    for ms in (0..).step_by(50) {
        let says: Vec<u8> = (0..times)
            .flat_map(|_| probe.event(event.clone()))
            .collect();
        host.carry(&says, Duration::from_millis(ms));
        host.to_send();
        host.said();
        if let Poll::Ready(done) = get.as_mut().poll(&mut context) {
            return (ms / 1000, done.unwrap_err().to_string());
        }
    }
    unreachable!()
}

#[test]
fn no_request_goes_on_without_an_end() {
    let live = Event::Live(wire::Live {
        force_mn: 0,
        steps: 0,
        stage_um: 0,
        speed_um_s: 0,
        current_ma: 0,
    });
    let (s, why) = goes_on(Request::status(), &live, 1);
    assert_eq!(s, 30);
    let status = ["the request Status", "30s", "switch it off and on"];
    assert!(status.iter().all(|words| why.contains(words)), "{why}");
    // as many bytes as the line carries in that time, at once
    let (s, why) = goes_on(Request::status(), &live, 20_000);
    assert!(s < 5 && why.contains("the request Status"), "{s} s: {why}");
    let (s, why) = goes_on(Request::command(Command::Home), &live, 1);
    assert_eq!(s, 270);
    assert!(
        why.contains("the request Home") && why.contains("emergency stop"),
        "{why}"
    );
    let (slides, movements) = (u64::from(identify().max_slides), 36);
    let (s, why) = goes_on(Request::identify(identify()), &live, 1);
    assert_eq!(s, 30 + (slides + 2 * movements) * 135, "{why}");
    let (s, why) = goes_on(ReadTable::default(), &Event::Phase(Phase::Ready), 1);
    assert_eq!(s, 300);
    assert!(why.contains("the request ReadTable"), "{why}");
}

/// A probe waits for its button for 30 s: what to press is said once, and its own answer comes before any limit.
#[test]
fn high_forces_want_the_button_and_say_so() {
    let time = Duration::from_secs(5);
    let host = super::Probe::new("here", time, time);
    let mut probe = Probe::default();
    let status = wire::Status {
        phase: Phase::Ready,
        textures: 3,
        table_bytes: 900,
        table_crc: 7,
        calibrated: 20_261_121,
        skin_mj: (1, 1),
        // so that nobody is asked for mount or stop
        high_force: true,
        ..wire::Status::default()
    };
    let mut set = std::pin::pin!(super::operations::set_high_force(&host, true));
    let mut context = std::task::Context::from_waker(std::task::Waker::noop());
    let mut waits = None;
    for ms in (0..60_000).step_by(50) {
        let mut says = Vec::new();
        for byte in host.to_send() {
            let Some(Ok(asked)) = probe.receiver.push::<wire::Request>(byte) else {
                continue;
            };
            match asked.command {
                Command::SetHighForce(true) => drop(waits.get_or_insert((asked.id, ms))),
                _ => says.extend([Event::Status(status.clone()), Event::Done(asked.id)]),
            }
        }
        if let Some((id, since)) = waits {
            if (ms - since) % 1000 == 0 {
                says.push(Event::Prompt(wire::Prompt::Button));
            }
            if ms - since == 30_000 {
                let why = Failure::NotPressed;
                says.push(Event::Refused { id, why });
            }
        }
        let says: Vec<u8> = says
            .into_iter()
            .flat_map(|event| probe.event(event))
            .collect();
        host.carry(&says, Duration::from_millis(ms));
        host.said();
        if let Poll::Ready(done) = set.as_mut().poll(&mut context) {
            let why = done.unwrap_err().to_string();
            assert!(why.contains("nobody pressed the blue button"), "{why}");
            let words = String::from_utf8(host.take_words()).unwrap();
            assert_eq!(words.matches("press the blue button").count(), 1, "{words}");
            return;
        }
    }
    panic!("no end");
}

#[test]
fn an_echo_is_none_of_another_version() {
    let requests = [
        Command::Status,
        Command::Home,
        Command::ReadTable(300),
        Command::Stream(true),
    ];
    for command in requests {
        let (mut session, mut send) = (Session::default(), Vec::new());
        let request = Request::command(command.clone());
        let mut job = Job::begin(request, &mut session, &mut send).unwrap();
        let sent = std::mem::take(&mut send);
        let polled = job.poll(&mut session, &sent, &mut send, |_| ());
        assert!(
            matches!(polled, Poll::Ready(Err(LinkError::Echo))),
            "{command:?}"
        );
    }
}

#[test]
fn an_outsider_may_ask_in_between() {
    let (mut session, mut send, mut probe) = (Session::default(), Vec::new(), Probe::default());
    let mut job = Job::begin(Request::identify(identify()), &mut session, &mut send).unwrap();
    let stop = session.request(Command::Stop, &mut send).unwrap();
    let bytes = probe.receive(&send);
    let mut told = Vec::new();
    let outcome = job.poll(&mut session, &bytes, &mut send, |report| {
        told.push(report.event.clone())
    });
    assert!(matches!(outcome, Poll::Ready(Ok(_))), "{outcome:?}");
    assert_eq!(told.last(), Some(&Event::Done(stop)), "all is shown");
}

/// A line that gives what the probe answers, piece by piece, and times out in between.
struct Line {
    probe: Probe,
    answer: VecDeque<u8>,
    silent: bool,
}

impl Read for Line {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.answer.len().min(buffer.len()).min(7);
        if n == 0 {
            return Err(io::ErrorKind::WouldBlock.into());
        }
        for (to, from) in buffer.iter_mut().zip(self.answer.drain(..n)) {
            *to = from;
        }
        Ok(n)
    }
}

impl Write for Line {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if !self.silent {
            self.answer.extend(self.probe.receive(bytes));
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_port_runs_transactions() {
    let bytes = table(20);
    let line = Line {
        probe: Probe {
            parts: 1,
            ..Probe::default()
        },
        answer: VecDeque::new(),
        silent: false,
    };
    let time = Duration::from_millis(50);
    let probe = super::Probe::new("here", time, time);
    let mut port = Port::new(line, probe.clone());
    let push = PushTable::new(&bytes).unwrap();
    port.run(probe.get(push)).unwrap();
    assert_eq!(*port.run(probe.table()).unwrap(), *bytes);
    assert_eq!(probe.losses(), (0, 0));
    port.stream.silent = true;
    // pulled once, and known from then on
    assert_eq!(*port.run(probe.table()).unwrap(), *bytes);
    let silent = port.run(probe.get(ReadTable::default())).unwrap_err();
    assert!(
        silent
            .to_string()
            .starts_with("here: the probe said nothing for"),
        "{silent}"
    );
}

/// What a line may do to a stretch of bytes.
/// Sends without end, and nothing of it is a report.
struct Noise;

impl Read for Noise {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        buffer.fill(0x55);
        Ok(buffer.len())
    }
}

impl Write for Noise {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn bytes_without_end_are_no_answer() {
    for request in [Command::Stop, Command::Home].map(Request::command) {
        let time = Duration::from_millis(1);
        let probe = super::Probe::new("here", time, time);
        let mut port = Port::new(Noise, probe.clone());
        let began = Instant::now();
        let why = port.run(probe.get(request)).unwrap_err();
        assert!(began.elapsed() < Duration::from_secs(10));
        let is_garbage = |why: &PortError| matches!(why, PortError::Garbage(1..));
        let garbage = matches!(&why, OperationError::Port { why, .. } if is_garbage(why));
        assert!(garbage, "{why}");
    }
}

/// Does an operation; its file is kept or not, and its question answered like this.
fn does<T>(
    operation: impl Future<Output = T>,
    host: &super::Probe,
    probe: &mut Probe,
    (keeps, says): (bool, bool),
) -> T {
    let (mut operation, mut now) = (std::pin::pin!(operation), Duration::ZERO);
    let mut context = std::task::Context::from_waker(std::task::Waker::noop());
    loop {
        if let Poll::Ready(done) = operation.as_mut().poll(&mut context) {
            return done;
        }
        now += Duration::from_millis(10);
        host.carry(&probe.receive(&host.to_send()), now);
        if let Some(backup) = host.backup() {
            assert_eq!(backup.bytes, probe.table);
            let full = Err("the disk is full".to_owned());
            host.kept(if keeps { Ok(backup.name) } else { full });
        }
        if host.question().is_some() {
            host.answer(says);
        }
    }
}

#[test]
fn nothing_is_lost_without_a_copy_and_a_yes() {
    let mut probe = Probe {
        parts: usize::MAX,
        table: table(3),
        ..Probe::default()
    };
    let time = Duration::from_secs(5);
    let host = super::Probe::new("here", time, time);
    let forget = || operations::forget(&host, Forget::SelfLearned);
    let forgets = |command: &Command| matches!(command, Command::Forget(_));
    let reads = |command: &Command| matches!(command, Command::ReadTable(_));
    for (answers, why) in [
        ((false, true), "the disk is full"),
        ((true, false), "nothing was changed"),
    ] {
        let said = does(forget(), &host, &mut probe, answers).unwrap_err();
        assert_eq!(said.to_string(), why);
        assert!(!probe.asked.iter().any(forgets));
    }
    does(forget(), &host, &mut probe, (true, true)).unwrap();
    assert!(probe.asked.iter().any(forgets));
    // pulled once, and once more after it may have become another one
    let pulled = |probe: &Probe| probe.asked.iter().filter(|c| reads(c)).count();
    assert_eq!(pulled(&probe), 1);
    does(host.table(), &host, &mut probe, (true, true)).unwrap();
    assert_eq!(pulled(&probe), 2);
}

fn damage() -> impl Strategy<Value = Vec<(usize, u8)>> {
    proptest::collection::vec((0usize..20_000, 1u8..), 0..6)
}

proptest! {
    #[test]
    fn reports_do_not_depend_on_where_reads_end(cuts in proptest::collection::vec(1usize..300, 1..50)) {
        let mut probe = Probe { parts: usize::MAX, table: table(40), ..Probe::default() };
        let mut bytes = Vec::new();
        for command in [
            Command::ReadTable(0),
            Command::Home,
            Command::Identify(identify()),
            Command::Label(Name::try_from("felt").unwrap()),
            Command::Forget(Forget::SelfLearned),
        ] {
            for event in probe.obey(wire::Request { id: 9, command }) {
                bytes.extend(probe.event(event));
            }
        }
        let whole = Session::default().receive(&bytes);
        prop_assert!(whole.len() > 10);
        let (mut session, mut pieces, mut rest) = (Session::default(), Vec::new(), bytes.as_slice());
        for &n in cuts.iter().cycle() {
            if rest.is_empty() {
                break;
            }
            let (now, later) = rest.split_at(n.min(rest.len()));
            pieces.extend(session.receive(now));
            rest = later;
        }
        prop_assert_eq!(pieces, whole);
        prop_assert_eq!((session.damaged(), session.missing()), (0, 0));
    }

    #[test]
    fn damaged_reports_are_never_believed_and_later_ones_understood(
        damage in damage(),
        garbage in proptest::collection::vec(any::<u8>(), 0..300),
    ) {
        let mut probe = Probe::default();
        let part = |n: u32| Event::TablePart {
            offset: n * 256,
            length: 15_360,
            bytes: (0..PART).map(|b| b as u8).collect(),
        };
        let frames: Vec<Vec<u8>> = (0..60).map(|n| probe.event(part(n))).collect();
        let sent = Session::default().receive(&frames.concat());
        let mut bytes = frames.concat();
        let length = bytes.len();
        for (at, flip) in damage {
            bytes[at % length] ^= flip;
        }
        let mut session = Session::default();
        let mut got = session.receive(&garbage);
        prop_assert!(got.is_empty());
        got.extend(session.receive(&[&[0][..], &bytes].concat()));
        prop_assert!(got.iter().all(|report| sent.contains(report)));
        prop_assert!(got.len() >= sent.len() - 12, "a wrong byte takes two frames at most");
        // what ends whatever the damage has left open
        session.receive(&[0]);
        let counted = got.len() as u64 + session.missing();
        prop_assert!(counted <= 60);
        let next = probe.event(Event::Done(7));
        let next = session.receive(&next);
        prop_assert_eq!(next.len(), 1);
        prop_assert!(got.is_empty() || got.len() as u64 + session.missing() + got[0].number as u64 == 60);
    }

    #[test]
    fn a_table_arrives_whole_or_not_at_all(damage in damage(), chunk in 1usize..400) {
        let bytes = table(60);
        let mut session = Session::default();
        let mut probe = Probe { parts: 2, table: table(2), ..Probe::default() };
        let (mut at, mut damage) = (0, damage);
        damage.sort_unstable();
        let mut disturb = |mut bytes: Vec<u8>| {
            let length = bytes.len();
            while let Some(&(place, flip)) = damage.first().filter(|d| d.0 < at + length) {
                damage.remove(0);
                if place >= at {
                    bytes[place - at] ^= flip;
                }
            }
            at += length;
            bytes.chunks(chunk).map(<[u8]>::to_vec).collect()
        };
        let pushed = see_through(&mut session, &mut probe, PushTable::new(&bytes).unwrap(), &mut disturb);
        let before = probe.table.clone();
        if pushed == Some(Ok(())) {
            prop_assert_eq!(&before, &bytes);
        } else {
            // only the commit cannot be repeated
            prop_assert!(probe.table == bytes || probe.table == table(2));
            prop_assert!(pushed.is_none() || pushed == Some(Err(LinkError::Unheard)), "{pushed:?}");
        }
        let read = see_through(&mut session, &mut probe, ReadTable::default(), &mut disturb);
        prop_assert_eq!(read, Some(Ok(before)));
    }

    #[test]
    fn any_bytes_are_survived(bytes in proptest::collection::vec(any::<u8>(), 0..3000)) {
        let (mut session, mut send) = (Session::default(), Vec::new());
        let mut job = Job::begin(ReadTable::default(), &mut session, &mut send).unwrap();
        let outcome = job.poll(&mut session, &bytes, &mut send, |report| panic!("{report:?}"));
        prop_assert!(outcome.is_pending());
    }
}
