//! A probe that somebody works with at a terminal: its line, the log of what is said, questions, and Ctrl-C, which
//! leaves the rig lifted and stopped.

use std::io::{self, Write};
use std::path::PathBuf;
use std::pin::{Pin, pin};
use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, OnceLock};
use std::task::Poll;
use std::time::Duration;

use tactus_core::wire::{Report, Status};
use tactus_link::bringup::Trouble;
use tactus_link::lifting::Stopped;
use tactus_link::line::{Line, LineError};
use tactus_link::lock::PortLock;
use tactus_link::log::{self, Log};
use tactus_link::person::{Question, QuestionKind};
use tactus_link::printer::OpenPrinter;
use tactus_link::probe::{GREETING, TIMEOUT};
use tactus_link::{OperationError, Port, Probe, Transaction};

use super::line::{Consent, Where};
use super::printer;
use crate::cmd::output::Format;
use crate::cmd::printed::{prompt as ask_for, say};

#[derive(Debug, thiserror::Error)]
pub(crate) enum BenchError {
    /// There is no line.
    #[error(transparent)]
    Open(#[from] LineError),
    /// An operation failed, or was stopped.
    #[error(transparent)]
    Operation(#[from] OperationError),
    #[error("{0}; the rig was stopped and lifted")]
    Log(io::Error),
    /// A bring-up did not reach its end.
    #[error(transparent)]
    BringUp(#[from] Trouble),
    /// There can be no log, or what is shown cannot be written.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The printer's set-up is not there, or cannot be kept.
    #[error("{0}")]
    Printer(String),
    #[error("nothing was changed: there is nobody to ask; add --yes to do it")]
    Nobody,
    #[error("nothing was changed: {} is there already: give --backup another name, or --force", .0.display())]
    Taken(PathBuf),
}

impl BenchError {
    /// Returns true where the user had it stopped: what a shell takes for Ctrl-C.
    pub(crate) fn is_interrupt(&self) -> bool {
        matches!(
            self,
            Self::Operation(OperationError::Stopped(_)) | Self::BringUp(Trouble::Quit)
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

    pub(crate) fn take(&self) -> bool {
        self.0.swap(false, Relaxed)
    }
}

pub(crate) struct Bench {
    port: Port<Box<dyn Line>>,
    pub(crate) probe: Probe,
    pub(crate) name: String,
    pub(crate) interrupt: Interrupt,
    log: Option<Log>,
    format: Format,
    pub(crate) consent: Consent,
    /// Answers may be lines that are no terminal's, as in a bring-up.
    pub(crate) takes_lines: bool,
    /// what failed here while an operation is being stopped
    failed: Option<BenchError>,
    printer: Option<OpenPrinter>,
    _lock: PortLock,
}

impl Bench {
    /// Opens the line and waits until the probe has its table: it may have had its power just now.
    pub(crate) fn open(place: &Where, format: Format) -> Result<(Self, Status), BenchError> {
        let interrupt = Interrupt::catch()?;
        let open = place.open()?;
        let log = place.log.as_ref().map(|path| Log::create(path, &open.name));
        let probe = Probe::new(&open.name, GREETING, TIMEOUT);
        let mut bench = Self {
            port: Port::new(open.line, probe.clone()),
            probe: probe.clone(),
            interrupt,
            log: log.transpose()?,
            format,
            consent: Consent::default(),
            takes_lines: false,
            failed: None,
            printer: None,
            name: open.name,
            _lock: open.lock,
        };
        if let Some(port) = &place.printer {
            let file = place.printer_setup.as_deref();
            bench.move_by(printer::open(port, file)?);
        }
        let status = bench.done(probe.hello(), &mut io::sink())?;
        Ok((bench, status))
    }

    /// Has a printer move the finger.
    pub(crate) fn move_by(&mut self, printer: OpenPrinter) {
        self.probe.move_by(printer.printer.clone());
        self.printer = Some(printer);
    }

    /// Does an operation, and prints its words where they are for people. Whatever ends it early leaves the rig stopped
    /// and lifted.
    pub(crate) fn done<T>(
        &mut self,
        operation: impl Future<Output = Result<T, OperationError>>,
        out: &mut dyn Write,
    ) -> Result<T, BenchError> {
        let mut operation = pin!(operation);
        loop {
            if let Poll::Ready(done) = self.poll(operation.as_mut(), out, &mut |_| ()) {
                return done;
            }
            if self.interrupt.take() {
                say("\nStopping and lifting the finger (Ctrl-C again: do not wait) ...");
                self.probe.interrupt();
            }
        }
    }

    /// Polls an operation once, and does what it needs meanwhile; `each` gets the reports that came.
    pub(crate) fn poll<T, F>(
        &mut self,
        operation: Pin<&mut F>,
        out: &mut dyn Write,
        each: &mut dyn FnMut(&Report),
    ) -> Poll<Result<T, BenchError>>
    where
        F: Future<Output = Result<T, OperationError>> + ?Sized,
    {
        let polled = self.port.poll(operation);
        self.keep_log(each);
        let words = self.probe.take_words();
        if self.format == Format::Text && !words.is_empty() {
            let shown = out.write_all(&words).and_then(|()| out.flush());
            shown.unwrap_or_else(|why| self.fails(why.into()));
        }
        let failure = self
            .printer
            .as_ref()
            .and_then(|by| by.printer.take_failure());
        if let Some(why) = failure {
            say(format_args!("Printer: {why}"));
        }
        if let Some(backup) = self.probe.backup() {
            let kept = self.consent.keep(&backup.bytes);
            let kept =
                kept.map(|file| format!("`tactus device table push {file}` brings it back."));
            self.probe.kept(kept.map_err(|why| format!("{why:#}")));
        }
        if let Some(question) = self.probe.question() {
            match self.ask(&question, out) {
                Ok(Some(yes)) => self.probe.answer(yes),
                Ok(None) => self.probe.stop(),
                Err(why) => self.fails(why),
            }
        }
        let Poll::Ready(done) = polled else {
            return Poll::Pending;
        };
        Poll::Ready(match self.failed.take() {
            Some(why) => Err(why),
            None => Ok(done?),
        })
    }

    /// Nothing more can be done; the rig is stopped and lifted first.
    fn fails(&mut self, why: BenchError) {
        self.failed.get_or_insert(why);
        self.probe.stop();
    }

    fn keep_log(&mut self, each: &mut dyn FnMut(&Report)) {
        for line in self.probe.said() {
            if let Some(log) = &mut self.log {
                log.line(&line);
            }
            if let log::Line::Report(report) = &line {
                each(report);
            }
        }
        if let Some(Err(why)) = self.log.as_mut().map(Log::flush) {
            self.log = None;
            self.fails(BenchError::Log(why));
        }
    }

    /// Asks who sits at the terminal; `None` is Ctrl-C or the end of the input.
    fn ask(&self, question: &Question, out: &mut dyn Write) -> Result<Option<bool>, BenchError> {
        let Question { said, asked, kind } = question;
        let prompt = match kind {
            QuestionKind::Consent => {
                writeln!(out, "{said}")?;
                out.flush()?;
                if self.consent.yes {
                    return Ok(Some(true));
                }
                if !self.takes_lines {
                    self.consent.can_be_given()?;
                }
                format!("{asked} [y/N] ")
            }
            QuestionKind::Moved => format!("{asked}, then press Enter (n: it stays): "),
            QuestionKind::Laid => format!("{asked} and press Enter: "),
            QuestionKind::LaidOrLeftOut => {
                format!("{asked} and press Enter, or s to leave it out: ")
            }
        };
        let answer = read_answer(&self.interrupt, &prompt)?;
        Ok(answer.map(|answer| {
            let answer = answer.trim().to_lowercase();
            match kind {
                QuestionKind::Consent => matches!(&answer[..], "y" | "yes"),
                QuestionKind::Moved => !matches!(&answer[..], "n" | "no" | "s"),
                QuestionKind::Laid => true,
                QuestionKind::LaidOrLeftOut => answer != "s",
            }
        }))
    }

    pub(crate) fn get<E: Transaction>(&mut self, transaction: E) -> Result<E::Outcome, BenchError> {
        let probe = self.probe.clone();
        self.done(probe.get(transaction), &mut io::sink())
    }

    pub(crate) fn table(&mut self) -> Result<Arc<[u8]>, BenchError> {
        let probe = self.probe.clone();
        self.done(probe.table(), &mut io::sink())
    }

    /// Reads once while nothing is asked for.
    pub(crate) fn listen(&mut self, each: &mut dyn FnMut(&Report)) -> Result<(), BenchError> {
        let probe = self.probe.clone();
        let mut heard = pin!(async { probe.listen().map(drop) });
        self.port.turn(true);
        match self.poll(heard.as_mut(), &mut io::sink(), each) {
            Poll::Ready(listened) => listened,
            Poll::Pending => Ok(()),
        }
    }

    /// Stops whatever is done, and waits until the finger is lifted and nothing moves. A second Ctrl-C ends the
    /// waiting.
    pub(crate) fn lift(&mut self) -> Result<Stopped, BenchError> {
        let probe = self.probe.clone();
        self.done(probe.lift(), &mut io::sink())
    }
}

/// The reason why a log did not get its name when its bench was left.
static UNKEPT: OnceLock<io::Error> = OnceLock::new();

impl Drop for Bench {
    fn drop(&mut self) {
        if let Some(Err(why)) = self.printer.as_mut().map(OpenPrinter::close) {
            say(format_args!(
                "where the printer is parked was not kept: {why}"
            ));
        }
        if let Some(Err(why)) = self.log.as_mut().map(Log::finish) {
            // the first one is told
            let _ = UNKEPT.set(why);
        }
    }
}

/// Checks that the logs of all benches were kept.
pub(super) fn logs_kept() -> io::Result<()> {
    let why = UNKEPT.get();
    why.map_or(Ok(()), |why| {
        Err(io::Error::new(why.kind(), why.to_string()))
    })
}

/// Asks, and waits for a line; `None`: Ctrl-C or the end of the input.
fn read_answer(interrupt: &Interrupt, prompt: &str) -> io::Result<Option<String>> {
    ask_for(prompt);
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
            return Ok(None);
        }
        match enter.recv_timeout(Duration::from_millis(100)) {
            Ok(line) => return line,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Ok(None),
        }
    }
}
