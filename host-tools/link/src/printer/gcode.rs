//! One line of G-code after the other to a printer, and its answers: numbers and checksums, lines that are asked for
//! again, words of errors. An answer `ok` alone proves little, since one may be lost or come twice; a place that was
//! asked for behind `M400` proves that all before it is done.

use std::collections::VecDeque;
use std::time::Duration;

/// Time after a request to send a line again in which an older Marlin says `ok`, which is not the line's.
const OK_OF_RESEND: Duration = Duration::from_millis(40);
/// Time after an error in which a request to send its line again may come.
const RESEND_OF_ERROR: Duration = Duration::from_millis(250);
/// Requests to send a line again, or lines without an answer, that end a session.
const MOST_RESENDS: u32 = 8;
/// Lines that may be asked for again.
const KEPT: usize = 8;
/// Longest line that a printer says.
const LONGEST: usize = 512;

/// Firmware of a printer.
#[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Dialect {
    /// Marlin.
    Marlin {
        /// It looks for `M410` while a line before it is carried out.
        emergency_parser: bool,
    },
    /// Klipper, behind its pseudo-terminal.
    Klipper,
}

impl Dialect {
    /// The dialect in an answer to `M115`.
    pub(super) fn of(answer: &str) -> Option<Self> {
        let (_, name) = answer.split_once("FIRMWARE_NAME:")?;
        let name = name.lines().next()?.split("PROTOCOL").next()?;
        if name.contains("Klipper") {
            return Some(Self::Klipper);
        }
        name.contains("Marlin").then(|| Self::Marlin {
            emergency_parser: answer.contains("Cap:EMERGENCY_PARSER:1"),
        })
    }
}

/// Errors of the line to a printer.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum LineError {
    /// It says nothing about a line.
    #[error("the printer does not answer: check its cable and that it is on, then try again")]
    Silent,
    /// It has started anew: its zero is gone.
    #[error(
        "the printer has started anew (a dip of its supply, or its port was opened again): its place is not known any \
         more. Lift the finger by hand if it still presses, then run `tactus device printer setup`"
    )]
    Reset,
    /// It says an error.
    #[error("the printer says: {0}")]
    Said(String),
    /// The line is disturbed.
    #[error("the printer asked {0} times for a line again: use a shorter cable, away from motors")]
    Disturbed(u32),
    /// The port is closed.
    #[error("the printer's port failed: {0}")]
    Closed(String),
}

/// The conversation with a printer.
#[derive(Debug, Default)]
pub(super) struct Dialogue {
    numbered: bool,
    number: u32,
    /// The last lines with their numbers.
    kept: VecDeque<(u32, String)>,
    /// The last one is not answered yet.
    is_open: bool,
    opened: Duration,
    send: Vec<u8>,
    line: Vec<u8>,
    /// When lines are sent again, and from which on.
    again: Option<(Duration, u32)>,
    resends: u32,
    place: Option<[f64; 3]>,
    /// What it said since the line was sent.
    heard: String,
    error: Option<LineError>,
    /// An error, unless a request to send a line again follows: when it is one, and its words.
    said_error: Option<(Duration, String)>,
    starts: u32,
}

impl Dialogue {
    /// Numbers its lines from 1, which a Marlin checks: to be called after `M110 N0`.
    pub(super) fn number(&mut self) {
        (self.numbered, self.number) = (true, 0);
        self.kept.clear();
    }

    /// Sends bytes beside the lines.
    pub(super) fn raw(&mut self, text: &str) {
        self.send.extend_from_slice(text.as_bytes());
    }

    /// Sends a line; the one before is answered.
    pub(super) fn send(&mut self, code: &str, now: Duration) {
        self.number += 1;
        let line = match self.numbered {
            true => {
                let line = format!("N{} {code}", self.number);
                let sum = line.bytes().fold(0, |sum, byte| sum ^ byte);
                format!("{line}*{sum}\n")
            }
            false => format!("{code}\n"),
        };
        self.raw(&line);
        self.kept.truncate(KEPT - 1);
        self.kept.push_front((self.number, line));
        (self.is_open, self.opened) = (true, now);
        self.heard.clear();
        self.place = None;
    }

    pub(super) fn take_due(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.send)
    }

    pub(super) fn is_answered(&self) -> bool {
        !self.is_open
    }

    pub(super) fn place(&self) -> Option<[f64; 3]> {
        self.place
    }

    pub(super) fn heard(&self) -> &str {
        &self.heard
    }

    /// How often it has started since the line was opened.
    pub(super) fn starts(&self) -> u32 {
        self.starts
    }

    pub(super) fn take_error(&mut self) -> Option<LineError> {
        self.error.take()
    }

    /// Forgets the open line: the printer starts anew, or answers to nothing that was said before.
    pub(super) fn forget(&mut self) {
        (self.is_open, self.numbered, self.again, self.error) = (false, false, None, None);
        (self.resends, self.said_error) = (0, None);
        self.line.clear();
    }

    pub(super) fn close(&mut self, why: String) {
        self.error = Some(LineError::Closed(why));
    }

    /// Takes what came.
    pub(super) fn carry(&mut self, received: &[u8], now: Duration) {
        for &byte in received {
            match byte {
                b'\n' | b'\r' => {
                    let line = std::mem::take(&mut self.line);
                    self.hear(String::from_utf8_lossy(&line).trim(), now);
                }
                byte if self.line.len() < LONGEST => self.line.push(byte),
                _ => {}
            }
        }
        if let Some((_, why)) = self.said_error.take_if(|(at, _)| now >= *at) {
            self.error = Some(LineError::Said(why));
        }
        if let Some((_, from)) = self.again.take_if(|(at, _)| now >= *at) {
            self.repeat_from(from, now);
        }
    }

    /// Sends the open line again: its answer may be lost, or the line itself.
    pub(super) fn repeat(&mut self, now: Duration) {
        if self.is_open {
            self.repeat_from(self.number, now);
        }
    }

    fn repeat_from(&mut self, from: u32, now: Duration) {
        for (number, line) in self.kept.iter().rev() {
            if *number >= from {
                self.send.extend_from_slice(line.as_bytes());
            }
        }
        (self.is_open, self.opened) = (true, now);
        self.count_resend();
    }

    fn count_resend(&mut self) {
        self.resends += 1;
        if self.resends > MOST_RESENDS {
            self.error = Some(LineError::Disturbed(self.resends));
        }
    }

    /// Time that the open line has waited for its answer.
    pub(super) fn waited(&self, now: Duration) -> Duration {
        match self.is_open {
            true => now.saturating_sub(self.opened),
            false => Duration::ZERO,
        }
    }

    fn hear(&mut self, line: &str, now: Duration) {
        if self.heard.len() < 16 * LONGEST {
            self.heard.push_str(line);
            self.heard.push('\n');
        }
        if let Some(rest) = line.strip_prefix("Resend:").or(line.strip_prefix("rs ")) {
            self.said_error = None;
            let wanted = rest.trim_start().trim_start_matches('N').trim();
            match wanted.parse::<u32>() {
                // it has this line already: the answer was lost
                Ok(wanted) if wanted == self.number + 1 => self.is_open = false,
                Ok(wanted) if self.kept.iter().any(|(number, _)| *number == wanted) => {
                    self.again.get_or_insert((now + OK_OF_RESEND, wanted));
                }
                _ => self.error = Some(LineError::Said(line.to_owned())),
            }
            return;
        }
        if line == "start" || line.ends_with("\u{fffd}start") {
            self.starts += 1;
            return;
        }
        if line.starts_with("Error:") || line.starts_with("!!") || line.contains("Shutdown") {
            // of a line that did not come whole: it is sent again
            if !line.contains("Last Line") {
                self.said_error = Some((now + RESEND_OF_ERROR, line.to_owned()));
            }
            return;
        }
        if let Some(place) = place(line) {
            self.place = Some(place);
        }
        let is_ok = line == "ok" || line.starts_with("ok ");
        if is_ok && self.again.is_none() {
            self.is_open = false;
            self.resends = self.resends.saturating_sub(1);
        }
    }
}

/// The place in an answer to `M114`.
fn place(line: &str) -> Option<[f64; 3]> {
    let (_, rest) = line.split_once("X:")?;
    let (x, rest) = rest.split_once("Y:")?;
    let (y, rest) = rest.split_once("Z:")?;
    let z = rest.split_whitespace().next()?;
    let number = |text: &str| text.trim().parse().ok().filter(|mm: &f64| mm.is_finite());
    Some([number(x)?, number(y)?, number(z)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW: Duration = Duration::from_secs(1);

    fn numbered() -> Dialogue {
        let mut dialogue = Dialogue::default();
        dialogue.number();
        dialogue.send("M114", NOW);
        assert_eq!(dialogue.take_due(), b"N1 M114*38\n");
        dialogue
    }

    #[test]
    fn a_line_that_is_asked_for_again_is_sent_again_and_the_ok_of_the_request_is_not_its_own() {
        let mut dialogue = numbered();
        dialogue.carry(
            b"Error:checksum mismatch, Last Line: 0\nResend: 1\nok\n",
            NOW,
        );
        assert!(!dialogue.is_answered() && dialogue.take_due().is_empty());
        dialogue.carry(b"", NOW + OK_OF_RESEND);
        assert_eq!(dialogue.take_due(), b"N1 M114*38\n");
        dialogue.carry(
            b"X:1.00 Y:2.00 Z:-3.50 E:0.00 Count X:80 Y:160 Z:0\nok\n",
            NOW,
        );
        assert!(dialogue.is_answered());
        assert_eq!(dialogue.place(), Some([1.0, 2.0, -3.5]));
        assert_eq!(dialogue.take_error(), None);
    }

    #[test]
    fn a_request_for_the_next_line_answers_this_one() {
        let mut dialogue = numbered();
        dialogue.repeat(NOW);
        let said = b"Error:Line Number is not Last Line Number+1, Last Line: 1\nResend: 2\n";
        dialogue.carry(said, NOW);
        assert!(dialogue.is_answered());
        dialogue.take_due();
        dialogue.send("M400", NOW);
        // an ok that came twice hid that the first one never arrived
        dialogue.carry(b"Resend: 1\nok\n", NOW);
        dialogue.carry(b"", NOW + OK_OF_RESEND);
        let sent = String::from_utf8(dialogue.take_due()).unwrap();
        assert!(sent.contains("N1 M114*38\nN2 M400*"), "{sent}");
        dialogue.carry(b"Resend: 9\n", NOW);
        assert!(matches!(dialogue.take_error(), Some(LineError::Said(_))));
    }

    #[test]
    fn a_storm_of_requests_ends_and_words_of_errors_are_told() {
        let mut dialogue = numbered();
        // each is answered after a moment
        for n in 0..=2 * MOST_RESENDS {
            dialogue.carry(b"Resend: 1\n", NOW * (2 * n + 1));
            dialogue.carry(b"", NOW * (2 * n + 2));
        }
        assert!(matches!(
            dialogue.take_error(),
            Some(LineError::Disturbed(_))
        ));
        dialogue.carry(b"!! Must home axis first: 1.0 0.0 0.0\nok\n", NOW * 99);
        assert_eq!(dialogue.take_error(), None);
        dialogue.carry(b"", NOW * 100);
        let said = dialogue.take_error().unwrap().to_string();
        assert!(said.contains("Must home axis first"), "{said}");
        dialogue.carry(b"start\n", NOW);
        assert_eq!(dialogue.starts(), 1);
    }

    #[test]
    fn dialects_are_told_apart_by_their_names() {
        let of = Dialect::of;
        let marlin = "FIRMWARE_NAME:Marlin 2.1.2 PROTOCOL_VERSION:1.0\nCap:EMERGENCY_PARSER:1\n";
        let with = |emergency_parser| Some(Dialect::Marlin { emergency_parser });
        assert_eq!(of(marlin), with(true));
        assert_eq!(of("FIRMWARE_NAME: Marlin V1; Sprinter"), with(false));
        assert_eq!(
            of("ok FIRMWARE_NAME:Klipper FIRMWARE_VERSION:v0.12"),
            Some(Dialect::Klipper)
        );
        assert_eq!(of("FIRMWARE_NAME:RepRapFirmware for Duet"), None);
        assert_eq!(of("Grbl 1.1h"), None);
    }
}
