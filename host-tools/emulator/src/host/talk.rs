//! A host in the same process: a [`Probe`] of [`tactus_link`] over the emulated board's USART3, by virtual time.

use std::pin::pin;
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use tactus_core::rig::Fault;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::wire::{Command, Event, Phase, Report, Reset};
use tactus_link::log::Line;
use tactus_link::{LinkError, OperationError, PortError, Probe, PushTable, Request, Transaction};

use crate::board::{Emulator, Error};

/// Default time that the board runs between two looks at the line, ns.
const STEP_NS: u64 = 1_000_000;
/// Longest that anything but explorations and training takes, virtual seconds.
pub const TIMEOUT_S: f64 = 60.0;

/// Reasons why the firmware did not carry out a request.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TalkError {
    /// The emulator.
    #[error(transparent)]
    Emulator(#[from] Error),
    /// The firmware refused it; its reason.
    #[error("the firmware refuses: {0}")]
    Refused(String),
    /// The firmware has restarted meanwhile.
    #[error("the firmware restarted instead of answering ({0:?})")]
    Rebooted(Reset),
    /// The operation, otherwise.
    #[error(transparent)]
    Operation(OperationError),
    /// The firmware does not answer any more.
    #[error(
        "no answer from the firmware in {0} virtual seconds: does this ELF speak the protocol? See its log with --log"
    )]
    Silent(f64),
}

impl From<OperationError> for TalkError {
    fn from(why: OperationError) -> Self {
        match why {
            OperationError::Link(why)
            | OperationError::Port {
                why: PortError::Link(why),
                ..
            } => why.into(),
            why => Self::Operation(why),
        }
    }
}

impl From<LinkError> for TalkError {
    fn from(why: LinkError) -> Self {
        match why {
            LinkError::Refused(why) => Self::Refused(why.to_string()),
            LinkError::Rebooted { reset, .. } => Self::Rebooted(reset),
            why => Self::Operation(why.into()),
        }
    }
}

/// Longer than any run: virtual seconds end what takes too long.
const NEVER: Duration = Duration::from_secs(1 << 40);

/// The host's end of the line.
pub struct Talk {
    emulator: Emulator,
    probe: Probe,
    step_ns: u64,
}

impl Talk {
    /// Talks to the firmware on a board.
    pub fn new(emulator: Emulator) -> Self {
        Self {
            emulator,
            probe: Probe::new("the emulated board", NEVER, NEVER),
            step_ns: STEP_NS,
        }
    }

    /// Looks at the line every so many ms instead of every one: two threads take turns at every look.
    pub fn look_every(mut self, ms: u64) -> Self {
        self.step_ns = ms.max(1) * STEP_NS;
        self
    }

    /// The board.
    pub fn board(&mut self) -> &mut Emulator {
        &mut self.emulator
    }

    /// The board, without the host.
    pub fn into_board(self) -> Emulator {
        self.emulator
    }

    /// The time it has reached, ns.
    pub fn now_ns(&self) -> u64 {
        self.emulator.now_ns()
    }

    /// The probe, for operations.
    pub fn probe(&self) -> Probe {
        self.probe.clone()
    }

    /// Frames that were damaged, and reports that were lost on the way from the firmware.
    pub fn losses(&self) -> (u64, u64) {
        self.probe.losses()
    }

    /// Sends what is due, runs the board to the next look, and takes in what the firmware said.
    fn carry(&mut self) -> Result<(), Error> {
        self.emulator.send(&self.probe.to_send());
        let until_ns = self.emulator.now_ns() + self.step_ns;
        self.emulator.run_until(until_ns)?;
        let received = self.emulator.received();
        let bytes: Vec<u8> = received.into_iter().map(|(_, byte)| byte).collect();
        let now = Duration::from_nanos(self.emulator.now_ns());
        self.probe.carry(&bytes, now);
        Ok(())
    }

    /// Runs the board to the next look and gives what the firmware said in it.
    pub fn step(&mut self) -> Result<Vec<Report>, TalkError> {
        self.carry()?;
        let reports = self.probe.listen()?;
        // nobody keeps a log
        self.probe.said();
        Ok(reports)
    }

    /// Runs the board until `pick` returns a value for a report; `each` gets all of them, and `None` after every look.
    /// Errors: [`TalkError::Silent`] if that takes longer than `timeout_s` of virtual time.
    pub fn wait<T>(
        &mut self,
        timeout_s: f64,
        mut each: impl FnMut(&mut Emulator, Option<&Report>),
        mut pick: impl FnMut(&Event) -> Option<Result<T, TalkError>>,
    ) -> Result<T, TalkError> {
        let until_ns = self.emulator.now_ns() + (timeout_s * 1e9) as u64;
        while self.emulator.now_ns() < until_ns {
            let mut picked = None;
            for report in self.step()? {
                each(&mut self.emulator, Some(&report));
                if picked.is_none() {
                    picked = pick(&report.event);
                }
            }
            each(&mut self.emulator, None);
            if let Some(picked) = picked {
                return picked;
            }
        }
        Err(TalkError::Silent(timeout_s))
    }

    /// Does an operation; `each` gets all reports meanwhile, and `None` after every look. Errors: [`TalkError::Silent`]
    /// if that takes longer than `timeout_s` of virtual time.
    pub fn operate<T>(
        &mut self,
        operation: impl Future<Output = Result<T, OperationError>>,
        timeout_s: f64,
        mut each: impl FnMut(&mut Emulator, Option<&Report>),
    ) -> Result<T, TalkError> {
        let (mut operation, mut context) = (pin!(operation), Context::from_waker(Waker::noop()));
        let until_ns = self.emulator.now_ns() + (timeout_s * 1e9) as u64;
        let mut polled = operation.as_mut().poll(&mut context);
        while polled.is_pending() && self.emulator.now_ns() < until_ns {
            self.carry()?;
            polled = operation.as_mut().poll(&mut context);
            for line in self.probe.said() {
                if let Line::Report(report) = line {
                    each(&mut self.emulator, Some(&report));
                }
            }
            each(&mut self.emulator, None);
        }
        self.probe.take_words();
        let done = match polled {
            Poll::Ready(done) => done.map_err(TalkError::from),
            Poll::Pending => Err(TalkError::Silent(timeout_s)),
        };
        if done.is_err() {
            // what would stop a rig that moves is up to the run
            self.probe.to_send();
        }
        done
    }

    /// Runs a transaction to its end, as [`operate`](Self::operate) does.
    pub fn run<E: Transaction>(
        &mut self,
        transaction: E,
        timeout_s: f64,
        each: impl FnMut(&mut Emulator, Option<&Report>),
    ) -> Result<E::Outcome, TalkError> {
        let probe = self.probe();
        self.operate(probe.get(transaction), timeout_s, each)
    }

    /// Sends a command and waits until it is over; `each` gets all reports meanwhile.
    pub fn send(
        &mut self,
        command: Command,
        timeout_s: f64,
        each: impl FnMut(&mut Emulator, Option<&Report>),
    ) -> Result<(), TalkError> {
        self.run(Request::command(command), timeout_s, each)
    }

    /// Waits until the firmware has booted and found the limit switches. Returns a fault of that, after another request
    /// to home.
    pub fn ready(
        &mut self,
        mut each: impl FnMut(&mut Emulator, Option<&Report>),
    ) -> Result<Option<Fault>, TalkError> {
        let fault = self.wait(TIMEOUT_S, &mut each, |event| match event {
            Event::Phase(Phase::Ready) => Some(Ok(None)),
            Event::Fault(fault) => Some(Ok(Some(*fault))),
            _ => None,
        })?;
        if fault.is_some() {
            self.send(Command::Home, TIMEOUT_S, each)?;
        }
        Ok(fault)
    }

    /// Sends the firmware calibration and table, which it keeps.
    pub fn teach(
        &mut self,
        calibration: &RigCalibration,
        table: &[u8],
        mut each: impl FnMut(&mut Emulator, Option<&Report>),
    ) -> Result<(), TalkError> {
        let write = Request::write_calibration(calibration)?;
        self.run(write, TIMEOUT_S, &mut each)?;
        self.run(PushTable::new(table)?, TIMEOUT_S, each)
    }
}
