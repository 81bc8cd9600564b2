//! What a probe does when it is asked: explorations, trainings, what it learns and forgets.

pub mod explore;
pub mod identify;
pub mod teach;
pub mod train;
pub mod training;

pub use identify::identify;
pub use train::train;

#[cfg(test)]
mod tests;
