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
mod seams;
mod steps;

pub use journal::{Entry, EntryMistake, EntrySeries, Journal};
pub use line::Line;
pub use mistakes::{MISTAKES, Mistake, Named};
pub use report::{Report, plot};
pub use seams::{Board, Person, Trouble};
pub use steps::{Bench, Found, STEPS, Series, Step};

/// Who is at the rig, and sees how it goes.
pub trait Owner: Person {
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
    person: &mut dyn Owner,
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
