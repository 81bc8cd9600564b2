//! A probe at a line, asked in JSON.

use std::cell::RefCell;
use std::future::Future;
use std::io;
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context, Waker};
use std::time::Duration;

use embassy_futures::yield_now;
use tactus_core::wire::{Event, Live, Phase, Report};

use super::heard::Heard;
use super::message::{File, Frame, Question, Reply, Request, Work};
use super::work::{Kept, work};
use crate::live::{asked_in_json, sentence};
use tactus_link::log::Line;
use tactus_link::person::{self, QuestionKind};
use tactus_link::probe::{GREETING, TIMEOUT};
use tactus_link::{OperationError, PortError, Probe};

#[derive(Default)]
struct Desk {
    work: Option<Work>,
    connected: bool,
    busy: bool,
    failed: Option<String>,
}

impl Desk {
    fn done(&mut self, done: Result<(), OperationError>) {
        if let Err(why) = done {
            self.failed = Some(sentence(&why));
        }
        self.busy = false;
    }
}

struct Open {
    probe: Probe,
    desk: Rc<RefCell<Desk>>,
    kept: Rc<RefCell<Kept>>,
    life: Pin<Box<dyn Future<Output = ()>>>,
    log: Vec<u8>,
    heard: Heard,
    live: Option<Live>,
    phase: Option<Phase>,
}

/// A probe at a line that somebody else carries.
#[derive(Default)]
pub struct Remote {
    open: Option<Open>,
}

type Answered = Result<Frame, Box<dyn std::error::Error>>;

impl Remote {
    /// Carries out a request in JSON, and replies in JSON.
    pub fn ask(&mut self, request: &str) -> String {
        asked_in_json(request, |request| match request {
            Ok(request) => match self.answer(request) {
                Ok(frame) => Reply::Frame(frame),
                Err(why) => Reply::Error {
                    why: sentence(why.as_ref()),
                },
            },
            Err(why) => Reply::Error { why },
        })
    }

    fn answer(&mut self, request: Request) -> Answered {
        match request {
            Request::Connect { port, now_ms } => {
                let open = self.open.insert(Open::new(&port)?);
                open.probe.carry(&[], Duration::from_millis(now_ms));
                open.proceed()
            }
            Request::Step { now_ms, received } => {
                let open = self.at_line()?;
                let now = Duration::from_millis(now_ms);
                open.probe.carry(&received, now);
                open.proceed()
            }
            Request::Closed => {
                let open = self.at_line()?;
                open.probe.close(PortError::Closed);
                let last = open.proceed();
                self.open = None;
                last
            }
            Request::Work { work } => {
                let open = self.at_line()?;
                {
                    let mut desk = open.desk.borrow_mut();
                    if !desk.connected {
                        return Err("no probe is connected".into());
                    }
                    if desk.busy {
                        return Err("the probe is busy: stop it first".into());
                    }
                    (desk.busy, desk.work) = (true, Some(work));
                }
                open.probe.clear_stop();
                open.proceed()
            }
            Request::Stop => {
                let open = self.at_line()?;
                let busy = open.desk.borrow().busy;
                if busy {
                    open.probe.stop();
                    let words = &mut open.probe.words();
                    io::Write::write_all(words, b"Stopping and lifting the finger ...\n")?;
                }
                open.proceed()
            }
            Request::Answer { yes } => {
                let open = self.at_line()?;
                // what was said stays where the words are
                let question = open.probe.question();
                if let Some(question) = question.filter(|asked| !asked.said.is_empty()) {
                    let said = question.said + "\n";
                    io::Write::write_all(&mut open.probe.words(), said.as_bytes())?;
                }
                open.probe.answer(yes);
                open.proceed()
            }
            Request::Log => {
                let open = self.at_line()?;
                let mut frame = open.frame()?;
                frame.files.push(File {
                    name: "session.jsonl".to_owned(),
                    bytes: open.log.clone(),
                });
                Ok(frame)
            }
        }
    }

    fn at_line(&mut self) -> Result<&mut Open, &'static str> {
        self.open.as_mut().ok_or("no probe is connected")
    }
}

impl Open {
    fn new(port: &str) -> io::Result<Self> {
        let probe = Probe::new(port, GREETING, TIMEOUT);
        let (desk, kept) = (Rc::<RefCell<Desk>>::default(), Rc::default());
        desk.borrow_mut().busy = true;
        let life = live(probe.clone(), Rc::clone(&desk), Rc::clone(&kept));
        let mut log = Vec::new();
        Line::first(port).write(&mut log)?;
        Ok(Self {
            life: Box::pin(life),
            probe,
            desk,
            kept,
            log,
            heard: Heard::default(),
            live: None,
            phase: None,
        })
    }

    fn proceed(&mut self) -> Answered {
        let mut context = Context::from_waker(Waker::noop());
        // it never ends
        let _ = self.life.as_mut().poll(&mut context);
        if let Some(backup) = self.probe.backup() {
            let (name, bytes) = (backup.name, backup.bytes);
            self.probe.kept(Ok(name.clone()));
            self.kept.borrow_mut().files.push(File { name, bytes });
        }
        self.frame()
    }

    fn hear(&mut self, report: &Report) {
        match &report.event {
            Event::Phase(phase) => self.phase = Some(*phase),
            Event::Status(status) => self.phase = Some(status.phase),
            Event::Live(live) => self.live = Some(*live),
            _ => {}
        }
    }

    fn frame(&mut self) -> Answered {
        for line in self.probe.said() {
            line.write(&mut self.log)?;
            if let Line::Report(report) = &line {
                self.hear(report);
            }
            self.heard.hear(&line);
        }
        let (received, known) = self.heard.take();
        let of = |value: fn(&Live) -> i32| {
            let live = self.live.as_ref();
            live.map_or(0.0, |live| f64::from(value(live)) * 1e-3)
        };
        let (mut desk, mut kept) = (self.desk.borrow_mut(), self.kept.borrow_mut());
        Ok(Frame {
            send: self.probe.to_send(),
            connected: desk.connected,
            busy: desk.busy,
            phase: self.phase,
            force_n: of(|live| live.force_mn.into()),
            stage_mm: of(|live| live.stage_um),
            speed_mm_s: of(|live| live.speed_um_s),
            at_ms: self.heard.at_ms,
            pac: received.pac,
            spectra: received.spectra,
            happened: received.happened,
            known,
            said: String::from_utf8_lossy(&self.probe.take_words()).into_owned(),
            failed: desk.failed.take(),
            question: self.probe.question().map(Question::from),
            files: std::mem::take(&mut kept.files),
            folders: std::mem::take(&mut kept.folders),
        })
    }
}

async fn live(probe: Probe, desk: Rc<RefCell<Desk>>, kept: Rc<RefCell<Kept>>) {
    let greeted = work(&probe, Work::Status, &kept).await;
    desk.borrow_mut().connected = greeted.is_ok();
    desk.borrow_mut().done(greeted);
    loop {
        // a line that is closed is told once, by whatever needs it next
        if let Err(why) = probe.listen() {
            let mut desk = desk.borrow_mut();
            desk.connected = false;
            desk.done(Err(why));
            break;
        }
        let next = desk.borrow_mut().work.take();
        if let Some(wanted) = next {
            let done = work(&probe, wanted, &kept).await;
            desk.borrow_mut().done(done);
        }
        yield_now().await;
    }
    std::future::pending().await
}

impl From<person::Question> for Question {
    fn from(question: person::Question) -> Self {
        let (said, asked) = (question.said, question.asked);
        let [yes, no] = match question.kind {
            QuestionKind::Consent => ["Yes", "No"],
            QuestionKind::Moved => ["It is moved", "It stays"],
            QuestionKind::Laid | QuestionKind::LaidOrLeftOut => ["It lies there", "Leave it out"],
        };
        let asked = match said.is_empty() {
            true => format!("{asked}."),
            false => format!("{said}\n{asked}"),
        };
        Self { asked, yes, no }
    }
}
