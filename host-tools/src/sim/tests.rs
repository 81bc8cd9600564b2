//! The simulated world against what the paper observed.

mod protocol;
