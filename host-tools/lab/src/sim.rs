//! Simulated probes: the core's own code on the physics of [`tactus_world`], and what is recorded and learned there.

// its tests compare with tolerances
#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

pub mod collection;
pub mod fault_case;
pub mod flash;
pub mod handheld;
pub mod over_link;
pub mod printer;
pub mod probe;
pub mod recorded;
pub mod rig;
