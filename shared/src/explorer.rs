//! Bayesian exploration: the posterior of every texture (eq. 1-4), and the next movement, which is the one that should
//! leave the least confusion among the textures that are still likely (eq. 7, 11-13).

mod answer;
mod candidates;
mod choice;
mod config;
mod early;
mod episode;
mod gaussians;
mod likelihoods;
mod likeness;
mod novelty;
mod overlap;
mod paced;
mod posterior;
mod spread;
mod student;
mod verify;
mod whitened;

pub use answer::{Answer, Verification};
pub use choice::{ExpectedOutcome, benefit, confusion};
pub use config::{Config, ExplorerError, Method, NEGLIGIBLE, ObserveError, Strategy};
pub use early::{Look, most_doubt};
pub use episode::EpisodeSummary;
pub use posterior::{Explorer, LEADING, Verdict, VerdictKind};
pub use verify::{ENOUGH_TRIALS, same_below};

#[cfg(test)]
mod tests;
