//! A session over bytes that somebody else carries: what has come and what time it is goes in, what is to be sent comes out.

use std::io;
use std::task::Poll;
use std::time::Duration;

use tactus_core::wire::{Command, Phase, Report, Status};

use super::session::{LinkError, MAX_TRIES, Session};
use super::transaction::{Job, Transaction};

/// A probe that says nothing for so long is taken for gone: its longest silence is an erase of its flash, 2 s.
pub const TIMEOUT: Duration = Duration::from_secs(5);
/// A first answer comes sooner: the probe reports its status at once.
pub const GREETING: Duration = Duration::from_secs(1);
/// A probe opens its store within 10 s of its start.
pub const BOOTING: Duration = Duration::from_secs(90);

/// Whether a probe has come up: one without a table has not opened its store yet.
pub fn is_up(status: &Status) -> bool {
    status.textures > 0 && status.phase != Phase::Homing
}

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

impl PortError {
    /// Whether the probe had its power just now, and is to be asked again.
    pub fn is_restart(&self) -> bool {
        matches!(self, Self::Link(LinkError::Rebooted { .. }))
    }
}

/// A session over bytes that somebody else carries. Times are since any moment, the same for all.
#[derive(Debug)]
pub struct Exchange {
    session: Session,
    timeout: Duration,
    /// to be sent with the next step
    pub(super) send: Vec<u8>,
    /// when a report came last, or was waited for from then on
    heard: Duration,
    /// bytes that came, and reports
    bytes: u64,
    reports: u64,
}

impl Exchange {
    /// A session that takes silence for a loss after `timeout`.
    pub fn new(timeout: Duration) -> Self {
        Self {
            session: Session::default(),
            timeout,
            send: Vec::new(),
            heard: Duration::ZERO,
            bytes: 0,
            reports: 0,
        }
    }

    /// From now on silence is taken for a loss after `timeout`.
    pub fn set_timeout(&mut self, timeout: Duration) {
        self.timeout = timeout;
    }

    /// What was damaged and lost so far.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// What is to be sent now.
    pub fn to_send(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.send)
    }

    /// Begins a transaction; the caller may do something else between its [steps](Self::step).
    ///
    /// # Errors
    /// See [`PortError`].
    pub fn begin<E: Transaction>(
        &mut self,
        transaction: E,
        now: Duration,
    ) -> Result<Job<E>, PortError> {
        self.heard = now;
        Ok(Job::begin(transaction, &mut self.session, &mut self.send)?)
    }

    /// Continues a transaction with what has come, which may be nothing; `each` gets every report. Not to be called again once
    /// it is ready.
    ///
    /// # Errors
    /// See [`PortError`].
    pub fn step<E: Transaction>(
        &mut self,
        job: &mut Job<E>,
        received: &[u8],
        now: Duration,
        mut each: impl FnMut(&Report),
    ) -> Result<Poll<E::Outcome>, PortError> {
        self.bytes += received.len() as u64;
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
                Poll::Pending if self.reports > before => self.heard = now,
                Poll::Pending => {}
            }
        }
        if now.saturating_sub(self.heard) >= self.timeout {
            match job.repeat(&mut self.session, &mut self.send) {
                Ok(true) => self.heard = now,
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

    /// Takes in what has come while no transaction is under way.
    pub fn listen(&mut self, received: &[u8], each: impl FnMut(&Report)) {
        self.bytes += received.len() as u64;
        let reports = self.session.receive(received);
        self.reports += reports.len() as u64;
        reports.iter().for_each(each);
    }
}
