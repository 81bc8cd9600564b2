//! A request, or several that follow each other, seen through whatever the line damages.

use std::task::Poll;

use tactus_core::wire::{Ask, Forget, PROTOCOL, Report, Tell};

use super::session::{LinkError, MAX_TRIES, Session};

/// Requests that follow each other, and what is to be known in the end.
pub trait Errand {
    /// What is known in the end.
    type Outcome;

    /// The next request; `None` when all is done. Asked for once the last one is done.
    ///
    /// # Errors
    /// The errand cannot go on.
    fn next(&mut self) -> Result<Option<Ask>, LinkError>;

    /// Something that the probe said meanwhile.
    ///
    /// # Errors
    /// The errand cannot go on.
    fn hear(&mut self, tell: &Tell) -> Result<(), LinkError>;

    /// What came of it, once all is done.
    ///
    /// # Errors
    /// [`LinkError::NoAnswer`], or the answer makes no sense.
    fn outcome(&mut self) -> Result<Self::Outcome, LinkError>;
}

/// A request that is not over.
#[derive(Debug)]
struct Asked {
    ask: Ask,
    /// of all tries, the last one last
    ids: Vec<u16>,
    /// something was told since
    heard: bool,
}

/// An errand on its way. It has one request under way at a time; whoever has the [`Session`] may make others in between,
/// to stop for example.
///
/// Where the line damages a request or a report, a request that may be made twice is. Others are left to whoever waits: a
/// damaged report need not have been their answer.
#[derive(Debug)]
pub struct Job<E> {
    errand: E,
    asked: Option<Asked>,
}

impl<E: Errand> Job<E> {
    /// Begins: appends the first request to `send`.
    ///
    /// # Errors
    /// See [`LinkError`].
    pub fn begin(errand: E, session: &mut Session, send: &mut Vec<u8>) -> Result<Self, LinkError> {
        let mut job = Self {
            errand,
            asked: None,
        };
        job.go_on(session, send)?;
        Ok(job)
    }

    /// Goes on with the bytes that were received (none are fine too): appends what is to be sent to `send`, and shows all
    /// reports to `each`. Not to be polled again once it is ready.
    pub fn poll(
        &mut self,
        session: &mut Session,
        received: &[u8],
        send: &mut Vec<u8>,
        mut each: impl FnMut(&Report),
    ) -> Poll<Result<E::Outcome, LinkError>> {
        let lost = session.damaged() + session.missing();
        let asked = self.last_id();
        // all that has come is shown, also what comes behind the end
        let mut over = None;
        for report in session.receive(received) {
            each(&report);
            if over.is_none() {
                over = self.take(session, &report.tell, send).transpose();
            }
        }
        let disturbed = session.damaged() + session.missing() > lost;
        if over.is_none() && disturbed && self.last_id() == asked {
            over = self.repeat(session, send).err().map(Err);
        }
        over.map_or(Poll::Pending, Poll::Ready)
    }

    /// Makes the last request again, if it may be made twice, and says whether: for whoever has heard nothing for long.
    ///
    /// # Errors
    /// [`LinkError::Disturbed`] or [`LinkError::Foreign`] after [`MAX_TRIES`].
    pub fn repeat(&mut self, session: &mut Session, send: &mut Vec<u8>) -> Result<bool, LinkError> {
        let Some(asked) = self.asked.as_mut().filter(|a| may_repeat(&a.ask)) else {
            return Ok(false);
        };
        if asked.ids.len() >= MAX_TRIES.into() {
            return Err(if session.foreign() > 0 {
                LinkError::Foreign
            } else {
                LinkError::Disturbed
            });
        }
        asked.ids.push(session.request(asked.ask.clone(), send)?);
        Ok(true)
    }

    /// The request that is under way.
    pub fn asking(&self) -> Option<&Ask> {
        self.asked.as_ref().map(|asked| &asked.ask)
    }

    fn last_id(&self) -> Option<u16> {
        self.asked.as_ref()?.ids.last().copied()
    }

    /// Takes in what the probe says; the outcome, when there is one.
    fn take(
        &mut self,
        session: &mut Session,
        tell: &Tell,
        send: &mut Vec<u8>,
    ) -> Result<Option<E::Outcome>, LinkError> {
        let Some(asked) = &mut self.asked else {
            return Ok(None);
        };
        let (first, repeatable) = (!asked.heard, may_repeat(&asked.ask));
        asked.heard = true;
        match tell {
            Tell::Done(id) if asked.ids.contains(id) => {
                self.go_on(session, send)?;
                if self.asked.is_none() {
                    return self.errand.outcome().map(Some);
                }
            }
            // a try before the last one may be refused because of the one before it
            Tell::Refused { id, why } if asked.ids.last() == Some(id) => {
                return Err(LinkError::Refused(why.as_str().to_owned()));
            }
            Tell::Damaged(_) if repeatable => {
                self.repeat(session, send)?;
            }
            // nothing was said in between, so it was this request that was damaged
            Tell::Damaged(_) if first => return Err(LinkError::Unheard),
            Tell::Booted { protocol, .. } if *protocol != PROTOCOL => {
                return Err(LinkError::Protocol(*protocol));
            }
            Tell::Booted {
                reset, last_words, ..
            } => {
                return Err(LinkError::Rebooted {
                    reset: *reset,
                    last_words: last_words.as_ref().map(|words| words.as_str().to_owned()),
                });
            }
            tell => self.errand.hear(tell)?,
        }
        Ok(None)
    }

    fn go_on(&mut self, session: &mut Session, send: &mut Vec<u8>) -> Result<(), LinkError> {
        self.asked = match self.errand.next()? {
            Some(ask) => Some(Asked {
                ids: vec![session.request(ask.clone(), send)?],
                ask,
                heard: false,
            }),
            None => None,
        };
        Ok(())
    }
}

/// Whether a request made twice does what it does once.
fn may_repeat(ask: &Ask) -> bool {
    match ask {
        Ask::Status
        | Ask::Stop
        | Ask::ReadCalibration
        | Ask::WriteCalibration(_)
        | Ask::Stream(_)
        | Ask::ReadTable(_)
        | Ask::BeginTable(_)
        | Ask::WriteTable { .. }
        | Ask::Forget(Forget::SelfTaught | Forget::Training(_))
        | Ask::FactoryTable => true,
        Ask::Home
        | Ask::Identify(_)
        | Ask::Answer(_)
        | Ask::Train(_)
        | Ask::Rename { .. }
        | Ask::Forget(Forget::Texture(_))
        | Ask::Calibrate
        | Ask::CommitTable => false,
    }
}
