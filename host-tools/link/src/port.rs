//! A session over anything that reads and writes: a serial line, a TCP connection.

use std::io::{self, Read, Write};
use std::task::Poll;
use std::time::{Duration, Instant};

use tactus_core::wire::{Command, Report};

use super::exchange::{Exchange, PortError};
use super::session::Session;
use super::transaction::{Job, Transaction};

/// A session over something that reads and writes. Its reads must return within a fraction of the timeout, with
/// [`io::ErrorKind::WouldBlock`] or [`io::ErrorKind::TimedOut`] when nothing came.
#[derive(Debug)]
pub struct Port<S> {
    pub(super) stream: S,
    exchange: Exchange,
    began: Instant,
}

impl<S: Read + Write> Port<S> {
    /// A port that takes silence for a loss after `timeout`.
    pub fn new(stream: S, timeout: Duration) -> Self {
        Self {
            stream,
            exchange: Exchange::new(timeout),
            began: Instant::now(),
        }
    }

    /// From now on the port takes silence for a loss after `timeout`.
    pub fn set_timeout(&mut self, timeout: Duration) {
        self.exchange.set_timeout(timeout);
    }

    /// What was damaged and lost so far.
    pub fn session(&self) -> &Session {
        self.exchange.session()
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
        self.exchange.begin(transaction, self.began.elapsed())
    }

    /// Continues a transaction: sends what is due, and reads once. Not to be called again once it is ready.
    ///
    /// # Errors
    /// See [`PortError`].
    pub fn step<E: Transaction>(
        &mut self,
        job: &mut Job<E>,
        each: impl FnMut(&Report),
    ) -> Result<Poll<E::Outcome>, PortError> {
        let mut bytes = [0; 4096];
        let received = self.carry(&mut bytes)?;
        self.exchange
            .step(job, received, self.began.elapsed(), each)
    }

    /// Sends a command beside the transaction under way, or without one; its answer is among the reports.
    ///
    /// # Errors
    /// See [`PortError`].
    pub fn send(&mut self, command: Command) -> Result<(), PortError> {
        self.exchange.send(command)
    }

    /// Sends what is due, and reads once, while no transaction is under way.
    ///
    /// # Errors
    /// See [`PortError`].
    pub fn listen(&mut self, each: impl FnMut(&Report)) -> Result<(), PortError> {
        let mut bytes = [0; 4096];
        let received = self.carry(&mut bytes)?;
        self.exchange.listen(received, each);
        Ok(())
    }

    /// Sends what is due and reads what has come, which may be nothing.
    fn carry<'b>(&mut self, bytes: &'b mut [u8]) -> Result<&'b [u8], PortError> {
        let send = &mut self.exchange.send;
        if !send.is_empty() {
            self.stream.write_all(send)?;
            self.stream.flush()?;
            send.clear();
        }
        match self.stream.read(bytes) {
            Ok(0) => Err(PortError::Closed),
            Ok(n) => Ok(bytes.get(..n).unwrap_or_default()),
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
