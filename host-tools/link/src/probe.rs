//! A probe that operations are done with, over bytes that somebody else carries.
//!
//! An operation is a future that holds a [`Probe`]. Whoever carries the bytes polls it, and between two polls hands
//! over what
//! came and what time it is ([`carry`](Probe::carry)), sends what is due, shows the [`words`](Probe::take_words), keeps
//! the log
//! ([`said`](Probe::said)) and files, and answers the questions.

use std::future::poll_fn;
use std::io;
use std::mem::take;
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::Poll;
use std::time::Duration;

use tactus_core::table::Table;
use tactus_core::wire::{Command, Event, Phase, Report, Status};

use super::error::{OperationError, PortError};
use super::lifting::{Lifting, RigWatch, Stopped, moves};
use super::limits::Limits;
use super::log::Line;
use super::person::{Backup, Question, Words};
use super::printer::Printer;
use super::request::Request;
use super::say::Prompts;
use super::session::{LinkError, MAX_TRIES, Session};
use super::table::ReadTable;
use super::transaction::{Job, Transaction};

/// A probe that says nothing for so long is taken for gone: its longest silence is an erase of its flash, 2 s.
pub const TIMEOUT: Duration = Duration::from_secs(5);
/// A first answer comes sooner: the probe reports its status at once.
pub const GREETING: Duration = Duration::from_secs(1);
/// A probe opens its store within 10 s of its start.
const BOOTING: Duration = Duration::from_secs(90);
/// Time between two questions to a probe that boots.
const BETWEEN: Duration = Duration::from_millis(100);

#[derive(Debug, Default)]
struct State {
    name: String,
    session: Session,
    /// silence that is allowed, and that of a probe which has answered
    greeting: Duration,
    timeout: Duration,
    send: Vec<u8>,
    received: Vec<u8>,
    /// bytes and reports that came
    came: (u64, u64),
    now: Duration,
    /// when a report came last, or was waited for from then on
    heard: Duration,
    closed: bool,
    /// why the line is closed, until somebody was told
    failure: Option<PortError>,
    rig: RigWatch,
    /// commands and reports that the log has not got yet
    said: Vec<Line<'static>>,
    stop: bool,
    lifting: bool,
    gives_up: bool,
    question: Option<Question>,
    answer: Option<bool>,
    backup: Option<Backup>,
    kept: Option<Result<String, String>>,
    /// the table in use, and its checksum
    table: Option<(u32, Arc<[u8]>)>,
    /// the checksum that the probe says it has
    in_use: Option<u32>,
    /// movements of the table that was read last
    movements: Option<usize>,
    /// of the request under way
    limits: Option<Limits>,
    /// moves the finger
    printer: Option<Printer>,
}

impl State {
    fn error(&self, why: PortError, moving: bool) -> OperationError {
        OperationError::Port {
            name: self.name.clone(),
            why,
            moving,
        }
    }

    fn open(&mut self, moving: bool) -> Result<(), OperationError> {
        if !self.closed {
            return Ok(());
        }
        let why = self.failure.take().unwrap_or(PortError::Closed);
        Err(self.error(why, moving))
    }

    fn asks(&mut self, command: &Command) {
        let learns = match command {
            Command::Label(_)
            | Command::Train(_)
            | Command::Rename { .. }
            | Command::Forget(_)
            | Command::BeginTable(_)
            | Command::CommitTable
            | Command::FactoryTable => true,
            Command::Identify(wanted) => wanted.learn,
            _ => false,
        };
        if learns {
            (self.table, self.in_use) = (None, None);
        }
        let command = Box::new(std::borrow::Cow::Owned(command.clone()));
        self.said.push(Line::Command(command));
    }

    fn hear(&mut self, reports: &[Report]) {
        for report in reports {
            self.rig.hear(report, self.now);
            if let Some(printer) = &self.printer {
                match &report.event {
                    Event::Arm(order) => printer.order(*order),
                    Event::Live(live) => printer.force(live.force_mn),
                    _ => {}
                }
            }
            match &report.event {
                Event::Status(status) => self.in_use = Some(status.table_crc),
                Event::TextureLearned(_) | Event::Booted { .. } => self.in_use = None,
                _ => {}
            }
            let in_use = match (&report.event, &self.table) {
                (Event::TextureLearned(_) | Event::Booted { .. }, _) => false,
                (Event::Status(status), Some((crc, _))) => *crc == status.table_crc,
                _ => true,
            };
            if !in_use {
                self.table = None;
            }
            let report = Box::new(std::borrow::Cow::Owned(report.clone()));
            self.said.push(Line::Report(report));
        }
    }

    fn begin<E: Transaction>(&mut self, transaction: E) -> Result<Job<E>, OperationError> {
        (self.heard, self.limits) = (self.now, None);
        let begun = Job::begin(transaction, &mut self.session, &mut self.send);
        let job = begun.map_err(|why| self.error(why.into(), false))?;
        if let Some(command) = job.command() {
            self.asks(&command.clone());
        }
        Ok(job)
    }

    fn send(&mut self, command: Command) -> Result<(), OperationError> {
        self.asks(&command);
        let sent = self.session.request(command, &mut self.send);
        sent.map_err(|why| self.error(LinkError::from(why).into(), false))?;
        Ok(())
    }

    fn listen(&mut self) -> Vec<Report> {
        let received = take(&mut self.received);
        let reports = self.session.receive(&received);
        self.came.0 += received.len() as u64;
        self.came.1 += reports.len() as u64;
        self.hear(&reports);
        reports
    }

    /// Continues a job with what came; the reports that came are pushed.
    fn step<E: Transaction>(
        &mut self,
        job: &mut Job<E>,
        reports: &mut Vec<Report>,
    ) -> Result<Poll<E::Outcome>, OperationError> {
        let moving = job.command().is_some_and(moves);
        if moving {
            self.rig.moves(job.last_id());
        }
        self.open(moving)?;
        let polled = self.poll(job, reports);
        self.hear(reports);
        polled.map_err(|why| {
            if moving && !matches!(why, PortError::Link(LinkError::Refused(_))) {
                // there may be nobody to hear it
                let _ = self.session.request(Command::Stop, &mut self.send);
            }
            self.error(why, moving)
        })
    }

    fn poll<E: Transaction>(
        &mut self,
        job: &mut Job<E>,
        reports: &mut Vec<Report>,
    ) -> Result<Poll<E::Outcome>, PortError> {
        self.limit(job)?;
        let received = take(&mut self.received);
        if !received.is_empty() {
            self.came.0 += received.len() as u64;
            let each = |report: &Report| reports.push(report.clone());
            let polled = job.poll(&mut self.session, &received, &mut self.send, each);
            self.came.1 += reports.len() as u64;
            match polled {
                Poll::Ready(Err(LinkError::Disturbed)) if self.came.1 == 0 => {
                    return Err(self.garbage());
                }
                Poll::Ready(outcome) => return Ok(Poll::Ready(outcome?)),
                // bytes without end that are no report are as good as silence
                Poll::Pending if !reports.is_empty() => self.heard = self.now,
                Poll::Pending => {}
            }
        }
        if self.now.saturating_sub(self.heard) >= self.greeting {
            let garbage = self.came.0 > 0 && self.came.1 == 0;
            match job.repeat(&mut self.session, &mut self.send) {
                Ok(true) => self.heard = self.now,
                Ok(false) | Err(LinkError::Disturbed) if garbage => {
                    return Err(self.garbage());
                }
                Ok(false) => return Err(PortError::Silent(self.greeting)),
                Err(LinkError::Disturbed) => {
                    return Err(PortError::Silent(self.greeting * MAX_TRIES.into()));
                }
                Err(why) => return Err(why.into()),
            }
        }
        Ok(Poll::Pending)
    }

    fn garbage(&self) -> PortError {
        match self.session.is_echo() {
            true => LinkError::Echo.into(),
            false => PortError::Garbage(self.came.0),
        }
    }

    /// Ends a request that is under way for too long.
    fn limit<E: Transaction>(&mut self, job: &Job<E>) -> Result<(), PortError> {
        let (id, Some(command)) = (job.first_id(), job.command()) else {
            return Ok(());
        };
        let now = (self.now, self.came.0);
        let limits = self
            .limits
            .take()
            .filter(|limits| limits.are_of(id, command));
        let limits = limits.unwrap_or_else(|| Limits::new((id, command), self.movements, now));
        if let Some(longest) = limits.passed(self.now, self.came.0) {
            let asked = format!("{command:?}");
            let request = asked.split(|c: char| !c.is_alphanumeric()).next();
            let request = request.unwrap_or_default().to_owned();
            return Err(PortError::Endless { request, longest });
        }
        self.limits = Some(limits);
        Ok(())
    }
}

/// A probe at the other end of a line; its copies are the same probe.
#[derive(Clone, Debug)]
pub struct Probe {
    state: Arc<Mutex<State>>,
    words: Words,
}

impl Probe {
    /// A probe at a line of this name. Silence is taken for a loss after `greeting`, and after `timeout` once
    /// [`hello`](Self::hello) was answered.
    pub fn new(name: &str, greeting: Duration, timeout: Duration) -> Self {
        let state = State {
            name: name.to_owned(),
            greeting,
            timeout,
            ..State::default()
        };
        Self {
            state: Arc::new(Mutex::new(state)),
            words: Words::default(),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    // ---- for whoever carries the bytes

    /// Takes in what came, and what time it is since any moment.
    pub fn carry(&self, received: &[u8], now: Duration) {
        let mut state = self.state();
        state.received.extend_from_slice(received);
        state.now = now.max(state.now);
        let reports = state.printer.as_ref().map(Printer::reports);
        for report in reports.unwrap_or_default() {
            // one that is lost is said again
            let _ = state.send(Command::Arm(report));
        }
    }

    /// Has a printer move the finger from now on.
    pub fn move_by(&self, printer: Printer) {
        self.state().printer = Some(printer);
    }

    /// Returns the bytes that are to be sent now.
    pub fn to_send(&self) -> Vec<u8> {
        take(&mut self.state().send)
    }

    /// The line is gone.
    pub fn close(&self, why: PortError) {
        let mut state = self.state();
        if !state.closed {
            (state.closed, state.failure) = (true, Some(why));
        }
    }

    /// Has the operation under way stop and lift the finger.
    pub fn stop(&self) {
        let mut state = self.state();
        state.stop = !state.lifting;
    }

    /// The same; where it lifts the finger already, it does not wait for that any more.
    pub fn interrupt(&self) {
        let mut state = self.state();
        match state.lifting {
            true => state.gives_up = true,
            false => state.stop = true,
        }
    }

    /// Forgets a stop that came too late.
    pub fn clear_stop(&self) {
        let mut state = self.state();
        (state.stop, state.gives_up) = (false, false);
    }

    /// The question that waits for its answer.
    pub fn question(&self) -> Option<Question> {
        self.state().question.clone()
    }

    /// Answers it.
    pub fn answer(&self, yes: bool) {
        let mut state = self.state();
        if state.question.take().is_some() {
            state.answer = Some(yes);
        }
    }

    /// A file that has to be kept now, once; [`kept`](Self::kept) says what came of it.
    pub fn backup(&self) -> Option<Backup> {
        self.state().backup.take()
    }

    /// The file is kept, and how it is brought back; or why it is not.
    pub fn kept(&self, how: Result<String, String>) {
        self.state().kept = Some(how);
    }

    /// Commands and reports since the last time, for a log.
    pub fn said(&self) -> Vec<Line<'static>> {
        take(&mut self.state().said)
    }

    /// Words since the last time.
    pub fn take_words(&self) -> Vec<u8> {
        self.words.take()
    }

    /// Name of the line.
    pub fn name(&self) -> String {
        self.state().name.clone()
    }

    /// Frames that were damaged, and reports that were lost on the line.
    pub fn losses(&self) -> (u64, u64) {
        let state = self.state();
        (state.session.damaged(), state.session.missing())
    }

    // ---- for operations

    /// A writer of words for people.
    pub fn words(&self) -> Words {
        self.words.clone()
    }

    /// The time.
    pub fn now(&self) -> Duration {
        self.state().now
    }

    /// Takes in what came while nothing is asked for.
    pub fn listen(&self) -> Result<Vec<Report>, OperationError> {
        let mut state = self.state();
        state.open(false)?;
        Ok(state.listen())
    }

    /// Sends a command beside whatever is under way.
    pub fn send(&self, command: Command) -> Result<(), OperationError> {
        self.state().send(command)
    }

    /// Listens for so long.
    pub async fn pause(&self, time: Duration) -> Result<(), OperationError> {
        let began = self.now();
        while self.now().saturating_sub(began) < time {
            self.listen()?;
            turn().await;
        }
        Ok(())
    }

    /// The status of a probe that has come up: it may have had its power just now.
    pub async fn hello(&self) -> Result<Status, OperationError> {
        let began = self.now();
        let status = loop {
            let status = self.get(Request::status()).await;
            let up = match &status {
                // one without a table has not opened its store yet
                Ok(status) => status.textures > 0 && status.phase != Phase::Homing,
                Err(OperationError::Port { why, .. }) => !why.is_restart(),
                Err(_) => true,
            };
            if up || self.now().saturating_sub(began) > BOOTING {
                break status?;
            }
            self.pause(BETWEEN).await?;
        };
        let mut state = self.state();
        state.greeting = state.timeout;
        Ok(status)
    }

    /// The table that the probe uses; it is pulled once for as long as the probe uses it.
    pub async fn table(&self) -> Result<Arc<[u8]>, OperationError> {
        if let Some((_, bytes)) = &self.state().table {
            return Ok(Arc::clone(bytes));
        }
        let bytes: Arc<[u8]> = self.get(ReadTable::default()).await?.into();
        let table = Table::read(&bytes)?;
        let mut state = self.state();
        if state.in_use.is_some_and(|crc| crc != table.crc()) {
            return Err(state.error(LinkError::Changed.into(), false));
        }
        state.movements = Some(table.movements().len());
        state.table = Some((table.crc(), Arc::clone(&bytes)));
        Ok(bytes)
    }

    /// Runs a transaction to its end, as [`run`](Self::run).
    pub async fn get<E: Transaction>(&self, transaction: E) -> Result<E::Outcome, OperationError> {
        self.run(transaction, |_| Ok(())).await
    }

    /// Runs a transaction that moves the rig, and says what a person is asked to do, faults and their recovery.
    pub async fn perform<E: Transaction>(
        &self,
        transaction: E,
    ) -> Result<E::Outcome, OperationError> {
        let (mut prompts, mut words) = (Prompts::default(), self.words());
        self.run(transaction, |report| prompts.show(report, &mut words))
            .await
    }

    /// Runs a transaction to its end; `each` gets every report. Whatever ends it early leaves the rig stopped and
    /// lifted.
    pub async fn run<E: Transaction>(
        &self,
        transaction: E,
        mut each: impl FnMut(&Report) -> io::Result<()>,
    ) -> Result<E::Outcome, OperationError> {
        let each = |report: &Report| each(report).map(|()| ControlFlow::Continue(()));
        let outcome = self.run_until(transaction, each).await?;
        // nothing but the user stops it
        outcome.ok_or(Stopped::Lifted.into())
    }

    /// Runs a transaction as [`run`](Self::run) does, and `each` may break it off: `None` then, and the rig is stopped
    /// and
    /// lifted.
    pub async fn run_until<E: Transaction>(
        &self,
        transaction: E,
        mut each: impl FnMut(&Report) -> io::Result<ControlFlow<()>>,
    ) -> Result<Option<E::Outcome>, OperationError> {
        let mut job = self.state().begin(transaction)?;
        loop {
            let mut reports = Vec::new();
            let polled = self.state().step(&mut job, &mut reports);
            let shown = reports.iter().try_fold(false, |ends, report| {
                each(report).map(|flow| ends || flow.is_break())
            });
            match (polled?, shown) {
                (_, Err(why)) => {
                    // what could not be shown goes before what came of stopping
                    let _ = self.lift().await;
                    return Err(why.into());
                }
                (Poll::Ready(outcome), Ok(_)) => return Ok(Some(outcome)),
                (Poll::Pending, Ok(true)) => {
                    return match self.lift().await? {
                        Stopped::Lifted => Ok(None),
                        came => Err(came.into()),
                    };
                }
                (Poll::Pending, Ok(false)) => {}
            }
            if take(&mut self.state().stop) {
                return Err(self.lift().await?.into());
            }
            turn().await;
        }
    }

    /// Stops whatever is done, and waits until the finger is lifted and nothing moves.
    pub async fn lift(&self) -> Result<Stopped, OperationError> {
        let mut lifting = {
            let state = &mut *self.state();
            (state.lifting, state.gives_up) = (true, false);
            Lifting::begin(&mut state.rig, state.now)
        };
        let came = self.lifted(&mut lifting).await;
        self.state().lifting = false;
        came
    }

    async fn lifted(&self, lifting: &mut Lifting) -> Result<Stopped, OperationError> {
        loop {
            {
                let mut state = self.state();
                if take(&mut state.gives_up) {
                    return Ok(Stopped::NotLifted);
                }
                for command in lifting.asks(state.now).into_iter().flatten() {
                    state.send(command)?;
                }
            }
            self.listen()?;
            {
                let state = self.state();
                if let Some(came) = lifting.came(&state.rig, state.now) {
                    return Ok(came);
                }
            }
            turn().await;
        }
    }

    /// Waits until `ready` makes something of the state; the user may stop that.
    async fn wait<T>(
        &self,
        mut ready: impl FnMut(&mut State) -> Option<T>,
    ) -> Result<T, OperationError> {
        loop {
            self.listen()?;
            {
                let mut state = self.state();
                if let Some(ready) = ready(&mut state) {
                    return Ok(ready);
                }
                if take(&mut state.stop) {
                    (state.question, state.backup) = (None, None);
                    // nothing moves between two requests
                    return Err(Stopped::Lifted.into());
                }
            }
            turn().await;
        }
    }

    /// Asks whoever is there, and waits for the answer.
    pub async fn ask(&self, question: Question) -> Result<bool, OperationError> {
        self.state().question = Some(question);
        self.wait(|state| state.answer.take()).await
    }

    /// Has a file kept; how it is brought back.
    pub async fn keep(&self, backup: Backup) -> Result<String, OperationError> {
        self.state().backup = Some(backup);
        let kept = self.wait(|state| state.kept.take()).await?;
        kept.map_err(OperationError::Said)
    }
}

/// Lets whoever carries the bytes go on.
pub(crate) async fn turn() {
    let mut over = false;
    poll_fn(|_| match std::mem::replace(&mut over, true) {
        true => Poll::Ready(()),
        false => Poll::Pending,
    })
    .await;
}
