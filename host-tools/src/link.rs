//! The host's end of the link to the probe, without IO and without a clock: bytes come in, bytes go out.
//!
//! [`Session`] makes requests and understands reports. [`Job`] sees an [`Errand`] through, which is one request
//! ([`Question`]) or a sequence of them ([`PushTable`], [`ReadTable`]), whatever is damaged or lost on the way.
//! [`Port`] runs jobs over anything that reads and writes: a serial line, a TCP connection.

use std::io::{self, Read, Write};
use std::task::Poll;
use std::time::{Duration, Instant};

use tactus_core::rig::calibration::{RigCalibration, RigCalibrationError};
use tactus_core::table::{Table, TableError};
use tactus_core::wire::{
    self, Ask, Forget, FrameError, Identify, MAX_FRAME, MAX_TEXTURES, Name, PART, PROTOCOL,
    Receiver, Report, Request, Reset, Status, Tell, TooLong, Train,
};

/// A request that may be made twice is made so often before the line is given up.
pub const MAX_TRIES: u8 = 5;

/// Why an errand came to nothing, and what to do.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum LinkError {
    /// The probe says why and what to do.
    #[error("the probe refused: {0}")]
    Refused(String),
    /// The probe started anew before it answered.
    #[error("the probe restarted ({reset:?}) before it answered{}: ask again", quoted(.last_words))]
    Rebooted {
        /// Why it did.
        reset: Reset,
        /// What the firmware had to say before it gave up.
        last_words: Option<String>,
    },
    /// The other end is of another version.
    #[error(
        "the probe speaks version {0} of the messages, this program version {PROTOCOL}: flash the firmware of this version, `tactus device flash`"
    )]
    Protocol(u8),
    /// The request was damaged on its way, and nobody but the user may repeat it.
    #[error("the request did not arrive whole, nothing was begun: ask again")]
    Unheard,
    /// The request or its answer was damaged again and again.
    #[error(
        "no answer got through in {MAX_TRIES} tries: check the cable and that both ends have the same baud rate"
    )]
    Disturbed,
    /// Whole frames come, and none of them is a message that is known here.
    #[error(
        "the other end speaks another version of the messages than this program (version {PROTOCOL}): flash the firmware of this version, `tactus device flash`"
    )]
    Foreign,
    /// The request is over, and what was asked for was not told.
    #[error(
        "the probe was done without an answer: it was stopped, or the answer was lost; ask again"
    )]
    NoAnswer,
    /// No table, or one that the probe does not hold.
    #[error("this is no table for the probe: {0}")]
    Table(#[from] TableError),
    /// More textures than the probe holds.
    #[error("the table has {0} textures, the probe holds {MAX_TEXTURES}: learn fewer")]
    Textures(u16),
    /// The table in use became another one while it was read.
    #[error("the table was changed while it was read: read it again")]
    Changed,
    /// Constants that no rig has.
    #[error("the calibration cannot be used: {0}")]
    Calibration(#[from] RigCalibrationError),
    /// A request too long for a frame; none that can be made is.
    #[error(transparent)]
    TooLong(#[from] TooLong),
}

fn quoted(words: &Option<String>) -> String {
    words
        .as_ref()
        .map(|words| format!(", its last words: {words}"))
        .unwrap_or_default()
}

/// Requests get their numbers here, and received bytes become reports.
#[derive(Debug, Default)]
pub struct Session {
    receiver: Receiver,
    next_id: u16,
    /// number of the report that should come next
    expected: Option<u16>,
    damaged: u64,
    foreign: u64,
    missing: u64,
}

impl Session {
    /// Appends the bytes of a request to `send`, and says its id. A 0 goes before it: what was on the line ends there.
    ///
    /// # Errors
    /// [`TooLong`].
    pub fn request(&mut self, ask: Ask, send: &mut Vec<u8>) -> Result<u16, TooLong> {
        let id = self.next_id;
        let mut room = [0; MAX_FRAME + 1];
        let frame = wire::encode(&Request { id, ask }, &mut room)?;
        self.next_id = id.wrapping_add(1);
        send.push(0);
        send.extend_from_slice(frame);
        Ok(id)
    }

    /// Takes in bytes as they come; the reports that end in them.
    pub fn receive(&mut self, bytes: &[u8]) -> Vec<Report> {
        let mut reports = Vec::new();
        for &byte in bytes {
            match self.receiver.push::<Report>(byte) {
                None => {}
                Some(Err(why)) => {
                    self.damaged += 1;
                    self.foreign += u64::from(why == FrameError::Message);
                }
                Some(Ok(report)) => {
                    // a probe that boots counts anew
                    if let (Some(expected), false) =
                        (self.expected, matches!(report.tell, Tell::Booted { .. }))
                    {
                        self.missing += u64::from(report.number.wrapping_sub(expected));
                    }
                    self.expected = Some(report.number.wrapping_add(1));
                    reports.push(report);
                }
            }
        }
        reports
    }

    /// Frames that were damaged so far.
    pub fn damaged(&self) -> u64 {
        self.damaged
    }

    /// Of these, frames that are whole and no message known here.
    pub fn foreign(&self) -> u64 {
        self.foreign
    }

    /// Reports that never came, by the gaps in their numbers; damaged ones are among them.
    pub fn missing(&self) -> u64 {
        self.missing
    }
}

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

/// One request, and what of the reports is its answer.
#[derive(Clone, Debug)]
pub struct Question<T> {
    ask: Option<Ask>,
    answer: Option<T>,
    pick: fn(&Tell, &mut Option<T>) -> Result<(), LinkError>,
}

impl<T> Errand for Question<T> {
    type Outcome = T;

    fn next(&mut self) -> Result<Option<Ask>, LinkError> {
        Ok(self.ask.take())
    }

    fn hear(&mut self, tell: &Tell) -> Result<(), LinkError> {
        (self.pick)(tell, &mut self.answer)
    }

    fn outcome(&mut self) -> Result<T, LinkError> {
        self.answer.take().ok_or(LinkError::NoAnswer)
    }
}

/// What an exploration found.
#[derive(Clone, PartialEq, Debug)]
pub struct Found {
    /// Index of the texture in the probe's table.
    pub texture: u16,
    /// Its name there.
    pub name: Name,
    /// Posterior probability.
    pub probability: f32,
    /// Whether it is over the threshold.
    pub sure: bool,
    /// Whether it is rather none of the textures known; the one named is the most alike.
    pub unknown: bool,
    /// Log-odds of that, where they can be told.
    pub log_odds: Option<f32>,
    /// Slides that counted.
    pub slides: u8,
    /// Whether the probe would learn from [`Question::answer`].
    pub asks: bool,
    /// Slides that the probe has learned from by itself.
    pub learned: u8,
}

/// What the probe has learned from an answer.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Taught {
    /// Name of the texture.
    pub name: Name,
    /// How many slides.
    pub slides: u8,
}

impl Question<()> {
    /// A request whose end is all there is to know: [`Ask::Home`], [`Ask::Stream`], ...
    pub fn command(ask: Ask) -> Self {
        Self {
            ask: Some(ask),
            answer: Some(()),
            pick: |_, _| Ok(()),
        }
    }

    /// Gives a texture another name.
    pub fn rename(from: Name, to: Name) -> Self {
        Self::command(Ask::Rename { from, to })
    }

    /// Has the probe forget a texture, what it taught itself, or a training.
    pub fn forget(what: Forget) -> Self {
        Self::command(Ask::Forget(what))
    }

    /// Has the probe take and keep these constants.
    ///
    /// # Errors
    /// [`LinkError::Calibration`] for constants that cannot be.
    pub fn write_calibration(calibration: &RigCalibration) -> Result<Self, LinkError> {
        calibration.check()?;
        let bytes = calibration.to_bytes();
        // 60 bytes into 64
        Ok(Self::command(Ask::WriteCalibration(
            bytes.into_iter().collect(),
        )))
    }
}

impl Question<Status> {
    /// How the probe is.
    pub fn status() -> Self {
        Self {
            ask: Some(Ask::Status),
            answer: None,
            pick: |tell, answer| {
                if let Tell::Status(status) = tell {
                    *answer = Some(status.clone());
                }
                Ok(())
            },
        }
    }
}

impl Question<RigCalibration> {
    /// The constants that the probe uses.
    pub fn read_calibration() -> Self {
        Self {
            ask: Some(Ask::ReadCalibration),
            answer: None,
            pick: take_calibration,
        }
    }

    /// Has the probe measure its motor's current without load; the constants that it then uses.
    pub fn calibrate() -> Self {
        Self {
            ask: Some(Ask::Calibrate),
            answer: None,
            pick: take_calibration,
        }
    }
}

fn take_calibration(tell: &Tell, answer: &mut Option<RigCalibration>) -> Result<(), LinkError> {
    if let Tell::Calibration(bytes) = tell {
        let bytes = bytes
            .as_slice()
            .try_into()
            .map_err(|_| RigCalibrationError::Damaged)?;
        *answer = Some(RigCalibration::from_bytes(bytes)?);
    }
    Ok(())
}

impl Question<Found> {
    /// Has the probe find out what lies under its finger.
    pub fn identify(how: Identify) -> Self {
        Self {
            ask: Some(Ask::Identify(how)),
            answer: None,
            pick: |tell, answer: &mut Option<Found>| {
                match tell {
                    Tell::Verdict {
                        texture,
                        name,
                        probability,
                        sure,
                        unknown,
                        log_odds,
                        slides,
                        asks,
                    } => {
                        *answer = Some(Found {
                            texture: *texture,
                            name: name.clone(),
                            probability: *probability,
                            sure: *sure,
                            unknown: *unknown,
                            log_odds: *log_odds,
                            slides: *slides,
                            asks: *asks,
                            learned: 0,
                        });
                    }
                    Tell::Taught {
                        slides,
                        itself: true,
                        ..
                    } => {
                        if let Some(found) = answer {
                            found.learned = *slides;
                        }
                    }
                    _ => {}
                }
                Ok(())
            },
        }
    }
}

impl Question<Taught> {
    /// Tells the probe what lay under its finger in the last exploration; what it has learned from that.
    pub fn answer(name: Name) -> Self {
        Self {
            ask: Some(Ask::Answer(name)),
            answer: None,
            pick: |tell, answer| {
                if let Tell::Taught {
                    name,
                    slides,
                    itself: false,
                } = tell
                {
                    *answer = Some(Taught {
                        name: name.clone(),
                        slides: *slides,
                    });
                }
                Ok(())
            },
        }
    }
}

impl Question<u32> {
    /// Has the probe learn what lies under its finger; how many slides it made for that.
    pub fn train(what: Train) -> Self {
        Self {
            ask: Some(Ask::Train(what)),
            answer: Some(0),
            pick: |tell, answer| {
                if let Tell::Learned { .. } = tell {
                    *answer.get_or_insert(0) += 1;
                }
                Ok(())
            },
        }
    }
}

/// Gives the probe another table: begins, writes it in parts of [`PART`] bytes, each when the one before is done, and has
/// it taken into use.
#[derive(Clone, Debug)]
pub struct PushTable {
    bytes: Vec<u8>,
    /// the next request: begin, then parts, then commit
    next: usize,
}

impl PushTable {
    /// The table at the beginning of `bytes`, checked.
    ///
    /// # Errors
    /// [`LinkError::Table`], [`LinkError::Textures`].
    pub fn new(bytes: &[u8]) -> Result<Self, LinkError> {
        let table = Table::read(bytes)?;
        if usize::from(table.textures()) > MAX_TEXTURES {
            return Err(LinkError::Textures(table.textures()));
        }
        Ok(Self {
            bytes: table.as_bytes().to_vec(),
            next: 0,
        })
    }

    /// Requests that are done or under way, and all there are.
    pub fn progress(&self) -> (usize, usize) {
        (self.next, self.bytes.len().div_ceil(PART) + 2)
    }
}

impl Errand for PushTable {
    type Outcome = ();

    fn next(&mut self) -> Result<Option<Ask>, LinkError> {
        let parts = self.bytes.len().div_ceil(PART);
        let next = self.next;
        self.next += 1;
        Ok(match next {
            0 => Some(Ask::BeginTable(self.bytes.len() as u32)),
            n if n <= parts => {
                let offset = (n - 1) * PART;
                let rest = self.bytes.get(offset..).unwrap_or_default();
                Some(Ask::WriteTable {
                    offset: offset as u32,
                    bytes: rest.iter().copied().take(PART).collect(),
                })
            }
            n if n == parts + 1 => Some(Ask::CommitTable),
            _ => None,
        })
    }

    fn hear(&mut self, _: &Tell) -> Result<(), LinkError> {
        Ok(())
    }

    fn outcome(&mut self) -> Result<(), LinkError> {
        Ok(())
    }
}

/// Reads the table that the probe uses; its bytes, checked. Whether the probe tells one part per request or all there are
/// is its own choice.
#[derive(Clone, Debug, Default)]
pub struct ReadTable {
    bytes: Vec<u8>,
    /// of the whole table, once told
    length: Option<u32>,
    /// bytes there were when the request under way was made, and how often it was made
    asked: (usize, u8),
}

impl Errand for ReadTable {
    type Outcome = Vec<u8>;

    fn next(&mut self) -> Result<Option<Ask>, LinkError> {
        let got = self.bytes.len();
        if self.length.is_some_and(|length| got as u32 >= length) {
            return Ok(None);
        }
        // done, and not a byte came: it was damaged
        let tries = if self.asked.0 == got { self.asked.1 } else { 0 };
        if tries == MAX_TRIES {
            return Err(LinkError::Disturbed);
        }
        self.asked = (got, tries + 1);
        Ok(Some(Ask::ReadTable(got as u32)))
    }

    fn hear(&mut self, tell: &Tell) -> Result<(), LinkError> {
        if let Tell::TablePart {
            offset,
            length,
            bytes,
        } = tell
        {
            if *self.length.get_or_insert(*length) != *length {
                return Err(LinkError::Changed);
            }
            // another is one that came twice, or comes behind a lost one and will be asked for again
            if *offset as usize == self.bytes.len() {
                self.bytes.extend_from_slice(bytes);
            }
        }
        Ok(())
    }

    fn outcome(&mut self) -> Result<Vec<u8>, LinkError> {
        // two tables of one length, half of each: the checksum says so
        match Table::read(&self.bytes) {
            Err(TableError::Crc { .. }) => Err(LinkError::Changed),
            Err(why) => Err(why.into()),
            Ok(_) => Ok(std::mem::take(&mut self.bytes)),
        }
    }
}

/// Why nothing came of an errand over a port.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// The port cannot be read or written.
    #[error("the port failed: {0}; check the cable, then open it again")]
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

/// A session over something that reads and writes. Its reads must come back within a fraction of the patience, with
/// [`io::ErrorKind::WouldBlock`] or [`io::ErrorKind::TimedOut`] when nothing came.
#[derive(Debug)]
pub struct Port<S> {
    stream: S,
    session: Session,
    patience: Duration,
    /// to be sent with the next step
    send: Vec<u8>,
    /// when something came last, or was waited for from then on
    heard: Instant,
    /// bytes that came, and reports
    bytes: u64,
    reports: u64,
}

impl<S: Read + Write> Port<S> {
    /// A port whose silence is taken for a loss after `patience`.
    pub fn new(stream: S, patience: Duration) -> Self {
        Self {
            stream,
            session: Session::default(),
            patience,
            send: Vec::new(),
            heard: Instant::now(),
            bytes: 0,
            reports: 0,
        }
    }

    /// Silence is taken for a loss after `patience` from now on.
    pub fn set_patience(&mut self, patience: Duration) {
        self.patience = patience;
    }

    /// What was damaged and lost so far.
    pub fn session(&self) -> &Session {
        &self.session
    }

    /// Sees an errand through; `each` is shown all reports.
    ///
    /// # Errors
    /// See [`PortError`].
    pub fn run<E: Errand>(
        &mut self,
        errand: E,
        mut each: impl FnMut(&Report),
    ) -> Result<E::Outcome, PortError> {
        let mut job = self.begin(errand)?;
        loop {
            if let Poll::Ready(outcome) = self.step(&mut job, &mut each)? {
                return Ok(outcome);
            }
        }
    }

    /// Begins an errand, for whoever has something else to do between its [steps](Port::step).
    ///
    /// # Errors
    /// See [`PortError`].
    pub fn begin<E: Errand>(&mut self, errand: E) -> Result<Job<E>, PortError> {
        self.heard = Instant::now();
        Ok(Job::begin(errand, &mut self.session, &mut self.send)?)
    }

    /// Goes on with an errand: sends what is due, and reads once. Not to be called again once it is ready.
    ///
    /// # Errors
    /// See [`PortError`].
    pub fn step<E: Errand>(
        &mut self,
        job: &mut Job<E>,
        mut each: impl FnMut(&Report),
    ) -> Result<Poll<E::Outcome>, PortError> {
        let mut bytes = [0; 4096];
        let received = self.exchange(&mut bytes)?;
        if !received.is_empty() {
            let reports = &mut self.reports;
            let polled = job.poll(&mut self.session, received, &mut self.send, |report| {
                *reports += 1;
                each(report);
            });
            return match polled {
                Poll::Ready(Err(LinkError::Disturbed)) if self.reports == 0 => {
                    Err(PortError::Garbage(self.bytes))
                }
                Poll::Ready(outcome) => Ok(Poll::Ready(outcome?)),
                Poll::Pending => Ok(Poll::Pending),
            };
        }
        if self.heard.elapsed() >= self.patience {
            match job.repeat(&mut self.session, &mut self.send) {
                Ok(true) => self.heard = Instant::now(),
                Ok(false) | Err(LinkError::Disturbed) if self.bytes > 0 && self.reports == 0 => {
                    return Err(PortError::Garbage(self.bytes));
                }
                Ok(false) => return Err(PortError::Silent(self.patience)),
                Err(LinkError::Disturbed) => {
                    return Err(PortError::Silent(self.patience * MAX_TRIES.into()));
                }
                Err(why) => return Err(why.into()),
            }
        }
        Ok(Poll::Pending)
    }

    /// Makes a request beside the errand under way, or without one; its answer is among the reports.
    ///
    /// # Errors
    /// See [`PortError`].
    pub fn ask(&mut self, ask: Ask) -> Result<(), PortError> {
        self.session
            .request(ask, &mut self.send)
            .map_err(LinkError::from)?;
        Ok(())
    }

    /// Sends what is due, and reads once, while there is no errand.
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
                self.heard = Instant::now();
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

#[cfg(test)]
mod tests;
