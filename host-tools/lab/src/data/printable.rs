//! Text of others as a terminal, a picture or a page may show it: a name from a file or a probe is data, and moves no
//! cursor.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::io::{self, Write};

use tactus_core::table::is_printable;

/// The text with JSON's escape in place of each character that prints nothing, or changes those around it; ends of
/// lines and tabs stay. So an object in JSON stays the same object.
pub fn printable(text: &str) -> Cow<'_, str> {
    let shown = |c: char| is_printable(c) || matches!(c, '\n' | '\t');
    if text.chars().all(shown) {
        return Cow::Borrowed(text);
    }
    let mut escaped = String::new();
    for c in text.chars() {
        if shown(c) {
            escaped.push(c);
            continue;
        }
        for unit in c.encode_utf16(&mut [0; 2]) {
            // a string takes whatever is written
            let _ = write!(escaped, "\\u{unit:04x}");
        }
    }
    Cow::Owned(escaped)
}

/// Writes text with [`printable`] between: the one place that the output of a command passes through.
#[derive(Debug)]
pub struct Printable<W> {
    to: W,
    /// The beginning of a character whose end comes with the next bytes.
    begun: Vec<u8>,
}

impl<W: Write> Printable<W> {
    /// Writes to `to`.
    pub fn new(to: W) -> Self {
        Self {
            to,
            begun: Vec::new(),
        }
    }
}

impl<W: Write> Write for Printable<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let all = [&self.begun, bytes].concat();
        self.begun.clear();
        for chunk in all.utf8_chunks() {
            self.to.write_all(printable(chunk.valid()).as_bytes())?;
            let invalid = chunk.invalid();
            let at_end = all.ends_with(invalid);
            match std::str::from_utf8(invalid) {
                Err(why) if at_end && why.error_len().is_none() => self.begun = invalid.to_vec(),
                Err(_) => self.to.write_all("\u{fffd}".as_bytes())?,
                Ok(_) => {}
            }
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_would_obey_is_escaped_and_letters_stay() {
        for (text, shown) in [
            (
                "Bäckerei 麻 \"linen\"\t5 %\n",
                "Bäckerei 麻 \"linen\"\t5 %\n",
            ),
            (
                "\u{1b}[2J\u{1b}]0;title\u{7}red",
                "\\u001b[2J\\u001b]0;title\\u0007red",
            ),
            ("a\u{9b}2J\u{7f}\r", "a\\u009b2J\\u007f\\u000d"),
            ("\u{202e}der\u{2066}\u{200f}", "\\u202eder\\u2066\\u200f"),
            ("\u{e0041}", "\\udb40\\udc41"),
        ] {
            assert_eq!(printable(text), shown);
            // whatever pieces it comes in
            for size in 1..=text.len() {
                let mut to = Printable::new(Vec::new());
                for piece in text.as_bytes().chunks(size) {
                    to.write_all(piece).unwrap();
                }
                assert_eq!(to.to, shown.as_bytes(), "{size}");
            }
            // and an object in JSON is the same
            let json = serde_json::to_string(text).unwrap();
            let same: String = serde_json::from_str(&printable(&json)).unwrap();
            assert_eq!(same, text);
        }
        let mut to = Printable::new(Vec::new());
        to.write_all(b"\xff\x1b\xc3(").unwrap();
        assert_eq!(to.to, "\u{fffd}\\u001b\u{fffd}(".as_bytes());
    }
}
