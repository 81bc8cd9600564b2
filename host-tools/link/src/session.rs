//! Turns requests into frames and received bytes into reports; the errors of a transaction.

use tactus_core::rig::calibration::RigCalibrationError;
use tactus_core::table::TableError;
use tactus_core::wire::{
    self, Command, Event, Failure, FrameError, MAX_FRAME, PROTOCOL, Receiver, Report, Reset,
    TooLong,
};

use super::sound::impossible;

/// A request that may be made twice is made so often before the line is given up.
pub const MAX_TRIES: u8 = 5;

fn remedy(of: &u8) -> &'static str {
    if *of > PROTOCOL {
        "this program is older, install the tactus of the probe's version, or flash this one's firmware: `tactus \
             device flash`"
    } else {
        "the probe is older, flash the firmware of this version: `tactus device flash`"
    }
}

/// The reason why a transaction failed, and the remedy.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum LinkError {
    /// The probe says why and what to do.
    #[error("the probe refused: {0}")]
    Refused(Box<Failure>),
    /// The probe started anew before it answered.
    #[error("the probe restarted ({reset:?}) before it answered{}: ask again", quoted(.last_words))]
    Rebooted {
        /// The cause of its restart.
        reset: Reset,
        /// The firmware's words before it gave up.
        last_words: Option<String>,
    },
    /// The other end is of another version.
    #[error(
        "the probe speaks version {of} of the messages, this program version {PROTOCOL}: {remedy}",
        of = .0,
        remedy = remedy(.0)
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
        "the other end speaks another version of the messages than this program (version {PROTOCOL}): flash the \
             firmware of this version, `tactus device flash`"
    )]
    Foreign,
    /// Frames of requests come back.
    #[error(
        "the port sends back what it gets: TX and RX are joined, or local echo is on. Part the two wires, or turn the \
         echo off"
    )]
    Echo,
    /// A report that no probe makes.
    #[error(
        "the probe reports what cannot be, {0}: the report is damaged, and was not used. Switch the probe off and on; \
         if it stays so, this is another device or another firmware"
    )]
    Impossible(&'static str),
    /// The request is over, and its answer did not come.
    #[error(
        "the probe was done without an answer: it was stopped, or the answer was lost; ask again"
    )]
    NoAnswer,
    /// No table, or one that the probe does not hold.
    #[error("this is no table for the probe")]
    Table(#[from] TableError),
    /// The table in use became another one while it was read.
    #[error("the table was changed while it was read: read it again")]
    Changed,
    /// Constants that no rig has.
    #[error("the calibration cannot be used")]
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

/// Bytes that are compared.
const COMPARED: usize = 1024;
/// Fewest bytes that are no accident.
const LEAST_ECHO: usize = 8;

/// Notes bytes as a line carries them that has seven bits and takes no zeros.
fn carry(to: &mut Vec<u8>, bytes: &[u8]) {
    let bytes = bytes
        .iter()
        .map(|byte| byte & 0x7f)
        .filter(|byte| *byte != 0);
    to.extend(bytes.take(COMPARED.saturating_sub(to.len())));
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
    /// understands what a host says
    echo: Receiver,
    /// Bytes that were sent, and that came, as the poorest line carries them; each up to [`COMPARED`].
    carried: [Vec<u8>; 2],
    /// The reason why nothing that comes in can be believed.
    pub(crate) refused: Option<LinkError>,
}

impl Session {
    /// Appends the bytes of a request to `send`, and says its id. A 0 goes before it: what was on the line ends there.
    pub fn request(&mut self, command: Command, send: &mut Vec<u8>) -> Result<u16, TooLong> {
        let id = self.next_id;
        let mut buffer = [0; MAX_FRAME + 1];
        let frame = wire::encode(&wire::Request { id, command }, &mut buffer)?;
        self.next_id = id.wrapping_add(1);
        send.push(0);
        send.extend_from_slice(frame);
        carry(&mut self.carried[0], frame);
        Ok(id)
    }

    /// Returns true if all that came are bytes that were sent, in their order: an echo, though no frame of it is whole.
    pub(crate) fn is_echo(&self) -> bool {
        let [sent, came] = &self.carried;
        let mut sent = sent.iter();
        came.len() >= LEAST_ECHO && came.iter().all(|byte| sent.any(|other| other == byte))
    }

    /// Takes in bytes as they come; the reports that end in them. One that cannot be is counted as damaged.
    pub fn receive(&mut self, bytes: &[u8]) -> Vec<Report> {
        let mut reports = Vec::new();
        carry(&mut self.carried[1], bytes);
        for &byte in bytes {
            let echo = self.echo.push::<wire::Request>(byte);
            match self.receiver.push::<Report>(byte) {
                None => {}
                Some(Err(why)) => {
                    self.damaged += 1;
                    self.foreign += u64::from(why == FrameError::Message);
                    if let Some(Ok(_)) = echo {
                        self.refused = Some(LinkError::Echo);
                    }
                }
                Some(Ok(report)) => {
                    // a probe that boots counts anew
                    if let (Some(expected), false) =
                        (self.expected, matches!(report.event, Event::Booted { .. }))
                    {
                        let missing = report.number.wrapping_sub(expected);
                        self.missing += u64::from(missing);
                    }
                    self.expected = Some(report.number.wrapping_add(1));
                    match impossible(&report.event) {
                        None => reports.push(report),
                        Some(what) => {
                            self.damaged += 1;
                            self.refused = Some(LinkError::Impossible(what));
                        }
                    }
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
