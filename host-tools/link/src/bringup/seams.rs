//! What the steps need of the board and of a person, and why one comes to no end.

use std::io;

use tactus_core::wire::bringup::{Measure, Pin, Saw};
use tactus_core::wire::{Command, Report, Reset};

use crate::LinkError;

/// The reason why a step came to no end.
#[derive(Debug, thiserror::Error)]
pub enum Trouble {
    /// The person ends it.
    #[error("stopped: no motor moves. The same command goes on with the step that was not over")]
    Quit,
    /// Another image runs.
    #[error(
        "another image runs on the board: flash the self-test (cargo xtask flash --self-test, or `tactus device \
             flash`), then the same command again"
    )]
    OtherImage,
    /// What is asked comes back.
    #[error("{}", LinkError::Echo)]
    Echo,
    /// The board says nothing.
    #[error(
        "the self-test says nothing: flash it (cargo xtask flash --self-test), press the board's black button, then \
             the same command again"
    )]
    Silent,
    /// An answer to another question, or one of another version.
    #[error("the board answers something else; are tactus and the self-test of one version? {0}")]
    Unexpected(String),
    /// Line, journal, or what is shown.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// The self-test at the other end of a line.
pub trait Board {
    /// Asks, and waits for the answer.
    fn ask(&mut self, measure: Measure) -> Result<Saw, Trouble>;

    /// Asks for something that ends with a new start of the board, and waits for that: why it started; `None` if it
    /// does not.
    fn restart(&mut self, measure: Measure) -> Result<Option<Reset>, Trouble>;

    /// Questions, their answers, and damaged frames so far.
    fn traffic(&self) -> [u32; 3];

    /// Time of the board at its last answer, and of the PC now, ms.
    fn times_ms(&self) -> [u64; 2];
}

/// The rig's firmware at the other end of a line.
pub trait Probe {
    /// Asks for something, and waits until it is over; `each` gets all that is said meanwhile. Within: why it was
    /// refused or came to nothing.
    fn ask(
        &mut self,
        command: Command,
        each: &mut dyn FnMut(&Report),
    ) -> Result<Result<(), String>, Trouble>;
}

/// Who is at the rig.
pub trait Person {
    /// Does something, and says when it is done.
    fn done(&mut self, please: &str) -> Result<(), Trouble>;
    /// Looks at something that moves in a moment.
    fn watch(&mut self, please: &str) -> Result<(), Trouble>;
    /// Sees a value that changes.
    fn show(&mut self, value: &str) -> Result<(), Trouble>;
    /// Presses a switch and keeps it pressed, or lets it go.
    fn press(&mut self, switch: Pin, pressed: bool) -> Result<(), Trouble>;
    /// Begins to squeeze the finger and lays it down; the board watches.
    fn squeeze(&mut self) -> Result<(), Trouble>;
    /// Chooses one of these.
    fn choose(&mut self, question: &str, answers: &[&str]) -> Result<usize, Trouble>;
    /// Measures something.
    fn number(&mut self, question: &str, unit: &str) -> Result<f64, Trouble>;
}
