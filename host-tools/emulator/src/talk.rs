//! A host in the same process: requests to the firmware, and its reports.

use tactus_core::wire::{self, Ask, MAX_FRAME, Receiver, Report, Request, Tell};

use crate::board::{Emulator, Error};

/// How far the board runs between two looks at the line, ns.
const STEP_NS: u64 = 1_000_000;

/// Why the firmware does not do what it is asked for.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TalkError {
    /// The emulator.
    #[error(transparent)]
    Emulator(#[from] Error),
    /// The request does not fit into a frame.
    #[error("{0}")]
    TooLong(wire::TooLong),
    /// It says why.
    #[error("the firmware refuses: {0}")]
    Refused(String),
    /// It has started anew meanwhile.
    #[error("the firmware restarted instead of answering ({0:?})")]
    Rebooted(wire::Reset),
    /// It says nothing more.
    #[error(
        "no answer from the firmware in {0} virtual seconds: does this ELF speak the protocol? See its log with --log"
    )]
    Silent(f64),
}

/// The host's end of the line.
pub struct Talk {
    emulator: Emulator,
    receiver: Receiver,
    next_id: u16,
    damaged: u32,
}

impl Talk {
    /// Talks to the firmware on a board.
    pub fn new(emulator: Emulator) -> Self {
        Self {
            emulator,
            receiver: Receiver::default(),
            next_id: 0,
            damaged: 0,
        }
    }

    /// The board.
    pub fn board(&mut self) -> &mut Emulator {
        &mut self.emulator
    }

    /// Frames that came damaged.
    pub fn damaged(&self) -> u32 {
        self.damaged
    }

    /// Runs the board for a millisecond and gives what the firmware said in it.
    ///
    /// # Errors
    /// See [`Emulator::run_until`].
    pub fn step(&mut self) -> Result<Vec<Report>, Error> {
        self.emulator.run_until(self.emulator.now_ns() + STEP_NS)?;
        let mut reports = Vec::new();
        for (_, byte) in self.emulator.received() {
            match self.receiver.push::<Report>(byte) {
                Some(Ok(report)) => reports.push(report),
                Some(Err(_)) => self.damaged += 1,
                None => {}
            }
        }
        Ok(reports)
    }

    /// Runs the board until `pick` makes something of a report; `each` sees all of them, and after every millisecond none.
    ///
    /// # Errors
    /// [`TalkError::Silent`] if that takes longer than `patience_s` of virtual time; see also [`TalkError`].
    pub fn wait<T>(
        &mut self,
        patience_s: f64,
        mut each: impl FnMut(&mut Emulator, Option<&Report>),
        mut pick: impl FnMut(&Tell) -> Option<Result<T, TalkError>>,
    ) -> Result<T, TalkError> {
        let until_ns = self.emulator.now_ns() + (patience_s * 1e9) as u64;
        while self.emulator.now_ns() < until_ns {
            let mut picked = None;
            for report in self.step()? {
                each(&mut self.emulator, Some(&report));
                if picked.is_none() {
                    picked = pick(&report.tell);
                }
            }
            each(&mut self.emulator, None);
            if let Some(picked) = picked {
                return picked;
            }
        }
        Err(TalkError::Silent(patience_s))
    }

    /// Asks for something and waits until it is over; `each` sees all reports meanwhile.
    ///
    /// # Errors
    /// See [`Talk::wait`] and [`TalkError`].
    pub fn ask(
        &mut self,
        ask: Ask,
        patience_s: f64,
        each: impl FnMut(&mut Emulator, Option<&Report>),
    ) -> Result<(), TalkError> {
        let id = self.next_id;
        self.next_id = id.wrapping_add(1);
        let mut room = [0; MAX_FRAME + 1];
        let frame = wire::encode(&Request { id, ask }, &mut room).map_err(TalkError::TooLong)?;
        self.emulator.send(frame);
        self.wait(patience_s, each, |tell| match tell {
            Tell::Done(done) if *done == id => Some(Ok(())),
            Tell::Refused { id: refused, why } if *refused == id => {
                Some(Err(TalkError::Refused(why.as_str().to_owned())))
            }
            Tell::Booted { reset, .. } => Some(Err(TalkError::Rebooted(*reset))),
            _ => None,
        })
    }
}
