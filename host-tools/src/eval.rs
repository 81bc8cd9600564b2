//! Texture tables learned from recorded slides, and how well they tell textures apart.

pub mod evaluate;
pub mod experiment;
pub mod learn;
pub mod lifelong;
pub mod novelty;
pub mod show;
