//! The first evening of a new rig: a person and the self-test image go through its parts step by step, and what is wrong is named.
//!
//! The board only measures ([`tactus_core::wire::bringup`]); limits and names of mistakes are here ([`judge`], [`MISTAKES`]), where a
//! PC tests them. [`run`] goes through [`STEPS`] over whatever carries bytes to the board ([`Board`]) and asks whoever is there
//! ([`Person`]). It knows the core only.

mod journal;
pub mod judge;
mod line;
mod mistakes;
mod report;
mod steps;

use std::io;

use tactus_core::wire::Reset;
use tactus_core::wire::bringup::{Measure, Pin, Saw};

pub use journal::{Entry, EntryMistake, EntrySeries, Journal};
pub use line::Line;
pub use mistakes::{MISTAKES, Mistake, Named};
pub use report::{Report, plot};
pub use steps::{Bench, Found, STEPS, Series, Step};

/// Why a step came to no end.
#[derive(Debug, thiserror::Error)]
pub enum Trouble {
    /// The person ends it.
    #[error("stopped: no motor moves. The same command goes on with the step that was not over")]
    Quit,
    /// Another image runs.
    #[error(
        "another image runs on the board: flash the self-test (cargo xtask flash --self-test, or `tactus device flash`), then the same command again"
    )]
    OtherImage,
    /// The board says nothing.
    #[error(
        "the self-test says nothing: flash it (cargo xtask flash --self-test), press the board's black button, then the same command again"
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
    ///
    /// # Errors
    /// See [`Trouble`].
    fn ask(&mut self, measure: Measure) -> Result<Saw, Trouble>;

    /// Asks for something that ends with a new start of the board, and waits for that: why it started; `None` if it does not.
    ///
    /// # Errors
    /// See [`Trouble`].
    fn restart(&mut self, measure: Measure) -> Result<Option<Reset>, Trouble>;
}

/// Who is at the rig.
pub trait Person {
    /// Does something, and says when it is done.
    ///
    /// # Errors
    /// [`Trouble::Quit`], as of all others here.
    fn done(&mut self, please: &str) -> Result<(), Trouble>;
    /// Looks at something that moves in a moment.
    fn watch(&mut self, please: &str) -> Result<(), Trouble>;
    /// Presses a switch and keeps it pressed, or lets it go.
    fn press(&mut self, switch: Pin, pressed: bool) -> Result<(), Trouble>;
    /// Begins to squeeze the finger and lays it down; the board watches.
    fn squeeze(&mut self) -> Result<(), Trouble>;
    /// Chooses one of these.
    fn choose(&mut self, question: &str, answers: &[&str]) -> Result<usize, Trouble>;
    /// Measures something.
    fn number(&mut self, question: &str, unit: &str) -> Result<f64, Trouble>;
    /// Sees what a step has found; whether to go on, although it has not passed.
    fn found(&mut self, step: &Step, entry: &Entry) -> Result<bool, Trouble>;
    /// What time it is, as 2026-11-24T19:30:00Z.
    fn now(&self) -> String;
}

/// Goes through the steps that have not passed yet, up to the first one that fails unless the person goes on; whether all have passed.
///
/// # Errors
/// See [`Trouble`].
pub fn run(
    board: &mut dyn Board,
    person: &mut dyn Person,
    journal: &mut Journal,
) -> Result<bool, Trouble> {
    for step in STEPS {
        if journal.has_passed(step.key) {
            continue;
        }
        let found = (step.run)(&mut Bench { board, person })?;
        let entry = Entry::new(step, person.now(), &found);
        journal.add(entry.clone())?;
        if !person.found(step, &entry)? {
            break;
        }
    }
    Ok(STEPS.iter().all(|step| journal.has_passed(step.key)))
}
