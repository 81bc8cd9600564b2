//! A simulated probe that somebody watches: it goes on step by step, and says at each what a display shows.
//!
//! The probe is the core's own, as on the chip: [`Session`] has it asked, lets time pass for it, and collects what it
//! says. Besides, the same core is asked what the probe does not say: what is probable while a slide goes on, and where
//! a slide lies among the textures. Requests and replies are JSON, so that a page needs one function.

mod message;
mod monitor;
#[cfg(feature = "import")]
mod own;
mod scene;
mod session;
mod slides;
mod standing;

pub(crate) use message::{Happening, KnownTable};
pub(crate) use monitor::{ProbeMonitor, Received};
#[cfg(feature = "import")]
pub use own::OwnFiles;
pub use session::Session;
pub(crate) use session::{asked_in_json, sentence};
pub use slides::bring_world;

#[cfg(test)]
mod tests;
