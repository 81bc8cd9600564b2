//! The paper's whole study on the simulated rig: the pilot that finds the movements, the training, the eight pairs, and
//! the identification among all 117 textures, beside the published numbers.

pub mod chart;
pub mod identify;
pub mod page;
pub mod pictures;
pub mod pilot;
pub mod published;
pub mod report;
pub mod slides;
pub mod training;
