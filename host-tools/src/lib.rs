//! Tactus on a PC: recordings, replays of them, virtual explorations, and what the command `tactus` shows.

pub mod collection;
pub mod evaluate;
pub mod experiment;
pub mod fabricslide;
pub mod follow;
pub mod handheld;
pub mod import;
pub mod learn;
pub mod lifelong;
pub mod link;
pub mod novelty;
pub mod played;
pub mod properties;
pub mod recordings;
pub mod replay;
pub mod rows;
pub mod scenario;
pub mod show;
pub mod sim;
pub mod simulated;
pub mod study;
