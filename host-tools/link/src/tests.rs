mod endless;
mod impossible;
mod over_a_port;

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
                    still: true,
                    pac: (0..BLOCK as i16).collect(),
                    ..Block::default()
                }),
                Event::Verdict(Verdict {
                    texture: how.among[0],
                    name: Name::try_from("velcro").unwrap(),
                    probability: 0.995,
                    sure: true,
                    log_odds: Some(-7.5),
                    slides: 3,
                    ..Verdict::default()
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
