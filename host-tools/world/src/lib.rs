//! The simulated world: textures, their surfaces, the finger that touches them, and the sensor's words.
//!
//! Everything here is physics and protocol. It knows nothing of the features, tables and decisions of the core and may
//! not import them (a test looks; recordings and learning are in crates that it does not know): the simulation has to
//! be hard to fool. Every constant is a figure of the paper (PAPER: Fishel & Loeb 2012), of the makers' documents or
//! says "chosen". The documents are SPM: BioTac SP Product Manual V2 (2015), whose protocol is the BioTac's; HDR and
//! LIB: SynTouch's biotac.h and biotac.c (kth-ros-pkg/biotac_driver); OUT: 39 600 recorded samples
//! (CNCR-NTU/biotac_sp_ros, output.txt).
//!
//! A world is its seeds: the same seeds give the same words, bit for bit on every machine.

// for that; its tests compare with tolerances
#![cfg_attr(not(test), deny(clippy::disallowed_methods))]

pub mod arm;
pub mod arm_program;
pub mod conditions;
pub mod encoder;
pub mod faults;
pub mod finger;
pub mod flow;
mod lever;
pub mod maths;
pub mod motion;
pub mod mount;
pub mod noise;
pub mod parts;
pub mod person;
pub mod played;
pub mod printer;
pub mod ripple;
pub mod sensor;
pub mod slot;
pub mod stage;
mod surface;
pub mod textures;
pub mod wiring;
pub mod world;

pub use conditions::{Conditions, TRIAL_VARIATION};

#[cfg(test)]
mod tests;
