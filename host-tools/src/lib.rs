//! Tactus on a PC: recordings, replays of them, virtual explorations, and what the command `tactus` shows.

pub mod data;
pub mod eval;
pub mod link;
pub mod sim;
#[cfg(feature = "study")]
pub mod study;

#[cfg(feature = "fabrics")]
pub use data::fabricslide;
pub use data::{import, properties, replay, rows};
pub use eval::{evaluate, experiment, learn, lifelong, novelty, show};
pub use link::follow;
pub use sim::{collection, handheld, recorded as played, rig as simulated, scenario};

pub mod recordings {
    //! The old path of [`crate::data::recordings`] and [`crate::data::recording`].
    pub use crate::data::recording::*;
    pub use crate::data::recordings::*;
}
