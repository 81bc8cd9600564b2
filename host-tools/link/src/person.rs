//! Questions to the person at a probe, files for it, and words.

use std::io::{self, Write};
use std::sync::{Arc, Mutex, PoisonError};

/// A question that has to be answered before an operation goes on.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Question {
    /// Facts that have to be known for it; may be empty.
    pub said: String,
    /// The question, or what somebody is to do.
    pub asked: String,
    /// The meaning of yes and no.
    pub kind: QuestionKind,
}

/// The meaning of yes and no.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum QuestionKind {
    /// Go on; else nothing is changed.
    Consent,
    /// The sample was moved; else it stays.
    Moved,
    /// The sample lies under the finger.
    Laid,
    /// The sample lies under the finger; else it is left out.
    LaidOrLeftOut,
}

/// A file that has to be kept before an operation goes on.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Backup {
    /// Its name.
    pub name: String,
    /// Its contents.
    pub bytes: Vec<u8>,
}

/// The words of an operation for people.
#[derive(Clone, Default, Debug)]
pub struct Words(Arc<Mutex<Vec<u8>>>);

impl Words {
    pub(super) fn take(&self) -> Vec<u8> {
        let mut words = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        std::mem::take(&mut *words)
    }
}

impl Write for Words {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut words = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        words.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
