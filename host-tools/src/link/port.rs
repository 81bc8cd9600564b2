//! A session over anything that reads and writes: a serial line, a TCP connection.

use std::io::{self, Read, Write};
use std::task::Poll;
use std::time::{Duration, Instant};

use tactus_core::wire::{Command, Report};

use super::session::{LinkError, MAX_TRIES, Session};
use super::transaction::{Job, Transaction};

/// Why a transaction over a port failed.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// The port cannot be read or written.
    #[error("the port failed; check the cable, then open it again")]
    Io(#[from] io::Error),
    /// The other end has closed the port.
    #[error("the other end closed the port; open it again")]
    Closed,
    /// The probe says nothing.
    #[error("the probe said nothing for {0:?}: check that it has power and that this is its port")]
    Silent(Duration),
    /// Bytes come, and none of them is a report.
    #[error(
        "{0} bytes came and not one report: this is not the probe's port, or not its baud rate, or another firmware runs there"
    )]
    Garbage(u64),
    /// See [`LinkError`].
    #[error(transparent)]
    Link(#[from] LinkError),
}

/// A session over something that reads and writes. Its reads must return within a fraction of the timeout, with
/// [`io::ErrorKind::WouldBlock`] or [`io::ErrorKind::TimedOut`] when nothing came.
#[derive(Debug)]
pub struct Port<S> {
    pub(super) stream: S,
    session: Session,
    timeout: Duration,
    /// to be sent with the next step
    send: Vec<u8>,
    /// when a report came last, or was waited for from then on
    heard: Instant,
    /// bytes that came, and reports
    bytes: u64,
    reports: u64,
}

impl<S: Read + Write> Port<S> {
    /// A port that takes silence for a loss after `timeout`.
    pub fn new(stream: S, timeout: Duration) -> Self {
        Self {
            stream,
            session: Session::default(),
            timeout,
            send: Vec::new(),
            heard: Instant::now(),
            bytes: 0,
            reports: 0,
        }
    }

    /// From now on the port takes silence for a loss after `timeout`.
    pub fn set_timeout(&mut self, timeout: Duration) {
        self.timeout = timeout;
    }

    /// What was damaged and lost so far.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// Runs a transaction to its end; `each` gets every report.
    ///
    /// # Errors
    /// See [`PortError`].
    pub fn run<E: Transaction>(
        &mut self,
        transaction: E,
        mut each: impl FnMut(&Report),
    ) -> Result<E::Outcome, PortError> {
        let mut job = self.begin(transaction)?;
        loop {
            if let Poll::Ready(outcome) = self.step(&mut job, &mut each)? {
                return Ok(outcome);
            }
        }
    }

    /// Begins a transaction; the caller may do something else between its [steps](Port::step).
    ///
    /// # Errors
    /// See [`PortError`].
    pub fn begin<E: Transaction>(&mut self, transaction: E) -> Result<Job<E>, PortError> {
        self.heard = Instant::now();
        Ok(Job::begin(transaction, &mut self.session, &mut self.send)?)
    }

    /// Continues a transaction: sends what is due, and reads once. Not to be called again once it is ready.
    ///
    /// # Errors
    /// See [`PortError`].
    pub fn step<E: Transaction>(
        &mut self,
        job: &mut Job<E>,
        mut each: impl FnMut(&Report),
    ) -> Result<Poll<E::Outcome>, PortError> {
        let mut bytes = [0; 4096];
        let received = self.exchange(&mut bytes)?;
        if !received.is_empty() {
            let before = self.reports;
            let reports = &mut self.reports;
            let polled = job.poll(&mut self.session, received, &mut self.send, |report| {
                *reports += 1;
                each(report);
            });
            match polled {
                Poll::Ready(Err(LinkError::Disturbed)) if self.reports == 0 => {
                    return Err(PortError::Garbage(self.bytes));
                }
                Poll::Ready(outcome) => return Ok(Poll::Ready(outcome?)),
                // bytes without end that are no report are as good as silence
                Poll::Pending if self.reports > before => self.heard = Instant::now(),
                Poll::Pending => {}
            }
        }
        if self.heard.elapsed() >= self.timeout {
            match job.repeat(&mut self.session, &mut self.send) {
                Ok(true) => self.heard = Instant::now(),
                Ok(false) | Err(LinkError::Disturbed) if self.bytes > 0 && self.reports == 0 => {
                    return Err(PortError::Garbage(self.bytes));
                }
                Ok(false) => return Err(PortError::Silent(self.timeout)),
                Err(LinkError::Disturbed) => {
                    return Err(PortError::Silent(self.timeout * MAX_TRIES.into()));
                }
                Err(why) => return Err(why.into()),
            }
        }
        Ok(Poll::Pending)
    }

    /// Sends a command beside the transaction under way, or without one; its answer is among the reports.
    ///
    /// # Errors
    /// See [`PortError`].
    pub fn send(&mut self, command: Command) -> Result<(), PortError> {
        self.session
            .request(command, &mut self.send)
            .map_err(LinkError::from)?;
        Ok(())
    }

    /// Sends what is due, and reads once, while no transaction is under way.
    ///
    /// # Errors
    /// See [`PortError`].
    pub fn listen(&mut self, each: impl FnMut(&Report)) -> Result<(), PortError> {
        let mut bytes = [0; 4096];
        let received = self.exchange(&mut bytes)?;
        let reports = self.session.receive(received);
        self.reports += reports.len() as u64;
        reports.iter().for_each(each);
        Ok(())
    }

    /// Sends what is due and reads what has come, which may be nothing.
    fn exchange<'b>(&mut self, bytes: &'b mut [u8]) -> Result<&'b [u8], PortError> {
        if !self.send.is_empty() {
            self.stream.write_all(&self.send)?;
            self.stream.flush()?;
            self.send.clear();
        }
        match self.stream.read(bytes) {
            Ok(0) => Err(PortError::Closed),
            Ok(n) => {
                self.bytes += n as u64;
                Ok(bytes.get(..n).unwrap_or_default())
            }
            Err(e)
                if matches!(
                    e.kind(),
                    io::ErrorKind::WouldBlock
                        | io::ErrorKind::TimedOut
                        | io::ErrorKind::Interrupted
                ) =>
            {
                Ok(&[])
            }
            Err(e) => Err(e.into()),
        }
    }
}
