//! Texture tables learned from recorded slides, and how well they tell textures apart.

pub mod alike;
pub mod basis;
mod calibrate;
pub mod courses;
mod enough;
pub mod evaluate;
pub mod evaluation;
pub mod experiment;
pub mod first;
pub mod gauge;
pub mod learn;
pub mod learned;
pub mod novelty;
pub mod open_set;
mod pace;
pub mod places;
pub mod refresh;
pub mod reliability;
pub mod report;
pub mod samples;
pub mod show;
pub mod table_summary;
pub mod transcript;
pub mod verdicts;
pub mod verified;
pub mod verify;
