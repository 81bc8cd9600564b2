//! What a probe does when it is asked: explorations, trainings, what it learns and forgets.

pub mod explore;
