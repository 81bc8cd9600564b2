//! Standard output and error. A reader that leaves ends the printing, not the work: its exit code stays that of what
//! was found.

use std::fmt::Display;
use std::io::{self, ErrorKind, Write};

use tactus_lab::data::printable::printable;

/// Standard output.
pub(crate) struct Printed(pub(crate) io::Stdout);

impl Write for Printed {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        unless_left(self.0.write(bytes), bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        unless_left(self.0.flush(), ())
    }
}

fn unless_left<T>(done: io::Result<T>, all: T) -> io::Result<T> {
    match done {
        Err(why) if why.kind() == ErrorKind::BrokenPipe => Ok(all),
        Err(why) if why.kind() == ErrorKind::Interrupted => Err(why),
        Err(why) => {
            let said = format!("standard output takes no more ({why}): give it another place");
            Err(io::Error::new(why.kind(), said))
        }
        Ok(done) => Ok(done),
    }
}

/// Standard error. What it does not take is not said: nobody is there.
pub(crate) struct Beside;

impl Write for Beside {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let _ = io::stderr().write_all(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Says something on standard error, on a line of its own.
pub(crate) fn say(what: impl Display) {
    let _ = writeln!(Beside, "{}", printable(&what.to_string()));
}

/// Says what went wrong. Of a text that is too long for people, as a name in a damaged file may be, the middle is left
/// out: what it is about comes first, what to do last.
pub(crate) fn say_error(what: &str) {
    const HALF: usize = 1000;
    let from_end = what.char_indices().rev().nth(HALF - 1);
    match (what.char_indices().nth(HALF), from_end) {
        (Some((begin, _)), Some((end, _))) if begin < end => {
            say(format_args!("{} ... {}", &what[..begin], &what[end..]));
        }
        _ => say(what),
    }
}

/// Says what somebody is to enter behind it.
pub(crate) fn prompt(what: impl Display) {
    let _ = write!(Beside, "{}", printable(&what.to_string()));
}
