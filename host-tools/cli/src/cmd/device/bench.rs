//! A probe that somebody works with: its line, the log of what is said, and Ctrl-C, which leaves the rig lifted and stopped.

use std::io::{self, Write};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::task::Poll;
use std::time::{Duration, Instant};

use tactus_core::table::{Table, TableError};
use tactus_core::wire::{Command, Event, Report, Status};
pub(crate) use tactus_lab::remote::say::Prompts;
use tactus_lab::remote::say::after;
use tactus_link::bringup::Trouble;
use tactus_link::exchange::{BOOTING, GREETING, TIMEOUT, is_up};
use tactus_link::lifting::{Lifting, RigHeard, Stopped as Rig, moves};
use tactus_link::line::Line;
use tactus_link::owner::Owner;
use tactus_link::{Job, LinkError, Port, PortError, ReadTable, Request, Transaction};

use super::history::History;
use super::line::{Emulator, OpenError, Where};
use super::log::Log;

/// An emulated board may go slower than real time.
const EMULATED: Duration = Duration::from_secs(30);

/// What went wrong at the bench, and what to do.
#[derive(Debug, thiserror::Error)]
pub(crate) enum BenchError {
    /// There is no line.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The line, or what the probe said.
    #[error("{name}: {why}{}", after(.why, *.moving))]
    Port {
        name: String,
        why: PortError,
        /// Something that moves was asked for and not over.
        moving: bool,
    },
    /// Ctrl-C.
    #[error("{}", Rig::Lifted)]
    Stopped,
    /// Ctrl-C, and the fault is that the lever does not find its top.
    #[error("{}", Rig::NotHome)]
    NotHome,
    /// Ctrl-C twice, or the probe did not answer.
    #[error("{}", Rig::NotLifted)]
    NotLifted,
    /// The probe holds a table that is none.
    #[error("the probe's table cannot be read: {0}")]
    Table(#[from] TableError),
    /// The log cannot be written.
    #[error("{0}; the rig was stopped and lifted")]
    Log(io::Error),
    /// A bring-up came to no end.
    #[error(transparent)]
    BringUp(#[from] Trouble),
    /// There can be no log, or what is shown cannot be written.
    #[error(transparent)]
    Io(#[from] io::Error),
}

impl BenchError {
    /// Whether the user had it stopped: what a shell takes for Ctrl-C.
    pub(crate) fn is_interrupt(&self) -> bool {
        matches!(
            self,
            Self::Stopped | Self::NotHome | Self::NotLifted | Self::BringUp(Trouble::Quit)
        )
    }
}

/// Ctrl-C, a closed terminal, `kill`: seen when somebody looks.
#[derive(Clone, Default)]
pub(crate) struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// From now on they do not end the program by themselves.
    pub(crate) fn catch() -> io::Result<Self> {
        let interrupt = Self::default();
        use signal_hook::consts::{SIGINT, SIGTERM};
        #[cfg(unix)]
        let signals = [SIGINT, SIGTERM, signal_hook::consts::SIGHUP];
        #[cfg(not(unix))]
        let signals = [SIGINT, SIGTERM];
        for signal in signals {
            signal_hook::flag::register(signal, Arc::clone(&interrupt.0))?;
        }
        Ok(interrupt)
    }

    /// Whether there was one since this was asked last.
    pub(crate) fn take(&self) -> bool {
        self.0.swap(false, Relaxed)
    }
}

/// A probe that somebody works with.
pub(crate) struct Bench {
    port: Port<Box<dyn Line>>,
    pub(crate) name: String,
    interrupt: Interrupt,
    heard: Heard,
    /// ends last
    _emulator: Option<Emulator>,
    _owner: Option<Owner>,
}

/// What the reports have said of the rig, and the log that keeps them.
struct Heard {
    log: Option<Log>,
    history: History,
    rig: RigHeard,
    began: Instant,
}

impl Heard {
    fn hear(&mut self, report: &Report) {
        if let Some(log) = &mut self.log {
            log.told(report);
        }
        self.history.hear(report);
        self.rig.hear(report, self.began.elapsed());
        if let Event::Chosen {
            slide, movement, ..
        } = &report.event
        {
            tracing::info!(slide, %movement, "the probe chooses");
        }
    }

    fn asked(&mut self, command: &Command) {
        if let Some(log) = &mut self.log {
            log.asked(command);
        }
    }

    /// That all of it is in the log.
    fn logged(&mut self) -> Result<(), BenchError> {
        let Some(Err(why)) = self.log.as_mut().map(Log::flush) else {
            return Ok(());
        };
        self.log = None;
        Err(BenchError::Log(why))
    }
}

impl Bench {
    /// Opens the line and waits until the probe has its table: it may have had its power just now.
    pub(crate) fn open(place: &Where) -> Result<(Self, Status), BenchError> {
        let interrupt = Interrupt::catch()?;
        let open = place.open()?;
        let log = place.log.as_ref().map(|path| Log::create(path, &open.name));
        let (greeting, timeout) = match open.emulator {
            Some(_) => (EMULATED, EMULATED),
            None => (GREETING, TIMEOUT),
        };
        let mut bench = Self {
            port: Port::new(open.line, greeting),
            interrupt,
            heard: Heard {
                log: log.transpose()?,
                history: History::of(&open.name),
                rig: RigHeard::default(),
                began: Instant::now(),
            },
            name: open.name,
            _emulator: open.emulator,
            _owner: open.owner,
        };
        let status = bench.hello()?;
        bench.port.set_timeout(timeout);
        Ok((bench, status))
    }

    /// The status of a probe that has come up.
    fn hello(&mut self) -> Result<Status, BenchError> {
        let began = Instant::now();
        loop {
            let status = self.get(Request::status());
            let is_up = match &status {
                Ok(status) => is_up(status),
                Err(BenchError::Port { why, .. }) => !why.is_restart(),
                Err(_) => true,
            };
            if is_up || began.elapsed() > BOOTING {
                return status;
            }
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// What was damaged and lost on the line: frames, reports.
    pub(crate) fn losses(&self) -> (u64, u64) {
        let session = self.port.session();
        (session.damaged(), session.missing())
    }

    /// What this PC remembers of the probe.
    pub(crate) fn history(&self) -> &History {
        &self.heard.history
    }

    /// Whether the user wants to end.
    pub(crate) fn interrupt(&self) -> &Interrupt {
        &self.interrupt
    }

    /// Runs a transaction to its end; `each` gets every report. Whatever ends it early leaves the rig stopped and lifted.
    pub(crate) fn run<E: Transaction>(
        &mut self,
        transaction: E,
        mut each: impl FnMut(&Report) -> io::Result<()>,
    ) -> Result<E::Outcome, BenchError> {
        let each = |report: &Report| each(report).map(|()| ControlFlow::Continue(()));
        let outcome = self.run_until(transaction, each)?;
        // nothing but the user stops it
        outcome.ok_or(BenchError::Stopped)
    }

    /// As [`run`](Self::run), and `each` may break it off: `None` then, and the rig is stopped and lifted.
    pub(crate) fn run_until<E: Transaction>(
        &mut self,
        transaction: E,
        mut each: impl FnMut(&Report) -> io::Result<ControlFlow<()>>,
    ) -> Result<Option<E::Outcome>, BenchError> {
        let mut job = self.begin(transaction)?;
        let mut goes_on = ControlFlow::Continue(());
        loop {
            let mut shown = Ok(());
            let polled = self.step(&mut job, |report| {
                if shown.is_ok() {
                    match each(report) {
                        Ok(ControlFlow::Continue(())) => {}
                        Ok(enough) => goes_on = enough,
                        Err(why) => shown = Err(why),
                    }
                }
            });
            match (polled, shown) {
                (Ok(Poll::Ready(outcome)), Ok(())) => return Ok(Some(outcome)),
                (Ok(Poll::Pending), Ok(())) if goes_on.is_break() => {
                    return match self.lift() {
                        BenchError::Stopped => Ok(None),
                        why => Err(why),
                    };
                }
                (Ok(Poll::Pending), Ok(())) if !self.interrupt.take() => {}
                (Ok(Poll::Pending), Ok(())) => {
                    eprintln!("\nStopping and lifting the finger (Ctrl-C again: do not wait) ...");
                    return Err(self.lift());
                }
                (Ok(_), Err(why)) => {
                    // what could not be shown goes before what came of stopping
                    self.lift();
                    return Err(why.into());
                }
                (Err(why @ BenchError::Log(_)), _) => {
                    self.lift();
                    return Err(why);
                }
                (Err(why), _) => return Err(why),
            }
        }
    }

    /// As [`run`](Self::run), for what comes of it alone.
    pub(crate) fn get<E: Transaction>(&mut self, transaction: E) -> Result<E::Outcome, BenchError> {
        self.run(transaction, |_| Ok(()))
    }

    /// As [`run`](Self::run), for commands that move the rig: prints what a person is asked to do, and a fault and its recovery.
    pub(crate) fn perform<E: Transaction>(
        &mut self,
        transaction: E,
        out: &mut impl Write,
    ) -> Result<E::Outcome, BenchError> {
        let mut prompts = Prompts::default();
        self.run(transaction, |report| prompts.show(report, out))
    }

    /// Begins a transaction; the caller may do something else between its [steps](Bench::step).
    pub(crate) fn begin<E: Transaction>(&mut self, transaction: E) -> Result<Job<E>, BenchError> {
        let begun = self.port.begin(transaction);
        let job = begun.map_err(|why| self.error(why, false))?;
        if let Some(command) = job.command() {
            self.heard.asked(command);
        }
        Ok(job)
    }

    /// Continues a transaction: reads once.
    ///
    /// # Errors
    /// See [`BenchError`]. A rig that moves gets a stop command, in case the probe still hears it.
    pub(crate) fn step<E: Transaction>(
        &mut self,
        job: &mut Job<E>,
        mut each: impl FnMut(&Report),
    ) -> Result<Poll<E::Outcome>, BenchError> {
        let moving = job.command().is_some_and(moves);
        if moving {
            self.heard.rig.moves(job.last_id());
        }
        let polled = self.port.step(job, |report| {
            self.heard.hear(report);
            each(report);
        });
        self.heard.logged()?;
        polled.map_err(|why| {
            if moving && !matches!(why, PortError::Link(LinkError::Refused(_))) {
                // there may be nobody to hear it
                let _ = self.port.send(Command::Stop);
                let _ = self.port.listen(|_| ());
            }
            self.error(why, moving)
        })
    }

    /// Sends a command beside the transaction under way.
    pub(crate) fn send(&mut self, command: Command) -> Result<(), BenchError> {
        self.heard.asked(&command);
        let asked = self.port.send(command);
        asked.map_err(|why| self.error(why, false))
    }

    /// Reads once, while no transaction is under way.
    pub(crate) fn listen(&mut self, mut each: impl FnMut(&Report)) -> Result<(), BenchError> {
        let listened = self.port.listen(|report| {
            self.heard.hear(report);
            each(report);
        });
        self.heard.logged()?;
        listened.map_err(|why| self.error(why, false))
    }

    /// The table that the probe uses; all of it is in the log then.
    pub(crate) fn table(&mut self) -> Result<Vec<u8>, BenchError> {
        self.get(ReadTable::default())
    }

    /// The names of the textures that the probe knows.
    pub(crate) fn names(&mut self) -> Result<Vec<String>, BenchError> {
        let bytes = self.table()?;
        Ok(Table::read(&bytes)?.names().map(str::to_owned).collect())
    }

    /// Stops whatever is done and waits until the finger is lifted and nothing moves: what came of it. A second Ctrl-C ends
    /// the waiting.
    pub(crate) fn lift(&mut self) -> BenchError {
        match self.try_lift() {
            Ok(Rig::Lifted) => BenchError::Stopped,
            Ok(Rig::NotHome) => BenchError::NotHome,
            Ok(Rig::NotLifted) => BenchError::NotLifted,
            Err(why) => why,
        }
    }

    fn try_lift(&mut self) -> Result<Rig, BenchError> {
        let began = self.heard.began;
        let mut lifting = Lifting::begin(&mut self.heard.rig, began.elapsed());
        loop {
            if self.interrupt.take() {
                return Ok(Rig::NotLifted);
            }
            for command in lifting.asks(began.elapsed()).into_iter().flatten() {
                self.send(command)?;
            }
            self.listen(|_| ())?;
            if let Some(came) = lifting.came(&self.heard.rig, began.elapsed()) {
                return Ok(came);
            }
        }
    }

    fn error(&self, why: PortError, moving: bool) -> BenchError {
        BenchError::Port {
            name: self.name.clone(),
            why,
            moving,
        }
    }
}

/// Waits for Enter, or for Ctrl-C.
pub(crate) fn wait_for_enter(interrupt: &Interrupt, prompt: &str) -> Result<(), BenchError> {
    read_answer(interrupt, prompt).map(|_| ())
}

/// Asks, and waits for a line; Ctrl-C or the end of the input stops.
pub(crate) fn read_answer(interrupt: &Interrupt, prompt: &str) -> Result<String, BenchError> {
    eprint!("{prompt}");
    let (entered, enter) = mpsc::channel();
    // a blocking read does not see Ctrl-C; the thread ends with the program
    std::thread::spawn(move || {
        let mut line = String::new();
        let read = io::stdin().read_line(&mut line);
        // nobody waits any more after Ctrl-C
        let _ = entered.send(read.map(|bytes| (bytes > 0).then_some(line)));
    });
    loop {
        if interrupt.take() {
            return Err(BenchError::Stopped);
        }
        match enter.recv_timeout(Duration::from_millis(100)) {
            Ok(Ok(Some(line))) => return Ok(line),
            Ok(Err(why)) => return Err(why.into()),
            Err(RecvTimeoutError::Timeout) => {}
            Ok(Ok(None)) | Err(RecvTimeoutError::Disconnected) => return Err(BenchError::Stopped),
        }
    }
}
