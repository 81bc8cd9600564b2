//! A probe that somebody works with: its line, what has been heard, and the way to a lifted finger.

use std::cell::RefCell;
use std::io::{self, Write};
use std::ops::ControlFlow;
use std::rc::Rc;
use std::task::Poll;
use std::time::Duration;

use embassy_futures::yield_now;
use tactus_core::table::TableError;
use tactus_core::wire::{Command, Event, Live, Phase, Report, Status};

use super::message::{File, Folder, Frame, Question};
use super::say::{NameError, after};
use super::verifying::NoReference;
use crate::data::recordings::RecordingError;
use crate::live::{Happening, KnownTable, ProbeMonitor};
use tactus_link::exchange::{BOOTING, Exchange, GREETING, PortError, TIMEOUT, is_up};
use tactus_link::lifting::{Lifting, RigHeard, Stopped, moves};
use tactus_link::log::Line as Logged;
use tactus_link::{Job, LinkError, ReadTable, Request, Transaction};

/// What went wrong, and what to do: the sentences of `tactus device`.
#[derive(Debug, thiserror::Error)]
pub(super) enum WorkError {
    /// The line, or what the probe said.
    #[error("{name}: {why}{}", after(.why, *.moving))]
    Port {
        name: String,
        why: PortError,
        /// Something that moves was asked for and not over.
        moving: bool,
    },
    /// The user had it stopped.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// The probe holds a table that is none, or was given one.
    #[error("the probe's table cannot be read: {0}")]
    Table(#[from] TableError),
    /// A file is no table for the probe.
    #[error("{file}")]
    File { file: String, source: LinkError },
    /// A name.
    #[error(transparent)]
    Name(#[from] NameError),
    /// There is nothing to hold a sample against.
    #[error(transparent)]
    NoReference(#[from] NoReference),
    /// A slide makes no sense.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Something cannot be shown.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// In a sentence.
    #[error("{0}")]
    Said(String),
}

/// What `tactus device` would print.
#[derive(Clone, Default)]
pub(super) struct Out(Rc<RefCell<Vec<u8>>>);

impl Write for Out {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.borrow_mut().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// What has come from the probe.
#[derive(Default)]
struct Told {
    rig: RigHeard,
    log: Vec<u8>,
    monitor: ProbeMonitor,
    live: Option<Live>,
    phase: Option<Phase>,
    at_ms: u32,
}

impl Told {
    fn hear(&mut self, report: &Report, now: Duration) -> io::Result<()> {
        let said = Logged::Report(Box::new(std::borrow::Cow::Borrowed(report)));
        said.write(&mut self.log)?;
        self.rig.hear(report, now);
        self.at_ms = report.at_ms;
        match &report.event {
            Event::Phase(phase) => self.phase = Some(*phase),
            Event::Status(status) => self.phase = Some(status.phase),
            Event::Live(live) => self.live = Some(*live),
            _ => {}
        }
        self.monitor.hear(report.event.clone());
        Ok(())
    }
}

struct Line {
    name: String,
    exchange: Exchange,
    received: Vec<u8>,
    now: Duration,
    closed: bool,
    told: Told,
    known: Option<KnownTable>,
    connected: bool,
    busy: bool,
    stop: bool,
    failed: Option<String>,
    question: Option<Question>,
    answer: Option<bool>,
    files: Vec<File>,
    folders: Vec<Folder>,
}

/// A probe that somebody works with.
#[derive(Clone)]
pub(super) struct Bench {
    line: Rc<RefCell<Line>>,
    pub(super) out: Out,
}

impl Bench {
    /// A line of this name.
    pub(super) fn new(name: &str, now: Duration) -> io::Result<Self> {
        let mut told = Told::default();
        Logged::first(name).write(&mut told.log)?;
        let line = Line {
            name: name.to_owned(),
            exchange: Exchange::new(GREETING),
            received: Vec::new(),
            now,
            closed: false,
            told,
            known: None,
            connected: false,
            busy: true,
            stop: false,
            failed: None,
            question: None,
            answer: None,
            files: Vec::new(),
            folders: Vec::new(),
        };
        Ok(Self {
            line: Rc::new(RefCell::new(line)),
            out: Out::default(),
        })
    }

    // ---- from outside

    /// These bytes have come, and it is so late.
    pub(super) fn take(&self, received: &[u8], now: Duration) {
        let mut line = self.line.borrow_mut();
        line.received.extend_from_slice(received);
        line.now = now.max(line.now);
    }

    pub(super) fn close(&self) {
        self.line.borrow_mut().closed = true;
    }

    pub(super) fn stop(&self) {
        let mut line = self.line.borrow_mut();
        line.stop = line.busy;
    }

    pub(super) fn answer(&self, yes: bool) {
        let mut line = self.line.borrow_mut();
        if line.question.take().is_some() {
            line.answer = Some(yes);
        }
    }

    /// What the line is called.
    pub(super) fn name(&self) -> String {
        self.line.borrow().name.clone()
    }

    pub(super) fn is_busy(&self) -> bool {
        self.line.borrow().busy
    }

    pub(super) fn is_connected(&self) -> bool {
        self.line.borrow().connected
    }

    /// The log so far.
    pub(super) fn log(&self) -> Vec<u8> {
        self.line.borrow().told.log.clone()
    }

    /// What has been since the last one.
    pub(super) fn frame(&self) -> Frame {
        let line = &mut *self.line.borrow_mut();
        let heard = line.told.monitor.take();
        let live = line.told.live.as_ref();
        let of = |value: fn(&Live) -> f64| live.map_or(0.0, |live| value(live) * 1e-3);
        let said = std::mem::take(&mut *self.out.0.borrow_mut());
        Frame {
            send: line.exchange.to_send(),
            connected: line.connected,
            busy: line.busy,
            phase: line.told.phase,
            force_n: of(|live| f64::from(live.force_mn)),
            stage_mm: of(|live| f64::from(live.stage_um)),
            speed_mm_s: of(|live| f64::from(live.speed_um_s)),
            at_ms: line.told.at_ms,
            pac: heard.pac,
            spectra: heard.spectra,
            happened: heard.happened,
            known: line.known.take(),
            tables: Vec::new(),
            streams: None,
            said: String::from_utf8_lossy(&said).into_owned(),
            failed: line.failed.take(),
            question: line.question.clone(),
            files: std::mem::take(&mut line.files),
            folders: std::mem::take(&mut line.folders),
        }
    }

    // ---- from inside

    pub(super) fn busy(&self, busy: bool) {
        let mut line = self.line.borrow_mut();
        (line.busy, line.stop) = (busy, false);
    }

    pub(super) fn connected(&self, connected: bool) {
        self.line.borrow_mut().connected = connected;
    }

    pub(super) fn fails(&self, why: String) {
        self.line.borrow_mut().failed = Some(why);
    }

    pub(super) fn keep(&self, name: String, bytes: Vec<u8>) {
        self.line.borrow_mut().files.push(File { name, bytes });
    }

    pub(super) fn keep_folder(&self, folder: Folder) {
        self.line.borrow_mut().folders.push(folder);
    }

    /// An exploration begins; without a table that is known nothing follows it.
    pub(super) fn explores(&self, config: tactus_core::explorer::Config) {
        self.line.borrow_mut().told.monitor.explores(config);
    }

    /// Frames that were damaged and reports that were lost.
    pub(super) fn losses(&self) -> (u64, u64) {
        let line = self.line.borrow();
        let session = line.exchange.session();
        (session.damaged(), session.missing())
    }

    /// Something that the probe said is to be shown.
    pub(super) fn happens(&self, what: Happening) {
        self.line.borrow_mut().told.monitor.happens(what);
    }

    /// Asks, and waits for the answer; `None`: the user stops it.
    pub(super) async fn ask(&self, question: Question) -> Result<Option<bool>, WorkError> {
        self.line.borrow_mut().question = Some(question);
        loop {
            self.listen()?;
            {
                let mut line = self.line.borrow_mut();
                if let Some(answer) = line.answer.take() {
                    return Ok(Some(answer));
                }
                if std::mem::take(&mut line.stop) {
                    line.question = None;
                    return Ok(None);
                }
            }
            yield_now().await;
        }
    }

    /// The status of a probe that has come up: it may have had its power just now.
    pub(super) async fn hello(&self) -> Result<Status, WorkError> {
        let began = self.line.borrow().now;
        let status = loop {
            let status = self.get(Request::status()).await;
            let up = match &status {
                Ok(status) => is_up(status),
                Err(WorkError::Port { why, .. }) => !why.is_restart(),
                Err(_) => true,
            };
            let now = self.line.borrow().now;
            if up || now.saturating_sub(began) > BOOTING {
                break status?;
            }
            yield_now().await;
        };
        self.line.borrow_mut().exchange.set_timeout(TIMEOUT);
        Ok(status)
    }

    /// The table that the probe uses; all of it is in the log then.
    pub(super) async fn table(&self) -> Result<Vec<u8>, WorkError> {
        let bytes = self.get(ReadTable::default()).await?;
        let line = &mut *self.line.borrow_mut();
        line.told.monitor.knows(&bytes);
        line.told.monitor.learned();
        line.known = Some(line.told.monitor.known().clone());
        Ok(bytes)
    }

    /// As [`run`](Self::run), for what comes of it alone.
    pub(super) async fn get<E: Transaction>(
        &self,
        transaction: E,
    ) -> Result<E::Outcome, WorkError> {
        self.run(transaction, |_| Ok(())).await
    }

    /// Runs a transaction to its end; `each` gets every report. Where the user stops it, the rig is stopped and lifted.
    pub(super) async fn run<E: Transaction>(
        &self,
        transaction: E,
        mut each: impl FnMut(&Report) -> io::Result<()>,
    ) -> Result<E::Outcome, WorkError> {
        let each = |report: &Report| each(report).map(|()| ControlFlow::Continue(()));
        let outcome = self.run_until(transaction, each).await?;
        // nothing but the user stops it
        outcome.ok_or(Stopped::Lifted.into())
    }

    /// As [`run`](Self::run), and `each` may break it off: `None` then, and the rig is stopped and lifted.
    pub(super) async fn run_until<E: Transaction>(
        &self,
        transaction: E,
        mut each: impl FnMut(&Report) -> io::Result<ControlFlow<()>>,
    ) -> Result<Option<E::Outcome>, WorkError> {
        let mut job = self.begin(transaction)?;
        let mut enough = false;
        loop {
            let polled = self.step(&mut job, |report| {
                enough |= each(report)?.is_break();
                Ok(())
            })?;
            if let Poll::Ready(outcome) = polled {
                return Ok(Some(outcome));
            }
            if enough {
                return match self.lift().await? {
                    Stopped::Lifted => Ok(None),
                    came => Err(came.into()),
                };
            }
            if std::mem::take(&mut self.line.borrow_mut().stop) {
                writeln!(self.out.clone(), "Stopping and lifting the finger ...")?;
                return Err(self.lift().await?.into());
            }
            yield_now().await;
        }
    }

    fn begin<E: Transaction>(&self, transaction: E) -> Result<Job<E>, WorkError> {
        let line = &mut *self.line.borrow_mut();
        let begun = line.exchange.begin(transaction, line.now);
        let job = begun.map_err(|why| line.error(why, false))?;
        if let Some(command) = job.command() {
            line.asked(command)?;
        }
        Ok(job)
    }

    fn step<E: Transaction>(
        &self,
        job: &mut Job<E>,
        mut each: impl FnMut(&Report) -> io::Result<()>,
    ) -> Result<Poll<E::Outcome>, WorkError> {
        let line = &mut *self.line.borrow_mut();
        let moving = job.command().is_some_and(moves);
        if moving {
            line.told.rig.moves(job.last_id());
        }
        if line.closed {
            return Err(line.error(PortError::Closed, moving));
        }
        let received = std::mem::take(&mut line.received);
        let (told, now) = (&mut line.told, line.now);
        let mut shown = Ok(());
        let polled = line.exchange.step(job, &received, now, |report| {
            let heard = told.hear(report, now).and_then(|()| each(report));
            if shown.is_ok() {
                shown = heard;
            }
        });
        shown?;
        polled.map_err(|why| {
            if moving && !matches!(why, PortError::Link(LinkError::Refused(_))) {
                // there may be nobody to hear it
                let _ = line.exchange.send(Command::Stop);
            }
            line.error(why, moving)
        })
    }

    /// Hears what comes while nothing is asked for.
    pub(super) fn listen(&self) -> Result<(), WorkError> {
        let line = &mut *self.line.borrow_mut();
        if line.closed {
            return Err(line.error(PortError::Closed, false));
        }
        let received = std::mem::take(&mut line.received);
        let (told, now) = (&mut line.told, line.now);
        let mut heard = Ok(());
        line.exchange.listen(&received, |report| {
            if heard.is_ok() {
                heard = told.hear(report, now);
            }
        });
        Ok(heard?)
    }

    /// Stops whatever is done and waits until the finger is lifted and nothing moves: what came of it.
    async fn lift(&self) -> Result<Stopped, WorkError> {
        let mut lifting = {
            let line = &mut *self.line.borrow_mut();
            Lifting::begin(&mut line.told.rig, line.now)
        };
        loop {
            {
                let line = &mut *self.line.borrow_mut();
                for command in lifting.asks(line.now).into_iter().flatten() {
                    line.asked(&command)?;
                    let asked = line.exchange.send(command);
                    asked.map_err(|why| line.error(why, false))?;
                }
            }
            self.listen()?;
            {
                let line = self.line.borrow();
                if let Some(came) = lifting.came(&line.told.rig, line.now) {
                    return Ok(came);
                }
            }
            yield_now().await;
        }
    }
}

impl Line {
    fn asked(&mut self, command: &Command) -> io::Result<()> {
        let asked = Logged::Command(Box::new(std::borrow::Cow::Borrowed(command)));
        asked.write(&mut self.told.log)
    }

    fn error(&self, why: PortError, moving: bool) -> WorkError {
        WorkError::Port {
            name: self.name.clone(),
            why,
            moving,
        }
    }
}
