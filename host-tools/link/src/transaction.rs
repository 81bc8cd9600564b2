//! A request, or several that follow each other, run to the end although the line damages frames.

use std::task::Poll;

use tactus_core::wire::{Command, Event, Forget, PROTOCOL, Report};

use super::session::{LinkError, MAX_TRIES, Session};

/// Requests that follow each other, and the outcome of all of them.
pub trait Transaction {
    /// The result at the end.
    type Outcome;

    /// The next request; `None` when all is done. Asked for once the last one is done.
    fn next(&mut self) -> Result<Option<Command>, LinkError>;

    /// Takes an event that the probe reports meanwhile.
    fn hear(&mut self, event: &Event) -> Result<(), LinkError>;

    /// The outcome, once all requests are done.
    fn outcome(&mut self) -> Result<Self::Outcome, LinkError>;
}

#[derive(Debug)]
struct Sent {
    command: Command,
    /// of all tries, the last one last
    ids: Vec<u16>,
    /// an event has come since
    heard: bool,
}

/// A transaction under way. One of its commands is under way at a time; the owner of the [`Session`] may send others in
/// between, to stop for example.
///
/// Where the line damages a request or a report, the job repeats a request that may be made twice. Any other request is
/// left to the caller: the damaged report need not have been its answer.
#[derive(Debug)]
pub struct Job<E> {
    transaction: E,
    sent: Option<Sent>,
}

impl<E: Transaction> Job<E> {
    /// Begins: appends the first request to `send`.
    pub fn begin(
        transaction: E,
        session: &mut Session,
        send: &mut Vec<u8>,
    ) -> Result<Self, LinkError> {
        let mut job = Self {
            transaction,
            sent: None,
        };
        job.go_on(session, send)?;
        Ok(job)
    }

    /// Goes on with the bytes that were received (none are fine too): appends what is to be sent to `send`, and shows
    /// all reports to `each`. Not to be polled again once it is ready.
    pub fn poll(
        &mut self,
        session: &mut Session,
        received: &[u8],
        send: &mut Vec<u8>,
        mut each: impl FnMut(&Report),
    ) -> Poll<Result<E::Outcome, LinkError>> {
        let lost = session.damaged() + session.missing();
        let sent = self.last_id();
        session.refused = None;
        // all that has come is shown, also what comes behind the end
        let mut over = None;
        for report in session.receive(received) {
            each(&report);
            if over.is_none() {
                over = self.take(session, &report.event, send).transpose();
            }
        }
        if let (Some(why), None | Some(Err(_))) = (session.refused.take(), &over) {
            over = Some(Err(why));
        }
        let disturbed = session.damaged() + session.missing() > lost;
        if over.is_none() && disturbed && self.last_id() == sent {
            over = self.repeat(session, send).err().map(Err);
        }
        over.map_or(Poll::Pending, Poll::Ready)
    }

    /// Makes the last request again, if it may be made twice, and says whether it did: for a caller that has received
    /// nothing for long.
    ///
    /// # Errors
    /// [`LinkError::Disturbed`] or [`LinkError::Foreign`] after [`MAX_TRIES`].
    pub fn repeat(&mut self, session: &mut Session, send: &mut Vec<u8>) -> Result<bool, LinkError> {
        let Some(sent) = self.sent.as_mut().filter(|a| may_repeat(&a.command)) else {
            return Ok(false);
        };
        if sent.ids.len() >= MAX_TRIES.into() {
            return Err(if session.foreign() > 0 {
                LinkError::Foreign
            } else {
                LinkError::Disturbed
            });
        }
        sent.ids.push(session.request(sent.command.clone(), send)?);
        Ok(true)
    }

    /// The request that is under way.
    pub fn command(&self) -> Option<&Command> {
        self.sent.as_ref().map(|sent| &sent.command)
    }

    pub(crate) fn first_id(&self) -> Option<u16> {
        self.sent.as_ref()?.ids.first().copied()
    }

    pub(crate) fn last_id(&self) -> Option<u16> {
        self.sent.as_ref()?.ids.last().copied()
    }

    /// Takes in what the probe says; the outcome, when there is one.
    fn take(
        &mut self,
        session: &mut Session,
        event: &Event,
        send: &mut Vec<u8>,
    ) -> Result<Option<E::Outcome>, LinkError> {
        let Some(sent) = &mut self.sent else {
            return Ok(None);
        };
        let (first, repeatable) = (!sent.heard, may_repeat(&sent.command));
        sent.heard = true;
        match event {
            Event::Done(id) if sent.ids.contains(id) => {
                self.go_on(session, send)?;
                if self.sent.is_none() {
                    return self.transaction.outcome().map(Some);
                }
            }
            // a try before the last one may be refused because of the one before it
            Event::Refused { id, why } if sent.ids.last() == Some(id) => {
                return Err(LinkError::Refused(Box::new(why.clone())));
            }
            Event::Damaged(_) if repeatable => {
                self.repeat(session, send)?;
            }
            // nothing was said in between, so it was this request that was damaged
            Event::Damaged(_) if first => return Err(LinkError::Unheard),
            Event::Booted { protocol, .. } if *protocol != PROTOCOL => {
                return Err(LinkError::Protocol(*protocol));
            }
            Event::Booted {
                reset, last_words, ..
            } => {
                return Err(LinkError::Rebooted {
                    reset: *reset,
                    last_words: last_words.as_ref().map(|words| words.as_str().to_owned()),
                });
            }
            event => self.transaction.hear(event)?,
        }
        Ok(None)
    }

    fn go_on(&mut self, session: &mut Session, send: &mut Vec<u8>) -> Result<(), LinkError> {
        self.sent = match self.transaction.next()? {
            Some(command) => Some(Sent {
                ids: vec![session.request(command.clone(), send)?],
                command,
                heard: false,
            }),
            None => None,
        };
        Ok(())
    }
}

fn may_repeat(command: &Command) -> bool {
    match command {
        Command::Status
        | Command::Stop
        | Command::ReadCalibration
        | Command::Arm(_)
        | Command::WriteCalibration(_)
        | Command::Stream(_)
        | Command::ReadTable(_)
        | Command::BeginTable(_)
        | Command::WriteTable { .. }
        | Command::Forget(Forget::SelfLearned | Forget::Training(_))
        | Command::SetFalseAlarm(_)
        | Command::SetHighForce(_)
        | Command::FactoryTable => true,
        Command::Home
        | Command::Identify(_)
        | Command::Label(_)
        | Command::Train(_)
        | Command::Rename { .. }
        | Command::Forget(Forget::Texture(_))
        | Command::Calibrate
        | Command::Weigh(_)
        | Command::TurnOver
        | Command::Verify(_)
        | Command::CommitTable => false,
    }
}
