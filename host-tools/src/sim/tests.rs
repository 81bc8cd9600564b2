//! The simulated world against what the paper observed.

mod bench;
mod explore;
mod protocol;
