//! The first evening of a new rig: a person and the self-test image go through its parts step by step, then with the
//! rig's own firmware, and what is wrong is named.
//!
//! The board only measures ([`tactus_core::wire::bringup`]); limits and names of mistakes are here ([`judge`],
//! [`MISTAKES`]), where a PC tests them. [`run`] goes through [`STEPS`] over whatever carries bytes to the board
//! ([`Board`]) and asks whoever is there ([`Person`]). It knows the core only.

mod bare;
mod journal;
pub mod judge;
mod line;
mod mistakes;
mod mounted;
mod report;
mod seams;
mod steps;
pub mod weights;

pub use journal::{Entry, EntryMistake, Journal};
pub use line::Line;
pub use mistakes::{MISTAKES, Mistake, Named, OTHER_MISTAKES};
pub use mounted::Mounted;
pub use report::Report;
pub use seams::{Board, Person, Probe, Trouble};
pub use steps::{Bench, Image, Product, STEPS, Step};

use steps::Run;

/// Who is at the rig, and sees how it goes.
pub trait Operator: Person {
    /// Sees what a step has found; whether to go on, although it has not passed.
    fn found(&mut self, step: &Step, entry: &Entry) -> Result<bool, Trouble>;
    /// The time, as 2026-11-24T19:30:00Z.
    fn now(&self) -> String;
}

/// Who is at the other end of the line.
pub enum Ends<'b> {
    /// The image that measures.
    SelfTest(&'b mut dyn Board),
    /// The rig's own.
    Rig(&'b mut dyn Probe),
}

/// The end of a bring-up.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Ended {
    /// All steps have passed.
    Passed,
    /// One has not.
    Failed,
    /// The next one takes this image.
    Flash(Image),
}

/// The image that the next step takes; `None`: all have passed.
pub fn next_image(product: Product, journal: &Journal) -> Option<Image> {
    let mut steps = product.steps().into_iter();
    let next = steps.find(|step| !journal.has_passed(step.key));
    next.map(Step::image)
}

/// Goes through the steps that have not passed yet, up to the first one that fails unless the person goes on, or that
/// takes another image.
pub fn run(
    product: Product,
    mut ends: Ends<'_>,
    person: &mut dyn Operator,
    journal: &mut Journal,
) -> Result<Ended, Trouble> {
    let steps = product.steps();
    for step in &steps {
        if journal.has_passed(step.key) {
            continue;
        }
        let found = match (&step.run, &mut ends) {
            (Run::SelfTest(run), Ends::SelfTest(board)) => run(&mut Bench {
                board: &mut **board,
                person,
                has_motors: product == Product::Rig,
            })?,
            (Run::Rig(run), Ends::Rig(probe)) => {
                let weighed = journal.last("scale");
                let now = person.now();
                let digits = now.chars().filter(char::is_ascii_digit).take(8);
                run(&mut Mounted {
                    has_motors: product == Product::Rig,
                    weighed: weighed.map_or(Vec::new(), |entry| entry.points.clone()),
                    today: digits.collect::<String>().parse().unwrap_or(0),
                    probe: &mut **probe,
                    person,
                })?
            }
            _ => return Ok(Ended::Flash(step.image())),
        };
        let entry = Entry::new(step, person.now(), &found);
        journal.add(entry.clone())?;
        if !person.found(step, &entry)? {
            break;
        }
    }
    Ok(
        match steps.iter().all(|step| journal.has_passed(step.key)) {
            true => Ended::Passed,
            false => Ended::Failed,
        },
    )
}
