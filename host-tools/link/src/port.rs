//! A probe at anything that reads and writes: a serial line, a TCP connection.

use std::io::{self, Read, Write};
use std::pin::{Pin, pin};
use std::task::{Context, Poll, Waker};

use super::clock::Clock;
use super::error::PortError;
use super::probe::Probe;

/// A carrier of a probe's bytes. Reads of its stream must return within a fraction of the timeout, with
/// [`io::ErrorKind::WouldBlock`] or [`io::ErrorKind::TimedOut`] when nothing came.
#[derive(Debug)]
pub struct Port<S> {
    pub(super) stream: S,
    probe: Probe,
    clock: Clock,
}

impl<S: Read + Write> Port<S> {
    /// A port of this probe.
    pub fn new(stream: S, probe: Probe) -> Self {
        Self {
            stream,
            probe,
            clock: Clock::start(),
        }
    }

    /// The probe.
    pub fn probe(&self) -> &Probe {
        &self.probe
    }

    /// Does an operation; nobody stops it or answers its questions.
    pub fn run<T>(&mut self, operation: impl Future<Output = T>) -> T {
        let mut operation = pin!(operation);
        loop {
            if let Poll::Ready(done) = self.poll(operation.as_mut()) {
                return done;
            }
        }
    }

    /// Polls an operation once, sends what is due, and reads once unless it is over.
    pub fn poll<F: Future + ?Sized>(&mut self, operation: Pin<&mut F>) -> Poll<F::Output> {
        let mut context = Context::from_waker(Waker::noop());
        // somebody may have thought about a question since the last time
        self.probe.carry(&[], self.clock.elapsed());
        let polled = operation.poll(&mut context);
        self.turn(polled.is_pending());
        polled
    }

    /// Sends what is due, and reads once where that is wanted. The probe is told where the line fails.
    pub fn turn(&mut self, reads: bool) {
        let mut bytes = [0; 4096];
        match self.exchange(&mut bytes, reads) {
            Ok(length) => {
                let received = bytes.get(..length).unwrap_or_default();
                self.probe.carry(received, self.clock.elapsed());
            }
            Err(why) => self.probe.close(why),
        }
    }

    fn exchange(&mut self, bytes: &mut [u8], reads: bool) -> Result<usize, PortError> {
        let send = self.probe.to_send();
        if !send.is_empty() {
            self.stream.write_all(&send)?;
            self.stream.flush()?;
        }
        if !reads {
            return Ok(0);
        }
        match self.stream.read(bytes) {
            Ok(0) => Err(PortError::Closed),
            Ok(length) => Ok(length),
            Err(why) => match why.kind() {
                io::ErrorKind::WouldBlock
                | io::ErrorKind::TimedOut
                | io::ErrorKind::Interrupted => Ok(0),
                _ => Err(why.into()),
            },
        }
    }
}
